#!/usr/bin/env bash
# Installs the package with what its tests need into an environment of its own, and checks it: generated files, types,
# style, and the tests against the real server. WAYMARK_BIN names the program; else `target/debug/waymark` is taken.
set -euo pipefail
cd "$(dirname "$0")"

environment=${WAYMARK_PYTHON_ENV:-../../target/python}
[ -x "$environment/bin/python" ] || python3 -m venv "$environment"
python=$environment/bin/python
"$python" -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
"$python" -m ruff format --check --quiet .
"$python" -m ruff check --quiet .
"$python" -m mypy
"$python" -m pytest
