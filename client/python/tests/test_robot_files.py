"""Claim: a robot that was enrolled connects with encryption by its file; a certificate that is not valid is named."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pictures
import pytest
from conftest import ROOT, SOON_S, Server

from waymark import (
    AsyncRobot,
    CertificateExpired,
    Image,
    InvalidInput,
    MapClient,
    NotAdmitted,
    Robot,
    RobotFile,
    TlsRefused,
)

PROGRAM = Path(os.environ.get("WAYMARK_BIN", ROOT / "target" / "debug" / "waymark"))


@pytest.fixture(scope="module")
def encrypted(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server with an encrypted endpoint."""
    data = tmp_path_factory.mktemp("encrypted")
    listen = ["--http", "127.0.0.1:0", "--zenoh", "tls/127.0.0.1:0", "--tls"]
    command = [str(PROGRAM), "serve", *listen, "--log", "warn", "--data", str(data)]
    settings = {name: value for name, value in os.environ.items() if not name.startswith("WAYMARK_")}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=settings) as process:
        assert process.stdout is not None
        try:
            https, zenoh = (process.stdout.readline().split()[1].rstrip("/") for _ in range(2))
            # On the server's own machine, plain text is answered.
            yield Server(https.replace("https://", "http://"), zenoh)
        finally:
            process.terminate()
            process.wait(20)


@pytest.fixture(scope="module")
def enrolled(encrypted: Server, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of robot `r1`."""
    with encrypted.maps() as maps:
        maps.create_map("hall")
        for robot in ("r1", "r2"):
            maps.put_robot(robot, "hall")
    out = tmp_path_factory.mktemp("robots") / "r1"
    command = [str(PROGRAM), "robot", "enrol", "r1", "--out", str(out), "--server", encrypted.http]
    subprocess.run(command, check=True, capture_output=True)
    return out / "robot.json"


def changed(file: Path, to: Path, **values: object) -> Path:
    """The file with other values, and with absolute paths."""
    read = json.loads(file.read_text())
    paths = {name: str(file.parent / read[name]) for name in ("certificate", "key", "authority")}
    to.write_text(json.dumps({**read, **paths, **values}))
    return to


def picture() -> Image:
    return Image.rgb(pictures.seen_from(pictures.front())).jpeg(90)


def test_an_enrolled_robot_is_answered(enrolled: Path, encrypted: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    assert RobotFile.read(enrolled).endpoint == encrypted.zenoh
    monkeypatch.setenv("WAYMARK_ROBOT_FILE", str(enrolled))
    with Robot.from_file() as robot:
        assert robot.name == "r1"
        assert robot.recognise("front", picture(), wait_s=SOON_S).map == "hall"


def test_an_enrolled_robot_hears_of_maps_by_their_names(enrolled: Path, encrypted: Server) -> None:
    with encrypted.maps() as maps, Robot.from_file(enrolled) as robot:
        with robot.map_changes("hall") as changes:
            first = changes.get(SOON_S)
            assert first is not None and first.version == maps.map("hall").version == robot.map_version("hall")
        with pytest.raises(InvalidInput, match="a map is named"):
            robot.map_changes("*")


def test_an_enrolled_robot_is_answered_in_a_program_of_asyncio(enrolled: Path) -> None:
    async def run() -> str:
        async with await AsyncRobot.from_file(enrolled) as robot:
            return (await robot.recognise("front", picture(), wait_s=SOON_S)).map

    assert asyncio.run(run()) == "hall"


def test_a_certificate_that_is_not_valid_is_named(enrolled: Path, encrypted: Server, tmp_path: Path) -> None:
    other = tmp_path / "robot.json"
    with pytest.raises(CertificateExpired, match="expired"):
        Robot.from_file(changed(enrolled, other, expires_ms=1))
    with pytest.raises(NotAdmitted, match="see waymark robot certificates"):
        Robot.from_file(changed(enrolled, other, robot="r2"), timeout_s=2)
    with pytest.raises(TlsRefused, match="waymark robot enrol"):
        Robot.from_file(changed(enrolled, other, authority=None), timeout_s=2)
    with pytest.raises(InvalidInput, match=r"robot\.json"):
        Robot.from_file(tmp_path / "no" / "robot.json")
    other.write_text("{}")
    with pytest.raises(InvalidInput, match="waymark robot enrol"):
        Robot.from_file(other)


def test_certificates_are_listed_and_revoked(encrypted: Server, tmp_path: Path) -> None:
    with encrypted.maps() as maps:
        maps.create_map("yard")
        maps.put_robot("r3", "yard")
        out = tmp_path / "r3"
        command = [str(PROGRAM), "robot", "enrol", "r3", "--out", str(out), "--server", encrypted.http]
        subprocess.run(command, check=True, capture_output=True)
        with Robot.from_file(out / "robot.json"):
            revoke(maps)
        with pytest.raises(NotAdmitted):
            Robot.from_file(out / "robot.json", timeout_s=2)


def revoke(maps: MapClient) -> None:
    """Revokes the only certificate of `r3`."""
    (only,) = maps.robot_certificates("r3")
    assert only.robot == "r3" and only.revoked_ms is None and only.expires_ms > only.issued_ms
    maps.revoke_robot_certificate("r3", only.serial)
    assert maps.robot_certificates("r3")[0].revoked_ms is not None
