"""Modality statistics of a map, recordings and reference runs behind them, and mapping."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from waymark.api.maps import Point2, WallBody

FusionMode = Literal["all", "near_best", "best"]
Modality = Literal["odometry", "laser", "landmarks"]
StatsScope = Literal["cell", "neighbourhood", "area", "map"]
MappingStage = Literal["resuming", "mapping", "finishing", "found", "done", "failed"]
# Along, to the left, heading: m, m, rad.
Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class AreaBody:
    """A part of the map with a name; corners in order, x and y in metres."""

    name: str
    corners_m: tuple[Point2, ...]


@dataclass(frozen=True, slots=True)
class ModalityStatsBody:
    """What runs have shown of one modality; errors are robot-aligned. The lowest `score` is best."""

    modality: Modality
    mean: Triple
    sigma: Triple
    availability: float
    rate_hz: float
    outliers: float
    steps: int
    measurements: int
    score: float | None = None


@dataclass(frozen=True, slots=True)
class ErrorModelBody:
    """What a modality gets wrong: subtracted from what it says, and added to its variances as a share."""

    modality: Modality
    bias: Triple
    variance_inflation: Triple


@dataclass(frozen=True, slots=True)
class AdviceBody:
    """What follows for a robot there; `best` is absent where too little is known."""

    used: tuple[Modality, ...]
    scope: StatsScope
    error_models: tuple[ErrorModelBody, ...]
    best: Modality | None = None


@dataclass(frozen=True, slots=True)
class AreaStatsBody:
    """What is known of a place."""

    advice: AdviceBody
    statistics: tuple[ModalityStatsBody, ...]


@dataclass(frozen=True, slots=True)
class CellBody:
    """A pose cell: a square metre, by its lower left corner, driven through in one of four headings."""

    x_m: float
    y_m: float
    heading_rad: float
    used: tuple[Modality, ...]
    best: Modality | None = None


@dataclass(frozen=True, slots=True)
class NamedAreaBody:
    """A named area and what is known of it, by heading: 0, pi/2, pi, -pi/2."""

    name: str
    corners_m: tuple[Point2, ...]
    headings: tuple[AreaStatsBody, ...]


@dataclass(frozen=True, slots=True)
class ModalityMapBody:
    """All that is known of a map's modalities."""

    fusion_mode: FusionMode
    areas: tuple[NamedAreaBody, ...]
    cell_m: float
    cells: tuple[CellBody, ...]
    omitted_cells: int
    map: AreaStatsBody


@dataclass(frozen=True, slots=True)
class RecordingStatusBody:
    """A recording as it stands; `reason` says why it is active no longer."""

    map: str
    robot: str
    active: bool
    distance_m: float
    odometry: int
    landmarks: int
    laser: int
    reason: str | None = None
    span_ns: tuple[int, int] | None = None


@dataclass(frozen=True, slots=True)
class ReferenceRunBody:
    """A run that was learnt from."""

    id: int
    robot: str
    created_ms: int
    distance_m: float
    cells: int
    statistics: tuple[ModalityStatsBody, ...]


@dataclass(frozen=True, slots=True)
class MappingProgressBody:
    """A mapping as it stands."""

    map: str
    robot: str
    stage: MappingStage
    scans: int
    dropped: int
    distance_m: float
    pose: Triple | None = None
    segments: int | None = None
    loop_closures: int | None = None
    reason: str | None = None
    journal_error: str | None = None
    walls: tuple[WallBody, ...] | None = None
