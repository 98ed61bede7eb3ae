"""Claim: every operation of the API has a method of the same name as in Rust, blocking and for asyncio."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import httpx
from conftest import ROOT, Server

from waymark import (
    AsyncMapClient,
    AsyncRobot,
    MapClient,
    Robot,
)
from waymark._http import OPERATIONS

# Methods of Rust that have another name here, with the reason.
OTHER_NAMES = {
    # Keyword arguments stand for the second method.
    "upload_view_with": "upload_view",
    "publish_odometry_at": "publish_odometry",
    # An inbox that one iterates over.
    "map_versions": "map_changes",
}
# Methods of Rust that are not here, with the reason.
NOT_HERE = {
    # For the server's own tests of refusals.
    "publish_raw_frame",
    # The constructors.
    "new",
    # Iteration.
    "next",
    # Keyword arguments of `localise`.
    "with_frame",
    "with_scan",
    "in_map",
}


def document(server: Server) -> dict[str, Any]:
    found: dict[str, Any] = httpx.get(f"{server.http}/api/v1/openapi.json", trust_env=False).json()
    return found


def test_every_operation_of_the_document_has_a_method(server: Server) -> None:
    described = {
        (method.upper(), path.removeprefix("/api/v1"))
        for path, item in document(server)["paths"].items()
        for method in item
    }
    assert len(described) > 60
    assert set(OPERATIONS.values()) == described and len(set(OPERATIONS.values())) == len(OPERATIONS)
    for call in OPERATIONS:
        assert callable(getattr(MapClient, call)) and inspect.iscoroutinefunction(getattr(AsyncMapClient, call)), call


def rust_methods(file: Path) -> set[str]:
    return set(re.findall(r"^    pub (?:async )?fn (\w+)", file.read_text(), re.MULTILINE))


def test_methods_have_the_names_of_the_rust_sdk() -> None:
    sources = ROOT / "client" / "src"
    declared = r'\w+: (\w+) "([^"]+)" => (\w+)'
    rust = {
        OTHER_NAMES.get(call, call): (method, path)
        for file in (sources / "http").glob("*.rs")
        for method, path, call in re.findall(declared, file.read_text())
    }
    assert rust == OPERATIONS
    methods = rust_methods(sources / "robot.rs") | rust_methods(sources / "questions.rs")
    robot = {OTHER_NAMES.get(each, each) for each in methods} - NOT_HERE
    assert {"recognise", "poses", "gaze", "localise"} <= robot
    for side in (Robot, AsyncRobot):
        assert [each for each in robot if not hasattr(side, each)] == []


def test_blocking_and_asynchronous_methods_take_the_same_arguments() -> None:
    for blocking, waiting in ((MapClient, AsyncMapClient), (Robot, AsyncRobot)):
        for name, method in inspect.getmembers(blocking, inspect.isfunction):
            if not name.startswith("_") and name != "close":
                other = inspect.signature(getattr(waiting, name))
                assert inspect.signature(method).parameters == other.parameters, name
