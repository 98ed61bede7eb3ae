"""From where landmarks are seen, what is seen from a pose and along a path, and where to look."""

from __future__ import annotations

from dataclasses import dataclass, field

from waymark._values import NAME
from waymark.api.maps import Point2


@dataclass(frozen=True, slots=True)
class PoseBody:
    """A pose in the map; without covariance it is exactly known."""

    x_m: float = 0.0
    y_m: float = 0.0
    theta_rad: float = 0.0
    covariance: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True)
class VisibilitySettingsBody:
    """A camera, and what counts as seen by it. What is absent is that of a usual robot."""

    focal_px: float | None = None
    width_px: float | None = None
    height_px: float | None = None
    camera_height_m: float | None = None
    tilt_low_rad: float | None = None
    tilt_high_rad: float | None = None
    pan_low_rad: float | None = None
    pan_high_rad: float | None = None
    max_incidence_rad: float | None = None
    min_side_px: float | None = None
    max_fill: float | None = None
    standoff_m: float | None = None


@dataclass(frozen=True, slots=True)
class MultiPolygon:
    """A GeoJSON `MultiPolygon` in metres of the map: by polygon, ring and point."""

    kind: str = field(metadata={NAME: "type"})
    coordinates: tuple[tuple[tuple[Point2, ...], ...], ...]


@dataclass(frozen=True, slots=True)
class VisibilityAreaProperties:
    """Figures of a visibility area."""

    landmark: str
    area_m2: float
    reach_m: float
    centroid_m: Point2 | None = None


@dataclass(frozen=True, slots=True)
class VisibilityAreaBody:
    """The floor area from which a landmark is seen: a GeoJSON `Feature` in metres of the map, not degrees."""

    kind: str = field(metadata={NAME: "type"})
    geometry: MultiPolygon
    properties: VisibilityAreaProperties


@dataclass(frozen=True, slots=True)
class VisibleLandmark:
    """A landmark that may be seen when the camera is turned to it; `margin_m` is positive inside of its area."""

    landmark: str
    probability: float
    margin_m: float


@dataclass(frozen=True, slots=True)
class VisibleResponse:
    """What may be seen, most probable first."""

    map_version: int
    landmarks: tuple[VisibleLandmark, ...]


@dataclass(frozen=True, slots=True)
class CoverageSampleBody:
    """One place of a path and the landmarks that are seen from it."""

    along_m: float
    x_m: float
    y_m: float
    landmarks: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CoverageGapBody:
    """A piece of a path from which no landmark is seen, in metres along it."""

    from_m: float
    to_m: float


@dataclass(frozen=True, slots=True)
class CoverageResponse:
    """What is seen along a path; `share` of it from which some landmark is."""

    map_version: int
    length_m: float
    share: float
    gaps: tuple[CoverageGapBody, ...]
    steps: tuple[CoverageSampleBody, ...]


@dataclass(frozen=True, slots=True)
class GazeTargetBody:
    """A landmark worth looking at: pan (left positive) and tilt (up positive) that centre it."""

    landmark: str
    pan_rad: float
    tilt_rad: float
    utility: float
    probability: float
    margin_m: float
    gain_nats: float
    range_m: float
    incidence_rad: float


@dataclass(frozen=True, slots=True)
class GazeRankingBody:
    """Where to look, best first; empty when nothing is in sight."""

    map_version: int
    ranked: tuple[GazeTargetBody, ...]
