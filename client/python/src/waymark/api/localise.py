"""Where a robot is, without its history."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from waymark.wire import Answer, Pose2Covariance

LocaliseStatus = Literal["located", "ambiguous", "no_match"]


@dataclass(frozen=True, slots=True)
class LocaliseHypothesisBody:
    """Where a robot may be; `matched` is the share of the scan's points with a wall."""

    map_from_robot: Pose2Covariance
    probability: float
    landmarks: tuple[str, ...]
    matched: float | None = None


@dataclass(frozen=True, slots=True)
class LocaliseResult:
    """Where a robot is: one pose (`located`), several hypotheses, or none, with the reason. `answer` is that to the
    picture."""

    map: str
    map_version: int
    status: LocaliseStatus
    hypotheses: tuple[LocaliseHypothesisBody, ...]
    reason: str | None = None
    map_from_robot: Pose2Covariance | None = None
    answer: Answer | None = None
