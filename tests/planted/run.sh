#!/usr/bin/env bash
# Tests of the tests: applies each patch of this folder in a worktree of its own, runs the command of its first line, and
# expects it to fail. `tests/planted/run.sh [NAME...]`; without names all of them. Prints a table; fails where a fault was not
# found, a patch no longer applies or does not build, or a test fails without it.
# CARGO_TARGET_DIR: where it is built (target/planted). Never that of the checkout: cargo takes the crates of two checkouts for
# the same ones, so a build with a fault would be used where there is none.
# PLANTED_LOGS: where the output of the tests goes.
set -uo pipefail
root=$(git -C "$(dirname "$0")" rev-parse --show-toplevel)
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$root/target/planted} CARGO_INCREMENTAL=0
logs=${PLANTED_LOGS:-$CARGO_TARGET_DIR/logs}
mkdir -p "$logs"
work=$(mktemp -d)
trap 'git -C "$root" worktree remove --force "$work/tree" 2>/dev/null; rm -rf "$work"' EXIT
git -C "$root" worktree add --quiet --detach "$work/tree" HEAD || exit 2
cd "$work/tree" || exit 2

# What the patch asks for: `# test: COMMAND`.
command_of() { head -1 "$1" | sed -n 's/^# test: //p'; }
builds() {
    case $1 in *'cargo test '*) eval "${1/cargo test /cargo test --no-run }" ;; esac
}

failed=0
declare -A green
report() {
    printf '| %-34s | %-28s | %5ss |\n' "$1" "$2" "$3"
    [ "$2" = found ] || failed=1
}
printf '| %-34s | %-28s | %6s |\n|%s|%s|%s|\n' fault outcome time "$(printf -- '-%.0s' {1..36})" "$(printf -- '-%.0s' {1..30})" --------
for patch in "$root"/tests/planted/*.patch; do
    name=$(basename "$patch" .patch)
    [ $# -eq 0 ] || [[ " $* " == *" $name "* ]] || continue
    begun=$SECONDS
    test=$(command_of "$patch")
    log=$logs/$name.log
    if [ -z "$test" ]; then
        report "$name" 'names no test' 0
        continue
    fi
    if [ -z "${green[$test]:-}" ]; then
        if ! eval "$test" >"$log" 2>&1; then
            report "$name" 'its test fails without it' $((SECONDS - begun))
            continue
        fi
        green[$test]=1
    fi
    if ! git apply "$patch" 2>>"$log"; then
        report "$name" 'the patch does not apply' 0
        continue
    fi
    if ! builds "$test" >"$log" 2>&1; then
        report "$name" 'it does not build' $((SECONDS - begun))
    elif eval "$test" >"$log" 2>&1; then
        report "$name" 'NOT FOUND' $((SECONDS - begun))
    else
        report "$name" found $((SECONDS - begun))
    fi
    git checkout --quiet . && git clean -fdq -e target
done
exit $failed
