"""Claim: a bundle is read by the program of its documentation, without Waymark, and makes the map again."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from conftest import ROOT, Server

from waymark import MapClient, Refused


def test_the_program_of_the_documentation_reads_a_bundle(server: Server, tmp_path: Path) -> None:
    program = re.search(r"^```python\n(.*?)^```$", (ROOT / "docs" / "BUNDLE.md").read_text(), re.MULTILINE | re.DOTALL)
    assert program is not None
    scope: dict[str, Any] = {}
    exec(program[1], scope)
    file = tmp_path / "bundle.zip"
    with MapClient(server.http) as maps:
        maps.create_map("bundle-first", building="house")
        size = maps.save_map("bundle-first", file)
        head, files = scope["read"](file)
        assert (size, head["version"], head["map"]) == (file.stat().st_size, 1, "bundle-first")
        assert json.loads(files["map.json"])["building"] == "house"
        bundle = file.read_bytes()
        assert maps.load_map(bundle, "bundle-second").building == "house"
        with pytest.raises(Refused) as refused:
            maps.load_map(bundle[:-1], "bundle-third")
        assert refused.value.code == "not_a_bundle"
    file.write_bytes(bundle[:50] + b"?" + bundle[51:])
    with pytest.raises(AssertionError, match="damaged"):
        scope["read"](file)
