#!/usr/bin/env bash
# The long form of the fuzz targets: 10^6 executions each, or as many as fit into a time. Prints a table: executions, seconds,
# peak memory, slowest input. What an input costs and what memory a run has are bounds of the tests: 1 s, 256 MB.
#
#   fuzz/long.sh [TARGET...]        WAYMARK_RUNS=1000000 executions, WAYMARK_SECONDS=600 for each target at most
#
# An input that breaks a target is kept in fuzz/artifacts. Bundles are no target here, for the server alone reads them:
# WAYMARK_RUNS=1000000 cargo test -p server --lib any_bytes_as_a_bundle.
set -euo pipefail
cd "$(dirname "$0")"
runs=${WAYMARK_RUNS:-1000000} seconds=${WAYMARK_SECONDS:-600}
targets=${*:-messages jpeg png json map_files keys pose stored credentials detect ros2_cdr}
host=$(rustc -vV | sed -n 's/^host: //p')
cargo build --quiet --release --locked --target "$host" --target-dir target
mkdir -p artifacts
broken=0
printf '| %-11s | %10s | %7s | %10s | %11s | %s |\n' target executions seconds 'peak RSS' 'slowest' outcome
printf '|---|---|---|---|---|---|\n'
for target in $targets; do
    found=$(mktemp -d)
    mkdir -p "corpus/$target"
    outcome=ok begun=$SECONDS
    "target/$host/release/$target" "$found" "corpus/$target" -runs="$runs" -max_total_time="$seconds" -max_len=8192 \
        -timeout=10 -rss_limit_mb=512 -artifact_prefix="artifacts/$target-" -print_final_stats=1 >"$found.log" 2>&1 ||
        { outcome='BROKEN'; broken=1; }
    stat() { sed -n "s/^stat::$1: *//p" "$found.log"; }
    printf '| %-11s | %10s | %7s | %7s MB | %9s s | %s |\n' "$target" "$(stat number_of_executed_units)" \
        $((SECONDS - begun)) "$(stat peak_rss_mb)" "$(stat slowest_unit_time_sec)" "$outcome"
    [ $outcome = ok ] || { grep -E 'panicked|ERROR|SUMMARY' -A2 "$found.log" | head -8 >&2; }
    rm -rf "$found" "$found.log"
done
exit $broken
