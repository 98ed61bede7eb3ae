"""Files of cameras. In: the report of `waymark camera calibrate --json`, intrinsics as JSON, ROS' `ost.yaml`, a
`camera_info` as `ros2 topic echo` prints it, OpenCV's YAML. Out: the numbers of `Intrinsics` by name.

YAML needs PyYAML; JSON needs nothing.
"""

from __future__ import annotations

import importlib
import json
import math
from os import PathLike
from pathlib import Path
from typing import Any

from waymark.errors import InvalidInput

# Largest file that is read, in bytes.
_MAX_BYTES = 1 << 20
# The field of a lens model by its names in ROS, and how many coefficients it has.
_MODELS = {
    "plumb_bob": "plumb_bob",
    "radtan": "plumb_bob",
    "rational_polynomial": "plumb_bob",
    "equidistant": "equidistant",
    "fisheye": "equidistant",
    "kannala_brandt": "equidistant",
    "kannala_brandt4": "equidistant",
}
_NO_LENS = ("", "none", "None", "pinhole", "perspective", "rectified")
_COEFFICIENTS = {"plumb_bob": 5, "rational_polynomial": 8, "equidistant": 4}
_NUMBERS = ("fx_px", "fy_px", "cx_px", "cy_px")


def numbers_of_file(path: str | PathLike[str]) -> dict[str, Any]:
    """The fields of the camera in a file; raises `InvalidInput` (`bad_camera_file`, `no_yaml`) that names the file."""
    data = Path(path).read_bytes()
    try:
        if len(data) > _MAX_BYTES:
            raise ValueError(f"{len(data)} bytes are more than {_MAX_BYTES}")
        text = data.decode("utf-8-sig").lstrip()
        read = _of_json(json.loads(text)) if text.startswith("{") else _of_yaml(text, path)
        return _checked(read)
    except InvalidInput:
        raise
    except (KeyError, ValueError, TypeError) as error:
        said = f"{error.args[0]} is missing" if isinstance(error, KeyError) else str(error)
        raise InvalidInput(f"{path} is no file of a camera: {said}", code="bad_camera_file", field="path") from error


def _of_json(value: dict[str, Any]) -> dict[str, Any]:
    camera = value.get("intrinsics", value)
    read = {name: camera[name] for name in _NUMBERS}
    for name in _COEFFICIENTS:
        if camera.get(name):
            read |= _lens(name, camera[name])
    for name in ("focal_sigma_px", "center_sigma_px"):
        read[name] = camera.get(name)
    if "fx_sigma_px" in value:
        # Of a report. Null: nothing is known of it, and what is usual is taken.
        read["focal_sigma_px"] = value["fx_sigma_px"]
        centre = (value["cx_sigma_px"], value["cy_sigma_px"])
        read["center_sigma_px"] = None if None in centre else max(centre)
    sides = value if value.get("width_px") else camera
    return read | {name: sides.get(name) or None for name in ("width_px", "height_px")}


def _of_yaml(text: str, path: str | PathLike[str]) -> dict[str, Any]:
    try:
        yaml: Any = importlib.import_module("yaml")
    except ImportError:
        raise InvalidInput(f"{path} is YAML, and PyYAML is not installed", code="no_yaml", field="path") from None
    # OpenCV's files begin with a directive and have types that are not of YAML.
    plain = "\n".join(line for line in text.splitlines() if not line.startswith("%")).replace("!!opencv-matrix", "")
    try:
        # `ros2 topic echo` ends a message with a line of its own.
        value = next(iter(yaml.safe_load_all(plain)), None)
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from error
    if not isinstance(value, dict):
        raise ValueError("neither JSON nor the YAML of a camera")
    if "camera_matrix" in value:
        k, d = value["camera_matrix"]["data"], value.get("distortion_coefficients", {}).get("data", [])
        sides = (value["image_width"], value["image_height"])
    else:
        # A message of ROS 2, or of ROS 1.
        k, d = value["k"] if "k" in value else value["K"], value.get("d", value.get("D", []))
        sides = (value["width"], value["height"])
    if len(k) != 9:
        raise ValueError(f"the camera matrix has {len(k)} numbers, not 9")
    read = dict(zip(_NUMBERS, (k[0], k[4], k[2], k[5]), strict=True))
    return read | {"width_px": sides[0], "height_px": sides[1]} | _lens(value.get("distortion_model", "plumb_bob"), d)


def _lens(model: str, coefficients: list[float]) -> dict[str, Any]:
    """The lens by the coefficients that are not 0: drivers send more, the last ones 0, or fewer."""
    used = max((at + 1 for at, each in enumerate(coefficients) if each != 0), default=0)
    if used == 0 and model in _NO_LENS:
        return {}
    name = _MODELS.get(model)
    if name is None:
        raise ValueError(f"the lens model {model!r} is not known")
    if name == "plumb_bob" and used > _COEFFICIENTS[name]:
        name = "rational_polynomial"
    most = _COEFFICIENTS[name]
    if used > most:
        raise ValueError(f"{used} coefficients for the lens model {model!r}")
    if not coefficients:
        return {}
    return {name: tuple(float(each) for each in (*coefficients, *(0.0,) * most)[:most])}


def _checked(read: dict[str, Any]) -> dict[str, Any]:
    for name in _NUMBERS:
        read[name] = float(read[name])
        if not math.isfinite(read[name]) or (name[0] == "f" and read[name] <= 0):
            raise ValueError(f"{name} = {read[name]}: the camera is not calibrated")
    for name in ("width_px", "height_px"):
        if read[name] is not None:
            read[name] = int(read[name])
            if read[name] < 1:
                raise ValueError(f"{name} = {read[name]}")
    return read
