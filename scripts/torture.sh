#!/usr/bin/env bash
# Attacks the program in every way for about ten minutes on two cores:
#
#     scripts/torture.sh [SCALE]
#
# kills        kills a running map at random moments; after resuming, the map must be equal to the byte
# corruptions  flips bits of records.bin; at most one batch may be lost, and no wrong record may be read
# cuts         truncates records.bin at random places
# scenes       mutates and generates scenes; each must be valid or refused with a remedy
# faults       makes calls of the graphics driver fail; there must be no panic, and the next run must go on
# cells        computes cells of random parameters; none may take much longer than a typical one
#
# SCALE (1 by default) multiplies all numbers. scripts/test.sh runs short forms of all attacks. A table is printed
# at the end. The exit code is 1 if there is a fault.
set -euo pipefail
cd "$(dirname "$0")/.."
export LC_ALL=C CARGO_INCREMENTAL="${CARGO_INCREMENTAL:-0}" GALLIVM_PERF="${GALLIVM_PERF:-nopt}"

scale="${1:-1}"
[[ "$scale" =~ ^[1-9][0-9]*$ ]] || { echo "usage: scripts/torture.sh [SCALE]" >&2; exit 2; }
log="$(mktemp)"
trap 'rm -f "$log"' EXIT
table=()
failed=0

# attack COUNT PACKAGE BINARY FILTER: runs tests and adds a row to the table for each line `torture: KIND N, faults M`.
attack() {
    local count="$1" package="$2" binary="$3" began=$SECONDS code=0
    shift 3
    RATTLEMAP_TORTURE="$count" cargo test --quiet -p "$package" --test "$binary" -- --nocapture "$@" >"$log" 2>&1 || code=$?
    local rows
    rows="$(sed -n 's/^.*torture: \([a-z]*\) \([0-9]*\), [a-z]* \([0-9]*\)$/\1 \2 \3/p' "$log")"
    if ((code)) || [[ -z "$rows" ]]; then
        failed=1
        tail -n 40 "$log" >&2
    fi
    while read -r kind tried found; do
        [[ -z "$kind" ]] || table+=("| $kind | $tried | $found | $((SECONDS - began)) s |")
    done <<<"$rows"
}

echo "== building"
cargo test --quiet -p rattlemap -p rattlemap-bench --test cli --test library --test instruments --no-run
echo "== kills"
attack $((60 * scale)) rattlemap cli killed_runs_can_be_resumed
echo "== corruptions and cuts"
attack $((10000 * scale)) rattlemap cli flipped_bits_damage
attack $((5000 * scale)) rattlemap cli a_file_may_end_anywhere
echo "== faults of the graphics driver"
attack $((100 * scale)) rattlemap cli a_failing_driver
echo "== scenes"
attack $((40000 * scale)) rattlemap library scene_fuzz
echo "== cells"
attack $((100000 * scale)) rattlemap-bench instruments every_cell_ends_soon

printf '\n| attacks | tried | faults | time |\n| --- | --- | --- | --- |\n'
printf '%s\n' "${table[@]}"
exit "$failed"
