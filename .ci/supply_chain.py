"""Compares the tree of dependencies with supply-chain.toml: least versions, licences, sources, banned packages, and
exceptions that are reviewed and still needed. Offline: it reads Cargo.lock's packages by `cargo metadata`.

`python3 .ci/supply_chain.py` checks; `--self-test` plants a fault of each kind and expects it to be found.
"""

import datetime
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent


def packages():
    """Every package that is built for this machine, and those of other platforms that are in the lock file by name."""
    host = re.search(r"host: (\S+)", subprocess.run(["rustc", "-vV"], capture_output=True, text=True, check=True).stdout)
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--filter-platform", host[1]]
    found = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if found.returncode != 0:
        sys.exit(found.stderr)
    return json.loads(found.stdout)["packages"]


def version(text):
    """The numbers of a version; what follows them is left out."""
    return tuple(int(number) for number in re.match(r"(\d+)\.(\d+)\.(\d+)", text).groups())


def is_allowed(licence, allowed):
    """Whether an SPDX expression can be fulfilled by allowed licences."""
    tokens = re.findall(r"\(|\)|AND|OR|[\w.+-]+(?: WITH [\w.-]+)?", licence.replace("/", " OR "))
    words = [t if t in ("(", ")") else {"AND": "and", "OR": "or"}.get(t, str(t in allowed)) for t in tokens]
    # Only True, False, and, or and brackets are left.
    return bool(words) and eval(" ".join(words), {"__builtins__": {}}, {"True": True, "False": False})


def faults(rules, found, today):
    """Every way in which the tree differs from the rules."""
    out, by_name = [], {}
    for package in found:
        by_name.setdefault(package["name"], []).append(package)
    for package in found:
        name, source = f"{package['name']} {package['version']}", package["source"]
        if source is not None and source not in rules["sources"]:
            out.append(f"{name} comes from {source}")
        if not is_allowed(package.get("license") or "", rules["licences"]):
            out.append(f"{name} has the licence {package.get('license')}")
    out += [f"{name} is banned" for name in rules["banned"] if name in by_name]
    for floor in rules["floor"]:
        there = by_name.get(floor["package"])
        if not there:
            out.append(f"{floor['package']} is gone: its floor is not needed")
        for package in there or []:
            if version(package["version"]) < version(floor["least"]):
                out.append(f"{package['name']} {package['version']} is below {floor['least']}: {floor['reason']}")
    for exception in rules["exception"]:
        is_there = any(p["version"] == exception["version"] for p in by_name.get(exception["package"], []))
        if not is_there:
            out.append(f"{exception['package']} {exception['version']} is not in the tree: review its exception")
        reviewed = datetime.date.fromisoformat(exception["reviewed"])
        if reviewed > today + datetime.timedelta(days=1) or len(exception["reason"]) < 20:
            out.append(f"{exception['package']}: the exception has no reason or no date")
    return out


def self_test(rules, found, today):
    """Plants faults."""
    ours = {"name": "planted", "version": "1.0.0", "source": None, "license": "MIT"}
    planted = {
        "a source": [*found, ours | {"source": "git+https://example.org/planted"}],
        "a licence": [*found, ours | {"license": "GPL-3.0-only AND MIT"}],
        "no licence": [*found, ours | {"license": None}],
        "a banned package": [*found, ours | {"name": "openssl-sys"}],
        "an old version": [*found, ours | {"name": "libsqlite3-sys", "version": "0.36.9"}],
        "an exception that is not needed": [p for p in found if p["name"] != "paste"],
    }
    for what, tree in planted.items():
        assert len(faults(rules, tree, today)) == 1, f"{what}: {faults(rules, tree, today)}"
    assert is_allowed("(MIT OR GPL-3.0-only) AND ISC", rules["licences"])
    assert is_allowed("Apache-2.0 WITH LLVM-exception", rules["licences"])
    assert not is_allowed("Apache-2.0 WITH Other-exception", rules["licences"])


def main():
    rules = tomllib.loads((ROOT / "supply-chain.toml").read_text())
    found, today = packages(), datetime.date.today()
    if "--self-test" in sys.argv:
        self_test(rules, found, today)
    out = faults(rules, found, today)
    for fault in out:
        print(fault, file=sys.stderr)
    print(f"{len(found)} packages, {len(rules['exception'])} reviewed exceptions, {len(out)} faults")
    sys.exit(bool(out))


main()
