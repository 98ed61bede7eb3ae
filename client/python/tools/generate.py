"""Writes the generated files: the messages of `waymark.proto`, the bodies of the OpenAPI document, and the blocking
client from that of asyncio.

    python tools/generate.py           writes them
    python tools/generate.py --check   says which are out of date

The messages need `pip install -e '.[dev]'`.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from bodies import bodies

PACKAGE = Path(__file__).resolve().parent.parent / "src" / "waymark"
PROTOS = PACKAGE.parents[3] / "protos"
DOCUMENT = PACKAGE.parents[3] / "docs" / "openapi.json"
PROTO = "waymark/v1/waymark.proto"
HEAD = "# Made by tools/generate.py from {source}. Do not edit.\n"

# In order; each where no letter stands before it.
WORDS = [
    (r"async def", "def"),
    (r"async with", "with"),
    (r"async for", "for"),
    (r"await ", ""),
    (r"Async(?=[A-Z])", ""),
    (r"__aenter__", "__enter__"),
    (r"__aexit__", "__exit__"),
    (r"__aiter__", "__iter__"),
    (r"aiter_(?=lines|bytes)", "iter_"),
    (r"aclose", "close"),
    (r"aread", "read"),
    (r"asyncio\.sleep", "time.sleep"),
    (r"import asyncio\nimport json", "import json\nimport time"),
    (r"import asyncio\nimport contextlib\nimport copy", "import contextlib\nimport copy\nimport time"),
    (r"waymark\._async", "waymark._sync"),
    (r"for asyncio, written by hand; `tools/generate\.py` makes `_sync` of it", "that blocks"),
]


def blocking(text: str) -> str:
    """The blocking form of a source for asyncio."""
    for pattern, word in WORDS:
        text = re.sub(rf"(?<![A-Za-z]){pattern}", word, text)
    return text


def generated() -> dict[Path, str]:
    """Path and text of every generated file."""
    files = {}
    for source in sorted((PACKAGE / "_async").glob("*.py")):
        text = HEAD.format(source=f"_async/{source.name}") + blocking(source.read_text())
        files[PACKAGE / "_sync" / source.name] = formatted(text)
    made = HEAD.format(source="docs/openapi.json") + bodies(DOCUMENT, PACKAGE / "wire.py")
    files[PACKAGE / "api" / "bodies.py"] = formatted(made)
    files.update(messages())
    return files


def formatted(text: str) -> str:
    """Sorted imports and lines as the project has them."""
    for command in (["check", "--select", "I", "--fix"], ["format"]):
        text = subprocess.run(
            [sys.executable, "-m", "ruff", *command, "--quiet", "--stdin-filename", str(PACKAGE / "x.py"), "-"],
            input=text,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
    return text


def messages() -> dict[Path, str]:
    """The messages by the protobuf compiler."""
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "grpc_tools.protoc", f"-I{PROTOS}", f"--python_out={out}", f"--pyi_out={out}"]
        subprocess.run([*command, PROTO], check=True)
        made = sorted(Path(out).rglob("waymark_pb2.py*"))
        return {PACKAGE / "v1" / file.name: file.read_text() for file in made}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--check", action="store_true", help="write nothing; fail if a file is out of date")
    is_check = parser.parse_args().check
    stale = []
    for path, text in generated().items():
        if not path.is_file() or path.read_text() != text:
            stale.append(path.name if is_check else f"{path.relative_to(PACKAGE)} written")
            if not is_check:
                path.parent.mkdir(exist_ok=True)
                path.write_text(text)
    for line in stale:
        print(f"{line} is out of date: python tools/generate.py" if is_check else line)
    return 1 if is_check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
