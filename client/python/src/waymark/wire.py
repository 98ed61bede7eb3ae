"""The messages of the wire as frozen dataclasses, with the field names of `waymark.proto`.

Lengths are metres, angles radians, image coordinates pixels with pixel (0, 0) at the centre of the top-left one. Frames
of coordinates: `map` (x, y on the floor, z up), `robot` (x forward, y left, z up), `camera` (x right, y down,
z forward), `landmark` (x outward normal, y the viewer's right, z up). `a_from_b` takes b-coordinates to
a-coordinates. Covariances are row-major: of poses on the floor over (x, y, theta), of poses in space over
(rotation vector, translation).
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import Any, Literal

from waymark.camera_file import numbers_of_file
from waymark.errors import InvalidInput, Refused

Status = Literal["unspecified", "matched", "ambiguous", "no_match", "rejected", "expired", "overloaded", "not_ready"]
QuadKind = Literal["unspecified", "full", "three_sided", "expected", "texture"]
Verdict = Literal["unspecified", "unknown", "unique", "ambiguous"]
PartAgreement = Literal["unspecified", "silent", "agrees", "disagrees"]
Sighting = Literal["unspecified", "global", "guided"]
FixQuantity = Literal["unspecified", "size", "camera_height", "camera_tilt", "mounting"]
PoseTrust = Literal["unspecified", "unsupported", "supported", "stale", "contradicted"]
GazeCriterion = Literal["unspecified", "product", "information"]
GazeAction = Literal["unspecified", "landmark", "ahead", "sweep"]


@dataclass(frozen=True, slots=True)
class Pose3:
    """A rigid transform: unit quaternion and translation."""

    qx: float = 0.0
    qy: float = 0.0
    qz: float = 0.0
    qw: float = 1.0
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0

    @classmethod
    def mounting(
        cls, x_m: float, y_m: float, z_m: float, *, pan_rad: float = 0.0, tilt_rad: float = 0.0, roll_rad: float = 0.0
    ) -> Pose3:
        """`robot_from_camera` of a camera at this point of the robot frame. With all angles 0 it looks forward and
        level; `pan_rad` turns it to the left, `tilt_rad` upwards, `roll_rad` clockwise about its own axis."""
        # About z by pan, y by -tilt and x by roll, after the axes of the camera: z forward, x right, y down.
        turned = _product(_about(2, pan_rad), _product(_about(1, -tilt_rad), _about(0, roll_rad)))
        qx, qy, qz, qw = _product(turned, (-0.5, 0.5, -0.5, 0.5))
        return cls(qx, qy, qz, qw, x_m, y_m, z_m)

    @classmethod
    def from_yaw(cls, x_m: float, y_m: float, z_m: float, yaw_rad: float) -> Pose3:
        """An upright one: turned about z alone, counter-clockwise."""
        return cls(*_about(2, yaw_rad), x_m, y_m, z_m)

    @classmethod
    def from_matrix(cls, matrix: Sequence[Sequence[float]] | Any) -> Pose3:
        """Of a homogeneous matrix, 4 x 4 or its upper 3 rows: lists, or an array of NumPy. Raises `InvalidInput` if it
        is no rotation with a translation."""
        m = [[float(each) for each in row] for row in matrix]
        _check_rigid(m, 3)
        # The largest of the four is well conditioned.
        traces = (m[0][0] - m[1][1] - m[2][2], m[1][1] - m[0][0] - m[2][2], m[2][2] - m[0][0] - m[1][1])
        of = (*traces, m[0][0] + m[1][1] + m[2][2])
        best = of.index(max(of))
        q = math.sqrt(1 + of[best]) / 2
        off = ((m[2][1], m[1][2]), (m[0][2], m[2][0]), (m[1][0], m[0][1]))
        if best == 3:
            x, y, z = ((a - b) / (4 * q) for a, b in off)
            turn = (x, y, z, q)
        else:
            parts = [0.0, 0.0, 0.0, (off[best][0] - off[best][1]) / (4 * q)]
            for axis in range(3):
                parts[axis] = q if axis == best else (m[axis][best] + m[best][axis]) / (4 * q)
            turn = (parts[0], parts[1], parts[2], parts[3])
        return cls(*turn, m[0][3], m[1][3], m[2][3])

    def matrix(self) -> tuple[tuple[float, ...], ...]:
        """The homogeneous matrix, 4 rows of 4; `numpy.array` takes it."""
        x, y, z, w = self.qx, self.qy, self.qz, self.qw
        return (
            (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), self.x_m),
            (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), self.y_m),
            (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), self.z_m),
            (0.0, 0.0, 0.0, 1.0),
        )

    @property
    def yaw_rad(self) -> float:
        """Heading of its x axis on the floor, counter-clockwise from x: of a robot, and of a landmark, whose x axis is
        its normal."""
        m = self.matrix()
        return math.atan2(m[1][0], m[0][0])

    @property
    def looks_rad(self) -> float:
        """Heading of its z axis on the floor: where a camera looks."""
        m = self.matrix()
        return math.atan2(m[1][2], m[0][2])


def _check_rigid(m: list[list[float]], size: int) -> None:
    """Raises `InvalidInput` unless its first `size` rows are a rotation and a translation."""
    is_rigid = len(m) >= size and all(len(row) == size + 1 for row in m)
    if is_rigid:
        for i in range(size):
            for j in range(size):
                dot = sum(m[i][k] * m[j][k] for k in range(size))
                is_rigid &= abs(dot - (i == j)) < 1e-3
        turn = m[0][0] * m[1][1] - m[0][1] * m[1][0]
        if size == 3 and is_rigid:
            turn = sum(m[2][k] * (m[0][k - 2] * m[1][k - 1] - m[0][k - 1] * m[1][k - 2]) for k in range(3))
        is_rigid &= turn > 0
    if not is_rigid:
        shape = f"{size + 1} x {size + 1}"
        raise InvalidInput(f"matrix is no {shape} rotation with a translation", code="out_of_range", field="matrix")


def _about(axis: int, angle_rad: float) -> tuple[float, float, float, float]:
    turn = [0.0, 0.0, 0.0, math.cos(angle_rad / 2)]
    turn[axis] = math.sin(angle_rad / 2)
    return (turn[0], turn[1], turn[2], turn[3])


def _product(
    a: tuple[float, float, float, float], b: tuple[float, float, float, float]
) -> tuple[float, float, float, float]:
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


@dataclass(frozen=True, slots=True)
class Pose2:
    """A pose on the floor."""

    x_m: float = 0.0
    y_m: float = 0.0
    theta_rad: float = 0.0

    @classmethod
    def from_matrix(cls, matrix: Sequence[Sequence[float]] | Any) -> Pose2:
        """Of a homogeneous matrix, 3 x 3 or its upper 2 rows: lists, or an array of NumPy."""
        m = [[float(each) for each in row] for row in matrix]
        _check_rigid(m, 2)
        return cls(m[0][2], m[1][2], math.atan2(m[1][0], m[0][0]))

    @property
    def yaw_rad(self) -> float:
        """`theta_rad`, from -pi to pi."""
        return math.atan2(math.sin(self.theta_rad), math.cos(self.theta_rad))

    def matrix(self) -> tuple[tuple[float, ...], ...]:
        """The homogeneous matrix, 3 rows of 3; `numpy.array` takes it."""
        c, s = math.cos(self.theta_rad), math.sin(self.theta_rad)
        return ((c, -s, self.x_m), (s, c, self.y_m), (0.0, 0.0, 1.0))


@dataclass(frozen=True, slots=True)
class Pose2Covariance:
    """A pose on the floor with covariance over (x, y, theta): 9 numbers."""

    pose: Pose2 = Pose2()
    covariance: tuple[float, ...] = (0.0,) * 9

    @property
    def sigma(self) -> tuple[float, float, float]:
        """Standard deviations of x (m), y (m) and theta (rad)."""
        c = self.covariance
        return (math.sqrt(max(c[0], 0.0)), math.sqrt(max(c[4], 0.0)), math.sqrt(max(c[8], 0.0)))


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """A camera: focal lengths and principal point in pixels, and one lens model at most, in the order of ROS and
    OpenCV."""

    fx_px: float = 0.0
    fy_px: float = 0.0
    cx_px: float = 0.0
    cy_px: float = 0.0
    # k1, k2, p1, p2, k3.
    plumb_bob: tuple[float, ...] = ()
    # k1, k2, p1, p2, k3, k4, k5, k6.
    rational_polynomial: tuple[float, ...] = ()
    # k1, k2, k3, k4 of OpenCV's fisheye.
    equidistant: tuple[float, ...] = ()
    # Standard deviations, as a calibration gives them.
    focal_sigma_px: float | None = None
    center_sigma_px: float | None = None
    # Of the pictures that it was calibrated with: an image of another scale has the intrinsics scaled, one of other
    # proportions is refused.
    width_px: int | None = None
    height_px: int | None = None

    @classmethod
    def from_file(cls, path: str | PathLike[str]) -> Intrinsics:
        """A calibrated camera, of the file that `waymark camera calibrate --json` writes, of intrinsics as JSON, or,
        with PyYAML, of ROS' `ost.yaml` or a `camera_info` that `ros2 topic echo` printed. Raises `InvalidInput`
        (`bad_camera_file`, `no_yaml`)."""
        return cls(**numbers_of_file(path))

    @classmethod
    def from_view(cls, width_px: int, height_px: int, horizontal_rad: float) -> Intrinsics:
        """A camera without distortion that sees this angle from the left to the right border of its image. A guess
        for the first steps: a calibrated camera gives better poses."""
        focal = width_px / 2 / math.tan(horizontal_rad / 2)
        centre = ((width_px - 1) / 2, (height_px - 1) / 2)
        return cls(focal, focal, *centre, width_px=width_px, height_px=height_px)


@dataclass(frozen=True, slots=True)
class Rejection:
    """Why a message was refused: a stable code, the field at fault and a sentence."""

    code: str = ""
    field: str = ""
    detail: str = ""


@dataclass(frozen=True, slots=True)
class Point:
    """A point of the image."""

    u_px: float = 0.0
    v_px: float = 0.0


@dataclass(frozen=True, slots=True)
class Candidate:
    """A landmark that a quad was compared with."""

    landmark: str = ""
    # C^r, H^r, the distance that decides and its threshold: None where points decide, and where infinite.
    correlation: float | None = None
    hausdorff: float | None = None
    distance: float | None = None
    threshold: float | None = None
    # Accepted below 1: distance over threshold, or, by points, -5 over their `log10_chance`.
    ratio: float = 0.0
    probability: float = 0.0
    # Empty, or the gate that refused it.
    refusal: str = ""
    gradient_similarity: float | None = None


@dataclass(frozen=True, slots=True)
class PointEvidence:
    """What matched points say of the first candidate."""

    matches: int = 0
    inliers: int = 0
    checked: int = 0
    agreeing: int = 0
    log10_chance: float = 0.0
    # 5 x 5 parts of the landmark as taught, by rows from its top left.
    agreement: tuple[PartAgreement, ...] = ()


@dataclass(frozen=True, slots=True)
class LandmarkPose:
    """Where a landmark is, seen from the camera, with covariance: 36 numbers."""

    camera_from_landmark: Pose3 | None = None
    covariance: tuple[float, ...] = ()
    reprojection_rms_px: float = 0.0


@dataclass(frozen=True, slots=True)
class CameraPose:
    """Where a photograph was taken, with covariance over (rotation vector, position) in the map frame: 36 numbers.
    `landmarks` are the one that gives the pose, then those that agree with it."""

    map_from_camera: Pose3 | None = None
    covariance: tuple[float, ...] = ()
    landmarks: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class QuadAnswer:
    """A quad of the image, and what it was recognised as. `landmark` is set only for the verdict `unique`."""

    corners: tuple[Point, ...] = ()
    kind: QuadKind = "unspecified"
    score: float = 0.0
    verdict: Verdict = "unspecified"
    landmark: str = ""
    candidates: tuple[Candidate, ...] = ()
    entropy_m: float = 0.0
    entropy_norm: float = 0.0
    confidence: float = 0.0
    pose: LandmarkPose | None = None
    second_pose: LandmarkPose | None = None
    pose_ambiguous: bool = False
    pose_refusal: str = ""
    points: PointEvidence | None = None
    doubtful_landmark: str = ""
    sighting: Sighting = "unspecified"
    guided_landmark: str = ""
    # That the quad is none of the map's landmarks.
    probability_none: float = 0.0


@dataclass(frozen=True, slots=True)
class StageTime:
    """Time that a stage took."""

    stage: str = ""
    ms: float = 0.0


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A place where the robot may be."""

    probability: float = 0.0
    map_from_robot: Pose2Covariance | None = None


@dataclass(frozen=True, slots=True)
class PoseRefusalCause:
    """A number that makes recognised landmarks fit a pose if it alone is changed: the value that was stated, and the
    one that fits the image, in `unit` (m, rad or px). `landmark` is set for `size`."""

    quantity: FixQuantity = "unspecified"
    landmark: str = ""
    expected: float = 0.0
    measured: float = 0.0
    sigma: float = 0.0
    unit: str = ""


@dataclass(frozen=True, slots=True)
class PoseRefusalDetail:
    """By how much recognised landmarks fit no pose of an upright robot, and why: the likeliest cause first, and the
    same in a sentence for a person."""

    chi2: float = 0.0
    limit: float = 0.0
    causes: tuple[PoseRefusalCause, ...] = ()
    sentence: str = ""


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer to a frame. "Nothing recognised" (`no_match`) is an answer, not a failure."""

    epoch: int = 0
    seq: int = 0
    captured_ns: int = 0
    map: str = ""
    map_version: int = 0
    status: Status = "unspecified"
    rejection: Rejection | None = None
    quads: tuple[QuadAnswer, ...] = ()
    # By landmarks named by the picture alone; a pose may start with it.
    map_from_robot: Pose2Covariance | None = None
    pose_landmarks: tuple[str, ...] = ()
    latency_ms: float = 0.0
    timings: tuple[StageTime, ...] = ()
    clock_suspect: bool = False
    # Why recognised landmarks gave no pose of the robot; empty where they did.
    pose_refusal: str = ""
    hypotheses: tuple[Hypothesis, ...] = ()
    # By landmarks that were named with the pose known before; it corrects that pose and starts none.
    guided_map_from_robot: Pose2Covariance | None = None
    guided_landmarks: tuple[str, ...] = ()
    only_expected: bool = False
    # With gate_reprojection and gate_inconsistent: which number does not fit, and by how much.
    pose_refusal_detail: PoseRefusalDetail | None = None
    # Only for a photograph that came with intrinsics and without a robot.
    camera_pose: CameraPose | None = None
    # Why recognised landmarks gave no pose of the camera; empty where they did.
    camera_pose_refusal: str = ""

    def accepted(self) -> Answer:
        """This answer; raises `Refused` with the code and the field if the server refused the frame."""
        if self.rejection is not None:
            raise Refused(self.rejection.detail, code=self.rejection.code, field=self.rejection.field)
        return self

    # The server that answers, over zenoh.
    server: str = ""
    # What walls say against the pose of a photograph: behind_wall, outside_map. The pose stands all the same.
    pose_cautions: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class CameraAnswer:
    """An answer, and the camera that it is for."""

    camera: str
    answer: Answer


@dataclass(frozen=True, slots=True)
class Scan:
    """One turn of a laser. Ranges at or beyond `max_range_m` had no return. The client sets epoch and number."""

    ranges_m: tuple[float, ...]
    first_bearing_rad: float
    bearing_step_rad: float
    max_range_m: float
    odom_from_robot: Pose2
    robot_from_laser: Pose2 = Pose2()
    captured_ns: int = field(default_factory=time.time_ns)
    # The map that the robot is on, where several servers share a router; empty: that of `Robot.enter_map`.
    map: str = ""


@dataclass(frozen=True, slots=True)
class RobotPose:
    """The fused pose of a robot. None older than 2 s is sent: silence means that the pose is unknown."""

    epoch: int = 0
    captured_ns: int = 0
    map: str = ""
    map_from_robot: Pose2Covariance | None = None
    # What it rests on now: odometry, landmarks, guided, laser, relocalisation.
    modalities: tuple[str, ...] = ()
    corrections: int = 0
    laser_corrections: int = 0
    age_ms: float = 0.0
    trust: PoseTrust = "unspecified"
    # The server that fused it.
    server: str = ""


@dataclass(frozen=True, slots=True)
class MapChanged:
    """A map has a new version."""

    map: str = ""
    version: int = 0
    # The server that serves the map.
    server: str = ""


@dataclass(frozen=True, slots=True)
class GazeRequest:
    """A question where to look. Without `map_from_robot` the last fused pose counts."""

    map_from_robot: Pose2Covariance | None = None
    camera_x_m: float = 0.0
    camera_y_m: float = 0.0
    # 0 stands for 1.2 m.
    camera_z_m: float = 0.0
    pan_rad: float = 0.0
    tilt_rad: float = 0.0
    rate_radps: float = 0.0
    pan_range_rad: tuple[float, ...] = ()
    tilt_range_rad: tuple[float, ...] = ()
    criterion: GazeCriterion = "unspecified"
    at_ns: int = field(default_factory=time.time_ns)
    looked_at: str = ""
    recognised: bool = False
    # As that of a scan.
    map: str = ""


@dataclass(frozen=True, slots=True)
class GazeAdvice:
    """Where to look. What follows `action` is set for `landmark` only."""

    map: str = ""
    map_version: int = 0
    rejection: Rejection | None = None
    action: GazeAction = "unspecified"
    landmark: str = ""
    pan_rad: float = 0.0
    tilt_rad: float = 0.0
    utility: float = 0.0
    probability: float = 0.0
    margin_m: float = 0.0
    gain_nats: float = 0.0
    range_m: float = 0.0
    incidence_rad: float = 0.0
    # The server that answers.
    server: str = ""


@dataclass(frozen=True, slots=True)
class ServerEvent:
    """The server of the robot is gone, and nobody answers until it is back; or there is one again. `map` is that of
    `Robot.enter_map`; empty: the robot's own."""

    kind: Literal["gone", "back"]
    server: str
    map: str = ""
