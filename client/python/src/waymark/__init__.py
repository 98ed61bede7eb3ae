"""Client of Waymark: landmarks and poses for robots, from their cameras.

`Robot` and `AsyncRobot` are the robot's side, over zenoh: frames or quads, odometry and scans go out, answers and
poses come in. `MapClient` and `AsyncMapClient` are the teacher's side, over HTTP, with a method for every operation of
the API.
`Image` takes files and NumPy or OpenCV arrays. `waymark.wire` has the messages, `waymark.api` the bodies of the API.
"""

from waymark import api, wire
from waymark._async.client import AsyncMapClient
from waymark._async.landmarks import AsyncJobEvents
from waymark._async.maps import AsyncLiveEvents
from waymark._http import Region, Revised
from waymark._link import Subscription
from waymark._session import Delivery
from waymark._sync.client import MapClient
from waymark._sync.landmarks import JobEvents
from waymark._sync.maps import LiveEvents
from waymark._values import UNSET
from waymark.api import CaptureMetadata, Job, Landmark, Map, Place, Size, WallBody
from waymark.async_robot import AsyncInbox, AsyncRobot
from waymark.errors import (
    CertificateExpired,
    InvalidInput,
    JobFailed,
    JobTimeout,
    NoAnswer,
    NotAdmitted,
    Refused,
    ServerGone,
    Superseded,
    TlsRefused,
    Unexpected,
    Unreachable,
    Untrusted,
    WaymarkError,
)
from waymark.image import Capture, Image
from waymark.named import NamedLandmark, named, named_landmarks, quad_corners
from waymark.quads import FoundQuad, Quads
from waymark.robot import Inbox, Robot
from waymark.robot_file import RobotFile
from waymark.wire import (
    Answer,
    CameraAnswer,
    Intrinsics,
    Pose2,
    Pose2Covariance,
    Pose3,
    QuadAnswer,
    RobotPose,
    Scan,
    ServerEvent,
)

__version__ = "0.1.0"

__all__ = [
    "UNSET",
    "Answer",
    "AsyncInbox",
    "AsyncJobEvents",
    "AsyncLiveEvents",
    "AsyncMapClient",
    "AsyncRobot",
    "CameraAnswer",
    "Capture",
    "CaptureMetadata",
    "CertificateExpired",
    "Delivery",
    "FoundQuad",
    "Image",
    "Inbox",
    "Intrinsics",
    "InvalidInput",
    "Job",
    "JobEvents",
    "JobFailed",
    "JobTimeout",
    "Landmark",
    "LiveEvents",
    "Map",
    "MapClient",
    "NamedLandmark",
    "NoAnswer",
    "NotAdmitted",
    "Place",
    "Pose2",
    "Pose2Covariance",
    "Pose3",
    "QuadAnswer",
    "Quads",
    "Refused",
    "Region",
    "Revised",
    "Robot",
    "RobotFile",
    "RobotPose",
    "Scan",
    "ServerEvent",
    "ServerGone",
    "Size",
    "Subscription",
    "Superseded",
    "TlsRefused",
    "Unexpected",
    "Unreachable",
    "Untrusted",
    "WallBody",
    "WaymarkError",
    "api",
    "named",
    "named_landmarks",
    "quad_corners",
    "wire",
]
