#!/usr/bin/env bash
# Checks the administrator's pages: types, units, what is generated, and journeys in a real browser against the real server.
# WAYMARK_PROGRAM names the program; else target/debug/waymark is taken.
set -euo pipefail
cd "$(dirname "$0")"

[ -x "${CHROMIUM:-/usr/bin/chromium}" ] || { apt-get update -q && apt-get install -qy --no-install-recommends chromium; }
npm ci --ignore-scripts --no-audit --no-fund
npm run check
npm run unit
npm run journeys
