"""A real server for the tests: `waymark serve` on free ports and a temporary folder.

WAYMARK_BIN names the program; without it, the one that `cargo build` made in `target/debug` is taken.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pictures
import pytest

from waymark import MapClient, Place, Size

ROOT = Path(__file__).resolve().parents[3]
SOON_S = 30.0


@dataclass(frozen=True)
class Server:
    """A running server: its addresses for HTTP and for robots."""

    http: str
    zenoh: str

    def maps(self) -> MapClient:
        """A client of it."""
        return MapClient(self.http)


@contextlib.contextmanager
def serving(data: Path) -> Iterator[Server]:
    """A server with its data in this directory, until the end."""
    program = Path(os.environ.get("WAYMARK_BIN", ROOT / "target" / "debug" / "waymark"))
    if not program.is_file():
        pytest.fail(f"no {program}: cargo build --bin waymark, or set WAYMARK_BIN")
    listen = ["--http", "127.0.0.1:0", "--zenoh", "tcp/127.0.0.1:0"]
    command = [str(program), "serve", *listen, "--log", "warn", "--data", str(data)]
    # Variables of this name are settings of the server.
    settings = {name: value for name, value in os.environ.items() if not name.startswith("WAYMARK_")}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=settings) as process:
        assert process.stdout is not None
        try:
            http, zenoh = (process.stdout.readline().split()[1].rstrip("/") for _ in range(2))
            yield Server(http, zenoh)
        finally:
            process.terminate()
            process.wait(20)


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One server for all tests; each test has maps and robots of its own names."""
    with serving(tmp_path_factory.mktemp("waymark")) as running:
        yield running


@pytest.fixture(scope="session")
def taught(server: Server) -> str:
    """The name of a map with posters `poster-0` (with a place) and `poster-1`, both learnt, and of a robot on it."""
    name = "taught"
    with server.maps() as maps:
        maps.create_map(name)
        x, y, z = pictures.CENTRE_M
        place = Place(x, y, z, theta_rad=1.5707963267948966)
        maps.add_landmark(name, "poster-0", Size(*pictures.SIZE_M), place)
        maps.add_landmark(name, "poster-1", Size(*pictures.SIZE_M))
        for seed in range(2):
            maps.upload_view(name, f"poster-{seed}", pictures.teaching_photo(seed))
        maps.wait_for_job(maps.learn(name), SOON_S * 4)
        for landmark in maps.landmarks(name):
            assert landmark.status == "active", landmark
        maps.put_robot(name, name)
    return name
