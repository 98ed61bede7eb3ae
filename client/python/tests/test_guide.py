"""Claim: the guide works: its programs run in order against a real server, and print what it says."""

from __future__ import annotations

import contextlib
import io
import re
import textwrap
from pathlib import Path
from typing import Any

import pictures
import pytest
from conftest import ROOT, Server

from waymark import Image

GUIDE = ROOT / "docs" / "guides" / "python.md"


def programs() -> list[str]:
    """The Python of the guide, block by block."""
    blocks = re.findall(r"^( *)```python\n(.*?)^\1```$", GUIDE.read_text(), re.MULTILINE | re.DOTALL)
    return [textwrap.dedent(block) for _, block in blocks]


def expected() -> list[str]:
    """The lines that it says one should see."""
    return GUIDE.read_text().split("## What you should see")[1].split("```text\n")[1].split("```")[0].splitlines()


def test_every_program_of_the_guide_runs(server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, seed in (("poster", 0), ("door", 1)):
        photo = Image.rgb(pictures.seen_from(pictures.front(1.6), seed)).jpeg(95)
        (tmp_path / f"{name}.jpg").write_bytes(photo.data)
    (tmp_path / "view.jpg").write_bytes(Image.rgb(pictures.seen_from(pictures.front(2.0))).jpeg(95).data)
    monkeypatch.chdir(tmp_path)
    assert len(programs()) == 7
    scope: dict[str, Any] = {}
    with contextlib.redirect_stdout(io.StringIO()) as out:
        for program in programs():
            here = program.replace("http://127.0.0.1:8080", server.http)
            exec(here.replace("tcp/127.0.0.1:7447", server.zenoh), scope)
    printed = out.getvalue().splitlines()
    for line in expected():
        assert any(same(line, each) for each in printed), (line, printed)


def same(line: str, printed: str) -> bool:
    """Whether both have the same words, and numbers within 0.05. What follows an ellipsis is free."""
    number = r"-?\d+\.\d+"
    words = re.sub(number, "#", line.split("...")[0])
    if not re.sub(number, "#", printed).startswith(words):
        return False
    pairs = zip(re.findall(number, line), re.findall(number, printed), strict=False)
    return all(abs(float(a) - float(b)) < 0.05 for a, b in pairs)


def test_the_guide_names_what_there_is() -> None:
    text = GUIDE.read_text()
    assert "./client/python[numpy,jpeg]" in text
    extras = (ROOT / "client" / "python" / "pyproject.toml").read_text()
    assert "\nnumpy = [" in extras and "\njpeg = [" in extras
