"""Events of a map as they come."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from waymark.wire import Answer, Pose2, PoseTrust


@dataclass(frozen=True, slots=True)
class LiveAnswer:
    """A frame was answered."""

    robot: str
    camera: str
    answer: Answer


@dataclass(frozen=True, slots=True)
class LivePose:
    """A fused pose, as it was published; covariance over (x, y, theta)."""

    robot: str
    map: str
    pose: Pose2
    covariance: tuple[float, ...]
    corrections: int
    age_ms: float
    trust: PoseTrust


@dataclass(frozen=True, slots=True)
class LivePosition:
    """A pose without covariance: `odometry` alone, or a simulator's `truth`."""

    source: str
    robot: str
    map: str
    pose: Pose2


@dataclass(frozen=True, slots=True)
class LivePresence:
    """A robot came or went."""

    robot: str
    map: str
    alive: bool


@dataclass(frozen=True, slots=True)
class LiveMapChange:
    """A map has a new version; `None`: it was deleted."""

    map: str
    version: int | None = None


@dataclass(frozen=True, slots=True)
class LiveMissed:
    """The reader was too slow: so many events are missing here."""

    events: int


LiveEvent: TypeAlias = LiveAnswer | LivePose | LivePosition | LivePresence | LiveMapChange | LiveMissed
