"""Messages of frames, quads and localisations. In: captures. Out: bytes of protobuf; and replies as results."""

from __future__ import annotations

from waymark._values import fill, from_message
from waymark.api.localise import LocaliseHypothesisBody, LocaliseResult, LocaliseStatus
from waymark.errors import Refused
from waymark.image import Capture, Encoding, Picture, as_image
from waymark.quads import FoundQuad, Quads
from waymark.v1 import waymark_pb2 as pb
from waymark.wire import Answer, Point, Pose2Covariance, Scan

_ENCODINGS: dict[Encoding, pb.ImageEncoding] = {
    "jpeg": pb.IMAGE_ENCODING_JPEG,
    "png": pb.IMAGE_ENCODING_PNG,
    "gray8": pb.IMAGE_ENCODING_GRAY8,
    "rgb8": pb.IMAGE_ENCODING_RGB8,
    "bgr8": pb.IMAGE_ENCODING_BGR8,
}
_STATUS: dict[int, LocaliseStatus] = {
    pb.LOCALISE_STATUS_LOCATED: "located",
    pb.LOCALISE_STATUS_AMBIGUOUS: "ambiguous",
}
# Fields of a capture that may be absent.
_OPTIONAL = ("intrinsics", "robot_from_camera", "odometry", "prior")


def frame_message(frame: Capture | Quads | Picture, epoch: int, seq: int, map: str = "") -> tuple[str, bytes]:
    """The part of the key, and the message of a frame or of quads; on `map` unless it names one."""
    if isinstance(frame, Quads):
        return "quads", _quads_bytes(frame, epoch, seq, map)
    return "frame", frame_bytes(frame, epoch, seq, map)


def frame_bytes(frame: Capture | Picture, epoch: int, seq: int, map: str = "") -> bytes:
    """The `Frame` message of a frame. The image is copied once, into the message."""
    capture = frame if isinstance(frame, Capture) else Capture(as_image(frame))
    image = capture.image
    message = pb.Frame(
        epoch=epoch,
        seq=seq,
        captured_ns=capture.captured_ns,
        encoding=_ENCODINGS[image.encoding],
        width_px=image.width_px,
        height_px=image.height_px,
        deadline_ms=capture.deadline_ms,
        map=capture.map or map,
    )
    for field in _OPTIONAL:
        value = getattr(capture, field)
        if value is not None:
            fill(getattr(message, field), value)
    # Fields of a message may come in any order: `image` is appended, so that it need not go through the message.
    tag = pb.Frame.IMAGE_FIELD_NUMBER << 3 | 2
    return b"".join((message.SerializeToString(), bytes([tag]), _varint(len(image.data)), image.data))


def _varint(number: int) -> bytes:
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    out.append(number)
    return bytes(out)


def _quads_bytes(quads: Quads, epoch: int, seq: int, map: str) -> bytes:
    message = pb.Quads(
        epoch=epoch,
        seq=seq,
        captured_ns=quads.captured_ns,
        width_px=quads.width_px,
        height_px=quads.height_px,
        quads=[_found_quad(quad) for quad in quads.quads],
        deadline_ms=quads.deadline_ms,
        map=quads.map or map,
    )
    for field in _OPTIONAL:
        value = getattr(quads, field)
        if value is not None:
            fill(getattr(message, field), value)
    return message.SerializeToString()


def _border(corners: tuple[Point, ...]) -> pb.Border:
    return pb.Border(corners=[pb.Point(u_px=corner.u_px, v_px=corner.v_px) for corner in corners])


def _found_quad(quad: FoundQuad) -> pb.FoundQuad:
    patch = pb.Patch(
        left_px=quad.left_px,
        top_px=quad.top_px,
        width_px=quad.patch.width_px,
        height_px=quad.patch.height_px,
        encoding=_ENCODINGS[quad.patch.encoding],
        image=bytes(quad.patch.data),
    )
    return pb.FoundQuad(
        border=_border(quad.corners),
        corner_covariance_px2=quad.corner_covariance_px2,
        alternates=[_border(corners) for corners in quad.alternates],
        score=quad.score,
        upright_ambiguous=quad.upright_ambiguous,
        patch=patch,
    )


def localise_request(frame: Capture | Picture | None, scan: Scan | None, map: str, wait_s: float) -> bytes:
    """The `LocaliseRequest` message."""
    request = pb.LocaliseRequest(map=map, deadline_ms=max(1, min(int(wait_s * 1000), 10_000)))
    if frame is not None:
        request.frame.ParseFromString(frame_bytes(frame, 0, 0))
    if scan is not None:
        fill(request.scan, scan)
    return request.SerializeToString()


def localise_result(reply: pb.LocaliseReply) -> LocaliseResult:
    """What a reply states; raises `Refused` with the code and the field of a refusal."""
    if reply.HasField("rejection"):
        refusal = reply.rejection
        raise Refused(refusal.detail, code=refusal.code, field=refusal.field)
    return LocaliseResult(
        map=reply.map,
        map_version=reply.map_version,
        status=_STATUS.get(reply.status, "no_match"),
        hypotheses=tuple(from_message(LocaliseHypothesisBody, each) for each in reply.hypotheses),
        reason=reply.reason or None,
        map_from_robot=from_message(Pose2Covariance, reply.map_from_robot)
        if reply.HasField("map_from_robot")
        else None,
        answer=from_message(Answer, reply.answer) if reply.HasField("answer") else None,
    )
