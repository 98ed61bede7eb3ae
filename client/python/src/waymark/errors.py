"""Errors. Each has a stable code, the field at fault, a sentence, and an advice what to do next."""

from __future__ import annotations

import re
from typing import Any

# By code: what to do next, in the words of this package.
ADVICE: dict[str, str] = {
    "bad_name": "lower-case letters, digits, - and _ only, at most 64",
    "exists": "take another name, or work on the one that is there",
    "in_use": "give its robots another map (`MapClient.put_robot`), or delete them, first",
    "unknown_map": "`MapClient.maps` lists those that there are, `create_map` makes one",
    "unknown_landmark": "`MapClient.landmarks` lists those that there are, `add_landmark` makes one",
    "unknown_robot": "`MapClient.put_robot(robot, map)` makes it known",
    "unknown_token": "`MapClient.tokens` lists those that there are",
    "unauthenticated": "give `MapClient` a `token`; on the server's own machine none is needed",
    "forbidden": "a token of a greater role is needed, or one for all maps",
    "no_views": "upload a photograph first: `MapClient.upload_view`",
    "quad_not_found": 'give `region=corners`, or `region="whole_image"` if the picture shows the landmark alone',
    "quad_ambiguous": 'crop the picture, or give one of `error.more["quads"]` as `region`',
    "size_differs": "measure again; `MapClient.update_landmark(..., size=...)` sets another size",
    "epoch_conflict": "another program uses this robot's name: stop one of them",
    "clock_ahead": "stamp all messages of a robot by one clock, at capture",
    "clock_behind": "stamp all messages of a robot by one clock, at capture",
    "too_large": "send a JPEG (`Image.jpeg`), or raise the server's `limits.frame_bytes`",
    "rate_limited": "send less often, or raise the server's limits",
    "overloaded": "send smaller frames, less often",
    "too_many": "stop a robot or a camera that is not needed, or raise the server's limits",
    "unreachable": "is `waymark serve` running, is this its endpoint?",
    "untrusted": "give `MapClient` the `authority` that signs it, and a name that is in it",
    "tls_refused": "enrol the robot again (waymark robot enrol), and name the server by one of its tls.names",
    "certificate_expired": "enrol the robot again: waymark robot enrol",
    "not_admitted": "it was revoked, is another robot's, or the robot was removed: see waymark robot certificates",
    "no_answer": "the frame or its answer was dropped, or the work takes longer: send again, or give a longer `wait_s`",
    "server_gone": "is it running, and has it a connection to the router? `Robot.server_events` tells when it is back",
    "map_contested": "several servers have the map: delete or rename it on all but one",
    "robot_contested": "several servers have the robot: `Robot.enter_map`, or remove it from all but one",
    "superseded": "send the next frame of a camera when the last is answered",
    "bad_image": "send a JPEG, a PNG, `uint8` pixels or a picture of Pillow",
    "size_mismatch": "give the size of the pixels, or of the pictures that the camera was calibrated with",
    "bad_camera_file": "`waymark camera calibrate --json` writes one, and so does ROS' camera_calibration (ost.yaml)",
    "no_yaml": "pip install 'waymark-client[yaml]', or give the numbers: `Intrinsics(fx_px, fy_px, cx_px, cy_px)`",
    "no_encoder": "pip install 'waymark-client[jpeg]', or send the raw image",
    "unexpected": "are client and server of the same version?",
    "timeout": "the server is busy; ask again",
    "busy": "the server is busy; ask again",
    "changed_meanwhile": "read it again, and change that (`MapClient.if_match`)",
    "in_progress": "the same creation is at work; ask again when it has ended",
}


class WaymarkError(Exception):
    """A failure. Its text is the code, the field at fault, the sentence, and the advice.

    `code` is stable and for programs; `field` names the input at fault, or is empty; `detail` is a sentence for a
    person; `status` is that of HTTP, or 0; `more` is what the server says beside, by code, such as the `quads` that
    were found.
    """

    default_code = "error"

    def __init__(
        self,
        detail: str,
        *,
        code: str = "",
        field: str = "",
        status: int = 0,
        more: dict[str, Any] | None = None,
    ) -> None:
        self.code = code or self.default_code
        self.field = field
        self.detail = detail
        self.status = status
        self.more: dict[str, Any] = more or {}
        super().__init__(detail)

    @property
    def advice(self) -> str:
        """What to do next; empty where nothing general can be said."""
        return ADVICE.get(self.code, "")

    def __str__(self) -> str:
        is_named = re.search(rf"(?<!\w){re.escape(self.field)}(?!\w)", self.detail) is not None
        where = f"{self.field}: " if self.field and not is_named else ""
        advice = f" ({self.advice})" if self.advice else ""
        return f"{self.code}: {where}{self.detail}{advice}"


class InvalidInput(WaymarkError, ValueError):
    """An argument that cannot be: a name, a picture, a number of bytes. Nothing was sent."""

    default_code = "invalid_value"


class Unreachable(WaymarkError):
    """No server there, or the connection broke."""

    default_code = "unreachable"


class Untrusted(WaymarkError):
    """The server's certificate is not signed by whom this client believes, or not for this name."""

    default_code = "untrusted"


class TlsRefused(Unreachable):
    """Something listens there, and there is no encrypted session: the robot's certificate is not valid at the server,
    or the server's own is not signed by the authority in the robot's file, or is for another name."""

    default_code = "tls_refused"


class CertificateExpired(WaymarkError):
    """The robot's certificate has ended."""

    default_code = "certificate_expired"


class NotAdmitted(WaymarkError):
    """The server takes nothing of this robot with this certificate: it is another robot's, or was revoked."""

    default_code = "not_admitted"


class NoAnswer(WaymarkError):
    """No answer to a frame or a question in time."""

    default_code = "no_answer"


class ServerGone(WaymarkError):
    """The server of the robot's map is gone: nobody answers until it is back."""

    default_code = "server_gone"


class Superseded(WaymarkError):
    """A newer frame of the same camera replaced this one."""

    default_code = "superseded"


class Refused(WaymarkError):
    """The server refused, and said why."""

    default_code = "refused"


class Unexpected(WaymarkError):
    """The answer does not fit this version of the package."""

    default_code = "unexpected"


class JobFailed(WaymarkError):
    """A job ended without success: `job_failed` or `job_cancelled`."""

    default_code = "job_failed"


class JobTimeout(WaymarkError):
    """A job did not end in time; it goes on at the server."""

    default_code = "job_timeout"
