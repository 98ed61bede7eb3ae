"""Gatherings: training views that a robot collects while it drives, and a person's decision on their tracks."""

from __future__ import annotations

from dataclasses import dataclass

from waymark.api.landmarks import FailedGate, PlacementReportBody
from waymark.api.maps import Job, Point2


@dataclass(frozen=True, slots=True)
class GatheringCountsBody:
    """What became of frames and quads."""

    frames: int = 0
    dropped: int = 0
    other_map: int = 0
    unusable: int = 0
    not_on_wall: int = 0
    kept: int = 0
    near_duplicate: int = 0
    too_few_observations: int = 0
    full: int = 0
    decided: int = 0
    known_landmark: int = 0
    not_requested: int = 0
    appearance_mismatch: int = 0
    track_limit: int = 0
    not_stored: int = 0


@dataclass(frozen=True, slots=True)
class Gathering:
    """Views being gathered (`open`), or gathered."""

    id: int
    map: str
    robot: str
    known: bool
    open: bool
    counts: GatheringCountsBody
    created_ms: int
    landmark: str | None = None
    ended_ms: int | None = None


@dataclass(frozen=True, slots=True)
class EstimatedPlace:
    """Where the object of a track seems to be, in the map; `angle_rad` is how far off the normal the camera looked."""

    x_m: float
    y_m: float
    z_m: float
    theta_rad: float
    width_m: float
    height_m: float
    views: int
    angle_rad: Point2


@dataclass(frozen=True, slots=True)
class TrackSummary:
    """An object that a robot drove past, for a person to decide on. `failed_gates` say what speaks against
    it."""

    number: int
    sightings: int
    known: int
    views: tuple[int, ...]
    inconsistent_views: int
    side_px: Point2
    v_c: float
    passes: bool
    failed_gates: tuple[FailedGate, ...]
    similar_tracks: tuple[int, ...]
    landmark: str | None = None
    best_view: int | None = None
    place: EstimatedPlace | None = None
    not_placed: str | None = None


@dataclass(frozen=True, slots=True)
class AcceptedTrackBody:
    """A track that is accepted, and the name of the landmark that it becomes; none for a landmark that is known."""

    track: int
    name: str | None = None


@dataclass(frozen=True, slots=True)
class ExtendedLandmark:
    """A landmark that got views."""

    name: str
    views: int
    placing: PlacementReportBody


@dataclass(frozen=True, slots=True)
class AcceptanceBody:
    """What an acceptance came to, with the training that was started."""

    landmarks: tuple[ExtendedLandmark, ...]
    job: Job | None = None
