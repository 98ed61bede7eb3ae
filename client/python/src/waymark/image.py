"""Pictures and frames. In: files, encoded bytes, raw pixels (NumPy and OpenCV arrays or bytes), pictures of Pillow.
Out: what is sent.

Arrays are taken by the buffer protocol, and pictures of Pillow by their methods: neither is needed to send bytes. Raw
pixels are copied once, when they are sent.
"""

from __future__ import annotations

import importlib
import struct
import time
import zlib
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias, runtime_checkable

from waymark.errors import InvalidInput
from waymark.wire import Intrinsics, Pose2, Pose2Covariance, Pose3

if TYPE_CHECKING:
    from typing_extensions import Buffer


class PixelArray(Protocol):
    """An array of NumPy or of OpenCV: what has its shape and its bytes, and shows them by the buffer protocol."""

    @property
    def shape(self) -> tuple[int, ...]: ...

    def tobytes(self) -> bytes: ...


Pixels: TypeAlias = "Buffer | PixelArray | PillowPicture"


@runtime_checkable
class PillowPicture(Protocol):
    """A picture of Pillow (`PIL.Image.Image`), by what is used of it."""

    @property
    def mode(self) -> str: ...

    @property
    def size(self) -> tuple[int, int]: ...

    def convert(self, mode: Any) -> Any: ...

    def getexif(self) -> Any: ...

    def tobytes(self) -> bytes: ...


Encoding = Literal["jpeg", "png", "gray8", "rgb8", "bgr8"]

# Bytes of a pixel by raw encoding.
_BYTES_PER_PX = {"gray8": 1, "rgb8": 3, "bgr8": 3}
# EXIF: the tag of the orientation, and by its value the `Transpose` of Pillow that turns the picture upright.
_EXIF_ORIENTATION = 0x0112
_UPRIGHT = {2: 0, 3: 3, 4: 1, 5: 5, 6: 4, 7: 6, 8: 2}
# Modes of Pillow with more than 8 bits a pixel: which of them are used is not known.
_WIDE_MODES = ("I", "F")
# OpenCV's flag for the quality of a JPEG.
_IMWRITE_JPEG_QUALITY = 1


@dataclass(frozen=True, slots=True)
class Image:
    """One picture with its encoding and size. Made by `encoded`, `file`, `gray`, `rgb`, `bgr` or `pillow`."""

    encoding: Encoding
    width_px: int
    height_px: int
    data: bytes | memoryview = field(repr=False)

    @classmethod
    def encoded(cls, data: Buffer) -> Image:
        """A JPEG or PNG file in memory; its size is read from its header."""
        held = bytes(data)
        if held.startswith(b"\x89PNG\r\n\x1a\n") and held[12:16] == b"IHDR" and len(held) >= 24:
            width, height = struct.unpack_from(">II", held, 16)
            return cls("png", width, height, held)
        size = _jpeg_size(held)
        if size is None:
            raise InvalidInput(
                f"neither a JPEG nor a PNG image, or a damaged header: it begins with {held[:8].hex(' ') or 'nothing'}",
                code="bad_image",
                field="image",
            )
        return cls("jpeg", *size, held)

    @classmethod
    def file(cls, path: str | PathLike[str]) -> Image:
        """A JPEG or PNG file."""
        return cls.encoded(Path(path).read_bytes())

    @classmethod
    def pillow(cls, picture: PillowPicture) -> Image:
        """A picture of Pillow, as raw pixels: grey ones as `gray8`, all others as `rgb8`. It is turned upright by its
        EXIF, as a file is; what is transparent is white. More than 8 bits a pixel are refused."""
        if picture.mode.split(";")[0] in _WIDE_MODES:
            raise InvalidInput(
                f"a picture of mode {picture.mode}: which of its bits are used is not known; scale it to 8 bits first",
                code="bad_image",
                field="image",
            )
        upright: Any = picture
        turn = _UPRIGHT.get(picture.getexif().get(_EXIF_ORIENTATION, 1))
        if turn is not None:
            upright = upright.transpose(turn)
        if "A" in upright.mode or "a" in upright.mode or "transparency" in getattr(upright, "info", {}):
            upright = _on_white(upright.convert("RGBA"))
        is_gray = upright.mode in ("L", "1")
        upright = upright.convert("L" if is_gray else "RGB")
        width_px, height_px = upright.size
        return cls("gray8" if is_gray else "rgb8", width_px, height_px, upright.tobytes())

    @classmethod
    def gray(cls, pixels: Pixels, size_px: tuple[int, int] | None = None) -> Image:
        """Grey pixels (`mono8`): an H x W array of bytes, or bytes with their width and height."""
        return cls._raw("gray8", pixels, size_px)

    @classmethod
    def rgb(cls, pixels: Pixels, size_px: tuple[int, int] | None = None) -> Image:
        """Red, green, blue (`rgb8`, Pillow): an H x W x 3 array of bytes, or bytes with their width and height."""
        return cls._raw("rgb8", pixels, size_px)

    @classmethod
    def bgr(cls, pixels: Pixels, size_px: tuple[int, int] | None = None) -> Image:
        """Blue, green, red (`bgr8`, OpenCV): an H x W x 3 array of bytes, or bytes with their width and height."""
        return cls._raw("bgr8", pixels, size_px)

    @classmethod
    def _raw(cls, encoding: Encoding, pixels: Pixels, size_px: tuple[int, int] | None) -> Image:
        each = _BYTES_PER_PX[encoding]
        array: Any = pixels
        if isinstance(array, PillowPicture):
            # It says itself which colours it has.
            picture = cls.pillow(array if each > 1 else array.convert("L"))
            return picture if each == 1 or picture.encoding == "rgb8" else cls.pillow(array.convert("RGB"))
        try:
            view = memoryview(array)
        except TypeError:
            raise InvalidInput(
                f"{type(array).__name__} has no pixels: bytes, an array or a picture of Pillow is expected",
                code="bad_image",
                field="image",
            ) from None
        if view.format != "B":
            raise InvalidInput(
                f"pixels of format {view.format!r}: uint8 is expected (in NumPy: `.astype(numpy.uint8)`)",
                code="bad_image",
                field="image",
            )
        if size_px is None:
            shape = view.shape or ()
            expected = "H x W" if each == 1 else f"H x W x {each}"
            if len(shape) != (2 if each == 1 else 3) or (each > 1 and shape[2] != each) or 0 in shape:
                raise InvalidInput(
                    f"an array of shape {shape}: {expected} is expected for {encoding}; bytes need `size_px`",
                    code="bad_image",
                    field="image",
                )
            width, height = shape[1], shape[0]
        else:
            width, height = size_px
        if width < 1 or height < 1 or view.nbytes != each * width * height:
            raise InvalidInput(
                f"{view.nbytes} bytes of pixels, {each * width * height} expected for {width} x {height} px {encoding}",
                code="size_mismatch",
                field="image",
            )
        # Rows with padding, slices and mirrored arrays are packed; whole arrays are not copied.
        data = view.cast("B") if view.c_contiguous else _packed(pixels)
        return cls(encoding, width, height, data)

    @property
    def is_raw(self) -> bool:
        """Whether it is uncompressed."""
        return self.encoding in _BYTES_PER_PX

    def png(self) -> Image:
        """The same picture as PNG; an encoded one stays as it is."""
        if not self.is_raw:
            return self
        each = _BYTES_PER_PX[self.encoding]
        data = bytearray(self.data)
        if self.encoding == "bgr8":
            data[0::3], data[2::3] = data[2::3], data[0::3]
        row = each * self.width_px
        # Each row begins with the number of its filter: none.
        lines = b"".join(b"\0" + data[at : at + row] for at in range(0, len(data), row))
        header = struct.pack(">IIBBBBB", self.width_px, self.height_px, 8, 0 if each == 1 else 2, 0, 0, 0)
        chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(lines, 1)), (b"IEND", b""))
        out = b"\x89PNG\r\n\x1a\n" + b"".join(
            struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
            for kind, body in chunks
        )
        return Image("png", self.width_px, self.height_px, out)

    def jpeg(self, quality: int = 85) -> Image:
        """The same picture as JPEG, by OpenCV or Pillow, whichever is installed; an encoded one stays as it is."""
        if not self.is_raw:
            return self
        data = _jpeg_by_opencv(self, quality) or _jpeg_by_pillow(self, quality)
        return Image("jpeg", self.width_px, self.height_px, data)


Picture: TypeAlias = "Image | PillowPicture | bytes | bytearray | memoryview | str | PathLike[str]"


def as_image(picture: Picture) -> Image:
    """An image, a picture of Pillow, the bytes of a JPEG or PNG file, or the path of one."""
    if isinstance(picture, Image):
        return picture
    if isinstance(picture, bytes | bytearray | memoryview):
        return Image.encoded(picture)
    if isinstance(picture, str | PathLike):
        return Image.file(picture)
    if isinstance(picture, PillowPicture):
        return Image.pillow(picture)
    raise InvalidInput(
        f"{type(picture).__name__} does not say which colours it has: `Image.bgr` takes arrays of OpenCV, `Image.rgb` "
        "and `Image.gray` others",
        code="bad_image",
        field="image",
    )


@dataclass(frozen=True, slots=True)
class Capture:
    """One frame with its capture data. Every part but the image may be left out.

    Without `intrinsics` there is recognition and no pose; without `robot_from_camera` there is no pose of the robot.
    `odometry` is `odom_from_robot` at capture; `prior` is what the robot believes, `map_from_robot`. `captured_ns` is
    the robot's clock at capture (ns since the Unix epoch); one clock stamps all messages of a robot. `deadline_ms`:
    no work begins later than this after receipt; 0 is the server's default. `map`: recognise against another map than
    the robot's own. `image` may be all that `Robot.publish_frame` takes: a picture of Pillow, a path, bytes.
    """

    image: Picture
    intrinsics: Intrinsics | None = None
    robot_from_camera: Pose3 | None = None
    odometry: Pose2 | None = None
    prior: Pose2Covariance | None = None
    captured_ns: int = field(default_factory=time.time_ns)
    deadline_ms: int = 0
    map: str = ""


def _on_white(picture: Any) -> Any:
    pillow: Any = importlib.import_module("PIL.Image")
    return pillow.alpha_composite(pillow.new("RGBA", picture.size, "white"), picture).convert("RGB")


def bytes_per_px(image: Image) -> int:
    """Bytes of a pixel; raises `InvalidInput` for an encoded image."""
    if not image.is_raw:
        raise InvalidInput("raw pixels are needed to cut patches out", code="wrong_encoding", field="image")
    return _BYTES_PER_PX[image.encoding]


def _packed(pixels: Any) -> bytes:
    # `tobytes` of NumPy is much faster than that of a view.
    data: bytes = pixels.tobytes() if hasattr(pixels, "tobytes") else memoryview(pixels).tobytes()
    return data


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Width and height of a JPEG by its start of frame (SOF0 to SOF15 without DHT, JPG and DAC)."""
    if not data.startswith(b"\xff\xd8"):
        return None
    at = 2
    while at + 4 <= len(data):
        if data[at] != 0xFF:
            return None
        marker = data[at + 1]
        if marker == 0xFF:
            at += 1
        elif marker == 0x01 or 0xD0 <= marker <= 0xD8:
            at += 2
        elif marker in (0xD9, 0xDA):
            return None
        elif 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            if at + 9 > len(data):
                return None
            height, width = struct.unpack_from(">HH", data, at + 5)
            return (width, height)
        else:
            at += 2 + int(struct.unpack_from(">H", data, at + 2)[0])
    return None


def _jpeg_by_opencv(image: Image, quality: int) -> bytes | None:
    try:
        cv2: Any = importlib.import_module("cv2")
        numpy: Any = importlib.import_module("numpy")
    except ImportError:
        return None
    shape = (image.height_px, image.width_px, _BYTES_PER_PX[image.encoding])
    pixels = numpy.frombuffer(image.data, numpy.uint8).reshape(shape)
    if image.encoding == "rgb8":
        pixels = numpy.ascontiguousarray(pixels[:, :, ::-1])
    done, data = cv2.imencode(".jpg", pixels, [_IMWRITE_JPEG_QUALITY, quality])
    return bytes(data) if done else None


def _jpeg_by_pillow(image: Image, quality: int) -> bytes:
    try:
        pillow: Any = importlib.import_module("PIL.Image")
    except ImportError:
        raise InvalidInput(
            "neither OpenCV nor Pillow is installed, and one of them has to compress", code="no_encoder", field="image"
        ) from None
    import io

    size = (image.width_px, image.height_px)
    mode, raw = ("L", "L") if image.encoding == "gray8" else ("RGB", "RGB" if image.encoding == "rgb8" else "BGR")
    out = io.BytesIO()
    pillow.frombytes(mode, size, bytes(image.data), "raw", raw).save(out, "JPEG", quality=quality)
    return out.getvalue()
