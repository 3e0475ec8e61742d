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
# cells        computes cells of random parameters; each must take at most a second of one core (`rattlemap-bench stress --part work`)
#
# SCALE (1 by default) multiplies all numbers but the last. scripts/test.sh runs short forms of all attacks. A table is printed
# at the end. The exit code is 1 if there is a fault.
set -euo pipefail
cd "$(dirname "$0")/.."
export LC_ALL=C CARGO_INCREMENTAL="${CARGO_INCREMENTAL:-0}" GALLIVM_PERF="${GALLIVM_PERF:-nopt}"

scale="${1:-1}"
[[ "$scale" =~ ^[1-9][0-9]*$ ]] || { echo "usage: scripts/torture.sh [SCALE]" >&2; exit 2; }
log="$(mktemp)"
work="$(mktemp -d)"
trap 'rm -rf "$log" "$work"' EXIT
table=()
failed=0

# attack COUNT BINARY FILTER: runs tests and adds a row to the table for each line `torture: KIND N, faults M`.
attack() {
    local count="$1" binary="$2" began=$SECONDS code=0
    shift 2
    RATTLEMAP_TORTURE="$count" cargo test --quiet -p rattlemap --test "$binary" -- --nocapture "$@" >"$log" 2>&1 || code=$?
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
cargo build --release -p rattlemap-bench
cargo test --quiet -p rattlemap --test cli --test core --no-run
echo "== kills"
attack $((60 * scale)) cli killed_runs_can_be_resumed
echo "== corruptions and cuts"
attack $((10000 * scale)) cli flipped_bits_cost
attack $((5000 * scale)) cli a_file_may_end_anywhere
echo "== faults of the graphics driver"
attack $((100 * scale)) cli a_driver_that_fails
echo "== scenes"
attack $((40000 * scale)) core scene_fuzz
echo "== cells"
began=$SECONDS
cells=0
cargo run --quiet --release -p rattlemap-bench -- stress --part work --out "$work/work" 2>&1 | tee "$log" || cells=1
tried="$(awk -F, '$1 == "all" { print $2 }' "$work/work/work.csv" 2>/dev/null || true)"
table+=("| cells | ${tried:-0} | $cells | $((SECONDS - began)) s |")
((cells == 0)) || failed=1

printf '\n| attacks | tried | faults | time |\n| --- | --- | --- | --- |\n'
printf '%s\n' "${table[@]}"
printf '\n'
sed -n 's/^work *\(holds\|FAILS\): /cells: /p' "$log"
exit "$failed"
