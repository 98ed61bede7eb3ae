"""Claim: the dataclasses have the fields of the wire and of the API, the generated files are up to date, and pictures
of every kind are read."""

from __future__ import annotations

import ast
import dataclasses
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pictures
import pytest
from conftest import Server

import waymark
from waymark import Capture, Image, Intrinsics, InvalidInput, Pose2, Pose2Covariance, Pose3, Unexpected, api, wire
from waymark._events import EventParser, live_event
from waymark._messages import frame_bytes, prepared
from waymark._values import NAME, MismatchError, fill, from_json, from_message, given, to_json
from waymark.image import as_image
from waymark.v1 import waymark_pb2 as pb

PACKAGE = Path(waymark.__file__).parent
# Messages that the client makes itself, of captures and of `Quads`.
MADE_HERE = {"Frame", "Odometry", "Scan", "Quads", "FoundQuad", "Border", "Patch", "LocaliseRequest", "Hello"}
# Replies with the type of the same answer over HTTP.
OF_THE_API = {"LocaliseReply", "LocaliseHypothesis"}
# Of one of several forms, or no body of JSON by itself.
OF_SEVERAL_FORMS = {"FindingBody", "IntrinsicsSuspicionBody", "ServerEvent", "ServerEventBody"}
NO_BODY = {"CameraFrame", "LiveMissed", "LiveOdometry", "LiveTruth"}
# Schemas without a type: refusals are raised, forms are sent part by part, events have a union.
NO_TYPE = {"Problem", "LocaliseForm", "NewViewForm", "PhotographForm", "UnderlayForm", "LiveEventData"}
# Schemas whose type has another name, beside enumerations, which have no `Body`.
OTHER_NAMES = {"ListOrder": "Order", "MapChangeBody": "LiveMapChange"}


def test_generated_files_are_up_to_date() -> None:
    command = [sys.executable, str(PACKAGE.parents[1] / "tools" / "generate.py"), "--check"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_dataclasses_have_the_fields_of_the_messages() -> None:
    for name, descriptor in pb.DESCRIPTOR.message_types_by_name.items():
        if name in MADE_HERE | OF_THE_API:
            continue
        fields = [field.name for field in dataclasses.fields(getattr(wire, name))]
        assert fields == [field.name for field in descriptor.fields], name
    # Epoch and number are set when it is sent.
    scan = {field.name for field in dataclasses.fields(wire.Scan)} | {"epoch", "seq"}
    assert scan == set(pb.Scan.DESCRIPTOR.fields_by_name)
    for enum in pb.DESCRIPTOR.enum_types_by_name.values():
        if enum.name != "ImageEncoding":
            prefix = enum.values[0].name.removesuffix("UNSPECIFIED")
            words = [value.name.removeprefix(prefix).lower() for value in enum.values]
            # The status of a localisation is a type of HTTP, where it is never left open.
            is_of_the_api = enum.name == "LocaliseStatus"
            expected = words[1:] if is_of_the_api else words
            assert list(getattr(api if is_of_the_api else wire, enum.name).__args__) == expected, enum.name


def test_every_schema_of_the_server_has_a_type_with_its_fields(server: Server) -> None:
    document = httpx.get(f"{server.http}/api/v1/openapi.json", trust_env=False).json()
    compared: set[str] = set()
    for name, schema in document["components"]["schemas"].items():
        if name in NO_TYPE or name.startswith("Page_"):
            continue
        ours = OTHER_NAMES.get(name, name.removesuffix("Body") if "enum" in schema else name)
        kind = getattr(api if ours in api.__all__ else wire, ours)
        if "enum" in schema:
            assert list(kind.__args__) == schema["enum"] or kind.__args__[1:] == (*schema["enum"][:-1],), name
        elif dataclasses.is_dataclass(kind) and name not in OF_SEVERAL_FORMS:
            compared.add(ours)
            fields = {field.metadata.get(NAME, field.name) for field in dataclasses.fields(kind)}
            assert fields - {"facts"} == schema["properties"].keys(), name
    assert len(compared) > 100
    types = {name for name in api.__all__ if dataclasses.is_dataclass(getattr(api, name))}
    assert types - compared == OF_SEVERAL_FORMS | NO_BODY | {"LandmarkDifferencePage"}


def test_messages_come_back_as_they_were() -> None:
    rejection = wire.Rejection("too_large", "frame", "5 bytes are more than 4")
    request = wire.GazeRequest(
        Pose2Covariance(Pose2(1.0, 2.0, 3.0), tuple(float(n) for n in range(9))), pan_range_rad=(-1.0, 1.0), at_ns=7
    )
    message = pb.GazeRequest()
    fill(message, dataclasses.replace(request, criterion="product"))
    assert from_message(wire.GazeRequest, message) == dataclasses.replace(request, criterion="product")
    answer = pb.Answer(status=pb.STATUS_NO_MATCH, rejection=pb.Rejection(**to_json(rejection)))
    agreement: Any = answer.quads.add(kind=pb.QUAD_KIND_THREE_SIDED).points.agreement
    agreement.extend([1, 2, 3, 99])
    read = from_message(wire.Answer, answer)
    assert (read.status, read.rejection, read.map_from_robot) == ("no_match", rejection, None)
    assert read.quads[0].points is not None and read.quads[0].pose is None
    assert read.quads[0].points.agreement == ("silent", "agrees", "disagrees", "unspecified")
    with pytest.raises(ValueError, match="information"):
        fill(pb.GazeRequest(), wire.GazeRequest(criterion="fastest"))  # type: ignore[arg-type]


def test_json_is_read_by_name_and_says_what_is_wrong() -> None:
    job = {"id": 3, "kind": "learn", "map": "hall", "state": "done", "progress": 1, "message": "", "new_field": {}}
    read = from_json(api.Job, job)
    assert read.progress == 1.0 and isinstance(read.progress, float) and read.result is None
    wrong: Any
    for wrong in ({}, {**job, "progress": "much"}, [], None, {**job, "progress": None}):
        with pytest.raises(MismatchError, match="Job"):
            from_json(api.Job, wrong)
    model = from_json(api.LandmarkModelBody, {"views": 1, "generated_views": 2, "learnt_ms": 3, "tau": 0.5})
    assert model.facts == {"tau": 0.5}
    camera = {"fx_px": 500, "fy_px": 500, "cx_px": 320, "cy_px": 240}
    report: dict[str, Any] = {
        "intrinsics": camera,
        "fx_sigma_px": None,
        "cx_sigma_px": 1,
        "cy_sigma_px": None,
        "rms_px": 0.5,
    }
    report |= {
        "width_px": 640,
        "height_px": 480,
        "reduced_chi2": 1,
        "orientations": 1,
        "aspect_ratio": 1,
        "warnings": [],
        "views": [],
    }
    calibrated = from_json(api.CalibrationReport, report)
    assert (calibrated.fx_sigma_px, calibrated.cx_sigma_px) == (math.inf, 1.0), "null: nothing is known of it"
    counted = {"configured": True, "received": {"scan": 7}, "sent": {}, "reasons": {"scan": {"no_transform": 2}}}
    assert from_json(api.Ros2Status, counted).reasons["scan"]["no_transform"] == 2
    assert given(a=None, b=waymark.UNSET, c=Pose2()) == {"a": None, "c": {"x_m": 0.0, "y_m": 0.0, "theta_rad": 0.0}}


def test_a_frame_is_the_message_of_the_wire() -> None:
    pixels = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)
    capture = Capture(
        Image.bgr(pixels),
        intrinsics=Intrinsics(500.0, 501.0, 1.0, 2.0, plumb_bob=(0.1, 0.2, 0.0, 0.0, 0.3)),
        robot_from_camera=Pose3.mounting(0.1, 0.0, 1.2),
        odometry=Pose2(),
        captured_ns=17,
        deadline_ms=5,
        map="hall",
    )
    frame = pb.Frame.FromString(frame_bytes(prepared(capture), 9, 300))
    assert (frame.epoch, frame.seq, frame.captured_ns, frame.deadline_ms, frame.map) == (9, 300, 17, 5, "hall")
    assert (frame.encoding, frame.width_px, frame.height_px) == (pb.IMAGE_ENCODING_BGR8, 3, 2)
    assert frame.image == pixels.tobytes() and list(frame.intrinsics.plumb_bob)[4] == 0.3
    assert frame.HasField("odometry") and not frame.HasField("prior")
    # A length of more than one byte.
    long = pb.Frame.FromString(frame_bytes(prepared(Image.gray(bytes(300 * 400), (400, 300))), 9, 300))
    assert len(long.image) == 120_000 and long.captured_ns > 0


def test_a_camera_looks_where_its_mounting_says() -> None:
    def looks(pose: Pose3) -> tuple[float, float, float]:
        x, y, z, w = pose.qx, pose.qy, pose.qz, pose.qw
        return (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y))

    assert looks(Pose3.mounting(0, 0, 1)) == pytest.approx((1, 0, 0))
    assert looks(Pose3.mounting(0, 0, 1, pan_rad=math.pi / 2)) == pytest.approx((0, 1, 0), abs=1e-12)
    assert looks(Pose3.mounting(0, 0, 1, tilt_rad=math.pi / 4)) == pytest.approx((0.5**0.5, 0, 0.5**0.5))
    rolled = Pose3.mounting(0, 0, 1, pan_rad=0.3, tilt_rad=0.2, roll_rad=0.1)
    assert looks(rolled) == pytest.approx(looks(Pose3.mounting(0, 0, 1, pan_rad=0.3, tilt_rad=0.2)))
    camera = Intrinsics.from_view(640, 480, math.pi / 2)
    assert camera.fx_px == pytest.approx(320.0) and (camera.cx_px, camera.cy_px) == (319.5, 239.5)


def test_poses_are_matrices_and_have_a_yaw() -> None:
    looks = Pose3.mounting(0.1, 0.2, 1.2, pan_rad=0.3, tilt_rad=-0.2, roll_rad=2.5)
    for pose in (looks, Pose3(), Pose3.from_yaw(1.0, 2.0, 0.0, 3.0), Pose3(qx=1.0, qw=0.0), Pose3(qz=1.0, qw=0.0)):
        matrix = np.array(pose.matrix())
        assert matrix.shape == (4, 4) and np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3))
        back = Pose3.from_matrix(matrix)
        assert np.allclose(back.matrix(), matrix) and np.allclose(Pose3.from_matrix(pose.matrix()).matrix(), matrix)
    assert Pose3.from_yaw(1.0, 2.0, 0.0, 3.0).yaw_rad == pytest.approx(3.0)
    assert Pose3.mounting(0, 0, 1, pan_rad=0.3, tilt_rad=0.2).looks_rad == pytest.approx(0.3)
    flat = Pose2(1.0, 2.0, 7.0)
    assert flat.yaw_rad == pytest.approx(7.0 - 2 * math.pi)
    assert np.array(flat.matrix()) @ (0.0, 0.0, 1.0) == pytest.approx((1.0, 2.0, 1.0))
    assert Pose2.from_matrix(flat.matrix()).yaw_rad == pytest.approx(flat.yaw_rad)
    mirrored = np.diag((1.0, 1.0, -1.0, 1.0))
    of3, of2 = Pose3.from_matrix, Pose2.from_matrix
    make: Any
    for make, wrong in ((of3, mirrored), (of3, np.eye(3)), (of2, 2 * np.eye(3))):
        with pytest.raises(InvalidInput) as refused:
            make(wrong)
        assert (refused.value.code, refused.value.field) == ("out_of_range", "matrix")


def test_clients_show_their_server_and_no_secret() -> None:
    with waymark.MapClient("http://127.0.0.1:1/", token="secret") as maps:
        assert repr(maps) == "MapClient('http://127.0.0.1:1')"


def test_errors_say_code_field_and_advice() -> None:
    text = str(waymark.Refused("5 bytes are more than 4", code="too_large", field="frame"))
    assert text.startswith("too_large: frame: 5 bytes") and "limits.frame_bytes" in text
    # A name that only a part of a word is like is said.
    assert "map: " in str(waymark.Refused("mapping", code="exists", field="map"))
    assert str(waymark.Refused("there is no map `x`", code="unknown_map", field="map")).count("map:") == 1


def test_sizes_are_read_from_headers(tmp_path: Path) -> None:
    photo = Image.rgb(pictures.poster(0))
    path = tmp_path / "photo.png"
    path.write_bytes(photo.png().data)
    jpeg = photo.jpeg()
    for image, encoding in ((Image.file(path), "png"), (Image.encoded(jpeg.data), "jpeg")):
        assert (image.encoding, image.width_px, image.height_px) == (encoding, 480, 360)
        assert image.png() is image and image.jpeg() is image and not image.is_raw
    for damaged in (b"", b"GIF89a", b"\x89PNG\r\n\x1a\n", jpeg.data[:20], b"\xff\xd8\xff\xe0\0\0" * 1000):
        with pytest.raises(InvalidInput) as refused:
            Image.encoded(damaged)
        assert refused.value.code == "bad_image"


def test_png_and_jpeg_show_the_same_picture() -> None:
    from io import BytesIO

    from PIL import Image as Pillow

    rgb = pictures.poster(3)
    bgr = np.ascontiguousarray(rgb[:, :, ::-1])
    gray = rgb[:, :, 1].copy()
    for image, expected in ((Image.rgb(rgb), rgb), (Image.bgr(bgr), rgb), (Image.gray(gray), gray)):
        assert (np.asarray(Pillow.open(BytesIO(image.png().data))) == expected).all()
        lossy = np.asarray(Pillow.open(BytesIO(image.jpeg(95).data))).astype(int)
        assert np.abs(lossy - expected).mean() < 4


def test_pictures_of_pillow_are_sent_as_they_look() -> None:
    from PIL import Image as Pillow

    rgb = pictures.poster(2)
    picture = Pillow.fromarray(rgb)
    for image in (Image.pillow(picture), Image.rgb(picture), as_image(picture), as_image(Capture(picture).image)):
        assert (image.encoding, image.width_px, image.height_px) == ("rgb8", 480, 360)
        assert image.data == rgb.tobytes()
    gray = picture.convert("L")
    assert Image.pillow(gray) == Image.gray(gray) and Image.pillow(gray).encoding == "gray8"
    assert Image.gray(picture).data == gray.tobytes()
    # A half of it is transparent, over black.
    clear = np.dstack((np.zeros_like(rgb), np.repeat([[0], [255]], 180, axis=0).repeat(480, axis=1).astype(np.uint8)))
    shown = np.frombuffer(Image.pillow(Pillow.fromarray(clear)).data, np.uint8).reshape(360, 480, 3)
    assert (shown[:180] == 255).all() and (shown[180:] == 0).all()
    # What a camera that was held upright wrote: every orientation of EXIF.
    for orientation in range(1, 9):
        raw = Pillow.fromarray(rgb)
        stored = {2: 0, 3: 3, 4: 1, 5: 5, 6: 2, 7: 6, 8: 4}.get(orientation)
        raw = raw if stored is None else raw.transpose(Pillow.Transpose(stored))
        raw.getexif()[0x0112] = orientation
        assert Image.pillow(raw).data == rgb.tobytes(), orientation
    palette = picture.convert("P")
    assert Image.pillow(palette).data == palette.convert("RGB").tobytes()
    with pytest.raises(InvalidInput) as wide:
        Image.pillow(Pillow.fromarray(np.zeros((3, 4), np.uint16)))
    assert wide.value.code == "bad_image" and "I;16" in str(wide.value)
    nothing: Any
    for nothing in (rgb, None, 3):
        with pytest.raises(InvalidInput) as refused:
            as_image(nothing)
        assert refused.value.code == "bad_image"
    with pytest.raises(InvalidInput):
        Image.rgb(nothing)


def test_arrays_of_other_shapes_are_refused() -> None:
    rgb = pictures.poster(0)
    for make, wrong in (
        (Image.rgb, rgb[:, :, 0]),
        (Image.gray, rgb),
        (Image.bgr, rgb.astype(np.float32)),
        (Image.rgb, np.zeros((0, 4, 3), np.uint8)),
    ):
        with pytest.raises(InvalidInput) as refused:
            make(np.array(wrong))
        assert refused.value.code == "bad_image"
    with pytest.raises(InvalidInput) as short:
        Image.rgb(bytes(35), (4, 3))
    assert short.value.code == "size_mismatch"
    with pytest.raises(InvalidInput):
        Image.gray(bytes(12))


def test_the_package_works_without_numpy_and_encoders(monkeypatch: pytest.MonkeyPatch) -> None:
    for file in PACKAGE.rglob("*.py"):
        tops = [node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.Import | ast.ImportFrom)]
        assert "numpy" not in {getattr(node, "module", None) or node.names[0].name for node in tops}, file
    monkeypatch.setitem(sys.modules, "PIL.Image", None)
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(InvalidInput) as refused:
        Image.gray(bytes(12), (4, 3)).jpeg()
    assert refused.value.code == "no_encoder" and "pip install" in str(refused.value)


def test_events_are_cut_and_named() -> None:
    parser = EventParser()
    body = [":", "", "event: pose", 'data: {"a": 1}', "", ": still here", "", "data: x", "data: y", "", "event: cut"]
    assert [event for line in body for event in parser.push(line)] == [("pose", '{"a": 1}'), ("message", "x\ny")]
    assert live_event("missed", "3") == api.LiveMissed(3)
    assert live_event("newer-event", "{}") is None
    gone = live_event("map_changed", '{"map": "hall", "version": null}')
    assert gone == api.LiveMapChange("hall", None)
    truth = live_event("truth", '{"robot": "r1", "map": "hall", "pose": {"x_m": 1, "y_m": 2, "theta_rad": 3}}')
    assert truth == api.LiveTruth("r1", "hall", Pose2(1.0, 2.0, 3.0))
    with pytest.raises(Unexpected):
        list(EventParser().push("data: " + "x" * (5 << 20)))
