"""Maps as versions: commits, differences, ways back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

ChangeKind = Literal["added", "removed", "changed"]


@dataclass(frozen=True, slots=True)
class ChangeSummary:
    """Counts of what changed."""

    landmarks_added: int
    landmarks_removed: int
    landmarks_changed: int
    views_added: int
    views_removed: int
    models_changed: int
    walls_changed: bool
    underlay_changed: bool
    reference_runs_added: int
    reference_runs_removed: int
    settings: tuple[str, ...]
    landmarks: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Commit:
    """What one request or job changed of a map: who, when, by what, and why."""

    id: int
    parent: int | None
    created_ms: int
    author: str
    job: int | None
    operation: str
    why: str | None
    summary: ChangeSummary


@dataclass(frozen=True, slots=True)
class RollbackOutcome:
    """What a way back did, and the newest commit after it."""

    changed: bool
    commit: Commit


@dataclass(frozen=True, slots=True)
class LandmarkDifference:
    """How a landmark differs."""

    name: str
    old_name: str | None
    change: ChangeKind
    fields: tuple[str, ...]
    views_added: int
    views_removed: int
    model_changed: bool


@dataclass(frozen=True, slots=True)
class WallsDifference:
    """How walls differ. `bounds_m`: least x, least y, greatest x, greatest y."""

    before: int
    after: int
    added: int
    removed: int
    bounds_m: tuple[float, float, float, float] | None


@dataclass(frozen=True, slots=True)
class LandmarkDifferencePage:
    """A page of the landmarks that differ."""

    items: tuple[LandmarkDifference, ...]
    next: str | None
    total: int


@dataclass(frozen=True, slots=True)
class Difference:
    """What differs between a map at two commits."""

    from_commit: int
    to_commit: int
    summary: ChangeSummary
    walls: WallsDifference | None
    landmarks: LandmarkDifferencePage
