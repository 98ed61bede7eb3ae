"""Robots, their cameras, and what became of their fixes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from waymark._values import NULL
from waymark.wire import Intrinsics, Pose2, PoseTrust


@dataclass(frozen=True, slots=True)
class RobotPose:
    """A fused pose on the robot's map; `age_ms` is at most 2000."""

    x_m: float
    y_m: float
    theta_rad: float
    covariance: tuple[float, ...]
    age_ms: float
    trust: PoseTrust = "unspecified"


@dataclass(frozen=True, slots=True)
class PoseByHand:
    """Where a person says that a robot is, with standard deviations of the coordinates and of the heading."""

    x_m: float
    y_m: float
    theta_rad: float
    sigma_m: float = 0.5
    sigma_rad: float = 0.35


@dataclass(frozen=True, slots=True)
class EpochConflictBody:
    """A second program speaks under the name of a robot and is refused."""

    epoch: int
    refused: int
    last_ms: int


@dataclass(frozen=True, slots=True)
class RefusalReason:
    """Why messages of a robot were refused: a stable word, the field and sentence of the last one, what to do."""

    code: str
    field: str
    detail: str
    advice: str
    count: int
    ago_ms: int


@dataclass(frozen=True, slots=True)
class RobotInput:
    """What became of one kind of a robot's messages: `frame`, `odometry`, `scan`, `camera_info`, `transform` or
    `connection`. Where `refused_in_a_row` rises, none is used any more."""

    input: str
    used: int
    refused: int
    refused_in_a_row: int
    reasons: tuple[RefusalReason, ...]


@dataclass(frozen=True, slots=True)
class RobotActivity:
    """What a robot has done since the server started; `frames_per_s` is over the last ten whole seconds."""

    answered: int
    inputs: tuple[RobotInput, ...]
    frames_per_s: float
    last_message_ms: int | None = None
    last_recognised_ms: int | None = None


@dataclass(frozen=True, slots=True)
class UnknownRobot:
    """A robot that sends messages and is not registered."""

    name: str
    messages: int
    first_ms: int
    last_ms: int
    camera: str | None = None


@dataclass(frozen=True, slots=True)
class UnknownRobots:
    """Robots that send messages and are not registered, by name; at most 64."""

    robots: tuple[UnknownRobot, ...]


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot: whether its software is connected, its pose, if that is known, and what it has done."""

    name: str
    map: str
    alive: bool
    epoch: int | None = None
    conflict: EpochConflictBody | None = None
    pose: RobotPose | None = None
    activity: RobotActivity | None = None


@dataclass(frozen=True, slots=True)
class CorrectionBody:
    """A fix, what became of it, and by how much it moved the pose, in the robot's frame before it."""

    epoch: int
    captured_ns: int
    map: str
    modality: str
    landmarks: tuple[str, ...]
    outcome: str
    chi2: float | None = None
    along_m: float | None = None
    across_m: float | None = None
    turn_rad: float | None = None


@dataclass(frozen=True, slots=True)
class CorrectionsBody:
    """What a robot's pose rests on, and what became of its fixes, oldest first; `totals` by modality and outcome."""

    modalities: tuple[str, ...]
    totals: dict[str, dict[str, int]]
    corrections: tuple[CorrectionBody, ...]


@dataclass(frozen=True, slots=True)
class PoseHypothesisBody:
    """A place where a robot may be."""

    probability: float
    x_m: float
    y_m: float
    theta_rad: float
    covariance: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class RelocalisationStatus:
    """How far a robot's relocalisation has come; `missing` lists what is needed before the first hypothesis becomes
    its pose."""

    relocalising: bool
    hypotheses: tuple[PoseHypothesisBody, ...]
    entropy_nats: float
    sightings: int
    landmarks: tuple[str, ...]
    missing: tuple[str, ...]
    min_probability: float
    map: str | None = None
    map_version: int | None = None


@dataclass(frozen=True, slots=True)
class TrajectoriesBody:
    """Where a robot was lately, by source; oldest first."""

    pose: tuple[Pose2, ...]
    odometry: tuple[Pose2, ...]
    truth: tuple[Pose2, ...]


@dataclass(frozen=True, slots=True)
class IntrinsicsSuspicionBody:
    """Why the intrinsics of a camera seem wrong: `focal` (error and sigma), `misfit` (reduced_chi2), `refused`
    (share)."""

    reason: Literal["focal", "misfit", "refused"]
    error: float | None = None
    sigma: float | None = None
    reduced_chi2: float | None = None
    share: float | None = None


@dataclass(frozen=True, slots=True)
class IntrinsicsMonitorBody:
    """What is known of a camera's intrinsics from its use."""

    tries: int
    refused: int
    landmarks: int
    reduced_chi2: float | None = None
    focal_error: float | None = None
    focal_sigma: float | None = None
    suspicion: IntrinsicsSuspicionBody | None = None


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera of a robot, since the server started."""

    name: str
    intrinsics: Intrinsics
    width_px: int
    height_px: int
    frames: int
    views: int
    intrinsics_monitor: IntrinsicsMonitorBody


@dataclass(frozen=True, slots=True)
class CameraFrame:
    """The last answered frame of a camera: the number of its answer, `image/jpeg` or `image/png`, and the file."""

    seq: int
    media_type: str
    image: bytes = field(repr=False)


@dataclass(frozen=True, slots=True)
class UploadedView:
    """Corners of the rectangle in one image: top-left, top-right, bottom-right, bottom-left, in pixels."""

    corners: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class UploadedViews:
    """Views of one flat rectangle, from at least three sides that differ by more than 15 degrees."""

    width_px: int
    height_px: int
    size_width_m: float
    size_height_m: float
    views: tuple[UploadedView, ...]


@dataclass(frozen=True, slots=True)
class CalibrationConstraintsBody:
    """What is known beside the views: radial coefficients that may be fitted (0 to 2), no roll, height of the camera
    over the landmark's centre, an unknown ratio of the landmark's sides."""

    radial: int = 1
    zero_roll: bool = False
    height_m: float | None = None
    unknown_aspect: bool = False


@dataclass(frozen=True, slots=True)
class CalibrationViewReport:
    """One view of a calibration."""

    used: bool
    rms_px: float | None = None
    distance_m: float | None = None


@dataclass(frozen=True, slots=True)
class CalibrationReport:
    """A calibrated camera, for pictures of `width_px` x `height_px`. Standard deviations are infinite where the views
    do not determine them."""

    intrinsics: Intrinsics
    width_px: int
    height_px: int
    fx_sigma_px: float = field(metadata={NULL: math.inf})
    cx_sigma_px: float = field(metadata={NULL: math.inf})
    cy_sigma_px: float = field(metadata={NULL: math.inf})
    rms_px: float
    reduced_chi2: float
    orientations: int
    aspect_ratio: float
    warnings: tuple[str, ...]
    views: tuple[CalibrationViewReport, ...]
    linear_fx_px: float | None = None


@dataclass(frozen=True, slots=True)
class Ros2Status:
    """What became of the messages of a robot of ROS 2 since the start of the server: messages received and sent by
    topic, and those not used, or only in part, by topic and reason. Without `configured` the settings of the server do
    not name the robot, and all else is empty."""

    configured: bool
    received: dict[str, int]
    sent: dict[str, int]
    reasons: dict[str, dict[str, int]]
