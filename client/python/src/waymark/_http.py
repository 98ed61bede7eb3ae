"""What both clients of the HTTP interface share: operations, paths, forms, refusals, events. Nothing here waits."""

from __future__ import annotations

import json
import math
import ssl
import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any, Generic, Literal, TypeAlias, TypeVar
from urllib.parse import quote

import httpx

from waymark._values import MismatchError, from_json, to_json
from waymark.api import (
    CaptureMetadata,
    Job,
    Size,
)
from waymark.errors import InvalidInput, JobFailed, Refused, Unexpected, Unreachable, Untrusted, WaymarkError
from waymark.image import Picture, as_image
from waymark.wire import Intrinsics, Pose3, Scan

T = TypeVar("T")

# Longest wait for one request, and longest silence of a stream, in seconds; the server sends something every 15 s.
TIMEOUT_S = 60.0
# Longest time a connection is kept without a request, in seconds: less than the 5 s after which the server closes it.
MAX_IDLE_S = 3.0
# Period of polling a job, in seconds.
JOB_POLL_S = 0.2

# The part of an uploaded picture that shows the landmark: the dominant quad, which the server detects; the whole
# picture; or its corners, top-left, top-right, bottom-right, bottom-left, in pixels.
Region: TypeAlias = Literal["detect", "whole_image"] | Sequence[Sequence[float]]

# Every operation of the API, by the name of the client's method: HTTP method, and path below /api/v1.
OPERATIONS: dict[str, tuple[str, str]] = {
    "cameras": ("GET", "/robots/{robot}/cameras"),
    "calibrate_camera": ("POST", "/robots/{robot}/cameras/{camera}/calibrate"),
    "camera_frame": ("GET", "/robots/{robot}/cameras/{camera}/frame"),
    "camera_answer": ("GET", "/robots/{robot}/cameras/{camera}/answer"),
    "start_gathering": ("POST", "/maps/{map}/gatherings"),
    "gatherings": ("GET", "/maps/{map}/gatherings"),
    "gathering": ("GET", "/maps/{map}/gatherings/{gathering}"),
    "stop_gathering": ("POST", "/maps/{map}/gatherings/{gathering}/stop"),
    "delete_gathering": ("DELETE", "/maps/{map}/gatherings/{gathering}"),
    "tracks": ("GET", "/maps/{map}/gatherings/{gathering}/tracks"),
    "discard_track": ("DELETE", "/maps/{map}/gatherings/{gathering}/tracks/{track}"),
    "track_icon": ("GET", "/maps/{map}/gatherings/{gathering}/tracks/{track}/views/{view}/icon"),
    "accept_tracks": ("POST", "/maps/{map}/gatherings/{gathering}/accept"),
    "begin_draft": ("POST", "/maps/{map}/drafts"),
    "drafts": ("GET", "/maps/{map}/drafts"),
    "discard_draft": ("DELETE", "/maps/{map}/drafts/{draft}"),
    "draft_difference": ("GET", "/maps/{map}/drafts/{draft}/difference"),
    "publish_draft": ("POST", "/maps/{map}/drafts/{draft}/publish"),
    "replay_draft": ("POST", "/maps/{map}/drafts/{draft}/replay"),
    "commits": ("GET", "/maps/{map}/commits"),
    "commit": ("GET", "/maps/{map}/commits/{commit}"),
    "difference": ("GET", "/maps/{map}/difference"),
    "roll_back": ("POST", "/maps/{map}/rollback"),
    "undo_commit": ("POST", "/maps/{map}/commits/{commit}/undo"),
    "health": ("GET", "/healthz"),
    "readiness": ("GET", "/readyz"),
    "servers": ("GET", "/servers"),
    "version": ("GET", "/version"),
    "metrics": ("GET", "/metrics"),
    "add_landmarks": ("POST", "/maps/{map}/bulk/create-landmarks"),
    "delete_landmarks": ("POST", "/maps/{map}/bulk/delete-landmarks"),
    "jobs": ("GET", "/jobs"),
    "add_landmark": ("POST", "/maps/{map}/landmarks"),
    "landmarks": ("GET", "/maps/{map}/landmarks"),
    "landmark": ("GET", "/maps/{map}/landmarks/{landmark}"),
    "update_landmark": ("PATCH", "/maps/{map}/landmarks/{landmark}"),
    "merge_landmarks": ("POST", "/maps/{map}/landmarks/{landmark}/merge"),
    "delete_landmark": ("DELETE", "/maps/{map}/landmarks/{landmark}"),
    "visibility_area": ("GET", "/maps/{map}/landmarks/{landmark}/visibility"),
    "stored_answers": ("GET", "/answers"),
    "stored_answer": ("GET", "/answers/{answer}"),
    "stored_quad_icon": ("GET", "/answers/{answer}/quads/{quad}/icon"),
    "landmark_model": ("GET", "/maps/{map}/landmarks/{landmark}/model"),
    "landmark_distances": ("GET", "/maps/{map}/landmarks/{landmark}/distances"),
    "landmark_evidence": ("GET", "/maps/{map}/landmarks/{landmark}/evidence"),
    "landmark_icon": ("GET", "/maps/{map}/landmarks/{landmark}/icon"),
    "duplicates": ("GET", "/maps/{map}/duplicates"),
    "localise": ("POST", "/maps/{map}/localise"),
    "learn": ("POST", "/maps/{map}/learn"),
    "learn_landmark": ("POST", "/maps/{map}/landmarks/{landmark}/learn"),
    "job": ("GET", "/jobs/{job}"),
    "cancel_job": ("DELETE", "/jobs/{job}"),
    "job_events": ("GET", "/jobs/{job}/events"),
    "events": ("GET", "/events"),
    "live_events": ("GET", "/maps/{map}/live"),
    "start_mapping": ("POST", "/maps/{map}/mapping"),
    "mapping": ("GET", "/maps/{map}/mapping"),
    "cancel_mapping": ("DELETE", "/maps/{map}/mapping"),
    "finish_mapping": ("POST", "/maps/{map}/mapping/finish"),
    "create_map": ("POST", "/maps"),
    "copy_map": ("POST", "/maps/{map}/copies"),
    "save_map": ("GET", "/maps/{map}/bundle"),
    "load_map": ("POST", "/bundles"),
    "maps": ("GET", "/maps"),
    "map": ("GET", "/maps/{map}"),
    "locate_map": ("PATCH", "/maps/{map}"),
    "delete_map": ("DELETE", "/maps/{map}"),
    "transform": ("GET", "/maps/{map}/transform"),
    "site_topology": ("GET", "/sites/{site}/topology"),
    "modalities": ("GET", "/maps/{map}/modalities"),
    "set_modalities": ("PUT", "/maps/{map}/modalities"),
    "modalities_at": ("GET", "/maps/{map}/modalities/at"),
    "recognise": ("POST", "/maps/{map}/recognise"),
    "start_recording": ("POST", "/robots/{robot}/recording"),
    "recording": ("GET", "/robots/{robot}/recording"),
    "cancel_recording": ("DELETE", "/robots/{robot}/recording"),
    "finish_recording": ("POST", "/robots/{robot}/recording/reference"),
    "reference_runs": ("GET", "/maps/{map}/reference-runs"),
    "delete_reference_run": ("DELETE", "/maps/{map}/reference-runs/{run}"),
    "put_robot": ("PUT", "/robots/{robot}"),
    "robots": ("GET", "/robots"),
    "robot": ("GET", "/robots/{robot}"),
    "set_robot_pose": ("PUT", "/robots/{robot}/pose"),
    "unknown_robots": ("GET", "/unknown-robots"),
    "delete_robot": ("DELETE", "/robots/{robot}"),
    "corrections": ("GET", "/robots/{robot}/corrections"),
    "relocalisation": ("GET", "/robots/{robot}/relocalisation"),
    "ros2_status": ("GET", "/robots/{robot}/ros2"),
    "trajectories": ("GET", "/robots/{robot}/trajectories"),
    "enrol_robot": ("POST", "/robots/{robot}/certificates"),
    "robot_certificates": ("GET", "/robots/{robot}/certificates"),
    "revoke_robot_certificate": ("DELETE", "/robots/{robot}/certificates/{serial}"),
    "create_token": ("POST", "/tokens"),
    "tokens": ("GET", "/tokens"),
    "revoke_token": ("DELETE", "/tokens/{token}"),
    "whoami": ("GET", "/whoami"),
    "audit": ("GET", "/audit"),
    "check_audit": ("GET", "/audit/check"),
    "page_link": ("POST", "/session/links"),
    "set_underlay": ("PUT", "/maps/{map}/underlay"),
    "underlay": ("GET", "/maps/{map}/underlay"),
    "underlay_image": ("GET", "/maps/{map}/underlay/image"),
    "delete_underlay": ("DELETE", "/maps/{map}/underlay"),
    "upload_view": ("POST", "/maps/{map}/landmarks/{landmark}/views"),
    "views": ("GET", "/maps/{map}/landmarks/{landmark}/views"),
    "delete_view": ("DELETE", "/maps/{map}/landmarks/{landmark}/views/{view}"),
    "view_icon": ("GET", "/maps/{map}/landmarks/{landmark}/views/{view}/icon"),
    "refused_views": ("GET", "/maps/{map}/landmarks/{landmark}/refused-views"),
    "refused_view_icon": ("GET", "/maps/{map}/landmarks/{landmark}/refused-views/{refused}/icon"),
    "make_backup": ("POST", "/backups"),
    "backups": ("GET", "/backups"),
    "backup": ("GET", "/backups/{backup}"),
    "backup_file": ("GET", "/backups/{backup}/file"),
    "delete_backup": ("DELETE", "/backups/{backup}"),
    "view_image": ("GET", "/maps/{map}/landmarks/{landmark}/views/{view}/image"),
    "visible": ("POST", "/maps/{map}/visible"),
    "coverage": ("POST", "/maps/{map}/coverage"),
    "gaze_ranking": ("POST", "/maps/{map}/gaze"),
    "visibility_settings": ("GET", "/maps/{map}/visibility-settings"),
    "set_visibility_settings": ("PUT", "/maps/{map}/visibility-settings"),
    "read_wall_file": ("POST", "/maps/{map}/walls/read"),
    "set_walls": ("PUT", "/maps/{map}/walls"),
    "walls": ("GET", "/maps/{map}/walls"),
}

# Operations that create. Each is sent with a fresh key, and once more with the same key where its answer was lost.
CREATIONS = frozenset(
    {
        "create_map",
        "copy_map",
        "load_map",
        "begin_draft",
        "add_landmark",
        "add_landmarks",
        "upload_view",
        "learn",
        "learn_landmark",
        "start_gathering",
        "accept_tracks",
        "finish_recording",
        "enrol_robot",
    }
)
# Changes of what has a revision. Each says which one it is meant for.
CHANGES = frozenset(
    {
        "locate_map",
        "delete_map",
        "set_walls",
        "set_underlay",
        "delete_underlay",
        "set_visibility_settings",
        "set_modalities",
        "update_landmark",
        "delete_landmark",
        "merge_landmarks",
        "roll_back",
        "undo_commit",
        "publish_draft",
    }
)
# Pause before a repeat, where the server says none, and the longest, in seconds.
PAUSE_S = 0.25
MAX_PAUSE_S = 5.0
# First pause before a stream is connected again; it doubles with each that fails, in seconds.
FIRST_PAUSE_S = 0.25


def request_of(call: str, at: Sequence[str | int]) -> tuple[str, str]:
    """HTTP method and path of an operation, with these values for the parameters of its path, in order."""
    method, path = OPERATIONS[call]
    values = iter(at)
    made = "/api/v1"
    for segment in path.split("/")[1:]:
        if segment.startswith("{"):
            text = str(next(values))
            # Not a segment of a path, or one that URLs take for another path.
            if text in ("", ".", ".."):
                raise InvalidInput(f"{segment[1:-1]} {text!r} is no name", code="bad_name", field=segment[1:-1])
            segment = quote(text, safe="")
        made += f"/{segment}"
    return method, made


def headers_of(call: str, key: str | None, revision: str | None, why: str | None) -> dict[str, str]:
    """The headers of an operation: a key for a creation, a fresh one unless it is given; for a change of what has a
    revision, the one it is meant for; and the reason of a change."""
    headers = {}
    if why is not None and OPERATIONS[call][0] != "GET":
        headers["waymark-why"] = quote(why, safe="")
    if call in CREATIONS:
        headers["idempotency-key"] = key if key is not None else uuid.uuid4().hex
    if call == "load_map":
        headers["content-type"] = "application/zip"
    if call in CHANGES:
        headers["if-match"] = "*" if revision is None else f'"{revision}"'
    return headers


@dataclass(frozen=True, slots=True)
class Revised(Generic[T]):
    """What was read, with its revision for `if_match`: another one after every edit or lesson, the same after what
    robots do by themselves."""

    value: T
    revision: str


def revision_of(response: httpx.Response) -> str:
    """The revision of what was read."""
    tag = response.headers.get("etag", "").split('"')
    if len(tag) != 3:
        raise Unexpected(f"{response.url}: no revision in ETag")
    return str(tag[1])


def pause_of(call: str, answer: httpx.Response | httpx.HTTPError) -> float | None:
    """How long to wait before a creation is repeated with its key; `None` if the answer is final."""
    if call not in CREATIONS:
        return None
    if isinstance(answer, httpx.Response):
        if answer.status_code not in (408, 503):
            return None
        seconds = answer.headers.get("retry-after", "")
        return min(float(seconds), MAX_PAUSE_S) if seconds.isdigit() else PAUSE_S
    is_final = isinstance(answer, httpx.TimeoutException | httpx.ConnectError | httpx.UnsupportedProtocol)
    return None if is_final else PAUSE_S


def query_of(query: dict[str, Any]) -> dict[str, str]:
    """A query as it is sent; what is `None` is left out."""
    words = {True: "true", False: "false"}
    return {name: words.get(value, str(value)) for name, value in query.items() if value is not None}


def refusal(response: httpx.Response, reason: str = "") -> Refused:
    """What an answer of an error says. `reason` is added to its sentence."""
    try:
        problem = response.json()
    except ValueError:
        problem = {}
    if not isinstance(problem, dict):
        problem = {}
    known = {"type", "title", "status", "code", "field", "detail"}
    return Refused(
        (problem.get("detail") or f"status {response.status_code} from {response.url}") + reason,
        code=problem.get("code") or "unknown",
        field=problem.get("field") or "",
        status=response.status_code,
        more={name: value for name, value in problem.items() if name not in known},
    )


def trusted(base: str, authority: str | PathLike[str] | None) -> ssl.SSLContext | bool:
    """Whom a client believes."""
    if authority is None and not base.lower().startswith("https:"):
        return True
    try:
        return ssl.create_default_context(cafile=authority)
    except (OSError, ssl.SSLError) as error:
        raise InvalidInput(f"{authority} is no certificate in PEM: {error}", field="authority") from error


def unreachable(base: str, error: httpx.HTTPError) -> Unreachable | Untrusted:
    """No answer from the server."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, ssl.SSLCertVerificationError):
            return Untrusted(f"the certificate of {base} is not trusted: {cause.verify_message}")
        cause = cause.__cause__ or cause.__context__
    return Unreachable(f"no answer from {base}: {error or type(error).__name__}")


def parsed(kind: Any, response: httpx.Response) -> Any:
    """The body of an answer."""
    try:
        return from_json(kind, response.json())
    except (MismatchError, ValueError) as error:
        raise Unexpected(f"{response.url} answered something unexpected ({error})") from error


def parsed_items(kind: Any, items: Sequence[Any], response: httpx.Response) -> list[Any]:
    """The items of a page."""
    try:
        return [from_json(kind, item) for item in items]
    except MismatchError as error:
        raise Unexpected(f"{response.url} answered something unexpected ({error})") from error


def view_form(
    region: Region,
    capture: CaptureMetadata | None,
    keep_near_duplicate: bool,
    make_landmark: bool,
    size: Size | None,
) -> dict[str, str]:
    """The parts of an upload besides the picture."""
    form: dict[str, str] = {}
    if region == "whole_image":
        form["whole_image"] = "true"
    elif region != "detect":
        form["corners"] = json.dumps([[float(x) for x in corner] for corner in region])
    if capture is not None:
        form["capture"] = json.dumps(to_json(capture))
    if keep_near_duplicate:
        form["keep_near_duplicate"] = "true"
    if make_landmark:
        form["create"] = "true"
    if size is not None:
        form |= {"width_m": repr(float(size.width_m)), "height_m": repr(float(size.height_m))}
    return form


def picture_part(picture: Picture) -> dict[str, tuple[str, bytes]]:
    """A picture as a part of a form: raw pixels go as PNG."""
    return {"image": ("image", bytes(as_image(picture).png().data))}


def localise_parts(
    image: Picture | None, intrinsics: Intrinsics | None, mounting: Pose3 | None, scan: Scan | None
) -> dict[str, Any]:
    """The parts of a localisation."""
    texts: dict[str, Any] = {}
    if intrinsics is not None:
        texts["intrinsics"] = to_json(intrinsics)
    if mounting is not None:
        texts["mounting"] = to_json(mounting)
    if scan is not None:
        ranges = [float(each) if math.isfinite(each) else None for each in scan.ranges_m]
        texts["scan"] = {
            "robot_from_laser": to_json(scan.robot_from_laser),
            "first_bearing_rad": scan.first_bearing_rad,
            "bearing_step_rad": scan.bearing_step_rad,
            "max_range_m": scan.max_range_m,
            "ranges_m": ranges,
        }
    # A part without a name of a file, so that a form without a picture is one, too.
    files: dict[str, Any] = {name: (None, json.dumps(value)) for name, value in texts.items()}
    return {"files": files | (picture_part(image) if image is not None else {})}


def is_passing(error: WaymarkError) -> bool:
    """Whether another connection is worth a try."""
    return isinstance(error, Unreachable) or (isinstance(error, Refused) and error.status in (408, 503))


def job_ended(job: Job) -> bool:
    """Whether it is done; raises if it ended without success."""
    if job.state in ("failed", "cancelled"):
        raise JobFailed(f"job {job.id} {job.state}: {job.message}", code=f"job_{job.state}")
    return job.state == "done"
