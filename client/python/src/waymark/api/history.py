"""Maps as versions: commits, differences, ways back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from waymark.api.landmarks import Place, Size

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
class SizeAndPlace:
    """Size and place of a landmark, as far as they are known."""

    size: Size | None = None
    place: Place | None = None


@dataclass(frozen=True, slots=True)
class LandmarkDifference:
    """How a landmark differs; `before` is absent if it is new, `after` if it is gone."""

    name: str
    old_name: str | None
    change: ChangeKind
    fields: tuple[str, ...]
    views_added: int
    views_removed: int
    model_changed: bool
    before: SizeAndPlace | None = None
    after: SizeAndPlace | None = None


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


@dataclass(frozen=True, slots=True)
class Draft:
    """A map of its own, made of another one to be edited beside it, and published to it as one commit."""

    name: str
    from_commit: int
    created_ms: int
    revision: str
    landmarks: int


@dataclass(frozen=True, slots=True)
class DraftDifference:
    """What publishing a draft would change of its map. While `conflicts` has any, it cannot be published."""

    from_commit: int
    conflicts: tuple[str, ...]
    summary: ChangeSummary
    walls: WallsDifference | None
    landmarks: LandmarkDifferencePage


ReplayedPose = Literal["same", "gained", "lost", "moved"]


@dataclass(frozen=True, slots=True)
class RobotReplay:
    """What a draft changes for one robot, in frames. `longest_move_m`: between the two poses of a frame."""

    robot: str
    frames: int
    unchanged: int
    lost: int
    gained: int
    pose_gained: int
    pose_lost: int
    pose_moved: int
    longest_move_m: float


@dataclass(frozen=True, slots=True)
class ReplayChange:
    """A frame that map and draft answer otherwise.

    `lost`: landmarks that the map names alone; `gained`: that the draft names alone.
    `distance_m` and `angle_rad` (0 to pi) lie between the two poses, where `pose` is `moved`."""

    robot: str
    camera: str
    captured_ms: int
    lost: tuple[str, ...]
    gained: tuple[str, ...]
    pose: ReplayedPose
    distance_m: float | None
    angle_rad: float | None


@dataclass(frozen=True, slots=True)
class Replay:
    """The last frames of a map's robots, answered by the map and by a draft of it."""

    frames: int
    unchanged: int
    robots: tuple[RobotReplay, ...]
    changes: tuple[ReplayChange, ...]
