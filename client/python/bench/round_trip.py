"""The round trip of a 640 x 480 frame from Python and from Rust, frame by frame in turn, against one server.

    cargo build --release --locked --bin waymark && cargo build --release --locked -p client --example round_trip
    python bench/round_trip.py --server ../../target/release/waymark \\
        --rust ../../target/release/examples/round_trip

A map with one learnt poster; both clients send the same JPEG and the same raw rgb8. Printed are medians, in
milliseconds: from send to answer, and of it what is not the server's (`Answer.latency_ms`).
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tests"))

import pictures  # noqa: E402

from waymark import Answer, Capture, Image, MapClient, Robot  # noqa: E402
from waymark._messages import frame_bytes, prepared  # noqa: E402
from waymark._values import from_message  # noqa: E402
from waymark.v1 import waymark_pb2 as pb  # noqa: E402

MAP = "bench"
ENCODINGS = ("jpeg", "rgb8")
# Frames of each kind that are sent before any is counted.
WARM_UP = 20
# The most quads of an answer.
MANY_QUADS = 24


@dataclass
class Times:
    """Round trips of one client, and what of each was not the server's; ms."""

    total: list[float] = field(default_factory=list)
    outside: list[float] = field(default_factory=list)

    def add(self, total_ms: float, server_ms: float) -> None:
        self.total.append(total_ms)
        self.outside.append(total_ms - server_ms)

    def __str__(self) -> str:
        return f"{statistics.median(self.total):.2f} ({statistics.median(self.outside):.2f} outside of the server)"


class RustSide:
    """`client/examples/round_trip.rs` as a child."""

    def __init__(self, program: str, endpoint: str, jpeg: Path, rgb: Path) -> None:
        size = [str(pictures.WIDTH_PX), str(pictures.HEIGHT_PX)]
        command = [program, "--endpoint", endpoint, "--robot", "rust", "--jpeg", str(jpeg), "--rgb", str(rgb)]
        self._child = subprocess.Popen(
            [*command, "--size", *size], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )

    def send(self, encoding: str) -> tuple[float, float]:
        assert self._child.stdin is not None and self._child.stdout is not None
        self._child.stdin.write(encoding + "\n")
        total, server = self._child.stdout.readline().split()
        return float(total), float(server)

    def close(self) -> None:
        assert self._child.stdin is not None
        self._child.stdin.close()
        self._child.wait(20)


def send_from_python(robot: Robot, frame: bytes | pictures.Pixels) -> tuple[float, float]:
    """Sends what a program has in its hands, the bytes of a file or an array, and waits for the answer."""
    started = time.perf_counter()
    image = Image.encoded(frame) if isinstance(frame, bytes) else Image.rgb(frame)
    answer = robot.recognise("front", Capture(image, deadline_ms=60_000), wait_s=30)
    elapsed_ms = 1e3 * (time.perf_counter() - started)
    return elapsed_ms, answer.accepted().latency_ms


def teach(url: str) -> None:
    """A map with one poster, and the two robots on it."""
    with MapClient(url) as maps:
        maps.create_map(MAP)
        maps.add_landmark(MAP, "poster")
        maps.upload_view(MAP, "poster", pictures.teaching_photo(0))
        maps.wait_for_job(maps.learn(MAP))
        for robot in ("python", "rust"):
            maps.put_robot(robot, MAP)


def measure(endpoint: str, rust_program: str, frames: int, folder: Path) -> dict[tuple[str, str], Times]:
    """Times by encoding and client. Who is first changes with every frame."""
    pixels = pictures.seen_from(pictures.front(2.0))
    jpeg = Image.rgb(pixels).jpeg(90).data
    assert isinstance(jpeg, bytes)
    (folder / "frame.jpg").write_bytes(jpeg)
    (folder / "frame.rgb").write_bytes(pixels.tobytes())
    sources: dict[str, bytes | pictures.Pixels] = {"jpeg": jpeg, "rgb8": pixels}
    times = {(encoding, side): Times() for encoding in ENCODINGS for side in ("python", "rust")}
    rust = RustSide(rust_program, endpoint, folder / "frame.jpg", folder / "frame.rgb")
    with Robot.connect("python", endpoint=endpoint, delivery="every") as robot:
        for number in range(-WARM_UP, frames):
            for encoding in ENCODINGS:
                for side in ("python", "rust") if number % 2 else ("rust", "python"):
                    from_python = side == "python"
                    took = send_from_python(robot, sources[encoding]) if from_python else rust.send(encoding)
                    if number >= 0:
                        times[encoding, side].add(*took)
    rust.close()
    return times


def own_work() -> str:
    """What the package itself computes for a frame, apart from zenoh."""
    pixels = pictures.seen_from(pictures.front(2.0))
    answer = pb.Answer()
    for number in range(MANY_QUADS):
        quad = answer.quads.add(verdict=pb.VERDICT_UNIQUE, landmark=f"poster-{number}")
        quad.points.agreement.extend([pb.PART_AGREEMENT_AGREES] * 25)
        quad.pose.covariance.extend([0.0] * 36)
        for _ in range(4):
            quad.corners.add()
            quad.candidates.add(landmark="poster")
    data = answer.SerializeToString()
    builds, reads = [], []
    for _ in range(300):
        started = time.perf_counter()
        frame_bytes(prepared(Capture(Image.rgb(pixels))), 1, 1)
        built = time.perf_counter()
        from_message(Answer, pb.Answer.FromString(data))
        builds.append(1e3 * (built - started))
        reads.append(1e3 * (time.perf_counter() - built))
    return (
        f"of it in this package: {statistics.median(builds):.2f} to write an rgb8 frame, "
        f"{statistics.median(reads):.2f} to read an answer of {MANY_QUADS} quads"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description="Round trips of a frame from Python and from Rust.")
    parser.add_argument("--server", required=True, help="the program `waymark`")
    parser.add_argument("--rust", required=True, help="the example `round_trip` of the crate `client`")
    parser.add_argument("--frames", type=int, default=300, help="of each encoding from each client")
    arguments = parser.parse_args()
    settings = {name: value for name, value in os.environ.items() if not name.startswith("WAYMARK_")}
    with tempfile.TemporaryDirectory() as folder:
        listen = ["--http", "127.0.0.1:0", "--zenoh", "tcp/127.0.0.1:0", "--log", "warn"]
        command = [arguments.server, "serve", *listen, "--data", f"{folder}/data"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=settings) as server:
            assert server.stdout is not None
            url, endpoint = (server.stdout.readline().split()[1].rstrip("/") for _ in range(2))
            teach(url)
            times = measure(endpoint, arguments.rust, arguments.frames, Path(folder))
            server.terminate()
    print(f"Python {platform.python_version()}, {arguments.frames} frames each, medians in ms")
    for encoding in ENCODINGS:
        python, rust = times[encoding, "python"], times[encoding, "rust"]
        difference = statistics.median(python.total) - statistics.median(rust.total)
        print(f"{encoding}: {python} from Python, {rust} from Rust, difference {difference:+.2f}")
    print(own_work())


if __name__ == "__main__":
    main()
