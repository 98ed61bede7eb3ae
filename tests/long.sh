#!/usr/bin/env bash
# All long forms of the tests, one after the other, with a dated report in docs/results. About five hours on two cores; each
# part may be left out or run alone: `tests/long.sh [fuzz] [simulation] [kills] [cuts] [soak] [planted]`.
# WAYMARK_RUNS, WAYMARK_SECONDS: of fuzz/long.sh. A part that fails is named, and the others go on.
set -uo pipefail
cd "$(dirname "$0")/.."
parts=${*:-fuzz simulation kills cuts soak planted}
report=docs/results/$(date -u +%Y-%m-%d)-long.md
log=$(mktemp -d)
failed=0
say() { printf '%s\n' "$@" >>"$report"; }

# part NAME TITLE COMMAND: runs it; the lines that matter go to the report.
part() {
    case " $parts " in *" $1 "*) ;; *) return ;; esac
    local begun=$SECONDS outcome=passed
    echo "== $2"
    bash -ec "$3" >"$log/$1" 2>&1 || { outcome=FAILED; failed=1; }
    say '' "## $2: $outcome" '' "\`$3\`, $((SECONDS - begun)) s" '' '```text'
    grep -E '^test |^test result|^\||panicked|seed [0-9]|cuts|kills|answered again|slope|p99' "$log/$1" |
        grep -v ' 0 passed; 0 failed' | tail -60 | cut -c1-118 >>"$report"
    say '```'
    echo "   $outcome, $((SECONDS - begun)) s, log $log/$1"
}

say "# Long forms of the tests, $(date -u +%Y-%m-%d)" '' \
    "Commit $(git rev-parse --short HEAD), $(nproc) processors, $(sed -n 's/^model name.*: //p' /proc/cpuinfo | head -1)."
part fuzz 'Fuzz targets' 'fuzz/long.sh; WAYMARK_RUNS=100000 cargo test --workspace --lib -- any_bytes_as_a_bundle; WAYMARK_RUNS=100000 cargo test -p server --lib any_frames'
part simulation 'Simulation, 20 000 seeds of frames and 1 000 of the store' \
    'WAYMARK_SEEDS=20000 cargo test --release -p engine --test simulation;
     WAYMARK_SEEDS=1000 cargo test --workspace --lib -- publication::tests::simulation'
part kills '200 kills' 'WAYMARK_KILLS=200 cargo test --workspace --test end_to_end -- --nocapture restart::'
part cuts '5 000 power cuts, and faults of disk and link' \
    'WAYMARK_LONG=1 cargo test --workspace --lib -- store::power_cuts store::damage store::io_errors;
     WAYMARK_LONG=1 cargo test --workspace --test end_to_end -- full_disk::;
     WAYMARK_LONG=1 cargo test --workspace --test link_faults -- --nocapture'
part soak 'An hour of mixed load' 'cargo run --release -p lab -- bench load --minutes 60'
part planted 'Planted faults' 'tests/planted/run.sh'
echo "report: $report"
exit $failed
