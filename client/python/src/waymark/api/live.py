"""What is no body of JSON by itself: events of a map as they come, and the last frame of a camera."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

from waymark.api.bodies import LiveAnswer, LiveMapChange, LivePose, LivePosition, LivePresence

__all__ = ["CameraFrame", "LiveEvent", "LiveMissed", "LiveOdometry", "LiveTruth"]


@dataclass(frozen=True, slots=True)
class LiveOdometry(LivePosition):
    """Where odometry alone says that a robot is."""


@dataclass(frozen=True, slots=True)
class LiveTruth(LivePosition):
    """Where a robot really is, told by a simulator."""


@dataclass(frozen=True, slots=True)
class LiveMissed:
    """The reader was too slow: so many events are missing here."""

    events: int


LiveEvent: TypeAlias = LiveAnswer | LivePose | LiveOdometry | LiveTruth | LivePresence | LiveMapChange | LiveMissed


@dataclass(frozen=True, slots=True)
class CameraFrame:
    """The last answered frame of a camera: the number of its answer, `image/jpeg` or `image/png`, and the file."""

    seq: int
    media_type: str
    image: bytes = field(repr=False)
