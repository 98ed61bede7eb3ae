"""Claim: each example runs against a real server, from photographs to a pose, and takes `--help`."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pictures
import pytest
from conftest import ROOT, SOON_S, Server

from waymark import Capture, Image, Pose2, Robot

EXAMPLES = sorted((ROOT / "client" / "python" / "examples").glob("*.py"))
MAP = "examples"
# What the photographs of the tests were taken with.
VIEW_DEG = "65.24"


def run(example: str, *arguments: str | Path) -> str:
    """The output of an example."""
    path = next(path for path in EXAMPLES if path.name.startswith(example))
    done = subprocess.run([sys.executable, path, *arguments], capture_output=True, text=True, timeout=SOON_S * 4)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def fails(example: str, *arguments: str | Path) -> str:
    """What an example says where it cannot go on: one line, and no traceback."""
    path = next(path for path in EXAMPLES if path.name.startswith(example))
    done = subprocess.run([sys.executable, path, *arguments], capture_output=True, text=True, timeout=SOON_S * 4)
    assert done.returncode == 1 and done.stderr.startswith(f"{path.name}: "), done.stdout + done.stderr
    assert len(done.stderr.splitlines()) == 1 and "Traceback" not in done.stderr, done.stderr
    return done.stderr


def test_what_cannot_go_on_ends_in_a_sentence(server: Server, tmp_path: Path) -> None:
    photo = tmp_path / "photo.png"
    photo.write_bytes(pictures.teaching_photo(0).data)
    zenoh, http = ["--endpoint", server.zenoh], ["--server", server.http]
    assert "unknown_robot" in fails("01", *zenoh, "--robot", "nobody", photo)
    assert "nosuch.jpg" in fails("01", *zenoh, "nosuch.jpg")
    assert "bad_image" in fails("02", *http, "--map", "sentences", Path(__file__))
    assert "unknown_robot" in fails("03", *zenoh, "--robot", "nobody", "--folder", tmp_path)
    drive = tmp_path / "drive.csv"
    drive.write_text("photo.png,0,0,0\n")
    place = ["--map", "nosuch", "--landmark", "poster", "--place", "0", "0", "1", "0"]
    assert "unknown_map" in fails("04", *http, *zenoh, *place, drive)
    assert "unknown_map" in fails("05", *http, "--map", "nosuch")
    assert "unreachable" in fails("05", "--server", "http://127.0.0.1:1")


def test_there_are_five() -> None:
    assert [path.name[:2] for path in EXAMPLES] == ["01", "02", "03", "04", "05"]


@pytest.mark.parametrize("example", [path.name for path in EXAMPLES])
def test_every_example_takes_help(example: str) -> None:
    assert "usage:" in run(example, "--help")


@pytest.fixture(scope="module")
def photographs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder: posters to teach, and in `drive` what a robot sees, with its odometry."""
    folder = tmp_path_factory.mktemp("photographs")
    for seed in range(2):
        (folder / f"Poster {seed}.png").write_bytes(pictures.teaching_photo(seed).data)
    drive = folder / "drive"
    drive.mkdir()
    lines = []
    for step in range(4):
        robot = pictures.front(2.4 - 0.1 * step)
        Path(drive / f"{step}.jpg").write_bytes(Image.rgb(pictures.seen_from(robot)).jpeg(95).data)
        lines.append(f"drive/{step}.jpg,{0.1 * step:.1f},0.0,0.0")
    (folder / "drive.csv").write_text("\n".join(lines))
    # The sample that lies beside the examples is a drive of pictures of these names.
    sample = (EXAMPLES[0].parent / "drive.csv").read_text()
    assert sample.splitlines() == ["picture,x_m,y_m,theta_rad", *lines]
    (folder / "sample.csv").write_text(sample)
    return folder


@pytest.fixture(scope="module")
def taught_by_example(server: Server, photographs: Path) -> str:
    """The output of 02, which teaches the map of the others."""
    size = [str(side) for side in pictures.SIZE_M]
    posters = sorted(photographs.glob("*.png"))
    arguments = ["--server", server.http, "--map", MAP, "--size", *size, "--robot", MAP]
    return run("02", *arguments, *posters, "--try", photographs / "drive" / "0.jpg")


def test_photographs_are_taught_and_tried(taught_by_example: str) -> None:
    assert "poster-0: active" in taught_by_example and "poster-1: active" in taught_by_example
    assert "0.jpg: matched poster-0" in taught_by_example


@pytest.mark.usefixtures("taught_by_example")
def test_a_robot_recognises_photographs(server: Server, photographs: Path) -> None:
    out = run("01", "--endpoint", server.zenoh, "--robot", MAP, photographs / "drive" / "1.jpg")
    assert f"matched against map {MAP}" in out and "poster-0, confidence" in out


@pytest.mark.usefixtures("taught_by_example")
def test_a_drive_is_localised_and_a_camera_loop_gives_poses(server: Server, photographs: Path) -> None:
    x, y, z = (str(value) for value in pictures.CENTRE_M)
    height = ["--camera-height", str(pictures.CAMERA_HEIGHT_M)]
    where = ["--server", server.http, "--endpoint", server.zenoh, "--map", MAP, "--robot", MAP]
    out = run("04", *where, "--landmark", "poster-0", "--place", x, y, z, "90", *height, photographs / "drive.csv")
    assert "3.jpg: x 5.0" in out and "supported" in out and "landmarks" in out, out
    last = re.findall(r"y (-?\d\.\d\d) m", out)[-1]
    assert abs(float(last) - 2.1) < 0.1, out

    out = run("04", *where, "--landmark", "poster-0", "--place", x, y, z, "90", *height, photographs / "sample.csv")
    assert "3.jpg: x 5.0" in out and "picture" not in out, out
    (photographs / "short.csv").write_text("drive/0.jpg,0.0,0.0\n")
    failed = fails("04", *where, "--landmark", "poster-0", "--place", x, y, z, "90", photographs / "short.csv")
    assert "line 1 of" in failed and "picture,x_m,y_m,theta_rad" in failed

    (photographs / "camera.json").write_text('{"fx_px": 500, "fy_px": 500, "cx_px": 319.5, "cy_px": 239.5}')
    known: list[str | Path] = [
        "--endpoint",
        server.zenoh,
        "--robot",
        MAP,
        "--camera",
        photographs / "camera.json",
        *height,
    ]
    out = run("03", *known, "--folder", photographs / "drive")
    assert len(re.findall(r"y (-?\d\.\d\d) \+-", out)) == 4, out
    loop = ["--endpoint", server.zenoh, "--robot", MAP, "--view-deg", VIEW_DEG, *height]
    out = run("03", *loop, "--folder", photographs / "drive")
    found = [float(y) for y in re.findall(r"y (-?\d\.\d\d) \+-", out)]
    assert len(found) == 4 and all(abs(y - (2.4 - 0.1 * step)) < 0.1 for step, y in enumerate(found)), out


@pytest.mark.usefixtures("taught_by_example")
def test_a_map_is_watched(server: Server, photographs: Path) -> None:
    example = next(path for path in EXAMPLES if path.name.startswith("05"))
    command = [sys.executable, str(example), "--server", server.http, "--map", MAP, "--count", "3"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as watching:
        assert watching.stdout is not None and watching.stdout.readline() == f"watching {MAP}\n"
        with server.maps() as maps, Robot.connect(MAP, endpoint=server.zenoh, delivery="every") as robot:
            image = Image.file(photographs / "drive" / "0.jpg")
            robot.recognise("front", Capture(image, odometry=Pose2(), deadline_ms=60_000), wait_s=SOON_S)
            maps.add_landmark(MAP, "noticed")
        out, _ = watching.communicate(timeout=SOON_S)
    assert f"{MAP} came" in out and f"{MAP}/front: poster-0" in out, out
