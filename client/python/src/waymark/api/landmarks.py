"""Landmarks and their training views."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from waymark._values import REST
from waymark.api.maps import Point2
from waymark.wire import Intrinsics, Pose2Covariance, Pose3

LandmarkStatus = Literal["not_learnt", "learning", "active", "inactive"]
LandmarkHealth = Literal["sound", "flagged", "quarantined"]
NumberOrder = Literal["number", "-number"]
UploadOutcome = Literal["new", "duplicate", "near_duplicate"]
RefusedBy = Literal["upload", "lesson"]


@dataclass(frozen=True, slots=True)
class Size:
    """Width and height of a landmark: 0.01 to 100 m."""

    width_m: float
    height_m: float


@dataclass(frozen=True, slots=True)
class Place:
    """Where a landmark is, in the map: its centre, and the direction of its outward normal. `tilt_rad` is 0 on a wall
    and pi/2 under a ceiling, where `theta_rad` says where its top points."""

    x_m: float
    y_m: float
    z_m: float
    theta_rad: float
    roll_rad: float = 0.0
    tilt_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class PlaceSigma:
    """Standard deviations of a place that the server found from views."""

    x_m: float
    y_m: float
    z_m: float
    theta_rad: float
    width_m: float
    height_m: float


Gate = Literal[
    "views",
    "saliency",
    "stable_points",
    "content",
    "visibility_confidence",
    "not_distinct",
    "looks_like",
    "by_pose_only",
    "stored_model",
    "similar_tracks",
    "known_landmark",
]


@dataclass(frozen=True, slots=True)
class LookAlikeBody:
    """A landmark that looks like another one."""

    landmark: str
    gradient_similarity: float


@dataclass(frozen=True, slots=True)
class FailedGate:
    """Why a landmark is not in use, or a track should not become one: the gate, one sentence, one advice; the other
    landmark with `looks_like` and `by_pose_only`."""

    gate: Gate
    sentence: str
    advice: str
    look_alike: LookAlikeBody | None = None

    def __str__(self) -> str:
        return f"{self.sentence} {self.advice}"


@dataclass(frozen=True, slots=True)
class LandmarkModelBody:
    """What was learnt of a landmark; `facts` are thresholds and figures of the training."""

    views: int
    generated_views: int
    learnt_ms: int
    facts: dict[str, Any] = field(default_factory=dict, metadata={REST: True})


@dataclass(frozen=True, slots=True)
class ObservedPlaceBody:
    """Where a landmark is observed, in the map."""

    x_m: float
    y_m: float
    theta_rad: float


@dataclass(frozen=True, slots=True)
class FindingBody:
    """What robots found of a landmark that is not where the map says: `moved`, with where it is observed, by how much
    and how often; or `missing`, with the number of consecutive frames without it."""

    kind: Literal["moved", "missing"]
    observed_place: ObservedPlaceBody | None = None
    offset_m: float | None = None
    sightings: int | None = None
    missed_frames: int | None = None


@dataclass(frozen=True, slots=True)
class Landmark:
    """A landmark. `failed_gates` is empty unless it is `inactive`; `revision` is another one after every edit or lesson
    of it (`MapClient.if_match`)."""

    name: str
    revision: str
    status: LandmarkStatus
    failed_gates: tuple[FailedGate, ...]
    views: int
    health: LandmarkHealth
    size: Size | None = None
    place: Place | None = None
    place_sigma: PlaceSigma | None = None
    model: LandmarkModelBody | None = None
    finding: FindingBody | None = None


@dataclass(frozen=True, slots=True)
class NewLandmark:
    """A landmark to be made."""

    name: str
    size: Size | None = None
    place: Place | None = None


@dataclass(frozen=True, slots=True)
class LandmarkDeletion:
    """A landmark to be deleted, if it still has this revision; without one, whatever is there."""

    name: str
    revision: str | None = None


@dataclass(frozen=True, slots=True)
class BulkOutcome:
    """Landmarks made or deleted."""

    count: int


@dataclass(frozen=True, slots=True)
class PlacementReportBody:
    """Whether views place a landmark, how many, and why not."""

    placed: bool
    views_used: int
    reason: str | None = None


@dataclass(frozen=True, slots=True)
class TrainingView:
    """A stored training view. Corners in pixels: top-left, top-right, bottom-right, bottom-left. `outcome` and
    `placing` are in the answer to an upload."""

    id: int
    corners: tuple[Point2, Point2, Point2, Point2]
    width_px: int
    height_px: int
    image_kind: str
    created_ms: int
    outcome: UploadOutcome | None = None
    placing: PlacementReportBody | None = None


@dataclass(frozen=True, slots=True)
class RefusedView:
    """A photograph that was not taken for a landmark, or not in its last lesson: `reason` is a code, `sentence` and
    `advice` are for people. `view` is the one that it repeats, or that the lesson left out."""

    id: int
    refused_ms: int
    by: RefusedBy
    reason: str
    sentence: str
    advice: str
    view: int | None = None
    icon: str | None = None


@dataclass(frozen=True, slots=True)
class CaptureMetadata:
    """How a photograph was taken; with it the server places the landmark, unless it was placed by hand."""

    intrinsics: Intrinsics
    map_from_robot: Pose2Covariance
    robot_from_camera: Pose3
    ceiling_height_m: float | None = None
    # (uu, uv, vv) of each corner.
    corner_covariance_px2: tuple[tuple[float, float, float], ...] | None = None
