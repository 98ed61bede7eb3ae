# Made by tools/generate.py from docs/openapi.json. Do not edit.
"""The bodies of the HTTP interface; its OpenAPI document says the same."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

from waymark._values import NAME, NULL, REST
from waymark.wire import Answer, Intrinsics, Pose2, Pose2Covariance, Pose3, PoseTrust

__all__ = [
    "AcceptRequest",
    "AcceptanceBody",
    "AcceptedTrackBody",
    "AdviceBody",
    "AnswerStatus",
    "AreaBody",
    "AreaStatsBody",
    "AuditCheck",
    "AuditEntry",
    "AuditHead",
    "Backup",
    "BackupHealth",
    "BackupManifest",
    "BackupMap",
    "BackupState",
    "Bounds",
    "BulkOutcome",
    "CalibrationConstraintsBody",
    "CalibrationReport",
    "CalibrationRequest",
    "CalibrationViewReport",
    "Camera",
    "Cameras",
    "CaptureMetadata",
    "CellBody",
    "CertificateRequest",
    "ChangeKind",
    "ChangeSummary",
    "Commit",
    "CornerCovariances",
    "Corners",
    "CorrectionBody",
    "CorrectionsBody",
    "Covariance",
    "CoverageGapBody",
    "CoverageRequest",
    "CoverageResponse",
    "CoverageSampleBody",
    "CreatedToken",
    "DatabaseCheckBody",
    "DatabaseCheckState",
    "Difference",
    "Distance",
    "DistanceHistogram",
    "Draft",
    "DraftDifference",
    "DuplicatePair",
    "EnrolledRobot",
    "EpochConflictBody",
    "ErrorModelBody",
    "EstimatedPlace",
    "EventKind",
    "ExtendedLandmark",
    "FailedGate",
    "FileWalls",
    "FindingBody",
    "FusionMode",
    "Gate",
    "Gathering",
    "GatheringChange",
    "GatheringCountsBody",
    "GazeQueryBody",
    "GazeRankingBody",
    "GazeTargetBody",
    "HarrisPoint",
    "HarrisSet",
    "Health",
    "IconKeypoint",
    "IntrinsicsMonitorBody",
    "IntrinsicsSuspicionBody",
    "Job",
    "JobState",
    "Landmark",
    "LandmarkChange",
    "LandmarkDeletion",
    "LandmarkDeletions",
    "LandmarkDifference",
    "LandmarkDifferencePage",
    "LandmarkDistances",
    "LandmarkEvidence",
    "LandmarkHealth",
    "LandmarkIcon",
    "LandmarkLesson",
    "LandmarkMerge",
    "LandmarkModelBody",
    "LandmarkModelDetail",
    "LandmarkPatch",
    "LandmarkPoint",
    "LandmarkStatus",
    "LearningSettings",
    "LeftOutBody",
    "LiveAnswer",
    "LiveMapChange",
    "LivePose",
    "LivePosition",
    "LivePresence",
    "LocaliseHypothesisBody",
    "LocaliseResult",
    "LocaliseStatus",
    "LookAlikeBody",
    "Map",
    "MapLesson",
    "MapPatch",
    "MappingProgressBody",
    "MappingStage",
    "MemoryPart",
    "MissingCondition",
    "Modality",
    "ModalityMapBody",
    "ModalityMapPatch",
    "ModalityStatsBody",
    "ModelPicture",
    "MultiPolygon",
    "NamedAreaBody",
    "NewCopy",
    "NewDraft",
    "NewGatheringBody",
    "NewLandmark",
    "NewLandmarks",
    "NewMap",
    "NewMapping",
    "NewToken",
    "NextLandmarkBody",
    "NumberOrder",
    "ObservedPlaceBody",
    "Order",
    "PageLink",
    "Pair",
    "Parent",
    "PassageEnd",
    "PipelinePreset",
    "Place",
    "PlaceLandmark",
    "PlaceSigma",
    "PlacementReportBody",
    "PointMatch",
    "PoseBody",
    "PoseByHand",
    "PoseHypothesisBody",
    "PriorCheck",
    "PriorSource",
    "QuadMatches",
    "Readiness",
    "ReadinessCounts",
    "RecordingStatusBody",
    "ReferenceRunBody",
    "ReferenceRuns",
    "ReferenceTrajectoryBody",
    "RefusalReason",
    "RefusedBy",
    "RefusedView",
    "RelocalisationStatus",
    "Replay",
    "ReplayChange",
    "ReplayedPose",
    "Robot",
    "RobotActivity",
    "RobotAssignment",
    "RobotCertificate",
    "RobotInput",
    "RobotPose",
    "RobotReplay",
    "Role",
    "Rollback",
    "RollbackOutcome",
    "Ros2Status",
    "RouteLeg",
    "ScanBody",
    "ServedMap",
    "ServerBody",
    "ServerEvent",
    "ServerEventBody",
    "Servers",
    "SiteTopologyBody",
    "Size",
    "SizeAndPlace",
    "Span",
    "StatsScope",
    "StorageHealth",
    "StoredAnswer",
    "StoredAnswerSummary",
    "StoredQuad",
    "ThresholdBody",
    "ThresholdLimit",
    "ThresholdWeights",
    "Token",
    "TopologyMap",
    "TopologyPassage",
    "TopologyPlace",
    "TopologyRoute",
    "TrackList",
    "TrackSummary",
    "TrainingView",
    "TrajectoriesBody",
    "TransformResponse",
    "TransformedPose",
    "Triple",
    "Underlay",
    "UnderlayPlace",
    "UnknownRobot",
    "UnknownRobots",
    "UploadOutcome",
    "UploadedView",
    "UploadedViews",
    "Version",
    "VisibilityAreaBody",
    "VisibilityAreaProperties",
    "VisibilitySettingsBody",
    "VisibleLandmark",
    "VisibleRequest",
    "VisibleResponse",
    "WallBody",
    "WallsBody",
    "WallsDifference",
    "Whoami",
]

# What came of a frame.
AnswerStatus = Literal[
    "matched", "ambiguous", "no_match", "rejected", "expired", "overloaded", "not_ready", "unspecified"
]
# How far a backup is.
BackupState = Literal["running", "complete", "failed", "damaged"]
# Least x, least y, greatest x, greatest y, in metres.
Bounds = tuple[float, float, float, float]
# Kind of a change.
ChangeKind = Literal["added", "removed", "changed"]
# A covariance over (x, y, theta), row-major, in m and rad.
Covariance = tuple[float, ...]
# How far the check of the database is.
DatabaseCheckState = Literal["running", "ok", "failed"]
# Which distance decides in a map.
Distance = Literal["both", "correlation", "hausdorff"]
# A kind of events that a reader can choose, for the document: [`ServerEventBody::KINDS`].
EventKind = Literal[
    "map_changed", "landmark_changed", "landmarks_changed", "job", "presence", "gathering", "backup", "tokens_changed"
]
# What is fused where runs have told which modality is best. Odometry carries the pose in any case.
FusionMode = Literal["all", "near_best", "best"]
# A quality gate, or another reason why something is not in use.
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
# What became of a gathering.
GatheringChange = Literal["begun", "ended", "decided", "deleted"]
# Where a job stands.
JobState = Literal["queued", "running", "done", "failed", "cancelled"]
# What became of a landmark.
LandmarkChange = Literal["added", "changed", "removed"]
# How far a landmark is trusted.
LandmarkHealth = Literal["sound", "flagged", "quarantined"]
# How far a landmark has come.
LandmarkStatus = Literal["not_learnt", "learning", "active", "inactive"]
# The order of a list: by name, or by the time of the last edit or lesson; `-` reverses it.
Order = Literal["name", "-name", "changed", "-changed"]
# What came of a localisation.
LocaliseStatus = Literal["located", "ambiguous", "no_match"]
# How far a mapping has come.
MappingStage = Literal["resuming", "mapping", "finishing", "found", "done", "failed"]
# Why the first hypothesis is not yet the pose.
MissingCondition = Literal["higher_probability", "second_landmark", "consistent_observations", "no_rival_pose"]
# What estimates poses by itself.
Modality = Literal["odometry", "laser", "landmarks"]
# A stored picture of a model.
ModelPicture = Literal["exemplar1", "exemplar2", "exemplar3", "mean", "mode1", "mode2"]
# The order of a list by number; `-` reverses it.
NumberOrder = Literal["number", "-number"]
# Two numbers: x and y in metres, or columns and rows in pixels.
Pair = tuple[float, float]
# A whole pipeline by its name.
PipelinePreset = Literal["default", "paper"]
# Whose pose a picture was compared with.
PriorSource = Literal["robot", "server"]
# Who did not take a photograph.
RefusedBy = Literal["upload", "lesson"]
# How the pose in an answer differs.
ReplayedPose = Literal["same", "gained", "lost", "moved"]
# What a principal may do. Each role may do all that those before it may.
Role = Literal["viewer", "robot", "teacher", "operator", "admin"]
# Two times in nanoseconds since the Unix epoch: from, to.
Span = tuple[int, int]
# Whose runs an advice rests on.
StatsScope = Literal["cell", "neighbourhood", "area", "map"]
# What limits a threshold.
ThresholdLimit = Literal["cost", "nearest_negative", "absolute_cap"]
# Three numbers: x and y in metres and a heading in radians, or their errors; variances of a line.
Triple = tuple[float, float, float]
# What became of an upload.
UploadOutcome = Literal["new", "duplicate", "near_duplicate"]
# Covariances of the four corners of a quad in square pixels, each (uu, uv, vv).
CornerCovariances = tuple[Triple, Triple, Triple, Triple]
# Corners in pixels: top-left, top-right, bottom-right, bottom-left.
Corners = tuple[Pair, Pair, Pair, Pair]


@dataclass(frozen=True, slots=True)
class AcceptRequest:
    """What is accepted."""

    tracks: tuple[AcceptedTrackBody, ...]
    """At least one."""
    learn: bool = False
    """Learn these landmarks at once."""


@dataclass(frozen=True, slots=True)
class AcceptanceBody:
    """What an acceptance came to."""

    landmarks: tuple[ExtendedLandmark, ...]
    """The landmarks that got views, by name."""
    job: Job | None = None
    """The lesson, if one was wanted."""


@dataclass(frozen=True, slots=True)
class AcceptedTrackBody:
    """A track that is accepted."""

    track: int
    """Number of the track."""
    name: str | None = None
    """Name of the landmark it becomes: a new one, or one without views. Several tracks of one object may be given
    one name. Not needed for views of a landmark that is known."""


@dataclass(frozen=True, slots=True)
class AdviceBody:
    """What follows for a robot there."""

    used: tuple[Modality, ...]
    """What is fused."""
    scope: StatsScope
    """Whose runs say so: those through the `cell`, those through it and the eight around it (`neighbourhood`),
    those through the named `area`, or all of the `map`."""
    error_models: tuple[ErrorModelBody, ...]
    """What each modality gets wrong there beyond what it claims."""
    best: Modality | None = None
    """The best modality; absent where too little is known, and everything is fused."""


@dataclass(frozen=True, slots=True)
class AreaBody:
    """A part of the map with a name: a room, a piece of corridor. It speaks for its square metres that were hardly
    driven through."""

    name: str
    """Unique, 1 to 64 bytes."""
    corners_m: tuple[Pair, ...]
    """Its corners in order, x and y in metres: 3 to 64."""


@dataclass(frozen=True, slots=True)
class AreaStatsBody:
    """What is known of a place."""

    advice: AdviceBody
    """What follows for a robot there."""
    statistics: tuple[ModalityStatsBody, ...]
    """What runs have shown, by modality."""


@dataclass(frozen=True, slots=True)
class AuditCheck:
    """The chain as it was found: the digest of every entry was computed anew."""

    entries: int
    """Entries that are kept."""
    forgotten: int
    """Entries that were forgotten for want of room; the chain goes on from their last one."""
    head: AuditHead
    """The newest entry. Noted elsewhere, it proves later that nothing before it was changed."""
    fault: str | None = None
    """The first thing that is wrong; none where the chain is whole."""


@dataclass(frozen=True, slots=True)
class AuditEntry:
    """A change, and who made it."""

    seq: int
    """1, 2, 3, ... without gaps."""
    time_ms: int
    """ms since the Unix epoch."""
    actor: str
    """Name of the token; `local` for the local one, `server` for what the server does by itself."""
    action: str
    """Method and path of the operation, as in the authorisation table, or what the server did."""
    target: str
    """Path of the request."""
    sha256: str
    """Digest of this entry and of all before it: SHA-256, hexadecimal."""
    token: int | None = None
    """Number of the token; none for the local one and the server."""
    request: str | None = None
    """Id of the request, as in the log of the server."""
    why: str | None = None
    """The reason that was given."""


@dataclass(frozen=True, slots=True)
class AuditHead:
    """A place in the chain."""

    seq: int
    """Number of the entry; 0 before the first."""
    sha256: str
    """Its digest: SHA-256, hexadecimal."""


@dataclass(frozen=True, slots=True)
class Backup:
    """A backup in the server's data directory."""

    name: str
    """Its time in UTC, as in `20261123-140530`."""
    state: BackupState
    """How far it is."""
    created_ms: int
    """When it was begun, ms since the Unix epoch."""
    bytes: int
    """Size of the file; 0 until it is complete."""
    reason: str | None = None
    """Why it failed, or what is wrong with it."""
    manifest: BackupManifest | None = None
    """What it holds, once it is complete."""


@dataclass(frozen=True, slots=True)
class BackupHealth:
    """The state of backups, in `/readyz`."""

    every_hours: int
    """Hours between scheduled backups; 0: none are scheduled."""
    newest: str | None = None
    """Name of the newest complete backup in the data directory."""
    newest_ms: int | None = None
    """When that was made, ms since the Unix epoch."""
    failed: str | None = None
    """Why the last attempt failed; absent once one has succeeded."""


@dataclass(frozen=True, slots=True)
class BackupManifest:
    """What a backup holds."""

    created_ms: int
    """When it was made, ms since the Unix epoch."""
    program: str
    """Version of the program that made it."""
    schema: int
    """Number of the last step of the database's schema."""
    maps: tuple[BackupMap, ...]
    """The maps, by name."""
    pictures: int
    """Number of stored pictures."""
    faults: tuple[str, ...]
    """What was wrong with the data when the backup was made."""


@dataclass(frozen=True, slots=True)
class BackupMap:
    """What a backup holds of one map."""

    name: str
    """Its name."""
    version: int
    """Its version."""
    landmarks: int
    """Number of landmarks."""
    views: int
    """Number of training views."""
    models: int
    """Number of models."""
    walls: int
    """Number of wall segments."""
    sha256: str
    """SHA-256 over the digests of its settings, landmarks, views, models and walls, hexadecimal."""


@dataclass(frozen=True, slots=True)
class BulkOutcome:
    """What was done to several landmarks."""

    count: int
    """Landmarks made or deleted."""


@dataclass(frozen=True, slots=True)
class CalibrationConstraintsBody:
    """What may be said beside the views."""

    radial: int = 1
    """Radial coefficients (k1, k2) that may be fitted, 0 to 2; only those are that the views ask for."""
    zero_roll: bool = False
    """The camera does not roll (C2)."""
    height_m: float | None = None
    """The camera is this high over the landmark's centre in all views, metres; negative below, -100 to 100 (C3)."""
    unknown_aspect: bool = False
    """The ratio of the landmark's sides is not what its size says, and is found with the camera."""


@dataclass(frozen=True, slots=True)
class CalibrationReport:
    """A calibrated camera. Standard deviations are infinite (null in JSON) where the views do not determine them."""

    intrinsics: Intrinsics
    """As frames carry it, with the standard deviations below: what is not known of the camera is then in the
    poses."""
    width_px: int
    """Width of the pictures that it was calibrated with."""
    height_px: int
    """Height of these pictures."""
    fx_sigma_px: float = field(metadata={NULL: math.inf})
    """Standard deviation of the focal length."""
    cx_sigma_px: float = field(metadata={NULL: math.inf})
    """Standard deviation of the principal point, to the right."""
    cy_sigma_px: float = field(metadata={NULL: math.inf})
    """Standard deviation of the principal point, down."""
    rms_px: float
    """Root mean square residual per coordinate."""
    reduced_chi2: float
    """Weighted squared residual over its degrees of freedom: about 1 where corners are as good as claimed."""
    orientations: int
    """Orientations of the landmark that differ by more than 15 degrees."""
    aspect_ratio: float
    """Height over width of the landmark over what its size says."""
    warnings: tuple[str, ...]
    """Why it should not be believed without a look: empty where nothing speaks against it."""
    views: tuple[CalibrationViewReport, ...]
    """Each view, in the order given."""
    linear_fx_px: float | None = None
    """Focal length of the linear solution, where there was one."""


@dataclass(frozen=True, slots=True)
class CalibrationRequest:
    """What to calibrate from."""

    uploaded_views: UploadedViews | None = None
    """Views of one rectangle; without them, the views that were kept of this camera's frames."""
    constraints: CalibrationConstraintsBody | None = None
    """What is known beside the views."""


@dataclass(frozen=True, slots=True)
class CalibrationViewReport:
    """One view of a calibration."""

    used: bool
    """Whether the camera rests on it; a view that does not fit is left out."""
    rms_px: float | None = None
    """Root mean square residual per coordinate."""
    distance_m: float | None = None
    """Distance of the camera from the landmark's centre, metres."""


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera of a robot, since the server started."""

    name: str
    """`[a-z0-9_-]{1,64}`, unique on the robot."""
    intrinsics: Intrinsics
    """As its frames say."""
    width_px: int
    """Of its frames."""
    height_px: int
    """Of its frames."""
    frames: int
    """Frames with these intrinsics in which a landmark was recognised."""
    views: int
    """Views of landmarks from different sides that are kept for calibration."""
    intrinsics_monitor: IntrinsicsMonitorBody
    """What the residuals of its fixes say: `suspicion` is set when the intrinsics seem off, with the reason and
    its number."""


@dataclass(frozen=True, slots=True)
class Cameras:
    """A robot's cameras."""

    cameras: tuple[Camera, ...]
    """By name."""


@dataclass(frozen=True, slots=True)
class CaptureMetadata:
    """How a picture was taken: the part `capture` of an upload. With it the server places the landmark itself, on
    the map's walls or under a ceiling, unless it was placed by hand."""

    intrinsics: Intrinsics
    """The camera."""
    map_from_robot: Pose2Covariance
    """Where the robot was, with covariance."""
    robot_from_camera: Pose3
    """The camera on the robot."""
    ceiling_height_m: float | None = None
    """The landmark is under a ceiling so high, not on a wall."""
    corner_covariance_px2: CornerCovariances | None = None
    """Covariance of each corner by the noise of its edges: (uu, uv, vv), top-left, top-right, bottom-right,
    bottom-left. Absent: 1 px, or the detector's where the server finds the corners."""


@dataclass(frozen=True, slots=True)
class CellBody:
    """A pose cell: a square metre that was driven through in one of four headings."""

    x_m: float
    """Its lower left corner, x."""
    y_m: float
    """Its lower left corner, y."""
    heading_rad: float
    """0, pi/2, pi or -pi/2, each for a quarter of the circle about it."""
    used: tuple[Modality, ...]
    """What is fused."""
    best: Modality | None = None
    """The best modality; absent where too little is known."""


@dataclass(frozen=True, slots=True)
class CertificateRequest:
    """A request for a certificate. The robot's private key stays where it was made."""

    request: str
    """PKCS #10, PEM, signed with the private key. Of it only the public key is taken."""
    valid_s: int | None = None
    """Seconds for which the certificate is valid, by the server's clock: 60 to ten years; a year if absent."""


@dataclass(frozen=True, slots=True)
class ChangeSummary:
    """Counts of what changed."""

    landmarks_added: int = 0
    """Landmarks that are new."""
    landmarks_removed: int = 0
    """Landmarks that are gone."""
    landmarks_changed: int = 0
    """Landmarks with another name, size, place, model, or other views."""
    views_added: int = 0
    """Training views that are new."""
    views_removed: int = 0
    """Training views that are gone."""
    models_changed: int = 0
    """Models that differ, if only by a threshold."""
    walls_changed: bool = False
    """The walls differ."""
    underlay_changed: bool = False
    """The picture under the map, or where it lies, differs."""
    reference_runs_added: int = 0
    """Reference runs that are new."""
    reference_runs_removed: int = 0
    """Reference runs that are gone."""
    settings: tuple[str, ...] = ()
    """Which settings differ: `name`, `site`, `building`, `floor`, `parent`, `pipeline` (detector or decision),
    `learning`, `fusion_mode`, `areas`, `visibility_settings`."""
    landmarks: tuple[str, ...] = ()
    """Names of the first landmarks that differ, at most 8."""


@dataclass(frozen=True, slots=True)
class Commit:
    """A commit: what one request or job changed of a map."""

    id: int
    """Its number: later commits have greater ones, also across maps."""
    created_ms: int
    """ms since the Unix epoch."""
    author: str
    """Name of the token, `local` for that of the server's machine, `server` for what the server does by itself. Of
    a job: who asked for it."""
    operation: str
    """Method and path of the request, as `PATCH /maps/{map}/landmarks/{landmark}`; of a job its kind; `outside`
    for what another program wrote into the database."""
    summary: ChangeSummary
    """What changed."""
    parent: int | None = None
    """The commit of this map before it; it may be forgotten."""
    job: int | None = None
    """The job, if one did it."""
    why: str | None = None
    """The reason that the client gave (header `Waymark-Why`)."""


@dataclass(frozen=True, slots=True)
class CorrectionBody:
    """A fix, what became of it, and by how much it moved the pose."""

    epoch: int
    """Echo of the frame or scan."""
    captured_ns: int
    """Echo of the frame or scan, robot's clock."""
    map: str
    """The map it is a pose in."""
    modality: str
    """`landmarks` (named without the pose), `guided` (landmarks named by the pose), `laser` or `relocalisation`;
    `by_hand` when a person said where it is; `map_change` when the robot came from another map."""
    landmarks: tuple[str, ...]
    """The landmarks it rests on, by name; empty for the laser."""
    outcome: str
    """`started` (it gave the first pose), `applied`, `gated_out` (it contradicts the pose and was left out),
    `reset` (the last of several that contradict the pose and agree with one another, or a person: it replaced
    the pose), `excluded_by_mode` (it agrees, but reference runs have shown another modality to be better here,
    and the map's fusion mode leaves this one out), `too_old`, `waiting` (newer than the last odometry),
    `carried_over` (the pose on another map, in the frame of this one)."""
    chi2: float | None = None
    """Squared Mahalanobis distance of the fix from the pose before it, 3 degrees of freedom; for `applied`,
    `excluded_by_mode` and `gated_out`."""
    along_m: float | None = None
    """By how much it moved the pose, in the robot's frame before it: forwards, metres."""
    across_m: float | None = None
    """By how much it moved the pose to the left, metres."""
    turn_rad: float | None = None
    """By how much it turned the pose to the left."""


@dataclass(frozen=True, slots=True)
class CorrectionsBody:
    """What a robot's pose rests on, and what became of its fixes."""

    modalities: tuple[str, ...]
    """What the pose rests on now: `odometry`, `landmarks`, `guided`, `laser`, `relocalisation`, `by_hand`; empty
    without a pose."""
    totals: dict[str, dict[str, int]]
    """For each modality how many fixes came to which end. For the laser also why scans gave no fix: `no_pose`
    (there is none to correct), `no_walls` (the map has none), `few_points`, `poor_match` (it shows something
    else than the map), `gate_prior` (it contradicts the pose), `ambiguous` (several poses fit), `superseded` (a
    newer one came first)."""
    corrections: tuple[CorrectionBody, ...]
    """The latest 200 of each modality, oldest first; without `repeated` ones, which tell nothing new."""


@dataclass(frozen=True, slots=True)
class CoverageGapBody:
    """A piece of the path from which no landmark is seen."""

    from_m: float
    """Its beginning, metres along the path."""
    to_m: float
    """Its end, metres along the path."""


@dataclass(frozen=True, slots=True)
class CoverageRequest:
    """A path to look at."""

    path: tuple[Pair, ...]
    """Its points: x, y in metres."""
    step_m: float = 0.0
    """How often to look: 0.01 to 10 m."""
    visibility_settings: VisibilitySettingsBody | None = None
    """Another camera than the map's."""


@dataclass(frozen=True, slots=True)
class CoverageResponse:
    """What is seen along a path."""

    map_version: int
    """Of this version of the map."""
    length_m: float
    """Length of the path."""
    share: float
    """Share of the path from which some landmark is seen."""
    gaps: tuple[CoverageGapBody, ...]
    """Pieces without a landmark, in order."""
    steps: tuple[CoverageSampleBody, ...]
    """Places along the path, `step_m` apart."""


@dataclass(frozen=True, slots=True)
class CoverageSampleBody:
    """One place of the path."""

    along_m: float
    """Metres from the beginning of the path."""
    x_m: float
    """Metres, in the map."""
    y_m: float
    """Metres, in the map."""
    landmarks: tuple[str, ...]
    """Names of the landmarks that are seen."""


@dataclass(frozen=True, slots=True)
class CreatedToken:
    """A new token, with its text."""

    text: str = field(repr=False)
    """`wmk_{id}_{secret}`, sent as `Authorization: Bearer`. It is shown this once: only its digest is stored."""
    token: Token
    """What it is."""


@dataclass(frozen=True, slots=True)
class DatabaseCheckBody:
    """The check of every page, row and index of the database that runs once after each start."""

    state: DatabaseCheckState
    """How far it is."""
    ended_ms: int | None = None
    """When it ended, ms since the Unix epoch."""
    faults: tuple[str, ...] = ()
    """What is wrong, at most 20; empty for whoever does not see all maps."""
    advice: str | None = None
    """What to do where it failed."""


@dataclass(frozen=True, slots=True)
class Difference:
    """What differs between a map at two commits."""

    from_commit: int
    """The earlier commit."""
    to_commit: int
    """The later commit; the newest one for the present state."""
    summary: ChangeSummary
    """Counts of all of it."""
    landmarks: LandmarkDifferencePage
    """The landmarks that differ, in the order of their numbers."""
    walls: WallsDifference | None = None
    """How the walls differ."""


@dataclass(frozen=True, slots=True)
class DistanceHistogram:
    """Distances of one kind that a threshold was fitted to."""

    threshold: float
    """Accepted below; 0 accepts nothing."""
    bin_width: float
    """Width of a bin; the first begins at 0."""
    own: tuple[int, ...]
    """Held-out distances of the landmark's own views, by bin."""
    own_beyond: int
    """Own distances beyond the last bin, infinite ones included."""
    others: tuple[int, ...]
    """Distances to other landmarks and distractors, by bin; of these only the 64 nearest are stored."""
    others_beyond: int
    """Distances to others that are in no bin: beyond the last one, or not among the nearest."""


@dataclass(frozen=True, slots=True)
class Draft:
    """A draft: a map of its own, made of another one and published to it as one commit."""

    name: str
    """Its name: every operation on maps takes it."""
    from_commit: int
    """The commit of the map that it began with."""
    created_ms: int
    """ms since the Unix epoch."""
    revision: str
    """That of the draft, as of any map."""
    landmarks: int
    """Landmarks in it."""


@dataclass(frozen=True, slots=True)
class DraftDifference:
    """What publishing a draft would change of its map."""

    from_commit: int
    """The commit of the map that the draft began with."""
    conflicts: tuple[str, ...]
    """What both have changed since, in words: while there is any, the draft cannot be published."""
    summary: ChangeSummary
    """Counts of all of it."""
    landmarks: LandmarkDifferencePage
    """The landmarks that differ."""
    walls: WallsDifference | None = None
    """How the walls differ."""


@dataclass(frozen=True, slots=True)
class DuplicatePair:
    """Two landmarks that look alike."""

    first: str
    """The landmark whose name comes first."""
    second: str
    """The other one."""
    gradient_similarity: float
    """Gradient similarity of the two, at most 1."""
    distance: float
    """1 minus that: what thresholds are compared with."""
    first_in_use: bool
    """Whether the first one is matched."""
    second_in_use: bool
    """Whether the second one is matched."""


@dataclass(frozen=True, slots=True)
class EnrolledRobot:
    """A new certificate, with what a robot needs to connect."""

    certificate_pem: str
    """The certificate, PEM."""
    zenoh: str
    """Where robots connect, as the server listens: its host may be `0.0.0.0`."""
    names: tuple[str, ...]
    """Names and addresses of the server's settings."""
    fleet: str
    """Name in every key."""
    certificate: RobotCertificate
    """What was stored of it."""
    authority_pem: str | None = None
    """Who has signed the server's certificate, PEM; null if that is a file of the operator's own."""


@dataclass(frozen=True, slots=True)
class EpochConflictBody:
    """A second epoch speaks under the name of a robot while the first is live."""

    epoch: int
    """The epoch that was refused last."""
    refused: int
    """Messages refused since the conflict began."""
    last_ms: int
    """Milliseconds since the last of them."""


@dataclass(frozen=True, slots=True)
class ErrorModelBody:
    """What a modality gets wrong: along, to the left, heading."""

    modality: Modality
    """`odometry`, `laser` or `landmarks`."""
    bias: Triple
    """Subtracted from what it says: metres, metres, radians; of odometry for each metre."""
    variance_inflation: Triple
    """Added to each variance, as a share of what it claims."""


@dataclass(frozen=True, slots=True)
class EstimatedPlace:
    """Where the object of a track seems to be, in the map."""

    x_m: float
    """Centre, x."""
    y_m: float
    """Centre, y."""
    z_m: float
    """Centre, above the floor."""
    theta_rad: float
    """Direction of the outward normal on the floor."""
    width_m: float
    """Width of the rectangle on the wall."""
    height_m: float
    """Height of the rectangle on the wall."""
    views: int
    """Views that agree on it."""
    angle_rad: Pair
    """How far off the normal the camera looked: least and most."""


@dataclass(frozen=True, slots=True)
class ExtendedLandmark:
    """A landmark that got views."""

    name: str
    """Name of the landmark."""
    views: int
    """How many it got."""
    placing: PlacementReportBody
    """Whether they place it."""


@dataclass(frozen=True, slots=True)
class FailedGate:
    """Why a landmark is not in use, or a track should not become one. A reason occurs once."""

    gate: Gate
    """Which gate, for programs."""
    sentence: str
    """What is wrong: one sentence for a person."""
    advice: str
    """What to do: one sentence for a person."""
    look_alike: LookAlikeBody | None = None
    """With `looks_like` and `by_pose_only`: the other landmark, unless it is gone."""

    def __str__(self) -> str:
        return f"{self.sentence} {self.advice}"


@dataclass(frozen=True, slots=True)
class FileWalls:
    """What was taken of a file. Nothing is stored."""

    segments: tuple[WallBody, ...]
    """The walls, in the order of the file."""
    length_m: float
    """Their length, m."""
    note: str | None = None
    """What a person should know of how it was read."""


@dataclass(frozen=True, slots=True)
class FindingBody:
    """What robots found of a landmark that is not where the map says. Stored as JSON."""

    kind: Literal["moved", "missing"]
    """Which of these it is."""
    observed_place: ObservedPlaceBody | None = None
    """Where it is observed."""
    offset_m: float | None = None
    """Distance from its place."""
    sightings: int | None = None
    """Observations that agree on it."""
    missed_frames: int | None = None
    """Consecutive frames without it."""


@dataclass(frozen=True, slots=True)
class Gathering:
    """Views being gathered, or gathered."""

    id: int
    """Its number, counting up over all maps."""
    map: str
    """The map."""
    robot: str
    """Who gathers."""
    known: bool
    """Whether views of recognised landmarks are wanted."""
    open: bool
    """It goes on."""
    counts: GatheringCountsBody
    """What became of the frames. Of a gathering that was interrupted by a restart: since then."""
    created_ms: int
    """ms since the Unix epoch."""
    landmark: str | None = None
    """The only landmark whose views are wanted."""
    ended_ms: int | None = None
    """ms since the Unix epoch."""


@dataclass(frozen=True, slots=True)
class GatheringCountsBody:
    """What became of frames and quads."""

    frames: int = 0
    """Frames offered."""
    dropped: int = 0
    """Of these, dropped because others were still being followed."""
    other_map: int = 0
    """Frames on another map."""
    unusable: int = 0
    """Quads that were too small, cut off or blurred to have an icon."""
    not_on_wall: int = 0
    """Quads that are not flat on a wall of the map."""
    kept: int = 0
    """Views kept."""
    near_duplicate: int = 0
    """Quads that repeat a stored view."""
    too_few_observations: int = 0
    """Quads not yet observed often enough."""
    full: int = 0
    """Quads of tracks that have all the views they may have."""
    decided: int = 0
    """Quads of tracks that were decided on."""
    known_landmark: int = 0
    """Quads that show a landmark, or may."""
    not_requested: int = 0
    """Quads that are no landmark, where only landmarks are wanted."""
    appearance_mismatch: int = 0
    """Quads at the place of a track that look different."""
    track_limit: int = 0
    """Quads beyond the number of tracks."""
    not_stored: int = 0
    """Views that were not stored because a bound was reached or the disk is full."""


@dataclass(frozen=True, slots=True)
class GazeQueryBody:
    """A question where to look."""

    pose: PoseBody
    """Where the robot is."""
    head: dict[str, Any] = field(default_factory=dict)
    """`camera_m`, `pan_rad`, `tilt_rad`, `rate_radps`."""
    viewer: dict[str, Any] | None = field(default_factory=dict)
    """`focal_px`, `pan_rad`, `tilt_rad` and the rest of the camera; absent for the map's (`/maps/{map}/visibility-
    settings`)."""
    criterion: str = ""
    """`product` (the paper's) or `information`."""


@dataclass(frozen=True, slots=True)
class GazeRankingBody:
    """Where to look."""

    map_version: int
    """Of this version of the map."""
    ranked: tuple[GazeTargetBody, ...]
    """Best first; empty when nothing is in sight."""


@dataclass(frozen=True, slots=True)
class GazeTargetBody:
    """A landmark worth looking at."""

    landmark: str
    """Name of the landmark."""
    pan_rad: float
    """Pan that centres it, left positive."""
    tilt_rad: float
    """Tilt that centres it, up positive."""
    utility: float
    """What it is ranked by; the criterion's number."""
    probability: float
    """Probability that it is seen."""
    margin_m: float
    """Distance to the boundary of its area, positive inside."""
    gain_nats: float
    """Expected gain of information on the pose."""
    range_m: float
    """Distance of the camera from its centre."""
    incidence_rad: float
    """Angle between its normal and the line of sight."""


@dataclass(frozen=True, slots=True)
class HarrisPoint:
    """A Harris point of an exemplar with its descriptor."""

    x_px: float
    """To the right, in icon pixels."""
    y_px: float
    """Downwards, in icon pixels."""
    response: float
    """Harris response, grey levels to the fourth."""
    jet: tuple[float, ...]
    """The seven components of the 7-jet, whitened: differences are in standard deviations."""


@dataclass(frozen=True, slots=True)
class HarrisSet:
    """Harris points of an exemplar."""

    exemplar: int
    """Which exemplar, from 1."""
    points: tuple[HarrisPoint, ...]
    """At most 60, by falling response."""


@dataclass(frozen=True, slots=True)
class Health:
    """The process lives."""

    status: str
    """`ok`."""


@dataclass(frozen=True, slots=True)
class IconKeypoint:
    """A Harris point of the mean icon."""

    x_px: float
    """To the right, in icon pixels."""
    y_px: float
    """Downwards, in icon pixels."""


@dataclass(frozen=True, slots=True)
class IntrinsicsMonitorBody:
    """What is known of a camera's intrinsics from its use."""

    tries: int
    """Frames counted."""
    refused: int
    """Of them, refused because no robot on the floor sees the corners there."""
    landmarks: int
    """Different landmarks in them."""
    reduced_chi2: float | None = None
    """Mean chi2 a degree of freedom of the fixes; about 1 where all is well."""
    focal_error: float | None = None
    """True over stated focal length, less 1, by the residuals."""
    focal_sigma: float | None = None
    """Standard deviation of `focal_error`."""
    suspicion: IntrinsicsSuspicionBody | None = None
    """Set when the intrinsics should be checked."""


@dataclass(frozen=True, slots=True)
class IntrinsicsSuspicionBody:
    """Why the intrinsics of a camera seem wrong."""

    reason: Literal["focal", "misfit", "refused"]
    """Which of these it is."""
    error: float | None = None
    """True over stated, less 1."""
    sigma: float | None = None
    """Standard deviation of `error`."""
    reduced_chi2: float | None = None
    """About 1 where all is well."""
    share: float | None = None
    """Share of the frames, 0 to 1."""


@dataclass(frozen=True, slots=True)
class Job:
    """Long work."""

    id: int
    """Its number, counting up over all maps."""
    kind: str
    """`learn`."""
    map: str
    """The map it works on."""
    state: JobState
    """Where it stands."""
    progress: float
    """0 to 1."""
    message: str
    """What it does, or why it failed."""
    result: Any = None
    """What came of it."""
    by: str = ""
    """Name of the token that asked for it; `server` for what the server does by itself."""
    created_ms: int = 0
    """When it was asked for, ms since the Unix epoch."""
    started_ms: int | None = None
    """When it was begun last; absent while it waits."""
    ended_ms: int | None = None
    """When it ended."""


@dataclass(frozen=True, slots=True)
class Landmark:
    """A landmark."""

    name: str
    """`[a-z0-9_-]{1,64}`, unique in the map."""
    status: LandmarkStatus
    """How far it has come."""
    failed_gates: tuple[FailedGate, ...]
    """Why it is not matched; empty unless it is inactive."""
    waived_gates: tuple[FailedGate, ...]
    """Gates that it does not pass and that do not keep it from being matched."""
    views: int
    """Real views stored."""
    health: LandmarkHealth
    """How far what robots saw lets it be trusted."""
    revision: str = ""
    """Another one after every edit of name, size, place, views or, by a person, health, and after every lesson of
    its model; the same after what robots do by themselves. `If-Match` takes it, in quotes."""
    learning: LearningSettings | None = None
    """Its own weights and gates, if a person has set some."""
    size: Size | None = None
    """Width and height, if measured."""
    place: Place | None = None
    """Where it is, if known."""
    place_sigma: PlaceSigma | None = None
    """How surely, where the server found the place from views; absent for a place by hand."""
    model: LandmarkModelBody | None = None
    """What was learnt."""
    finding: FindingBody | None = None
    """What speaks against it."""


@dataclass(frozen=True, slots=True)
class LandmarkDeletion:
    """A landmark to be deleted."""

    name: str
    """Its name."""
    revision: str | None = None
    """The revision that is meant; absent for whatever is there."""


@dataclass(frozen=True, slots=True)
class LandmarkDeletions:
    """Landmarks to be deleted together: all, or none."""

    landmarks: tuple[LandmarkDeletion, ...]
    """1 to 2000."""


@dataclass(frozen=True, slots=True)
class LandmarkDifference:
    """How a landmark differs."""

    name: str
    """Its name after the change, or before it if it is gone."""
    change: ChangeKind
    """Whether it is new, gone, or differs."""
    fields: tuple[str, ...]
    """Of one that stays: name, size, place, learning."""
    views_added: int
    """Training views that are new."""
    views_removed: int
    """Training views that are gone."""
    model_changed: bool
    """Its model differs, if only by a threshold."""
    old_name: str | None = None
    """Its name before, where that was another one."""
    before: SizeAndPlace | None = None
    """Its size and place before; absent if it is new."""
    after: SizeAndPlace | None = None
    """Its size and place after; absent if it is gone."""


@dataclass(frozen=True, slots=True)
class LandmarkDistances:
    """How far a landmark's own views and everything else are from its model."""

    landmark: str
    """The landmark."""
    correlation: DistanceHistogram
    """The correlation distance, 0 to 2."""
    hausdorff: DistanceHistogram
    """The Hausdorff distance."""
    gradient_dissimilarity: DistanceHistogram
    """1 minus the gradient similarity."""


@dataclass(frozen=True, slots=True)
class LandmarkEvidence:
    """How strongly the points of quads spoke for a landmark in the stored answers: heaps by the negative decimal
    logarithm of the number of false alarms."""

    landmark: str
    """The landmark."""
    answers: int
    """Stored answers that were read: the newest that name it or were compared with it, at most 500."""
    threshold: float
    """Accepted from here upwards."""
    bin_width: float
    """Width of a bin; the first begins at 0. The last has everything beyond, too."""
    named: tuple[int, ...]
    """Quads that were named as it, by bin."""
    doubtful: tuple[int, ...]
    """Quads with its points while a part of it showed something else, by bin."""
    named_without_points: int
    """Quads named as it without points, by the picture as a whole."""


@dataclass(frozen=True, slots=True)
class LandmarkIcon:
    """A landmark beside a quad that was compared with it."""

    landmark: str
    """Its name at that time."""
    icon: str | None = None
    """Path of its icon as it was learnt; absent if there is no landmark with a model of this name any more."""


@dataclass(frozen=True, slots=True)
class LandmarkLesson:
    """How to learn one landmark."""

    generated_views: int | None = None
    """Views generated from each photograph, 0 to 100; absent fills up where photographs are few."""


@dataclass(frozen=True, slots=True)
class LandmarkMerge:
    """Another landmark that is the same object."""

    from_: str = field(metadata={NAME: "from"})
    """Its name. It is deleted."""


@dataclass(frozen=True, slots=True)
class LandmarkModelBody:
    """What was learnt of a landmark, in brief."""

    views: int
    """Real views it rests on."""
    generated_views: int
    """Views generated from the real ones."""
    learnt_ms: int
    """ms since the Unix epoch."""
    facts: dict[str, Any] = field(default_factory=dict, metadata={REST: True})
    """Thresholds and figures of the learning."""


@dataclass(frozen=True, slots=True)
class LandmarkModelDetail:
    """What was learnt of a landmark."""

    landmark: str
    """Its landmark."""
    sha256: str
    """SHA-256 of the stored bytes, hexadecimal: the same digest is the same model."""
    in_use: bool
    """Whether it is matched."""
    named_by_points: bool
    """Whether its points identify the landmark, and its icons never."""
    views: int
    """Views that it was learnt from, generated ones included."""
    generated_views: int
    """How many of them were generated."""
    exemplars: int
    """Learnt icons: the mean, and up to two modes."""
    icon_px: int
    """Side of an icon, in icon pixels."""
    keypoints: tuple[IconKeypoint, ...]
    """Harris points of the mean icon."""
    points: tuple[LandmarkPoint, ...]
    """Points of up to three photographs, at most 240."""
    bits_per_point: int
    """Bits of the descriptor of one point."""
    mode_shares: tuple[float, ...]
    """Share of the variance of the views that the leading modes explain, 0 to 1 each, falling."""
    correlation: ThresholdBody
    """Threshold of the correlation distance, 0 to 2."""
    hausdorff: ThresholdBody
    """Threshold of the Hausdorff distance."""
    weights: ThresholdWeights
    """What these two weigh."""
    gradient_dissimilarity: ThresholdBody
    """Threshold of 1 minus the gradient similarity: its cap, or a share of the nearest negative."""
    saliency: float
    """Saliency, 0 to 1."""
    stable_points: int
    """Keypoints of the mean icon that are found in the other views, too."""
    visibility_confidence: float
    """Spread of the viewpoints of all views, generated ones included, 0 to 10. No gate takes it."""
    photographed_visibility_confidence: float
    """The same of photographed views only; 0 with fewer than two. The gate and the choice of gaze take this one."""
    memory: tuple[MemoryPart, ...]
    """Memory in use."""
    harris: tuple[HarrisSet, ...] = ()
    """Harris points of each exemplar with their descriptors, where they are asked for."""


@dataclass(frozen=True, slots=True)
class LandmarkPatch:
    """What changes of a landmark. A field that is absent stays, one that is null is forgotten."""

    name: str | None = None
    """Another name, `[a-z0-9_-]{1,64}`, unique in the map. Everything that belongs to the landmark stays with it."""
    size: Size | None = None
    """Width and height."""
    place: Place | None = None
    """Where it is."""
    learning: LearningSettings | None = None
    """Weights and gates."""
    health: LandmarkHealth | None = None
    """A person's decision; a new size or place is sound by itself."""


@dataclass(frozen=True, slots=True)
class LandmarkPoint:
    """A point of the landmark's photographs."""

    x: float
    """To the right, 0 to 1 over the landmark's width."""
    y: float
    """Downwards, 0 to 1 over the landmark's height."""
    sigma: float
    """Scale, in shares of the landmark's side."""


@dataclass(frozen=True, slots=True)
class LearningSettings:
    """Weights and gates of a map or of one landmark, where a person wants others than the server has. What is
    absent of a landmark is as the map has it, and of a map as the server has it."""

    reason: str
    """Why: one line of 1 to 200 characters. The history of the map has it, too."""
    false_positive_weight: float | None = None
    """Cost of a wrong acceptance, 0.1 to 1000, where a refused own view costs 1 (lambda : mu)."""
    min_views: int | None = None
    """Fewest views, 1 to 200."""
    min_saliency_f: float | None = None
    """Least saliency F, 0 to 1000."""
    min_stable_points: int | None = None
    """Fewest stable points, 0 to 60."""
    min_visibility_confidence: float | None = None
    """Least visibility confidence of its photographs, 0 to 10."""
    refuse_one_side: bool | None = None
    """Whether a smaller visibility confidence keeps it out of use."""
    use_despite_gates: bool | None = None
    """It is used whatever its measured gates say. Without a threshold it is still not."""


@dataclass(frozen=True, slots=True)
class LeftOutBody:
    """An object of a drive that is no landmark."""

    x_m: float
    """Its centre in the map, metres."""
    y_m: float
    """Metres."""
    z_m: float
    """Over the floor, metres."""
    width_m: float
    """Metres."""
    height_m: float
    """Metres."""
    views: int
    """Number of its views."""
    reason: str
    """Why it is none."""


@dataclass(frozen=True, slots=True)
class LiveAnswer:
    """The answer to a frame."""

    robot: str
    """Name of the robot."""
    camera: str
    """Name of its camera."""
    answer: Answer
    """What was answered, the map's name included."""


@dataclass(frozen=True, slots=True)
class LivePose:
    """A fused pose, as it was published."""

    robot: str
    """Name of the robot."""
    map: str
    """The map it is a pose in."""
    pose: Pose2
    """Where the robot is."""
    covariance: tuple[float, ...]
    """Over (x, y, theta), row-major."""
    corrections: int
    """Corrections by landmarks so far."""
    age_ms: float
    """From the capture of what supports it to its publication."""
    trust: PoseTrust
    """How far it is trusted."""


@dataclass(frozen=True, slots=True)
class LivePosition:
    """A pose without covariance."""

    robot: str
    """Name of the robot."""
    map: str
    """The map it is a pose in."""
    pose: Pose2
    """Where the robot is."""


@dataclass(frozen=True, slots=True)
class LivePresence:
    """A robot came or went."""

    robot: str
    """Name of the robot."""
    map: str
    """Its map, if it has one; else empty."""
    alive: bool
    """Came, or went."""


@dataclass(frozen=True, slots=True)
class LocaliseHypothesisBody:
    """Where the robot may be."""

    map_from_robot: Pose2Covariance
    """The pose with its covariance."""
    probability: float
    """All hypotheses sum to 1."""
    landmarks: tuple[str, ...]
    """The landmarks that it rests on."""
    matched: float | None = None
    """Share of the scan's points with a wall, 0 to 1; null where the scan was not used."""


@dataclass(frozen=True, slots=True)
class LocaliseResult:
    """Where a robot is, without its history."""

    map: str
    """The map."""
    map_version: int
    """Its version."""
    status: LocaliseStatus
    """What came of it."""
    hypotheses: tuple[LocaliseHypothesisBody, ...]
    """Where the robot may be, most probable first, at most 16."""
    reason: str | None = None
    """Why there is not exactly one pose: `nothing_recognised`, a code of `pose_refusal` of an answer, `ambiguous`,
    `undetermined` (the walls leave a direction open), `few_points`, `poor_match`, `map_too_large`, `stopped`."""
    map_from_robot: Pose2Covariance | None = None
    """The pose; null unless `located`."""
    answer: Answer | None = None
    """The answer to the picture: `Answer` of protos/waymark/v1/waymark.proto as JSON."""


@dataclass(frozen=True, slots=True)
class LookAlikeBody:
    """A landmark that looks like another one."""

    landmark: str
    """Name of the other landmark."""
    gradient_similarity: float
    """Gradient similarity of the two, at most 1."""


@dataclass(frozen=True, slots=True)
class Map:
    """A map."""

    name: str
    """`[a-z0-9_-]{1,64}`, unique."""
    version: int
    """Counts up with every change that an answer could depend on."""
    landmarks: int
    """Landmarks in it, learnt or not."""
    distance: Distance
    """Which distance decides."""
    revision: str = ""
    """Another one after every edit or lesson of the map or of what is in it, the same after what robots do by
    themselves: `If-Match` takes it, in quotes."""
    has_underlay: bool = False
    """A picture is shown under it: `GET /maps/{map}/underlay`."""
    preset: PipelinePreset | None = None
    """Detector and decision; absent: those of the server's settings."""
    learning: LearningSettings | None = None
    """Weights and gates of its landmarks, if a person has set some."""
    draft_of: str | None = None
    """The map that it is a draft of."""
    site: str | None = None
    """The site it belongs to, in words."""
    building: str | None = None
    """The building it belongs to, in words."""
    floor: str | None = None
    """The floor it belongs to, in words."""
    parent: Parent | None = None
    """Where it lies in another map."""


@dataclass(frozen=True, slots=True)
class LiveMapChange:
    """A map has a new version, or is gone."""

    map: str
    """Name of the map."""
    version: int | None = None
    """New version; absent when deleted."""


@dataclass(frozen=True, slots=True)
class MapLesson:
    """What to learn of a map, and how."""

    landmarks: tuple[str, ...] | None = None
    """Names; absent means every landmark that has views."""
    generated_views: int | None = None
    """Views generated from each photograph, 0 to 100; absent fills up where photographs are few."""


@dataclass(frozen=True, slots=True)
class MapPatch:
    """What changes of a map. A field that is absent stays, one that is null is forgotten."""

    name: str | None = None
    """Another name. Refused while a robot, an open job or an open gathering has the present one."""
    preset: PipelinePreset | None = None
    """Detector and decision, from the next version on; null: those of the server's settings."""
    distance: Distance | None = None
    """Which distance decides; absent where `preset` changes: that of the preset."""
    learning: LearningSettings | None = None
    """Weights and gates of its landmarks; what a landmark sets of its own goes before."""
    site: str | None = None
    """The site it belongs to, in words: 1 to 64 characters."""
    building: str | None = None
    """The building it belongs to, in words: 1 to 64 characters."""
    floor: str | None = None
    """The floor it belongs to, in words: 1 to 64 characters."""
    parent: Parent | None = None
    """Where it lies in another map."""


@dataclass(frozen=True, slots=True)
class MappingProgressBody:
    """A mapping as it stands."""

    map: str
    """Name of the map."""
    robot: str
    """Whose scans."""
    stage: MappingStage
    """How far it has come."""
    scans: int
    """Scans that were taken."""
    dropped: int
    """Scans that were not: the queue was full, the robot's software was started again, or there were too many."""
    distance_m: float
    """Way driven, metres."""
    frames: int | None = None
    """Frames that were taken; absent where no landmarks are looked for."""
    frames_refused: str | None = None
    """What of the frames cannot be used: how often, and why."""
    landmarks: int | None = None
    """Number of landmarks that are proposed, once they are found."""
    left_out: tuple[LeftOutBody, ...] = ()
    """What hangs there and is no landmark, and why: the 64 with the most views."""
    gathering: int | None = None
    """The gathering whose tracks these are, once the walls are stored."""
    pose: Triple | None = None
    """Where the robot is in the map so far: x, y, theta; absent before the first scan."""
    segments: int | None = None
    """Number of walls, once they are found."""
    loop_closures: int | None = None
    """Loop closures, once fitted."""
    reason: str | None = None
    """Why it failed, or why a finished one proposes no landmarks."""
    journal_error: str | None = None
    """Why further scans are not kept on disk: a restart of the server would lose them. Absent while they are."""
    walls: tuple[WallBody, ...] | None = None
    """The walls that are held: what would replace those of the map. Absent at every other stage."""


@dataclass(frozen=True, slots=True)
class MemoryPart:
    """Memory of a model for one purpose."""

    purpose: str
    """What it holds."""
    bytes: int
    """Bytes."""


@dataclass(frozen=True, slots=True)
class ModalityMapBody:
    """All that is known of a map's modalities."""

    fusion_mode: FusionMode
    """What is fused."""
    areas: tuple[NamedAreaBody, ...]
    """Areas with a name."""
    cell_m: float
    """Side of the cells."""
    cells: tuple[CellBody, ...]
    """Cells that were driven through; see `modalities/at` for what was found in one."""
    omitted_cells: int
    """Cells that this answer has no room for."""
    map: AreaStatsBody
    """All of the map."""


@dataclass(frozen=True, slots=True)
class ModalityMapPatch:
    """What changes; a field that is absent stays."""

    fusion_mode: FusionMode | None = None
    """What is fused."""
    areas: tuple[AreaBody, ...] | None = None
    """All named areas, at most 64; where they overlap the first one counts."""


@dataclass(frozen=True, slots=True)
class ModalityStatsBody:
    """What runs have shown of one modality: odometry alone, or the laser or landmarks each with odometry only.
    Errors are robot-aligned: metres along, metres to the left, radians."""

    modality: Modality
    """`odometry`, `laser` or `landmarks`."""
    mean: Triple
    """Mean error of its own position."""
    sigma: Triple
    """Standard deviations about that."""
    availability: float
    """Share of the way on which it knew something lately."""
    rate_hz: float
    """Measurements a second."""
    outliers: float
    """Share of them off by more than three of the standard deviations that they claim."""
    steps: int
    """Steps of 5 cm that were compared."""
    measurements: int
    """Measurements that were compared."""
    score: float | None = None
    """Mean squared error over availability, 0.1 rad as much as a metre; absent if it never knew anything. The
    lowest is best."""


@dataclass(frozen=True, slots=True)
class MultiPolygon:
    """A GeoJSON `MultiPolygon`: polygons of rings of points, m in the map; the outer ring counter-clockwise, that
    of a hole clockwise, the first point repeated."""

    kind: str = field(metadata={NAME: "type"})
    """`MultiPolygon`."""
    coordinates: tuple[tuple[tuple[Pair, ...], ...], ...]
    """By polygon, ring and point: x, y in metres."""


@dataclass(frozen=True, slots=True)
class NamedAreaBody:
    """A named area and what is known of it."""

    name: str
    """Unique, 1 to 64 bytes."""
    corners_m: tuple[Pair, ...]
    """Its corners in order, x and y in metres."""
    headings: tuple[AreaStatsBody, ...]
    """By heading: 0, pi/2, pi, -pi/2."""


@dataclass(frozen=True, slots=True)
class NewCopy:
    """A copy of a map to be."""

    name: str
    """Its name: `[a-z0-9_-]{1,64}`, unique."""


@dataclass(frozen=True, slots=True)
class NewDraft:
    """A draft to be."""

    name: str
    """Its name: `[a-z0-9_-]{1,64}`, unique among maps and drafts."""


@dataclass(frozen=True, slots=True)
class NewGatheringBody:
    """Who gathers what."""

    robot: str
    """A robot that stands on this map."""
    landmark: str | None = None
    """Only views of this landmark, which must be learnt already; absent: of whatever flat four-sided thing is none
    yet."""
    known: bool = False
    """Views of every landmark that is recognised beyond doubt, too."""


@dataclass(frozen=True, slots=True)
class NewLandmark:
    """A landmark to be."""

    name: str
    """`[a-z0-9_-]{1,64}`, unique in the map."""
    size: Size | None = None
    """Width and height; without it there is no pose."""
    place: Place | None = None
    """Where it is; without it there is no robot pose."""


@dataclass(frozen=True, slots=True)
class NewLandmarks:
    """Landmarks to be made together: all, or none."""

    landmarks: tuple[NewLandmark, ...]
    """1 to 2000."""


@dataclass(frozen=True, slots=True)
class NewMap:
    """A map to be."""

    name: str
    """`[a-z0-9_-]{1,64}`, unique."""
    preset: PipelinePreset | None = None
    """Detector and decision; absent: those of the server's settings."""
    distance: Distance | None = None
    """Which distance decides; absent: that of the preset."""
    site: str | None = None
    """The site it belongs to, in words: 1 to 64 characters."""
    building: str | None = None
    """The building it belongs to, in words: 1 to 64 characters."""
    floor: str | None = None
    """The floor it belongs to, in words: 1 to 64 characters."""
    parent: Parent | None = None
    """Where it lies in another map."""


@dataclass(frozen=True, slots=True)
class NewMapping:
    """Who makes the map."""

    robot: str
    """A robot that stands on this map; its scans must come with odometry."""
    origin: Triple | None = None
    """Where its first pose is in the frame of the map: x, y in metres, heading in radians. If absent, the drive
    makes the frame: it begins at the origin, and what a survey finds is known relative to the drive as a whole."""
    landmarks: bool = False
    """Look for landmarks, too: its frames, with intrinsics and mounting, are kept until the end, and objects on
    walls become tracks of a gathering."""


@dataclass(frozen=True, slots=True)
class NewToken:
    """A token to be made."""

    name: str
    """Who or what it is for, `[a-z0-9_-]{1,64}`; several may have the same."""
    role: Role
    """What it may do."""
    maps: tuple[str, ...] | None = None
    """Maps that it is for; absent for all maps and what is above maps."""
    valid_s: int | None = None
    """Seconds until it expires, by the server's clock, at most ten years; absent for never."""


@dataclass(frozen=True, slots=True)
class NextLandmarkBody:
    """A landmark to look for, and the pose from which the camera turns to it."""

    landmark: str
    """Name of the landmark."""
    along_m: float
    """How far along the leg the robot is."""
    x_m: float
    """The robot there, metres, in the map."""
    y_m: float
    """The robot there."""
    theta_rad: float
    """Its heading along the leg."""
    pan_rad: float
    """Turn of the camera from the heading, left positive."""
    tilt_rad: float
    """Tilt of the camera, up positive."""
    range_m: float
    """Distance on the floor."""


@dataclass(frozen=True, slots=True)
class ObservedPlaceBody:
    """Where a landmark is observed, in the map."""

    x_m: float
    """Centre, x."""
    y_m: float
    """Centre, y."""
    theta_rad: float
    """Direction of the outward normal on the floor."""


@dataclass(frozen=True, slots=True)
class PageLink:
    """A link that opens the page once, with the rights of the one who asked for it."""

    path: str = field(repr=False)
    """Path and query, to be put after the server's address: `/open?code=...`."""
    valid_s: int
    """Seconds for which it is valid."""


@dataclass(frozen=True, slots=True)
class LandmarkDifferencePage:
    """A page of a list."""

    items: tuple[LandmarkDifference, ...]
    """The items, in order."""
    next: str | None = None
    """Give this as `cursor` for the next page; null on the last."""
    total: int = 0
    """Items of all pages together."""


@dataclass(frozen=True, slots=True)
class Parent:
    """Where a map lies in another."""

    map: str
    """The map in whose frame it lies."""
    x_m: float
    """Its origin there, x."""
    y_m: float
    """Its origin there, y."""
    theta_rad: float
    """Direction of its x axis there."""
    level_m: float = 0.0
    """Its floor above that one's, within 1000 m."""
    covariance: Covariance | None = None
    """Over (x, y, theta), row-major; absent for 5 cm and half a degree."""


@dataclass(frozen=True, slots=True)
class PassageEnd:
    """An end of a passage."""

    place: str
    """The place there, `hall/3`."""
    x_m: float
    """The middle of the passage, metres, in the map of the place."""
    y_m: float
    """Of the middle."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where a landmark is, in the map."""

    x_m: float
    """Centre, x."""
    y_m: float
    """Centre, y."""
    z_m: float
    """Centre, above the floor."""
    theta_rad: float
    """Direction of the outward normal on the floor, counter-clockwise from map x; under a ceiling, where the top
    points."""
    roll_rad: float = 0.0
    """Turn about the outward normal, within 0.5; 0 when the sides are vertical."""
    tilt_rad: float = 0.0
    """Turn of the outward normal from level downwards: 0 on a wall, pi/2 under a ceiling."""


@dataclass(frozen=True, slots=True)
class PlaceLandmark:
    """A landmark seen from a place."""

    landmark: str
    """Name of the landmark."""
    share: float
    """Share of the place from which it is seen, above 0 to 1."""


@dataclass(frozen=True, slots=True)
class PlaceSigma:
    """Standard deviations of a place that the server found from views."""

    x_m: float
    """Of the centre, x."""
    y_m: float
    """Of the centre, y."""
    z_m: float
    """Of the centre, above the floor."""
    theta_rad: float
    """Of the direction."""
    width_m: float
    """Of the width."""
    height_m: float
    """Of the height."""


@dataclass(frozen=True, slots=True)
class PlacementReportBody:
    """What came of placing a landmark by its views."""

    placed: bool
    """The landmark has a place by its views now."""
    views_used: int
    """Views with a robot pose that the place rests on."""
    reason: str | None = None
    """Why not: `by_hand` (a place by hand stays), or what is wrong with the views, with the residual."""


@dataclass(frozen=True, slots=True)
class PointMatch:
    """A point of a quad that is like a point of a landmark."""

    seen: Pair
    """Place in the quad's icon: (0, 0) is its top-left corner, (1, 1) its bottom-right one; a little outside is
    possible."""
    taught: Pair
    """Place in the landmark's icon, likewise."""
    agrees: bool
    """Whether it agrees with the others on where the landmark is."""


@dataclass(frozen=True, slots=True)
class PoseBody:
    """A pose in the map."""

    x_m: float
    """Metres, in the map."""
    y_m: float
    """Metres, in the map."""
    theta_rad: float
    """Heading in the map."""
    covariance: Covariance | None = None
    """Over (x, y, theta), row-major; absent for a pose that is exactly known."""


@dataclass(frozen=True, slots=True)
class PoseByHand:
    """Where a person says that a robot is."""

    x_m: float
    """Metres, in the robot's map."""
    y_m: float
    """Metres, in the robot's map."""
    theta_rad: float
    """Heading in the map, -2 pi to 2 pi."""
    sigma_m: float = 0.0
    """Standard deviation of each coordinate; 0.5 by default, 0.01 to 10."""
    sigma_rad: float = 0.0
    """Standard deviation of the heading; 0.35 by default, 0.01 to 3.15."""


@dataclass(frozen=True, slots=True)
class PoseHypothesisBody:
    """A place where a robot may be."""

    probability: float
    """Its share of the belief, 0 to 1; all of them together leave some for everywhere else."""
    x_m: float
    """Metres, in the map."""
    y_m: float
    """Metres, in the map."""
    theta_rad: float
    """Heading in the map."""
    covariance: Covariance
    """Over (x, y, theta), row-major."""


@dataclass(frozen=True, slots=True)
class PriorCheck:
    """The pose of the robot that was known without a picture, and the pose by the picture alone."""

    source: PriorSource
    """Whose pose it is."""
    prior: Pose2Covariance
    """The pose without the picture, map frame, with covariance."""
    limit: float
    """The largest distance that a robot's prior lets pass."""
    refused: bool
    """The pose was refused for it: `refusal` is `gate_prior`."""
    seen: Pose2Covariance | None = None
    """The pose by the landmarks of the picture: of several solutions the nearest to the prior, also where it was
    refused; null where the picture gives none."""
    distance2: float | None = None
    """Squared Mahalanobis distance of the two, under the sum of their covariances."""


@dataclass(frozen=True, slots=True)
class QuadMatches:
    """The points of a quad that are like points of a landmark."""

    landmark: str
    """The landmark that is named, else the nearest candidate, by its name at that time."""
    matches: tuple[PointMatch, ...]
    """At most 100, those that agree first."""


@dataclass(frozen=True, slots=True)
class Readiness:
    """How far the server can do its work."""

    status: str
    """`ready`, or `degraded`: everything runs, but one of `counts` is not 0, the disk has no room, the server has
    no part in its router, another server has one of its maps, the last scheduled backup failed, or the check of
    the database did."""
    maps_not_in_use: dict[str, str]
    """Maps whose stored version cannot be made ready, with the reason: an earlier version is used, or none since
    the server started. A later change of the map tries again. Only maps of the token that asks: none without
    one."""
    panics: dict[str, int]
    """Panics caught since the start, by where: what they met was refused or dropped, everything else went on. Each
    is in the log. Anything but 0 is a fault of the program."""
    counts: ReadinessCounts | None = None
    """How many there are of what is wrong, for whoever asks."""
    damaged_pictures: tuple[str, ...] = ()
    """Views, tracks and underlays whose stored picture is damaged, at most 100, of maps of the token that asks:
    none without one. The picture is not used; the same photograph, uploaded again, mends it."""
    router: str | None = None
    """Why the server has no part in the router that it is to join: no connection, or a name that another server
    has. Told to whoever sees all maps."""
    maps_not_served: dict[str, str] = field(default_factory=dict)
    """Maps that another server has, too, with the reason: robots are refused on them here. Only maps of the token
    that asks."""
    database_check: DatabaseCheckBody | None = None
    """The check of the whole database after the start."""
    backup: BackupHealth | None = None
    """The newest backup, and why the last attempt failed. A token for all maps is told the name and the reason."""
    parts_still_s: dict[str, int] = field(default_factory=dict)
    """For how many seconds each part that has work, or is probed, has not gone on. Beyond a few the server is not
    ready. Empty for whoever does not see all maps."""
    storage: StorageHealth | None = None
    """The disk of the data directory; absent for whoever does not see all maps."""


@dataclass(frozen=True, slots=True)
class ReadinessCounts:
    """How many things are wrong, named or not."""

    maps_not_in_use: int
    """Maps whose stored version is not in use."""
    damaged_pictures: int
    """Views, tracks and underlays whose stored picture is damaged."""


@dataclass(frozen=True, slots=True)
class RecordingStatusBody:
    """A recording as it stands."""

    map: str
    """Name of the map."""
    robot: str
    """Whose run."""
    active: bool
    """False once it is full, or the robot's software was started again, or it went to another map, or its odometry
    jumped: what was recorded until then can be learnt from."""
    distance_m: float
    """Way driven by odometry, metres."""
    odometry: int
    """Readings of odometry that were kept."""
    landmarks: int
    """Fixes by landmarks."""
    laser: int
    """Fixes by the laser."""
    reason: str | None = None
    """Why it is active no longer."""
    span_ns: Span | None = None
    """Time of the first and the last reading of odometry, ns of the robot's clock; absent before the first."""


@dataclass(frozen=True, slots=True)
class ReferenceRunBody:
    """A run that was learnt from."""

    id: int
    """Its number, counting up over all maps."""
    robot: str
    """Whose run."""
    created_ms: int
    """ms since the Unix epoch."""
    distance_m: float
    """Way of which the path was known, metres."""
    cells: int
    """Square metres by heading that it tells of."""
    statistics: tuple[ModalityStatsBody, ...]
    """What it showed, all of it together."""


@dataclass(frozen=True, slots=True)
class ReferenceRuns:
    """Runs of a map that were learnt from."""

    runs: tuple[ReferenceRunBody, ...]
    """Oldest first; at most 200."""


@dataclass(frozen=True, slots=True)
class ReferenceTrajectoryBody:
    """Where the robot really was."""

    poses: tuple[tuple[int, float, float, float], ...]
    """Time (ns of the robot's clock, as in its messages), x and y in metres on the map, heading in radians; times
    rise, 2 to 200 000 (up to 112 bytes each). Nothing is learnt between two that are more than a second apart."""
    sigma_m: float | None = None
    """Standard deviation of its positions, metres; 0.01 if absent."""
    sigma_rad: float | None = None
    """Of its headings, radians; 0.005 if absent."""


@dataclass(frozen=True, slots=True)
class RefusalReason:
    """Why messages of a robot were refused."""

    code: str
    """A stable word."""
    field: str
    """The field at fault of the last one, or the topic of ROS."""
    detail: str
    """A sentence for a person about the last one."""
    advice: str
    """What to do; empty where the sentence says it."""
    count: int
    """How many."""
    ago_ms: int
    """Since the last one."""


@dataclass(frozen=True, slots=True)
class RefusedView:
    """A photograph that was not taken for a landmark, or not in its last lesson."""

    id: int
    """Its number, never used again."""
    refused_ms: int
    """ms since the Unix epoch."""
    by: RefusedBy
    """Who did not take it."""
    reason: str
    """A code: of the refusal of the upload, `duplicate`, `near_duplicate`, `beyond_limit` or `picture_unreadable`."""
    sentence: str
    """Why: one sentence for a person."""
    advice: str
    """What to do: one sentence for a person."""
    view: int | None = None
    """The view that it repeats, or that the lesson left out; null where that is gone."""
    icon: str | None = None
    """Path of a small picture of it; null where it could not be decoded."""


@dataclass(frozen=True, slots=True)
class RelocalisationStatus:
    """How far a robot's relocalisation has come."""

    relocalising: bool
    """False for a robot that knows where it is, or has seen nothing to search with: all else is empty then."""
    hypotheses: tuple[PoseHypothesisBody, ...]
    """Most probable first, eight at most."""
    entropy_nats: float
    """Of the belief over the whole map, nats: 0 when one cell of 0.2 m and 10 degrees has it all."""
    sightings: int
    """Sightings that it rests on."""
    landmarks: tuple[str, ...]
    """The landmarks by which the first hypothesis explains them."""
    missing: tuple[MissingCondition, ...]
    """What is missing before the first one becomes the robot's pose; empty if nothing is."""
    min_probability: float
    """The first one must be more probable than this."""
    map: str | None = None
    """The map it searches."""
    map_version: int | None = None
    """Version of that map."""


@dataclass(frozen=True, slots=True)
class Replay:
    """What robots on the map would be told otherwise if the draft were published: their last frames, answered by
    map and draft."""

    frames: int
    """Frames that were answered by both."""
    unchanged: int
    """Of those, the ones with equal answers."""
    robots: tuple[RobotReplay, ...]
    """Counts of each robot, by name."""
    changes: tuple[ReplayChange, ...]
    """The frames with different answers, newest first in turn of their cameras."""


@dataclass(frozen=True, slots=True)
class ReplayChange:
    """A frame with different answers."""

    robot: str
    """Who sent it."""
    camera: str
    """By which camera."""
    captured_ms: int
    """Robot's clock at capture, ms since the Unix epoch."""
    lost: tuple[str, ...]
    """Landmarks that the map names alone."""
    gained: tuple[str, ...]
    """Landmarks that the draft names alone."""
    pose: ReplayedPose
    """The robot's pose."""
    distance_m: float | None = None
    """Between the two poses, m; null unless it is `moved`."""
    angle_rad: float | None = None
    """Between the two headings, rad, 0 to pi; null unless it is `moved`."""


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot."""

    name: str
    """`[a-z0-9_-]{1,64}`, unique."""
    map: str
    """The map it stands on."""
    alive: bool
    """Its software is connected, or sent a message within the last 3 s."""
    epoch: int | None = None
    """The start of its software that speaks for it; absent if it is not connected."""
    conflict: EpochConflictBody | None = None
    """A second program that uses the robot's name and is refused; shown for 10 s after its last message."""
    pose: RobotPose | None = None
    """Its fused pose; absent if it is unknown, or nothing newer than 2 s supports it."""
    activity: RobotActivity | None = None
    """What it has done since the server started; absent before its first message."""


@dataclass(frozen=True, slots=True)
class RobotActivity:
    """What a robot has done since the server started."""

    answered: int
    """Frames that were searched for landmarks and answered."""
    inputs: tuple[RobotInput, ...]
    """What was used and what was refused, by kind; a kind of which nothing came is absent."""
    frames_per_s: float
    """Answered frames in a second, over the last ten whole seconds, or all since its first message."""
    last_message_ms: int | None = None
    """Since the last message, used or refused; absent where only connections were refused."""
    last_recognised_ms: int | None = None
    """Since the last frame in which a landmark was named; absent if there was none."""


@dataclass(frozen=True, slots=True)
class RobotAssignment:
    """Where a robot stands."""

    map: str
    """Name of the map."""


@dataclass(frozen=True, slots=True)
class RobotCertificate:
    """A certificate of a robot, without its key."""

    serial: str
    """16 hexadecimal digits."""
    robot: str
    """Whose it is."""
    sha256: str
    """SHA-256 of the certificate (DER), hexadecimal."""
    issued_ms: int
    """Milliseconds since the Unix epoch."""
    expires_ms: int
    """Not valid from then on."""
    revoked_ms: int | None = None
    """Not valid since then; null if it was not revoked."""


@dataclass(frozen=True, slots=True)
class RobotInput:
    """What became of one kind of a robot's messages."""

    input: str
    """`frame`, `odometry`, `scan`; of ROS 2 also `camera_info` and `transform`; `connection`: its links to the
    server."""
    used: int
    """How many were used."""
    refused: int
    """How many were refused, or lack what others need."""
    refused_in_a_row: int
    """How many of them since the last that was used: where it rises, none is used any more."""
    reasons: tuple[RefusalReason, ...]
    """Why, the last reason first."""


@dataclass(frozen=True, slots=True)
class RobotPose:
    """A fused pose on the robot's map."""

    x_m: float
    """Metres, in the map."""
    y_m: float
    """Metres, in the map."""
    theta_rad: float
    """Heading in the map."""
    covariance: Covariance
    """Over (x, y, theta), row-major."""
    age_ms: float
    """Since the capture of the newest odometry or fix that supports it; at most 2000."""
    trust: PoseTrust
    """How far it is trusted, as it was last published. Read as unspecified where a server does not say."""


@dataclass(frozen=True, slots=True)
class RobotReplay:
    """What the draft changes for one robot, in frames."""

    robot: str
    """Its name."""
    frames: int
    """Frames of it."""
    unchanged: int
    """With equal answers."""
    lost: int
    """In which landmarks are not named any more."""
    gained: int
    """In which landmarks are named that were not."""
    pose_gained: int
    """With a pose by the draft alone."""
    pose_lost: int
    """With a pose by the map alone."""
    pose_moved: int
    """With another pose."""
    longest_move_m: float
    """Longest way between the two poses of a frame, m."""


@dataclass(frozen=True, slots=True)
class Rollback:
    """A way back."""

    to: int
    """The commit whose state the map gets."""


@dataclass(frozen=True, slots=True)
class RollbackOutcome:
    """What a roll back did."""

    changed: bool
    """False if the map was so already; then no commit was made."""
    commit: Commit
    """The newest commit."""


@dataclass(frozen=True, slots=True)
class Ros2Status:
    """What became of the messages of a robot of ROS 2 since the start of the server."""

    configured: bool
    """Whether the settings of the server name the robot; if not, all else is empty."""
    received: dict[str, int]
    """Messages received, by topic."""
    sent: dict[str, int]
    """Messages sent, by topic."""
    reasons: dict[str, dict[str, int]]
    """Messages that were not used, or only in part, by topic and reason, such as `no_transform`; the log has the
    details. The topic is empty for what belongs to none."""


@dataclass(frozen=True, slots=True)
class RouteLeg:
    """A part of a route within one place."""

    place: str
    """The place, `hall/3`."""
    length_m: float
    """With the passage after it."""
    path: tuple[Pair, ...]
    """Its corners: x, y in metres, in the map of the place."""
    passage: int | None = None
    """Index of the passage at its end; `null` for the last leg, which ends at the place's centre."""
    next_landmark: NextLandmarkBody | None = None
    """The landmark to look for; `null` where none is seen from this leg."""


@dataclass(frozen=True, slots=True)
class ScanBody:
    """A planar laser scan: the part `scan`."""

    robot_from_laser: Pose2
    """Pose of the laser on the robot."""
    first_bearing_rad: float
    """Bearing of the first beam, counter-clockwise from the laser's x axis."""
    bearing_step_rad: float
    """From one beam to the next; negative for a laser that turns clockwise."""
    max_range_m: float
    """A range of at least this is a beam without return."""
    ranges_m: tuple[float | None, ...]
    """One range a beam, at most 16384; null without return."""


@dataclass(frozen=True, slots=True)
class ServedMap:
    """A map of a server."""

    name: str
    """Its name."""
    is_served: bool
    """Whether robots are answered on it."""


@dataclass(frozen=True, slots=True)
class ServerBody:
    """A server."""

    name: str
    """Its name."""
    maps: tuple[ServedMap, ...]
    """Its maps, without drafts, by name."""
    robots: int
    """How many robots are registered with it."""


@dataclass(frozen=True, slots=True)
class ServerEvent:
    """A numbered event."""

    id: str
    """Its id, for `Last-Event-ID`."""
    at_ms: int
    """ms since the Unix epoch."""
    kind: Literal[
        "ready",
        "reset",
        "map_changed",
        "landmark_changed",
        "landmarks_changed",
        "job",
        "presence",
        "gathering",
        "backup",
        "tokens_changed",
    ]
    """Which of these it is."""
    map: str | None = None
    """The map."""
    version: int | None = None
    """Its version; null if it is gone."""
    landmark: str | None = None
    """Its name."""
    change: LandmarkChange | GatheringChange | None = None
    """What became of it."""
    count: int | None = None
    """How many."""
    job: int | None = None
    """Its number."""
    state: JobState | BackupState | None = None
    """Where it stands."""
    robot: str | None = None
    """The robot."""
    present: bool | None = None
    """Whether it is there."""
    gathering: int | None = None
    """Its number."""
    backup: str | None = None
    """Its name."""


@dataclass(frozen=True, slots=True)
class ServerEventBody:
    """What has happened. In JSON, `kind` is the name of the variant."""

    kind: Literal[
        "ready",
        "reset",
        "map_changed",
        "landmark_changed",
        "landmarks_changed",
        "job",
        "presence",
        "gathering",
        "backup",
        "tokens_changed",
    ]
    """Which of these it is."""
    map: str | None = None
    """The map."""
    version: int | None = None
    """Its version; null if it is gone."""
    landmark: str | None = None
    """Its name."""
    change: LandmarkChange | GatheringChange | None = None
    """What became of it."""
    count: int | None = None
    """How many."""
    job: int | None = None
    """Its number."""
    state: JobState | BackupState | None = None
    """Where it stands."""
    robot: str | None = None
    """The robot."""
    present: bool | None = None
    """Whether it is there."""
    gathering: int | None = None
    """Its number."""
    backup: str | None = None
    """Its name."""


@dataclass(frozen=True, slots=True)
class Servers:
    """This server and those that it shares a router with."""

    server: str
    """Name of this server."""
    router: tuple[str, ...]
    """Endpoints of the router that it joins; empty: it is the router itself."""
    is_connected: bool
    """There is a connection to the router."""
    servers: tuple[ServerBody, ...]
    """All servers that live, this one among them, by name."""
    contested_maps: dict[str, tuple[str, ...]]
    """Maps that several servers have, with the servers: at most one of them serves it."""
    contested_robots: dict[str, tuple[str, ...]]
    """Robots that are registered with several servers: their messages must name the map."""
    ignored: int
    """Announcements that were not taken because they were too many."""


@dataclass(frozen=True, slots=True)
class SiteTopologyBody:
    """Places and passages of the maps of a site."""

    maps: tuple[TopologyMap, ...]
    """The versions of the maps it rests on, by map."""
    places: tuple[TopologyPlace, ...]
    """By map, then by number."""
    passages: tuple[TopologyPassage, ...]
    """Doorways by map, then links between maps."""
    route: TopologyRoute | None = None
    """Where one was asked for."""


@dataclass(frozen=True, slots=True)
class Size:
    """Width and height of a landmark."""

    width_m: float
    """0.01 to 100."""
    height_m: float
    """0.01 to 100."""


@dataclass(frozen=True, slots=True)
class SizeAndPlace:
    """Size and place of a landmark, as far as they are known."""

    size: Size | None = None
    """Its size."""
    place: Place | None = None
    """Where it is, in the map."""


@dataclass(frozen=True, slots=True)
class StorageHealth:
    """The disk of the data directory at the last look, some seconds ago at most."""

    total_bytes: int
    """Bytes that the server's user can fill; 0 where that is not known."""
    free_bytes: int
    """Of these, free."""
    reusable_bytes: int
    """Bytes of the database file that deletions have freed: new data take them first."""
    used_percent: int
    """Used share, in percent, rounded down."""
    limit_percent: int
    """The setting `limits.disk_percent`: from here on nothing is added."""
    refused: str | None = None
    """Why nothing is added at present, and what to do. Robots are served all the same."""


@dataclass(frozen=True, slots=True)
class StoredAnswer:
    """A stored answer with everything that was said."""

    summary: StoredAnswerSummary
    """In brief."""
    answer: Answer
    """`Answer` of protos/waymark/v1/waymark.proto as JSON: quads with candidates, distances and thresholds, poses."""
    quads: tuple[StoredQuad, ...]
    """The pictures of its quads, in the order of `answer.quads`."""
    prior_check: PriorCheck | None = None
    """The pose before the frame and that by the frame; null where none was known before."""


@dataclass(frozen=True, slots=True)
class StoredAnswerSummary:
    """A stored answer in brief."""

    id: int
    """Its number, never used again."""
    map: str
    """The map that the frame was compared with."""
    robot: str
    """The robot that sent the frame."""
    camera: str
    """The camera that took it."""
    stored_ms: int
    """ms since the Unix epoch."""
    status: AnswerStatus
    """What came of the frame."""
    has_pose: bool
    """Whether it gave a pose of the robot by the picture alone."""
    landmarks: tuple[str, ...]
    """The landmarks that it names, by their names at that time."""
    candidates: tuple[str, ...]
    """The other landmarks that quads were compared with."""
    refusal: str | None = None
    """Why there is no pose: the code of the frame's rejection; where no landmark was named, the gate that refused
    the nearest candidate; else the gate that refused the pose."""


@dataclass(frozen=True, slots=True)
class StoredQuad:
    """The pictures that belong to a quad of a stored answer."""

    landmarks: tuple[LandmarkIcon, ...]
    """The landmarks it was compared with, in the order of the answer's candidates."""
    icon: str | None = None
    """Path of its icon; absent for quads that are too small, partly outside of the picture, or beyond the first
    eight."""
    matched: QuadMatches | None = None
    """Its points that are like those of the best candidate; null without an icon, and where that has no points."""


@dataclass(frozen=True, slots=True)
class ThresholdBody:
    """A threshold with its evidence. A distance is accepted only when it is strictly below."""

    threshold: float
    """In the unit of the distance; 0 accepts nothing."""
    false_positive_rate: float
    """Share of other distances below it."""
    false_negative_rate: float
    """Share of own distances at or above it."""
    positives: int
    """Own distances that it was fitted to."""
    negatives: int
    """Distances to others that it was fitted to."""
    limited_by: ThresholdLimit
    """What limits it."""


@dataclass(frozen=True, slots=True)
class ThresholdWeights:
    """Costs that thresholds of the correlation and the Hausdorff distance weigh."""

    lambda_: float = field(metadata={NAME: "lambda"})
    """Of a wrong acceptance."""
    mu: float
    """Of a refused own view."""


@dataclass(frozen=True, slots=True)
class Token:
    """A token without its secret."""

    id: int
    """Its number; never given again."""
    name: str
    """Who or what it is for."""
    role: Role
    """What it may do."""
    created_ms: int
    """Milliseconds since the Unix epoch."""
    maps: tuple[str, ...] | None = None
    """Maps that it is for, by name; null for all maps and what is above maps. Deleted maps are left out."""
    expires_ms: int | None = None
    """Not valid from then on; null for never."""
    revoked_ms: int | None = None
    """Not valid since then; null if it was not revoked."""


@dataclass(frozen=True, slots=True)
class TopologyMap:
    """A map of a site."""

    map: str
    """Its name."""
    version: int
    """Its version."""


@dataclass(frozen=True, slots=True)
class TopologyPassage:
    """A doorway between two places, or a link between two maps."""

    ends: tuple[PassageEnd, ...]
    """Its two ends."""
    length_m: float
    """From centre to centre of its places."""
    landmarks: tuple[str, ...]
    """What is seen from its first end, deepest inside its visibility area first; at most 32."""
    width_m: float | None = None
    """Free width, at most 2 m; `null` for a link."""


@dataclass(frozen=True, slots=True)
class TopologyPlace:
    """Free floor that no doorway divides."""

    place: str
    """Map and number, `hall/3`. Numbers are those of this version of the map."""
    map: str
    """The map."""
    x_m: float
    """The point of it nearest to its centre of gravity, metres, in the map."""
    y_m: float
    """Of that point."""
    area_m2: float
    """Free floor."""
    landmarks: tuple[PlaceLandmark, ...]
    """What is seen from it, from most of it first; at most 32."""


@dataclass(frozen=True, slots=True)
class TopologyRoute:
    """A route from passage to passage."""

    length_m: float
    """Sum of its legs."""
    legs: tuple[RouteLeg, ...]
    """In order, at least one."""


@dataclass(frozen=True, slots=True)
class TrackList:
    """All tracks of a gathering that wait for a decision."""

    tracks: tuple[TrackSummary, ...]
    """By number; those that somebody has decided on are not among them."""


@dataclass(frozen=True, slots=True)
class TrackSummary:
    """A track: an object that a robot drove past, for a person to decide on."""

    number: int
    """Its number in the gathering."""
    sightings: int
    """Frames in which it was followed."""
    known: int
    """Of these, such in which it was taken for a landmark of the map, or nearly."""
    views: tuple[int, ...]
    """Numbers of its views; `views/{number}/icon` is the picture."""
    inconsistent_views: int
    """Views beside these that do not agree on its place: another border of it was found, or something else. They
    are left out."""
    side_px: Pair
    """Smallest and largest side of the quad in the picture."""
    v_c: float
    """How far apart the views are (the gate `visibility_confidence`)."""
    passes: bool
    """Whether a lesson of these views would pass every gate, look-alikes apart, and nothing else speaks against
    it."""
    failed_gates: tuple[FailedGate, ...]
    """What speaks against it."""
    similar_tracks: tuple[int, ...]
    """Other tracks that look alike or are at the same place: perhaps the same thing twice, or two of one kind."""
    landmark: str | None = None
    """The landmark whose views these are; null for a thing that is none yet."""
    best_view: int | None = None
    """The view that stands best for all."""
    place: EstimatedPlace | None = None
    """Where it is by its views."""
    not_placed: str | None = None
    """Why that is not known."""


@dataclass(frozen=True, slots=True)
class TrainingView:
    """A stored training view."""

    id: int
    """Its number, never used again."""
    corners: Corners
    """The landmark's corners in the picture: top-left, top-right, bottom-right, bottom-left, in pixels."""
    width_px: int
    """Of the picture, as a viewer shows it."""
    height_px: int
    """Of the picture, as a viewer shows it."""
    image_kind: str
    """`png` or `jpeg`."""
    created_ms: int
    """ms since the Unix epoch."""
    outcome: UploadOutcome | None = None
    """In the answer to an upload: what became of it. With `duplicate` and `near_duplicate` the view given is the
    one that is there."""
    placing: PlacementReportBody | None = None
    """In the answer to an upload with `capture`: whether the landmark has a place by its views now, or why not."""


@dataclass(frozen=True, slots=True)
class TrajectoriesBody:
    """Where a robot was lately, by source; oldest first, at most 2000 of each."""

    pose: tuple[Pose2, ...]
    """Fused poses."""
    odometry: tuple[Pose2, ...]
    """Odometry alone, laid on the map at the robot's first known pose."""
    truth: tuple[Pose2, ...]
    """The truth, where a simulator tells it."""


@dataclass(frozen=True, slots=True)
class TransformResponse:
    """How one map lies in another."""

    via: tuple[str, ...]
    """The maps on the way, both ends included; those that the asker may not see are left out."""
    to_from_map: TransformedPose
    """Maps coordinates of the first to the other."""
    level_m: float
    """Height of the first one's floor above the other's."""
    pose: TransformedPose | None = None
    """The pose that was asked for, in the other map; its covariance is that of the maps alone."""


@dataclass(frozen=True, slots=True)
class TransformedPose:
    """A pose with its covariance over (x, y, theta), row-major."""

    x_m: float
    """Metres, in the other map."""
    y_m: float
    """Metres, in the other map."""
    theta_rad: float
    """Heading in the other map."""
    covariance: Covariance
    """Over (x, y, theta), row-major."""


@dataclass(frozen=True, slots=True)
class Underlay:
    """A picture under a map; `underlay/image` is the picture itself."""

    place: UnderlayPlace
    """Where it lies."""
    width_px: int
    """Of the picture, as a viewer shows it."""
    height_px: int
    """Of the picture, as a viewer shows it."""
    image_kind: str
    """`png` or `jpeg`."""
    created_ms: int
    """ms since the Unix epoch."""


@dataclass(frozen=True, slots=True)
class UnderlayPlace:
    """Where a picture lies in the map."""

    metres_per_pixel: float
    """Side of a pixel, 0.0001 to 10."""
    x_m: float = 0.0
    """Lower left corner of the lower left pixel, x."""
    y_m: float = 0.0
    """Lower left corner of the lower left pixel, y."""
    theta_rad: float = 0.0
    """Direction of the picture's rows in the map, counter-clockwise from map x."""


@dataclass(frozen=True, slots=True)
class UnknownRobot:
    """A robot that sends messages and is not registered."""

    name: str
    """The name it uses."""
    messages: int
    """Its refused messages."""
    first_ms: int
    """Since the first of them."""
    last_ms: int
    """Since the last of them."""
    camera: str | None = None
    """The camera of its last frame; absent if it sent none."""


@dataclass(frozen=True, slots=True)
class UnknownRobots:
    """Robots that send messages and are not registered."""

    robots: tuple[UnknownRobot, ...]
    """By name; at most 64, those that were heard last."""


@dataclass(frozen=True, slots=True)
class UploadedView:
    """One uploaded view."""

    corners: Corners
    """Top-left, top-right, bottom-right, bottom-left, in pixels as seen."""


@dataclass(frozen=True, slots=True)
class UploadedViews:
    """Views of one flat rectangle."""

    width_px: int
    """Of the images."""
    height_px: int
    """Of the images."""
    size_width_m: float
    """Of the rectangle; only its ratio matters for the camera."""
    size_height_m: float
    """See `size_width_m`."""
    views: tuple[UploadedView, ...]
    """At least two, better five to ten, from at least three sides that differ by more than 15 degrees."""


@dataclass(frozen=True, slots=True)
class Version:
    """What runs here."""

    name: str
    """`waymark`."""
    version: str
    """Of the program."""
    api: str
    """Of the HTTP interface."""
    protocol: str
    """Of the protocol over zenoh."""
    server: str = ""
    """Name of this server among those of a router."""


@dataclass(frozen=True, slots=True)
class VisibilityAreaBody:
    """The floor area from which a landmark is seen: a GeoJSON `Feature` in metres of the map, not degrees."""

    kind: str = field(metadata={NAME: "type"})
    """`Feature`."""
    geometry: MultiPolygon
    """The polygons."""
    properties: VisibilityAreaProperties
    """The landmark, and figures of the area."""


@dataclass(frozen=True, slots=True)
class VisibilityAreaProperties:
    """Figures of a visibility area."""

    landmark: str
    """Name of the landmark."""
    area_m2: float
    """Square metres."""
    reach_m: float
    """Furthest possible distance from the landmark."""
    centroid_m: Pair | None = None
    """Centre of gravity, where there is an area."""


@dataclass(frozen=True, slots=True)
class VisibilitySettingsBody:
    """A camera, and what counts as seen by it. Every number may be absent."""

    focal_px: float | None = None
    """Focal length, pixels: 10 to 20 000; usually 512."""
    width_px: float | None = None
    """Width of the image, pixels: 16 to 20 000; usually 640."""
    height_px: float | None = None
    """Height of the image, pixels: 16 to 20 000; usually 480."""
    camera_height_m: float | None = None
    """Height of the camera above the floor: 0 to 10 m; usually 1.2."""
    tilt_low_rad: float | None = None
    """Lowest tilt of the camera, up positive, within 1.55; usually -0.35. The same as the highest for one that is
    fixed."""
    tilt_high_rad: float | None = None
    """Highest tilt; usually 0.35. Signs under ceilings are seen only by cameras that look up."""
    pan_low_rad: float | None = None
    """Rightmost pan, left positive, from -pi; usually -1.7."""
    pan_high_rad: float | None = None
    """Leftmost pan, to pi; usually 1.7."""
    max_incidence_rad: float | None = None
    """Most oblique view against a landmark's normal: 0.01 to 1.48; usually 1.309, 75 degrees."""
    min_side_px: float | None = None
    """Shortest side of a landmark in the image, pixels: 1 to 20 000; usually 75."""
    max_fill: float | None = None
    """Largest share of the image that a landmark may take: 0.01 to 1; usually 0.9."""
    standoff_m: float | None = None
    """How far before its wall a landmark is taken to hang, so that its own wall does not hide it: 0.001 to 0.5 m;
    usually 0.05."""


@dataclass(frozen=True, slots=True)
class VisibleLandmark:
    """A landmark that may be seen."""

    landmark: str
    """Name of the landmark."""
    probability: float
    """Probability that it is seen when the camera is turned to it."""
    margin_m: float
    """Distance to the boundary of its area, positive inside."""


@dataclass(frozen=True, slots=True)
class VisibleRequest:
    """Where the robot is."""

    pose: PoseBody
    """Pose of the robot."""
    visibility_settings: VisibilitySettingsBody | None = None
    """Another camera than the map's."""


@dataclass(frozen=True, slots=True)
class VisibleResponse:
    """What may be seen."""

    map_version: int
    """Of this version of the map."""
    landmarks: tuple[VisibleLandmark, ...]
    """Most probable first."""


@dataclass(frozen=True, slots=True)
class WallBody:
    """A straight piece of wall, the free side on the left of a to b."""

    a: Pair
    """First end: x, y in metres."""
    b: Pair
    """Second end: x, y in metres."""
    covariance: Triple | None = None
    """How well it is known, about its middle: variance of its direction (rad^2), covariance of direction and
    offset to its free side (rad m), variance of the offset (m^2), relative to the map frame. A map made of
    scans has it. Absent: measured by hand, to 1 cm."""


@dataclass(frozen=True, slots=True)
class WallsBody:
    """The walls of a map."""

    segments: tuple[WallBody, ...]
    """In the order given."""


@dataclass(frozen=True, slots=True)
class WallsDifference:
    """How walls differ."""

    before: int
    """Number of segments before."""
    after: int
    """Number of segments after."""
    added: int
    """Segments that are new."""
    removed: int
    """Segments that are gone."""
    bounds_m: Bounds | None = None
    """The box round both (map frame, m): least x, least y, greatest x, greatest y."""


@dataclass(frozen=True, slots=True)
class Whoami:
    """Who asks, as the server sees it."""

    name: str
    """Name of the token; `local` for that of the server's own machine."""
    role: Role
    """What may be done."""
    maps: tuple[str, ...] | None = None
    """Maps that it is for; null for all maps and what is above maps."""
    token: int | None = None
    """Number of the token; null for the local one."""
    expires_ms: int | None = None
    """Not valid from then on, milliseconds since the Unix epoch; null for never."""
