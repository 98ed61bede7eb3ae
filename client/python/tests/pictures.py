"""Pictures for the tests: textured posters, and photographs of them by a camera of known place. No data set."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from waymark import Image, Intrinsics, Pose2

Pixels: TypeAlias = NDArray[np.uint8]

# Of every photograph.
WIDTH_PX, HEIGHT_PX = 640, 480
CAMERA = Intrinsics(500.0, 500.0, 319.5, 239.5)
# Of every poster, in metres, and where poster 0 hangs: on the wall along y = 0, seen from y > 0.
SIZE_M = (0.8, 0.6)
CENTRE_M = (5.0, 0.0, 1.5)
# Height of the camera over the floor; it looks forward.
CAMERA_HEIGHT_M = 1.4


def poster(seed: int) -> Pixels:
    """A coloured poster, 480 x 360: shapes of random places and colours in a dark frame."""
    random = np.random.default_rng(seed)
    height, width = 360, 480
    picture = np.full((height, width, 3), random.integers(150, 230, 3), dtype=np.uint8)
    v, u = np.mgrid[0:height, 0:width]
    for _ in range(60):
        centre = random.uniform((0, 0), (width, height))
        radius = random.uniform(8, 60, 2)
        turn = random.uniform(0, math.pi)
        x = (u - centre[0]) * math.cos(turn) + (v - centre[1]) * math.sin(turn)
        y = (v - centre[1]) * math.cos(turn) - (u - centre[0]) * math.sin(turn)
        is_box = random.random() < 0.5
        inside = np.maximum(abs(x) / radius[0], abs(y) / radius[1]) < 1
        if not is_box:
            inside = (x / radius[0]) ** 2 + (y / radius[1]) ** 2 < 1
        picture[inside] = random.integers(0, 256, 3)
    frame = 14
    picture[:frame] = picture[-frame:] = 25
    picture[:, :frame] = picture[:, -frame:] = 25
    return picture


def corners_px(robot: Pose2, centre_m: tuple[float, float, float] = CENTRE_M) -> list[tuple[float, float]]:
    """Corners of a poster at `centre_m` in the image of a robot there: clockwise from the top left."""
    x, y, z = centre_m
    half_w, half_h = SIZE_M[0] / 2, SIZE_M[1] / 2
    # Who looks at the wall from y > 0 has +x on the left.
    in_map = [(x + a * half_w, y, z + b * half_h) for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    forward = (math.cos(robot.theta_rad), math.sin(robot.theta_rad))
    found = []
    for px, py, pz in in_map:
        dx, dy = px - robot.x_m, py - robot.y_m
        depth = dx * forward[0] + dy * forward[1]
        right = dx * forward[1] - dy * forward[0]
        down = CAMERA_HEIGHT_M - pz
        found.append((CAMERA.fx_px * right / depth + CAMERA.cx_px, CAMERA.fy_px * down / depth + CAMERA.cy_px))
    return found


def homography(source: list[tuple[float, float]], target: list[tuple[float, float]]) -> NDArray[np.float64]:
    """3 x 3, from four points to four points."""
    rows, right = [], []
    for (x, y), (u, v) in zip(source, target, strict=True):
        rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
        right += [u, v]
    solved = np.linalg.solve(np.array(rows, dtype=float), np.array(right, dtype=float))
    return np.append(solved, 1.0).reshape(3, 3)


def photograph(of: Pixels, corners: list[tuple[float, float]], seed: int = 1) -> Pixels:
    """A photograph, RGB, of a plain wall with a poster in these corners (px), with a little noise."""
    height, width = of.shape[:2]
    outline = [(-0.5, -0.5), (width - 0.5, -0.5), (width - 0.5, height - 0.5), (-0.5, height - 0.5)]
    to_poster = homography(corners, outline)
    total = np.zeros((HEIGHT_PX, WIDTH_PX, 3))
    v, u = np.mgrid[0:HEIGHT_PX, 0:WIDTH_PX].astype(float)
    wall = np.broadcast_to(200.0 - 20.0 * u[..., None] / WIDTH_PX, total.shape)
    # Four samples a pixel.
    for du in (-0.25, 0.25):
        for dv in (-0.25, 0.25):
            x, y, w = np.einsum("ij,jhw->ihw", to_poster, np.stack([u + du, v + dv, np.ones_like(u)]))
            column, row = np.rint(x / w).astype(int), np.rint(y / w).astype(int)
            is_inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
            sample = of[row.clip(0, height - 1), column.clip(0, width - 1)]
            total += np.where(is_inside[..., None], sample, wall)
    noise = np.random.default_rng(seed).normal(0.0, 2.0, total.shape[:2])[..., None]
    return (total / 4 + noise).clip(0, 255).astype(np.uint8)


def seen_from(robot: Pose2, seed: int = 0, centre_m: tuple[float, float, float] = CENTRE_M) -> Pixels:
    """What a robot at this pose sees of poster `seed`, RGB."""
    return photograph(poster(seed), corners_px(robot, centre_m))


def front(distance_m: float = 2.0, x_m: float = CENTRE_M[0]) -> Pose2:
    """A robot that looks straight at the wall from this distance."""
    return Pose2(x_m, distance_m, -math.pi / 2)


def teaching_photo(seed: int) -> Image:
    """A photograph to teach a poster from, PNG."""
    return Image.rgb(seen_from(front(1.6), seed)).png()
