"""Claim: a camera is read from every file that has one, and what is no such file is an error that names it."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

from waymark import Intrinsics, InvalidInput

REPORT: dict[str, Any] = {
    "intrinsics": {"fx_px": 600, "fy_px": 601.5, "cx_px": 319, "cy_px": 239, "plumb_bob": [0.1, 0.2, 0, 0, 0]},
    "width_px": 640,
    "height_px": 480,
    "fx_sigma_px": 5.0,
    "cx_sigma_px": 3.0,
    "cy_sigma_px": 4.0,
}
OST = """image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [600., 0., 319.,
         0., 601.5, 239.,
         0., 0., 1.]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.1, 0.2, 0., 0., 0.]
"""
INFO = """header:
  stamp:
    sec: 3
  frame_id: camera
height: 480
width: 640
distortion_model: plumb_bob
d:
- 0.1
- 0.2
k:
- 600.0
- 0.0
- 319.0
- 0.0
- 601.5
- 239.0
- 0.0
- 0.0
- 1.0
---
"""
CAMERA = Intrinsics(600.0, 601.5, 319.0, 239.0, plumb_bob=(0.1, 0.2, 0.0, 0.0, 0.0), width_px=640, height_px=480)


def read(folder: Path, text: str) -> Intrinsics:
    path = folder / "camera"
    path.write_text(text, encoding="utf-8")
    return Intrinsics.from_file(path)


def test_files_of_every_kind_are_read(tmp_path: Path) -> None:
    opencv = "%YAML:1.0\n---\n" + OST.replace("camera_matrix:", "camera_matrix: !!opencv-matrix")
    ros1 = INFO.replace("d:", "D:").replace("k:", "K:").replace("width:", "width: ")
    for text in (OST, "\ufeff" + OST, "# mine\n" + OST, opencv, INFO, ros1, OST.replace("\n", "\r\n")):
        assert read(tmp_path, text) == CAMERA, text
    found = read(tmp_path, json.dumps(REPORT))
    assert found == Intrinsics(600.0, 601.5, 319.0, 239.0, (0.1, 0.2, 0.0, 0.0, 0.0), (), (), 5.0, 4.0, 640, 480)
    unknown = read(tmp_path, json.dumps(REPORT | {"fx_sigma_px": None, "cy_sigma_px": None}))
    assert (unknown.focal_sigma_px, unknown.center_sigma_px) == (None, None)
    bare = read(tmp_path, json.dumps(REPORT["intrinsics"]))
    assert (bare.fx_px, bare.width_px, bare.focal_sigma_px) == (600.0, None, None)


def test_lenses_are_told_by_what_is_in_their_lists(tmp_path: Path) -> None:
    def lens(model: str, list_: str) -> Intrinsics:
        return read(tmp_path, OST.replace("plumb_bob", model).replace("0.1, 0.2, 0., 0., 0.", list_))

    rational = lens("plumb_bob", "1, 2, 3, 4, 5, 6, 7, 8, 0, 0, 0, 0, 0, 0")
    assert rational.rational_polynomial == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0) and not rational.plumb_bob
    assert lens("rational_polynomial", "0.1, 0.2, 0, 0, 0, 0, 0, 0").plumb_bob == (0.1, 0.2, 0.0, 0.0, 0.0)
    assert lens("plumb_bob", "0.1, 0.2, 0, 0").plumb_bob == (0.1, 0.2, 0.0, 0.0, 0.0)
    assert lens("fisheye", "0.1, 0.2, 0, 0").equidistant == (0.1, 0.2, 0.0, 0.0)
    none = lens("none", "0, 0, 0, 0, 0")
    assert not none.plumb_bob + none.rational_polynomial + none.equidistant


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "neither JSON nor the YAML"),
        ("hello", "neither JSON nor the YAML"),
        ("{", "no file of a camera"),
        ('{"fx_px": 600, "fy_px": 600, "cx_px": 1}', "cy_px is missing"),
        ("a: [", "no file of a camera"),
        (OST.replace("camera_matrix", "matrix"), "missing"),
        (OST.replace("600., 0., 319.", "0., 0., 319."), "not calibrated"),
        (OST.replace(",\n         0., 0., 1.]", "]"), "6 numbers, not 9"),
        (OST.replace("plumb_bob", "thin_prism"), "thin_prism"),
        (OST.replace("0.1, 0.2, 0., 0., 0.", "1, 2, 3, 4, 5, 6, 7, 8, 9"), "9 coefficients"),
        (OST.replace("image_width: 640", "image_width: 0"), "width_px = 0"),
    ],
)
def test_what_is_no_camera_is_refused_by_name(tmp_path: Path, text: str, word: str) -> None:
    with pytest.raises(InvalidInput) as refused:
        read(tmp_path, text)
    assert refused.value.code == "bad_camera_file" and word in str(refused.value), str(refused.value)
    assert str(tmp_path) in str(refused.value) and "waymark camera calibrate --json" in str(refused.value)


def test_yaml_asks_for_its_reader_and_json_does_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "yaml", None)
    with pytest.raises(InvalidInput) as refused:
        read(tmp_path, OST)
    assert refused.value.code == "no_yaml" and "pip install" in str(refused.value)
    assert read(tmp_path, json.dumps(REPORT)).fx_px == 600.0
