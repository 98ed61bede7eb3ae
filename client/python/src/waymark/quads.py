"""Quads that a robot's own detector found, with the pixels around them in place of the image."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from waymark.errors import InvalidInput
from waymark.image import Image, bytes_per_px
from waymark.wire import Intrinsics, Point, Pose2, Pose2Covariance, Pose3

# What is sent around a quad, as a share of its width and height on each side: the learnt border may lie outside of the
# found one.
_MARGIN = 0.4
# Most quads of a message, and most pixels of their patches.
_MAX_QUADS = 24
_MAX_PATCHES_PX = 2_304_000

Corners = Sequence[Point] | Sequence[tuple[float, float]]


@dataclass(frozen=True, slots=True)
class FoundQuad:
    """Four corners in pixels of the image, clockwise from the top left, and a patch of the image whose first pixel is
    at (`left_px`, `top_px`). Made by `cut`.

    `corner_covariance_px2`: uu, uv, vv of each corner, 12 numbers; empty stands for 1 px^2. `alternates`: other borders
    of the same object inside of it, outermost first, at most 8. `upright_ambiguous`: another corner may as well be the
    top left one.
    """

    corners: tuple[Point, ...]
    patch: Image
    left_px: int
    top_px: int
    corner_covariance_px2: tuple[float, ...] = ()
    alternates: tuple[tuple[Point, ...], ...] = ()
    score: float = 0.0
    upright_ambiguous: bool = False

    @classmethod
    def cut(cls, image: Image, corners: Corners, *, score: float = 0.0, upright_ambiguous: bool = False) -> FoundQuad:
        """A quad with the raw pixels around it; raises `InvalidInput` for an encoded image, and for a quad outside of
        it."""
        points = tuple(each if isinstance(each, Point) else Point(float(each[0]), float(each[1])) for each in corners)
        if len(points) != 4 or not all(math.isfinite(each) for p in points for each in (p.u_px, p.v_px)):
            raise InvalidInput("a quad has four finite corners", code="out_of_range", field="corners")
        left, right = _span([p.u_px for p in points], image.width_px)
        top, bottom = _span([p.v_px for p in points], image.height_px)
        each = bytes_per_px(image)
        row = each * image.width_px
        pixels = memoryview(image.data)
        lines = (pixels[y * row + left * each : y * row + (right + 1) * each] for y in range(top, bottom + 1))
        patch = Image(image.encoding, right - left + 1, bottom - top + 1, b"".join(lines))
        return cls(points, patch, left, top, score=score, upright_ambiguous=upright_ambiguous)


@dataclass(frozen=True, slots=True)
class Quads:
    """The quads of one image, best first, with its capture data, as `Capture` has it. It is published and recognised as
    a frame of its camera is; `quads` may be empty: nothing was found."""

    width_px: int
    height_px: int
    quads: tuple[FoundQuad, ...]
    intrinsics: Intrinsics | None = None
    robot_from_camera: Pose3 | None = None
    odometry: Pose2 | None = None
    prior: Pose2Covariance | None = None
    captured_ns: int = field(default_factory=time.time_ns)
    deadline_ms: int = 0
    map: str = ""

    @classmethod
    def cut(
        cls,
        image: Image,
        found: Iterable[Corners],
        *,
        intrinsics: Intrinsics | None = None,
        robot_from_camera: Pose3 | None = None,
        odometry: Pose2 | None = None,
        prior: Pose2Covariance | None = None,
    ) -> Quads:
        """The quads with these corners in a raw image, best first: at most 24, and as many as have together no more
        pixels than the largest frame."""
        spare = _MAX_PATCHES_PX
        quads: list[FoundQuad] = []
        for corners in found:
            quad = FoundQuad.cut(image, corners)
            area = quad.patch.width_px * quad.patch.height_px
            if area <= spare and len(quads) < _MAX_QUADS:
                spare -= area
                quads.append(quad)
        of = (image.width_px, image.height_px, tuple(quads))
        return cls(*of, intrinsics, robot_from_camera, odometry, prior)


def _span(along: list[float], length: int) -> tuple[int, int]:
    """First and last pixel of a patch along one axis."""
    low, high = min(along), max(along)
    margin = _MARGIN * (high - low)
    first, last = max(0, math.floor(low - margin)), min(length - 1, math.ceil(high + margin))
    if first > last:
        raise InvalidInput("the quad lies outside of the image", code="out_of_range", field="corners")
    return first, last
