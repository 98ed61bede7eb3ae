"""Messages of frames, quads and localisations. In: captures. Out: bytes of protobuf; and replies as results."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from waymark._values import fill, from_message
from waymark.api import LocaliseHypothesisBody, LocaliseResult, LocaliseStatus
from waymark.errors import Refused
from waymark.image import Capture, Encoding, Image, Picture, as_image
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


# What a message has beside its pixels, in bytes: numbers of the camera, its place, a covariance, the name of a map.
HEAD_BYTES = 1024


@dataclass(frozen=True, slots=True)
class Sent:
    """What is about to be sent of one image. `withheld_bytes`: of an image that is left out, because with it the
    message would be larger than the server takes."""

    capture: Capture | Quads
    image: Image | None
    withheld_bytes: int = 0

    @property
    def pixel_bytes(self) -> int:
        """Bytes of its pixels."""
        if self.image is not None:
            return len(self.image.data)
        return sum(len(quad.patch.data) for quad in self.capture.quads) if isinstance(self.capture, Quads) else 0

    def withheld(self) -> Sent:
        """The same without pixels: the server refuses it by name."""
        return dataclasses.replace(self, withheld_bytes=self.pixel_bytes)


def prepared(frame: Capture | Quads | Picture) -> Sent:
    """A frame, or quads, with the image read."""
    if isinstance(frame, Quads):
        return Sent(frame, None)
    capture = frame if isinstance(frame, Capture) else Capture(frame)
    return Sent(capture, as_image(capture.image))


def frame_message(sent: Sent, epoch: int, seq: int, map: str = "") -> tuple[str, bytes]:
    """The part of the key, and the message of a frame or of quads; on `map` unless it names one."""
    if isinstance(sent.capture, Quads) and not sent.withheld_bytes:
        return "quads", _quads_bytes(sent.capture, epoch, seq, map)
    return "frame", frame_bytes(sent, epoch, seq, map)


def frame_bytes(sent: Sent, epoch: int, seq: int, map: str = "") -> bytes:
    """The `Frame` message of a frame. The image is copied once, into the message."""
    capture, image = sent.capture, sent.image
    message = pb.Frame(
        epoch=epoch,
        seq=seq,
        captured_ns=capture.captured_ns,
        deadline_ms=capture.deadline_ms,
        map=capture.map or map,
        withheld_bytes=sent.withheld_bytes,
    )
    for field in _OPTIONAL:
        value = getattr(capture, field)
        if value is not None:
            fill(getattr(message, field), value)
    if image is None:
        return message.SerializeToString()
    message.encoding = _ENCODINGS[image.encoding]
    message.width_px, message.height_px = image.width_px, image.height_px
    if sent.withheld_bytes:
        return message.SerializeToString()
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


def localise_request(sent: Sent | None, scan: Scan | None, map: str, wait_s: float) -> bytes:
    """The `LocaliseRequest` message."""
    request = pb.LocaliseRequest(map=map, deadline_ms=max(1, min(int(wait_s * 1000), 10_000)))
    if sent is not None:
        request.frame.ParseFromString(frame_bytes(sent, 0, 0))
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
