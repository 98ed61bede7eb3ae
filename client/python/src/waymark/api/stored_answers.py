"""Answers to frames that the server has stored."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from waymark.wire import Answer

AnswerStatus = Literal[
    "matched", "ambiguous", "no_match", "rejected", "expired", "overloaded", "not_ready", "unspecified"
]


@dataclass(frozen=True, slots=True)
class StoredAnswerSummary:
    """A stored answer in brief. `landmarks` are those that it names, `candidates` the others that quads were compared
    with, by their names at that time; `refusal` says why there is no pose."""

    id: int
    map: str
    robot: str
    camera: str
    stored_ms: int
    status: AnswerStatus
    has_pose: bool
    landmarks: tuple[str, ...]
    candidates: tuple[str, ...]
    refusal: str | None = None


@dataclass(frozen=True, slots=True)
class LandmarkIcon:
    """A landmark beside a quad that was compared with it, and the path of its icon."""

    landmark: str
    icon: str | None = None


@dataclass(frozen=True, slots=True)
class StoredQuad:
    """The path of a quad's icon, and the landmarks that it was compared with."""

    landmarks: tuple[LandmarkIcon, ...]
    icon: str | None = None


@dataclass(frozen=True, slots=True)
class StoredAnswer:
    """A stored answer with everything that was said; `quads` has the pictures of `answer.quads`."""

    summary: StoredAnswerSummary
    answer: Answer
    quads: tuple[StoredQuad, ...]
