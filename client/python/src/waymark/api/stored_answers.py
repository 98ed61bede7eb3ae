"""Answers to frames that the server has stored."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from waymark.wire import Answer, Pose2Covariance

AnswerStatus = Literal[
    "matched", "ambiguous", "no_match", "rejected", "expired", "overloaded", "not_ready", "unspecified"
]
PriorSource = Literal["robot", "server"]


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
class PointMatch:
    """A point of a quad that is like a point of a landmark. Places in both icons: (0, 0) is the top-left corner, (1, 1)
    the bottom-right one. `agrees`: with the others, on where the landmark is."""

    seen: tuple[float, float]
    taught: tuple[float, float]
    agrees: bool


@dataclass(frozen=True, slots=True)
class QuadMatches:
    """The points of a quad that are like those of its best candidate, at most 100, those that agree first."""

    landmark: str
    matches: tuple[PointMatch, ...]


@dataclass(frozen=True, slots=True)
class PriorCheck:
    """The pose that was known without a picture, and the pose by the picture alone. `distance2` is their squared
    Mahalanobis distance; a pose beyond `limit` is refused where the robot sent the prior."""

    source: PriorSource
    prior: Pose2Covariance
    limit: float
    refused: bool
    seen: Pose2Covariance | None = None
    distance2: float | None = None


@dataclass(frozen=True, slots=True)
class StoredQuad:
    """The path of a quad's icon, the landmarks that it was compared with, and its points that are like those of the
    best candidate."""

    landmarks: tuple[LandmarkIcon, ...]
    icon: str | None = None
    matched: QuadMatches | None = None


@dataclass(frozen=True, slots=True)
class StoredAnswer:
    """A stored answer with everything that was said; `quads` has the pictures of `answer.quads`, `prior_check` the pose
    before the frame."""

    summary: StoredAnswerSummary
    answer: Answer
    quads: tuple[StoredQuad, ...]
    prior_check: PriorCheck | None = None
