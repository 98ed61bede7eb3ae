from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class ImageEncoding(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    IMAGE_ENCODING_UNSPECIFIED: _ClassVar[ImageEncoding]
    IMAGE_ENCODING_JPEG: _ClassVar[ImageEncoding]
    IMAGE_ENCODING_PNG: _ClassVar[ImageEncoding]
    IMAGE_ENCODING_GRAY8: _ClassVar[ImageEncoding]
    IMAGE_ENCODING_RGB8: _ClassVar[ImageEncoding]
    IMAGE_ENCODING_BGR8: _ClassVar[ImageEncoding]

class Status(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    STATUS_UNSPECIFIED: _ClassVar[Status]
    STATUS_MATCHED: _ClassVar[Status]
    STATUS_AMBIGUOUS: _ClassVar[Status]
    STATUS_NO_MATCH: _ClassVar[Status]
    STATUS_REJECTED: _ClassVar[Status]
    STATUS_EXPIRED: _ClassVar[Status]
    STATUS_OVERLOADED: _ClassVar[Status]
    STATUS_NOT_READY: _ClassVar[Status]

class QuadKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    QUAD_KIND_UNSPECIFIED: _ClassVar[QuadKind]
    QUAD_KIND_FULL: _ClassVar[QuadKind]
    QUAD_KIND_THREE_SIDED: _ClassVar[QuadKind]
    QUAD_KIND_EXPECTED: _ClassVar[QuadKind]
    QUAD_KIND_TEXTURE: _ClassVar[QuadKind]

class Verdict(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    VERDICT_UNSPECIFIED: _ClassVar[Verdict]
    VERDICT_UNKNOWN: _ClassVar[Verdict]
    VERDICT_UNIQUE: _ClassVar[Verdict]
    VERDICT_AMBIGUOUS: _ClassVar[Verdict]

class PartAgreement(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    PART_AGREEMENT_UNSPECIFIED: _ClassVar[PartAgreement]
    PART_AGREEMENT_SILENT: _ClassVar[PartAgreement]
    PART_AGREEMENT_AGREES: _ClassVar[PartAgreement]
    PART_AGREEMENT_DISAGREES: _ClassVar[PartAgreement]

class Sighting(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    SIGHTING_UNSPECIFIED: _ClassVar[Sighting]
    SIGHTING_GLOBAL: _ClassVar[Sighting]
    SIGHTING_GUIDED: _ClassVar[Sighting]

class FixQuantity(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    FIX_QUANTITY_UNSPECIFIED: _ClassVar[FixQuantity]
    FIX_QUANTITY_SIZE: _ClassVar[FixQuantity]
    FIX_QUANTITY_CAMERA_HEIGHT: _ClassVar[FixQuantity]
    FIX_QUANTITY_CAMERA_TILT: _ClassVar[FixQuantity]
    FIX_QUANTITY_MOUNTING: _ClassVar[FixQuantity]

class PoseTrust(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    POSE_TRUST_UNSPECIFIED: _ClassVar[PoseTrust]
    POSE_TRUST_UNSUPPORTED: _ClassVar[PoseTrust]
    POSE_TRUST_SUPPORTED: _ClassVar[PoseTrust]
    POSE_TRUST_STALE: _ClassVar[PoseTrust]
    POSE_TRUST_CONTRADICTED: _ClassVar[PoseTrust]

class GazeCriterion(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    GAZE_CRITERION_UNSPECIFIED: _ClassVar[GazeCriterion]
    GAZE_CRITERION_PRODUCT: _ClassVar[GazeCriterion]
    GAZE_CRITERION_INFORMATION: _ClassVar[GazeCriterion]

class GazeAction(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    GAZE_ACTION_UNSPECIFIED: _ClassVar[GazeAction]
    GAZE_ACTION_LANDMARK: _ClassVar[GazeAction]
    GAZE_ACTION_AHEAD: _ClassVar[GazeAction]
    GAZE_ACTION_SWEEP: _ClassVar[GazeAction]

class LocaliseStatus(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    LOCALISE_STATUS_UNSPECIFIED: _ClassVar[LocaliseStatus]
    LOCALISE_STATUS_LOCATED: _ClassVar[LocaliseStatus]
    LOCALISE_STATUS_AMBIGUOUS: _ClassVar[LocaliseStatus]
    LOCALISE_STATUS_NO_MATCH: _ClassVar[LocaliseStatus]
IMAGE_ENCODING_UNSPECIFIED: ImageEncoding
IMAGE_ENCODING_JPEG: ImageEncoding
IMAGE_ENCODING_PNG: ImageEncoding
IMAGE_ENCODING_GRAY8: ImageEncoding
IMAGE_ENCODING_RGB8: ImageEncoding
IMAGE_ENCODING_BGR8: ImageEncoding
STATUS_UNSPECIFIED: Status
STATUS_MATCHED: Status
STATUS_AMBIGUOUS: Status
STATUS_NO_MATCH: Status
STATUS_REJECTED: Status
STATUS_EXPIRED: Status
STATUS_OVERLOADED: Status
STATUS_NOT_READY: Status
QUAD_KIND_UNSPECIFIED: QuadKind
QUAD_KIND_FULL: QuadKind
QUAD_KIND_THREE_SIDED: QuadKind
QUAD_KIND_EXPECTED: QuadKind
QUAD_KIND_TEXTURE: QuadKind
VERDICT_UNSPECIFIED: Verdict
VERDICT_UNKNOWN: Verdict
VERDICT_UNIQUE: Verdict
VERDICT_AMBIGUOUS: Verdict
PART_AGREEMENT_UNSPECIFIED: PartAgreement
PART_AGREEMENT_SILENT: PartAgreement
PART_AGREEMENT_AGREES: PartAgreement
PART_AGREEMENT_DISAGREES: PartAgreement
SIGHTING_UNSPECIFIED: Sighting
SIGHTING_GLOBAL: Sighting
SIGHTING_GUIDED: Sighting
FIX_QUANTITY_UNSPECIFIED: FixQuantity
FIX_QUANTITY_SIZE: FixQuantity
FIX_QUANTITY_CAMERA_HEIGHT: FixQuantity
FIX_QUANTITY_CAMERA_TILT: FixQuantity
FIX_QUANTITY_MOUNTING: FixQuantity
POSE_TRUST_UNSPECIFIED: PoseTrust
POSE_TRUST_UNSUPPORTED: PoseTrust
POSE_TRUST_SUPPORTED: PoseTrust
POSE_TRUST_STALE: PoseTrust
POSE_TRUST_CONTRADICTED: PoseTrust
GAZE_CRITERION_UNSPECIFIED: GazeCriterion
GAZE_CRITERION_PRODUCT: GazeCriterion
GAZE_CRITERION_INFORMATION: GazeCriterion
GAZE_ACTION_UNSPECIFIED: GazeAction
GAZE_ACTION_LANDMARK: GazeAction
GAZE_ACTION_AHEAD: GazeAction
GAZE_ACTION_SWEEP: GazeAction
LOCALISE_STATUS_UNSPECIFIED: LocaliseStatus
LOCALISE_STATUS_LOCATED: LocaliseStatus
LOCALISE_STATUS_AMBIGUOUS: LocaliseStatus
LOCALISE_STATUS_NO_MATCH: LocaliseStatus

class Pose3(_message.Message):
    __slots__ = ("qx", "qy", "qz", "qw", "x_m", "y_m", "z_m")
    QX_FIELD_NUMBER: _ClassVar[int]
    QY_FIELD_NUMBER: _ClassVar[int]
    QZ_FIELD_NUMBER: _ClassVar[int]
    QW_FIELD_NUMBER: _ClassVar[int]
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    Z_M_FIELD_NUMBER: _ClassVar[int]
    qx: float
    qy: float
    qz: float
    qw: float
    x_m: float
    y_m: float
    z_m: float
    def __init__(self, qx: _Optional[float] = ..., qy: _Optional[float] = ..., qz: _Optional[float] = ..., qw: _Optional[float] = ..., x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., z_m: _Optional[float] = ...) -> None: ...

class Pose2(_message.Message):
    __slots__ = ("x_m", "y_m", "theta_rad")
    X_M_FIELD_NUMBER: _ClassVar[int]
    Y_M_FIELD_NUMBER: _ClassVar[int]
    THETA_RAD_FIELD_NUMBER: _ClassVar[int]
    x_m: float
    y_m: float
    theta_rad: float
    def __init__(self, x_m: _Optional[float] = ..., y_m: _Optional[float] = ..., theta_rad: _Optional[float] = ...) -> None: ...

class Pose2Covariance(_message.Message):
    __slots__ = ("pose", "covariance")
    POSE_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    pose: Pose2
    covariance: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, pose: _Optional[_Union[Pose2, _Mapping]] = ..., covariance: _Optional[_Iterable[float]] = ...) -> None: ...

class Intrinsics(_message.Message):
    __slots__ = ("fx_px", "fy_px", "cx_px", "cy_px", "plumb_bob", "rational_polynomial", "equidistant", "focal_sigma_px", "center_sigma_px", "width_px", "height_px")
    FX_PX_FIELD_NUMBER: _ClassVar[int]
    FY_PX_FIELD_NUMBER: _ClassVar[int]
    CX_PX_FIELD_NUMBER: _ClassVar[int]
    CY_PX_FIELD_NUMBER: _ClassVar[int]
    PLUMB_BOB_FIELD_NUMBER: _ClassVar[int]
    RATIONAL_POLYNOMIAL_FIELD_NUMBER: _ClassVar[int]
    EQUIDISTANT_FIELD_NUMBER: _ClassVar[int]
    FOCAL_SIGMA_PX_FIELD_NUMBER: _ClassVar[int]
    CENTER_SIGMA_PX_FIELD_NUMBER: _ClassVar[int]
    WIDTH_PX_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_PX_FIELD_NUMBER: _ClassVar[int]
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    plumb_bob: _containers.RepeatedScalarFieldContainer[float]
    rational_polynomial: _containers.RepeatedScalarFieldContainer[float]
    equidistant: _containers.RepeatedScalarFieldContainer[float]
    focal_sigma_px: float
    center_sigma_px: float
    width_px: int
    height_px: int
    def __init__(self, fx_px: _Optional[float] = ..., fy_px: _Optional[float] = ..., cx_px: _Optional[float] = ..., cy_px: _Optional[float] = ..., plumb_bob: _Optional[_Iterable[float]] = ..., rational_polynomial: _Optional[_Iterable[float]] = ..., equidistant: _Optional[_Iterable[float]] = ..., focal_sigma_px: _Optional[float] = ..., center_sigma_px: _Optional[float] = ..., width_px: _Optional[int] = ..., height_px: _Optional[int] = ...) -> None: ...

class Frame(_message.Message):
    __slots__ = ("epoch", "seq", "captured_ns", "encoding", "width_px", "height_px", "image", "intrinsics", "robot_from_camera", "odometry", "prior", "deadline_ms", "map", "withheld_bytes")
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    CAPTURED_NS_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    WIDTH_PX_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_PX_FIELD_NUMBER: _ClassVar[int]
    IMAGE_FIELD_NUMBER: _ClassVar[int]
    INTRINSICS_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FROM_CAMERA_FIELD_NUMBER: _ClassVar[int]
    ODOMETRY_FIELD_NUMBER: _ClassVar[int]
    PRIOR_FIELD_NUMBER: _ClassVar[int]
    DEADLINE_MS_FIELD_NUMBER: _ClassVar[int]
    MAP_FIELD_NUMBER: _ClassVar[int]
    WITHHELD_BYTES_FIELD_NUMBER: _ClassVar[int]
    epoch: int
    seq: int
    captured_ns: int
    encoding: ImageEncoding
    width_px: int
    height_px: int
    image: bytes
    intrinsics: Intrinsics
    robot_from_camera: Pose3
    odometry: Pose2
    prior: Pose2Covariance
    deadline_ms: int
    map: str
    withheld_bytes: int
    def __init__(self, epoch: _Optional[int] = ..., seq: _Optional[int] = ..., captured_ns: _Optional[int] = ..., encoding: _Optional[_Union[ImageEncoding, str]] = ..., width_px: _Optional[int] = ..., height_px: _Optional[int] = ..., image: _Optional[bytes] = ..., intrinsics: _Optional[_Union[Intrinsics, _Mapping]] = ..., robot_from_camera: _Optional[_Union[Pose3, _Mapping]] = ..., odometry: _Optional[_Union[Pose2, _Mapping]] = ..., prior: _Optional[_Union[Pose2Covariance, _Mapping]] = ..., deadline_ms: _Optional[int] = ..., map: _Optional[str] = ..., withheld_bytes: _Optional[int] = ...) -> None: ...

class Hello(_message.Message):
    __slots__ = ("frame_bytes",)
    FRAME_BYTES_FIELD_NUMBER: _ClassVar[int]
    frame_bytes: int
    def __init__(self, frame_bytes: _Optional[int] = ...) -> None: ...

class Rejection(_message.Message):
    __slots__ = ("code", "field", "detail")
    CODE_FIELD_NUMBER: _ClassVar[int]
    FIELD_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    code: str
    field: str
    detail: str
    def __init__(self, code: _Optional[str] = ..., field: _Optional[str] = ..., detail: _Optional[str] = ...) -> None: ...

class Point(_message.Message):
    __slots__ = ("u_px", "v_px")
    U_PX_FIELD_NUMBER: _ClassVar[int]
    V_PX_FIELD_NUMBER: _ClassVar[int]
    u_px: float
    v_px: float
    def __init__(self, u_px: _Optional[float] = ..., v_px: _Optional[float] = ...) -> None: ...

class Border(_message.Message):
    __slots__ = ("corners",)
    CORNERS_FIELD_NUMBER: _ClassVar[int]
    corners: _containers.RepeatedCompositeFieldContainer[Point]
    def __init__(self, corners: _Optional[_Iterable[_Union[Point, _Mapping]]] = ...) -> None: ...

class Patch(_message.Message):
    __slots__ = ("left_px", "top_px", "width_px", "height_px", "encoding", "image")
    LEFT_PX_FIELD_NUMBER: _ClassVar[int]
    TOP_PX_FIELD_NUMBER: _ClassVar[int]
    WIDTH_PX_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_PX_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    IMAGE_FIELD_NUMBER: _ClassVar[int]
    left_px: int
    top_px: int
    width_px: int
    height_px: int
    encoding: ImageEncoding
    image: bytes
    def __init__(self, left_px: _Optional[int] = ..., top_px: _Optional[int] = ..., width_px: _Optional[int] = ..., height_px: _Optional[int] = ..., encoding: _Optional[_Union[ImageEncoding, str]] = ..., image: _Optional[bytes] = ...) -> None: ...

class FoundQuad(_message.Message):
    __slots__ = ("border", "corner_covariance_px2", "alternates", "score", "upright_ambiguous", "patch")
    BORDER_FIELD_NUMBER: _ClassVar[int]
    CORNER_COVARIANCE_PX2_FIELD_NUMBER: _ClassVar[int]
    ALTERNATES_FIELD_NUMBER: _ClassVar[int]
    SCORE_FIELD_NUMBER: _ClassVar[int]
    UPRIGHT_AMBIGUOUS_FIELD_NUMBER: _ClassVar[int]
    PATCH_FIELD_NUMBER: _ClassVar[int]
    border: Border
    corner_covariance_px2: _containers.RepeatedScalarFieldContainer[float]
    alternates: _containers.RepeatedCompositeFieldContainer[Border]
    score: float
    upright_ambiguous: bool
    patch: Patch
    def __init__(self, border: _Optional[_Union[Border, _Mapping]] = ..., corner_covariance_px2: _Optional[_Iterable[float]] = ..., alternates: _Optional[_Iterable[_Union[Border, _Mapping]]] = ..., score: _Optional[float] = ..., upright_ambiguous: bool = ..., patch: _Optional[_Union[Patch, _Mapping]] = ...) -> None: ...

class Quads(_message.Message):
    __slots__ = ("epoch", "seq", "captured_ns", "width_px", "height_px", "quads", "intrinsics", "robot_from_camera", "odometry", "prior", "deadline_ms", "map")
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    CAPTURED_NS_FIELD_NUMBER: _ClassVar[int]
    WIDTH_PX_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_PX_FIELD_NUMBER: _ClassVar[int]
    QUADS_FIELD_NUMBER: _ClassVar[int]
    INTRINSICS_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FROM_CAMERA_FIELD_NUMBER: _ClassVar[int]
    ODOMETRY_FIELD_NUMBER: _ClassVar[int]
    PRIOR_FIELD_NUMBER: _ClassVar[int]
    DEADLINE_MS_FIELD_NUMBER: _ClassVar[int]
    MAP_FIELD_NUMBER: _ClassVar[int]
    epoch: int
    seq: int
    captured_ns: int
    width_px: int
    height_px: int
    quads: _containers.RepeatedCompositeFieldContainer[FoundQuad]
    intrinsics: Intrinsics
    robot_from_camera: Pose3
    odometry: Pose2
    prior: Pose2Covariance
    deadline_ms: int
    map: str
    def __init__(self, epoch: _Optional[int] = ..., seq: _Optional[int] = ..., captured_ns: _Optional[int] = ..., width_px: _Optional[int] = ..., height_px: _Optional[int] = ..., quads: _Optional[_Iterable[_Union[FoundQuad, _Mapping]]] = ..., intrinsics: _Optional[_Union[Intrinsics, _Mapping]] = ..., robot_from_camera: _Optional[_Union[Pose3, _Mapping]] = ..., odometry: _Optional[_Union[Pose2, _Mapping]] = ..., prior: _Optional[_Union[Pose2Covariance, _Mapping]] = ..., deadline_ms: _Optional[int] = ..., map: _Optional[str] = ...) -> None: ...

class Candidate(_message.Message):
    __slots__ = ("landmark", "correlation", "hausdorff", "distance", "threshold", "ratio", "probability", "refusal", "gradient_similarity")
    LANDMARK_FIELD_NUMBER: _ClassVar[int]
    CORRELATION_FIELD_NUMBER: _ClassVar[int]
    HAUSDORFF_FIELD_NUMBER: _ClassVar[int]
    DISTANCE_FIELD_NUMBER: _ClassVar[int]
    THRESHOLD_FIELD_NUMBER: _ClassVar[int]
    RATIO_FIELD_NUMBER: _ClassVar[int]
    PROBABILITY_FIELD_NUMBER: _ClassVar[int]
    REFUSAL_FIELD_NUMBER: _ClassVar[int]
    GRADIENT_SIMILARITY_FIELD_NUMBER: _ClassVar[int]
    landmark: str
    correlation: float
    hausdorff: float
    distance: float
    threshold: float
    ratio: float
    probability: float
    refusal: str
    gradient_similarity: float
    def __init__(self, landmark: _Optional[str] = ..., correlation: _Optional[float] = ..., hausdorff: _Optional[float] = ..., distance: _Optional[float] = ..., threshold: _Optional[float] = ..., ratio: _Optional[float] = ..., probability: _Optional[float] = ..., refusal: _Optional[str] = ..., gradient_similarity: _Optional[float] = ...) -> None: ...

class PointEvidence(_message.Message):
    __slots__ = ("matches", "inliers", "checked", "agreeing", "log10_chance", "agreement")
    MATCHES_FIELD_NUMBER: _ClassVar[int]
    INLIERS_FIELD_NUMBER: _ClassVar[int]
    CHECKED_FIELD_NUMBER: _ClassVar[int]
    AGREEING_FIELD_NUMBER: _ClassVar[int]
    LOG10_CHANCE_FIELD_NUMBER: _ClassVar[int]
    AGREEMENT_FIELD_NUMBER: _ClassVar[int]
    matches: int
    inliers: int
    checked: int
    agreeing: int
    log10_chance: float
    agreement: _containers.RepeatedScalarFieldContainer[PartAgreement]
    def __init__(self, matches: _Optional[int] = ..., inliers: _Optional[int] = ..., checked: _Optional[int] = ..., agreeing: _Optional[int] = ..., log10_chance: _Optional[float] = ..., agreement: _Optional[_Iterable[_Union[PartAgreement, str]]] = ...) -> None: ...

class LandmarkPose(_message.Message):
    __slots__ = ("camera_from_landmark", "covariance", "reprojection_rms_px")
    CAMERA_FROM_LANDMARK_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    REPROJECTION_RMS_PX_FIELD_NUMBER: _ClassVar[int]
    camera_from_landmark: Pose3
    covariance: _containers.RepeatedScalarFieldContainer[float]
    reprojection_rms_px: float
    def __init__(self, camera_from_landmark: _Optional[_Union[Pose3, _Mapping]] = ..., covariance: _Optional[_Iterable[float]] = ..., reprojection_rms_px: _Optional[float] = ...) -> None: ...

class CameraPose(_message.Message):
    __slots__ = ("map_from_camera", "covariance", "landmarks")
    MAP_FROM_CAMERA_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_FIELD_NUMBER: _ClassVar[int]
    LANDMARKS_FIELD_NUMBER: _ClassVar[int]
    map_from_camera: Pose3
    covariance: _containers.RepeatedScalarFieldContainer[float]
    landmarks: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, map_from_camera: _Optional[_Union[Pose3, _Mapping]] = ..., covariance: _Optional[_Iterable[float]] = ..., landmarks: _Optional[_Iterable[str]] = ...) -> None: ...

class QuadAnswer(_message.Message):
    __slots__ = ("corners", "kind", "score", "verdict", "landmark", "candidates", "entropy_m", "entropy_norm", "confidence", "pose", "second_pose", "pose_ambiguous", "pose_refusal", "points", "doubtful_landmark", "sighting", "guided_landmark", "probability_none")
    CORNERS_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    SCORE_FIELD_NUMBER: _ClassVar[int]
    VERDICT_FIELD_NUMBER: _ClassVar[int]
    LANDMARK_FIELD_NUMBER: _ClassVar[int]
    CANDIDATES_FIELD_NUMBER: _ClassVar[int]
    ENTROPY_M_FIELD_NUMBER: _ClassVar[int]
    ENTROPY_NORM_FIELD_NUMBER: _ClassVar[int]
    CONFIDENCE_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    SECOND_POSE_FIELD_NUMBER: _ClassVar[int]
    POSE_AMBIGUOUS_FIELD_NUMBER: _ClassVar[int]
    POSE_REFUSAL_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    DOUBTFUL_LANDMARK_FIELD_NUMBER: _ClassVar[int]
    SIGHTING_FIELD_NUMBER: _ClassVar[int]
    GUIDED_LANDMARK_FIELD_NUMBER: _ClassVar[int]
    PROBABILITY_NONE_FIELD_NUMBER: _ClassVar[int]
    corners: _containers.RepeatedCompositeFieldContainer[Point]
    kind: QuadKind
    score: float
    verdict: Verdict
    landmark: str
    candidates: _containers.RepeatedCompositeFieldContainer[Candidate]
    entropy_m: float
    entropy_norm: float
    confidence: float
    pose: LandmarkPose
    second_pose: LandmarkPose
    pose_ambiguous: bool
    pose_refusal: str
    points: PointEvidence
    doubtful_landmark: str
    sighting: Sighting
    guided_landmark: str
    probability_none: float
    def __init__(self, corners: _Optional[_Iterable[_Union[Point, _Mapping]]] = ..., kind: _Optional[_Union[QuadKind, str]] = ..., score: _Optional[float] = ..., verdict: _Optional[_Union[Verdict, str]] = ..., landmark: _Optional[str] = ..., candidates: _Optional[_Iterable[_Union[Candidate, _Mapping]]] = ..., entropy_m: _Optional[float] = ..., entropy_norm: _Optional[float] = ..., confidence: _Optional[float] = ..., pose: _Optional[_Union[LandmarkPose, _Mapping]] = ..., second_pose: _Optional[_Union[LandmarkPose, _Mapping]] = ..., pose_ambiguous: bool = ..., pose_refusal: _Optional[str] = ..., points: _Optional[_Union[PointEvidence, _Mapping]] = ..., doubtful_landmark: _Optional[str] = ..., sighting: _Optional[_Union[Sighting, str]] = ..., guided_landmark: _Optional[str] = ..., probability_none: _Optional[float] = ...) -> None: ...

class PoseRefusalCause(_message.Message):
    __slots__ = ("quantity", "landmark", "expected", "measured", "sigma", "unit")
    QUANTITY_FIELD_NUMBER: _ClassVar[int]
    LANDMARK_FIELD_NUMBER: _ClassVar[int]
    EXPECTED_FIELD_NUMBER: _ClassVar[int]
    MEASURED_FIELD_NUMBER: _ClassVar[int]
    SIGMA_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    quantity: FixQuantity
    landmark: str
    expected: float
    measured: float
    sigma: float
    unit: str
    def __init__(self, quantity: _Optional[_Union[FixQuantity, str]] = ..., landmark: _Optional[str] = ..., expected: _Optional[float] = ..., measured: _Optional[float] = ..., sigma: _Optional[float] = ..., unit: _Optional[str] = ...) -> None: ...

class PoseRefusalDetail(_message.Message):
    __slots__ = ("chi2", "limit", "causes", "sentence")
    CHI2_FIELD_NUMBER: _ClassVar[int]
    LIMIT_FIELD_NUMBER: _ClassVar[int]
    CAUSES_FIELD_NUMBER: _ClassVar[int]
    SENTENCE_FIELD_NUMBER: _ClassVar[int]
    chi2: float
    limit: float
    causes: _containers.RepeatedCompositeFieldContainer[PoseRefusalCause]
    sentence: str
    def __init__(self, chi2: _Optional[float] = ..., limit: _Optional[float] = ..., causes: _Optional[_Iterable[_Union[PoseRefusalCause, _Mapping]]] = ..., sentence: _Optional[str] = ...) -> None: ...

class StageTime(_message.Message):
    __slots__ = ("stage", "ms")
    STAGE_FIELD_NUMBER: _ClassVar[int]
    MS_FIELD_NUMBER: _ClassVar[int]
    stage: str
    ms: float
    def __init__(self, stage: _Optional[str] = ..., ms: _Optional[float] = ...) -> None: ...

class Hypothesis(_message.Message):
    __slots__ = ("probability", "map_from_robot")
    PROBABILITY_FIELD_NUMBER: _ClassVar[int]
    MAP_FROM_ROBOT_FIELD_NUMBER: _ClassVar[int]
    probability: float
    map_from_robot: Pose2Covariance
    def __init__(self, probability: _Optional[float] = ..., map_from_robot: _Optional[_Union[Pose2Covariance, _Mapping]] = ...) -> None: ...

class Answer(_message.Message):
    __slots__ = ("epoch", "seq", "captured_ns", "map", "map_version", "status", "rejection", "quads", "map_from_robot", "pose_landmarks", "latency_ms", "timings", "clock_suspect", "pose_refusal", "hypotheses", "guided_map_from_robot", "guided_landmarks", "only_expected", "pose_refusal_detail", "camera_pose", "camera_pose_refusal", "server", "pose_cautions")
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    CAPTURED_NS_FIELD_NUMBER: _ClassVar[int]
    MAP_FIELD_NUMBER: _ClassVar[int]
    MAP_VERSION_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    REJECTION_FIELD_NUMBER: _ClassVar[int]
    QUADS_FIELD_NUMBER: _ClassVar[int]
    MAP_FROM_ROBOT_FIELD_NUMBER: _ClassVar[int]
    POSE_LANDMARKS_FIELD_NUMBER: _ClassVar[int]
    LATENCY_MS_FIELD_NUMBER: _ClassVar[int]
    TIMINGS_FIELD_NUMBER: _ClassVar[int]
    CLOCK_SUSPECT_FIELD_NUMBER: _ClassVar[int]
    POSE_REFUSAL_FIELD_NUMBER: _ClassVar[int]
    HYPOTHESES_FIELD_NUMBER: _ClassVar[int]
    GUIDED_MAP_FROM_ROBOT_FIELD_NUMBER: _ClassVar[int]
    GUIDED_LANDMARKS_FIELD_NUMBER: _ClassVar[int]
    ONLY_EXPECTED_FIELD_NUMBER: _ClassVar[int]
    POSE_REFUSAL_DETAIL_FIELD_NUMBER: _ClassVar[int]
    CAMERA_POSE_FIELD_NUMBER: _ClassVar[int]
    CAMERA_POSE_REFUSAL_FIELD_NUMBER: _ClassVar[int]
    SERVER_FIELD_NUMBER: _ClassVar[int]
    POSE_CAUTIONS_FIELD_NUMBER: _ClassVar[int]
    epoch: int
    seq: int
    captured_ns: int
    map: str
    map_version: int
    status: Status
    rejection: Rejection
    quads: _containers.RepeatedCompositeFieldContainer[QuadAnswer]
    map_from_robot: Pose2Covariance
    pose_landmarks: _containers.RepeatedScalarFieldContainer[str]
    latency_ms: float
    timings: _containers.RepeatedCompositeFieldContainer[StageTime]
    clock_suspect: bool
    pose_refusal: str
    hypotheses: _containers.RepeatedCompositeFieldContainer[Hypothesis]
    guided_map_from_robot: Pose2Covariance
    guided_landmarks: _containers.RepeatedScalarFieldContainer[str]
    only_expected: bool
    pose_refusal_detail: PoseRefusalDetail
    camera_pose: CameraPose
    camera_pose_refusal: str
    server: str
    pose_cautions: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, epoch: _Optional[int] = ..., seq: _Optional[int] = ..., captured_ns: _Optional[int] = ..., map: _Optional[str] = ..., map_version: _Optional[int] = ..., status: _Optional[_Union[Status, str]] = ..., rejection: _Optional[_Union[Rejection, _Mapping]] = ..., quads: _Optional[_Iterable[_Union[QuadAnswer, _Mapping]]] = ..., map_from_robot: _Optional[_Union[Pose2Covariance, _Mapping]] = ..., pose_landmarks: _Optional[_Iterable[str]] = ..., latency_ms: _Optional[float] = ..., timings: _Optional[_Iterable[_Union[StageTime, _Mapping]]] = ..., clock_suspect: bool = ..., pose_refusal: _Optional[str] = ..., hypotheses: _Optional[_Iterable[_Union[Hypothesis, _Mapping]]] = ..., guided_map_from_robot: _Optional[_Union[Pose2Covariance, _Mapping]] = ..., guided_landmarks: _Optional[_Iterable[str]] = ..., only_expected: bool = ..., pose_refusal_detail: _Optional[_Union[PoseRefusalDetail, _Mapping]] = ..., camera_pose: _Optional[_Union[CameraPose, _Mapping]] = ..., camera_pose_refusal: _Optional[str] = ..., server: _Optional[str] = ..., pose_cautions: _Optional[_Iterable[str]] = ...) -> None: ...

class Odometry(_message.Message):
    __slots__ = ("epoch", "seq", "captured_ns", "odom_from_robot", "map")
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    CAPTURED_NS_FIELD_NUMBER: _ClassVar[int]
    ODOM_FROM_ROBOT_FIELD_NUMBER: _ClassVar[int]
    MAP_FIELD_NUMBER: _ClassVar[int]
    epoch: int
    seq: int
    captured_ns: int
    odom_from_robot: Pose2
    map: str
    def __init__(self, epoch: _Optional[int] = ..., seq: _Optional[int] = ..., captured_ns: _Optional[int] = ..., odom_from_robot: _Optional[_Union[Pose2, _Mapping]] = ..., map: _Optional[str] = ...) -> None: ...

class Scan(_message.Message):
    __slots__ = ("epoch", "seq", "captured_ns", "odom_from_robot", "robot_from_laser", "first_bearing_rad", "bearing_step_rad", "max_range_m", "ranges_m", "map")
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    CAPTURED_NS_FIELD_NUMBER: _ClassVar[int]
    ODOM_FROM_ROBOT_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FROM_LASER_FIELD_NUMBER: _ClassVar[int]
    FIRST_BEARING_RAD_FIELD_NUMBER: _ClassVar[int]
    BEARING_STEP_RAD_FIELD_NUMBER: _ClassVar[int]
    MAX_RANGE_M_FIELD_NUMBER: _ClassVar[int]
    RANGES_M_FIELD_NUMBER: _ClassVar[int]
    MAP_FIELD_NUMBER: _ClassVar[int]
    epoch: int
    seq: int
    captured_ns: int
    odom_from_robot: Pose2
    robot_from_laser: Pose2
    first_bearing_rad: float
    bearing_step_rad: float
    max_range_m: float
    ranges_m: _containers.RepeatedScalarFieldContainer[float]
    map: str
    def __init__(self, epoch: _Optional[int] = ..., seq: _Optional[int] = ..., captured_ns: _Optional[int] = ..., odom_from_robot: _Optional[_Union[Pose2, _Mapping]] = ..., robot_from_laser: _Optional[_Union[Pose2, _Mapping]] = ..., first_bearing_rad: _Optional[float] = ..., bearing_step_rad: _Optional[float] = ..., max_range_m: _Optional[float] = ..., ranges_m: _Optional[_Iterable[float]] = ..., map: _Optional[str] = ...) -> None: ...

class RobotPose(_message.Message):
    __slots__ = ("epoch", "captured_ns", "map", "map_from_robot", "modalities", "corrections", "laser_corrections", "age_ms", "trust", "server")
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    CAPTURED_NS_FIELD_NUMBER: _ClassVar[int]
    MAP_FIELD_NUMBER: _ClassVar[int]
    MAP_FROM_ROBOT_FIELD_NUMBER: _ClassVar[int]
    MODALITIES_FIELD_NUMBER: _ClassVar[int]
    CORRECTIONS_FIELD_NUMBER: _ClassVar[int]
    LASER_CORRECTIONS_FIELD_NUMBER: _ClassVar[int]
    AGE_MS_FIELD_NUMBER: _ClassVar[int]
    TRUST_FIELD_NUMBER: _ClassVar[int]
    SERVER_FIELD_NUMBER: _ClassVar[int]
    epoch: int
    captured_ns: int
    map: str
    map_from_robot: Pose2Covariance
    modalities: _containers.RepeatedScalarFieldContainer[str]
    corrections: int
    laser_corrections: int
    age_ms: float
    trust: PoseTrust
    server: str
    def __init__(self, epoch: _Optional[int] = ..., captured_ns: _Optional[int] = ..., map: _Optional[str] = ..., map_from_robot: _Optional[_Union[Pose2Covariance, _Mapping]] = ..., modalities: _Optional[_Iterable[str]] = ..., corrections: _Optional[int] = ..., laser_corrections: _Optional[int] = ..., age_ms: _Optional[float] = ..., trust: _Optional[_Union[PoseTrust, str]] = ..., server: _Optional[str] = ...) -> None: ...

class MapChanged(_message.Message):
    __slots__ = ("map", "version", "server")
    MAP_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    SERVER_FIELD_NUMBER: _ClassVar[int]
    map: str
    version: int
    server: str
    def __init__(self, map: _Optional[str] = ..., version: _Optional[int] = ..., server: _Optional[str] = ...) -> None: ...

class GazeRequest(_message.Message):
    __slots__ = ("map_from_robot", "camera_x_m", "camera_y_m", "camera_z_m", "pan_rad", "tilt_rad", "rate_radps", "pan_range_rad", "tilt_range_rad", "criterion", "at_ns", "looked_at", "recognised", "map")
    MAP_FROM_ROBOT_FIELD_NUMBER: _ClassVar[int]
    CAMERA_X_M_FIELD_NUMBER: _ClassVar[int]
    CAMERA_Y_M_FIELD_NUMBER: _ClassVar[int]
    CAMERA_Z_M_FIELD_NUMBER: _ClassVar[int]
    PAN_RAD_FIELD_NUMBER: _ClassVar[int]
    TILT_RAD_FIELD_NUMBER: _ClassVar[int]
    RATE_RADPS_FIELD_NUMBER: _ClassVar[int]
    PAN_RANGE_RAD_FIELD_NUMBER: _ClassVar[int]
    TILT_RANGE_RAD_FIELD_NUMBER: _ClassVar[int]
    CRITERION_FIELD_NUMBER: _ClassVar[int]
    AT_NS_FIELD_NUMBER: _ClassVar[int]
    LOOKED_AT_FIELD_NUMBER: _ClassVar[int]
    RECOGNISED_FIELD_NUMBER: _ClassVar[int]
    MAP_FIELD_NUMBER: _ClassVar[int]
    map_from_robot: Pose2Covariance
    camera_x_m: float
    camera_y_m: float
    camera_z_m: float
    pan_rad: float
    tilt_rad: float
    rate_radps: float
    pan_range_rad: _containers.RepeatedScalarFieldContainer[float]
    tilt_range_rad: _containers.RepeatedScalarFieldContainer[float]
    criterion: GazeCriterion
    at_ns: int
    looked_at: str
    recognised: bool
    map: str
    def __init__(self, map_from_robot: _Optional[_Union[Pose2Covariance, _Mapping]] = ..., camera_x_m: _Optional[float] = ..., camera_y_m: _Optional[float] = ..., camera_z_m: _Optional[float] = ..., pan_rad: _Optional[float] = ..., tilt_rad: _Optional[float] = ..., rate_radps: _Optional[float] = ..., pan_range_rad: _Optional[_Iterable[float]] = ..., tilt_range_rad: _Optional[_Iterable[float]] = ..., criterion: _Optional[_Union[GazeCriterion, str]] = ..., at_ns: _Optional[int] = ..., looked_at: _Optional[str] = ..., recognised: bool = ..., map: _Optional[str] = ...) -> None: ...

class GazeAdvice(_message.Message):
    __slots__ = ("map", "map_version", "rejection", "action", "landmark", "pan_rad", "tilt_rad", "utility", "probability", "margin_m", "gain_nats", "range_m", "incidence_rad", "server")
    MAP_FIELD_NUMBER: _ClassVar[int]
    MAP_VERSION_FIELD_NUMBER: _ClassVar[int]
    REJECTION_FIELD_NUMBER: _ClassVar[int]
    ACTION_FIELD_NUMBER: _ClassVar[int]
    LANDMARK_FIELD_NUMBER: _ClassVar[int]
    PAN_RAD_FIELD_NUMBER: _ClassVar[int]
    TILT_RAD_FIELD_NUMBER: _ClassVar[int]
    UTILITY_FIELD_NUMBER: _ClassVar[int]
    PROBABILITY_FIELD_NUMBER: _ClassVar[int]
    MARGIN_M_FIELD_NUMBER: _ClassVar[int]
    GAIN_NATS_FIELD_NUMBER: _ClassVar[int]
    RANGE_M_FIELD_NUMBER: _ClassVar[int]
    INCIDENCE_RAD_FIELD_NUMBER: _ClassVar[int]
    SERVER_FIELD_NUMBER: _ClassVar[int]
    map: str
    map_version: int
    rejection: Rejection
    action: GazeAction
    landmark: str
    pan_rad: float
    tilt_rad: float
    utility: float
    probability: float
    margin_m: float
    gain_nats: float
    range_m: float
    incidence_rad: float
    server: str
    def __init__(self, map: _Optional[str] = ..., map_version: _Optional[int] = ..., rejection: _Optional[_Union[Rejection, _Mapping]] = ..., action: _Optional[_Union[GazeAction, str]] = ..., landmark: _Optional[str] = ..., pan_rad: _Optional[float] = ..., tilt_rad: _Optional[float] = ..., utility: _Optional[float] = ..., probability: _Optional[float] = ..., margin_m: _Optional[float] = ..., gain_nats: _Optional[float] = ..., range_m: _Optional[float] = ..., incidence_rad: _Optional[float] = ..., server: _Optional[str] = ...) -> None: ...

class LocaliseRequest(_message.Message):
    __slots__ = ("frame", "scan", "map", "deadline_ms")
    FRAME_FIELD_NUMBER: _ClassVar[int]
    SCAN_FIELD_NUMBER: _ClassVar[int]
    MAP_FIELD_NUMBER: _ClassVar[int]
    DEADLINE_MS_FIELD_NUMBER: _ClassVar[int]
    frame: Frame
    scan: Scan
    map: str
    deadline_ms: int
    def __init__(self, frame: _Optional[_Union[Frame, _Mapping]] = ..., scan: _Optional[_Union[Scan, _Mapping]] = ..., map: _Optional[str] = ..., deadline_ms: _Optional[int] = ...) -> None: ...

class LocaliseHypothesis(_message.Message):
    __slots__ = ("map_from_robot", "probability", "landmarks", "matched")
    MAP_FROM_ROBOT_FIELD_NUMBER: _ClassVar[int]
    PROBABILITY_FIELD_NUMBER: _ClassVar[int]
    LANDMARKS_FIELD_NUMBER: _ClassVar[int]
    MATCHED_FIELD_NUMBER: _ClassVar[int]
    map_from_robot: Pose2Covariance
    probability: float
    landmarks: _containers.RepeatedScalarFieldContainer[str]
    matched: float
    def __init__(self, map_from_robot: _Optional[_Union[Pose2Covariance, _Mapping]] = ..., probability: _Optional[float] = ..., landmarks: _Optional[_Iterable[str]] = ..., matched: _Optional[float] = ...) -> None: ...

class LocaliseReply(_message.Message):
    __slots__ = ("rejection", "map", "map_version", "status", "reason", "map_from_robot", "hypotheses", "answer", "server")
    REJECTION_FIELD_NUMBER: _ClassVar[int]
    MAP_FIELD_NUMBER: _ClassVar[int]
    MAP_VERSION_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    MAP_FROM_ROBOT_FIELD_NUMBER: _ClassVar[int]
    HYPOTHESES_FIELD_NUMBER: _ClassVar[int]
    ANSWER_FIELD_NUMBER: _ClassVar[int]
    SERVER_FIELD_NUMBER: _ClassVar[int]
    rejection: Rejection
    map: str
    map_version: int
    status: LocaliseStatus
    reason: str
    map_from_robot: Pose2Covariance
    hypotheses: _containers.RepeatedCompositeFieldContainer[LocaliseHypothesis]
    answer: Answer
    server: str
    def __init__(self, rejection: _Optional[_Union[Rejection, _Mapping]] = ..., map: _Optional[str] = ..., map_version: _Optional[int] = ..., status: _Optional[_Union[LocaliseStatus, str]] = ..., reason: _Optional[str] = ..., map_from_robot: _Optional[_Union[Pose2Covariance, _Mapping]] = ..., hypotheses: _Optional[_Iterable[_Union[LocaliseHypothesis, _Mapping]]] = ..., answer: _Optional[_Union[Answer, _Mapping]] = ..., server: _Optional[str] = ...) -> None: ...
