#!/usr/bin/env bash
# Everything that is claimed of a GPU, measured in one go on a machine that has one.
#
#     scripts/measure_gpu.sh BINARY OUT [SIDE [PART...]]
#
# BINARY is a release build of rattlemap; nothing else of the repository is needed but
# scenes/, so that both can be carried to a machine without Rust. In parts, all of them unless some are named:
#
#     right       the lanes are right in both precisions, cell by cell against the reference
#     speed       maps of SIDE x SIDE cells (1024 unless given), each three times
#     engines     the same map on every engine, from 10^3 lanes to as many as fit (`rattlemap bench engines`)
#
# All of it takes eight minutes at most: the last part gets what the others have left (ENGINES_SECONDS, if set).
# The first hardware adapter is measured, or the one that WGPU_ADAPTER_NAME names, be it a software one. Writes to
# OUT, whatever has been measured by then after every part:
#
#     devices.txt             adapters, limits, drivers
#     validation_*.json       correctness, 128 x 128, per precision
#     speed.csv               one row per timed run
#     engines/                throughput against lanes on every engine: tables and figures
#     summary.md              medians, and what they were measured on
#     failed                  what did not go well, if anything: the exit code is 1 then
set -euo pipefail

[[ $# -ge 2 ]] || { sed -n '2,24p' "$0" | sed 's/^# \{0,1\}//'; exit 2; }
binary="$(realpath "$1")"
out="$2"
side="${3:-1024}"
parts=("${@:4}")
((${#parts[@]})) || parts=(right speed engines)
for part in "${parts[@]}"; do
    [[ "$part" =~ ^(right|speed|engines)$ ]] || { echo "error: no part $part; there are right, speed, engines" >&2; exit 2; }
done
scenes="$(cd "$(dirname "$0")/.." && pwd)/scenes"
scene="$scenes/e_omega.toml"
adaptive="$scenes/adaptive.toml"
mkdir -p "$out"
# In memory where there is enough: a disk is not what is timed.
free="$(df --output=avail -k /dev/shm 2>/dev/null | tail -n 1 || true)"
if ((${free:-0} > 4000000)); then work="$(mktemp -d -p /dev/shm)"; else work="$(mktemp -d)"; fi
trap 'rm -rf "$work"' EXIT

square() { printf -- '--set axis.0.count=%s --set axis.1.count=%s' "$1" "$1"; }

rm -f "$out/failed"
# What fails is a finding; the machine is there to be measured all the same.
failed() { echo "$*" | tee -a "$out/failed" >&2; }

# Drivers keep what they have compiled in the home folder, and some images say nowhere where the driver is.
[[ -w "${HOME:-/nowhere}" ]] || export HOME="$work"
nvidia=/usr/local/nvidia/share/vulkan/icd.d/nvidia_icd.json
[[ -n "${VK_DRIVER_FILES:-}" || ! -e "$nvidia" || -e /usr/share/vulkan/icd.d/nvidia_icd.json || -e /etc/vulkan/icd.d/nvidia_icd.json ]] ||
    export VK_DRIVER_FILES="$nvidia"

"$binary" devices | tee "$out/devices.txt"

# The block of an adapter: its name, then "  key  value" lines. A software driver beside the hardware must not be
# measured in its place.
if [[ -n "${WGPU_ADAPTER_NAME:-}" ]]; then
    adapter="$(grep -iF -A3 -- "$WGPU_ADAPTER_NAME" <(grep -A3 '^gpu:' "$out/devices.txt") | head -n 4 || true)"
else
    adapter="$(grep -A3 '^gpu:' "$out/devices.txt" | grep -B1 -A2 '^  kind  *hardware' | head -n 4 || true)"
fi
if [[ "$adapter" != gpu:* ]]; then
    echo "error: no hardware adapter; install its Vulkan driver, or name an adapter by WGPU_ADAPTER_NAME" >&2
    echo "libraries: $(ldconfig -p 2>/dev/null | grep -E 'libvulkan|libGLX_nvidia' | tr -s '[:space:]' ' ')" >&2
    echo "drivers: $(ls /usr/share/vulkan/icd.d /etc/vulkan/icd.d 2>/dev/null | tr '\n' ' ')" >&2
    exit 1
fi
WGPU_ADAPTER_NAME="$(sed -n '1s/^gpu: //p' <<<"$adapter")"
export WGPU_ADAPTER_NAME

precisions=()
for precision in f32 f64; do
    ! grep -q "^  precision .*$precision" <<<"$adapter" || precisions+=("$precision")
done

right() {
    for precision in "${precisions[@]}"; do
        # shellcheck disable=SC2046 # the words of square are meant to be split
        "$binary" map "$scene" --engine gpu --precision "$precision" --out "$work/right" --force $(square 128) ||
            { failed "map: $precision is not there"; continue; }
        "$binary" validate "$work/right" --samples 2000 || failed "validate: $precision has unexplained cells"
        cp "$work/right/validation.json" "$out/validation_$precision.json" || true
    done
}

# name, precision, further settings
timed() {
    local name="$1" precision="$2"
    shift 2
    for run in 1 2 3; do
        # shellcheck disable=SC2046
        "$binary" map "${of:-$scene}" --engine gpu --precision "$precision" --out "$work/timed" --force $(square "$side") \
            "$@" 2>"$work/said" || { failed "map: $name, $precision: $(tail -n 1 "$work/said")"; continue; }
        # "N cells on gpu (f32) in S s: C cells/s, P lane-periods/s, K ns per lane-step; outputs O s"
        grep -E '^[0-9]+ cells.* on gpu' "$work/said" |
            sed -E 's/^([0-9]+) cells.* in ([0-9.]+) s: ([0-9]+) cells\/s, ([0-9]+) lane-periods\/s, ([0-9.]+) ns per lane-step; outputs ([0-9.]+) s.*/\1,\2,\3,\4,\5,\6/' |
            sed "s/^/$name,$precision,$run,/" >>"$out/speed.csv" || failed "map: $name, $precision says no times"
    done
}

speed() {
    echo "what,precision,run,cells,integration_s,cells_per_s,lane_periods_per_s,ns_per_lane_step,outputs_s" >"$out/speed.csv"
    for precision in "${precisions[@]}"; do
        timed brute_force "$precision" --set integration.early_stop=false
        timed early_stop "$precision"
        timed period_only "$precision" --set 'outputs.quantities=["class"]' --set 'outputs.files=["npy"]'
        of="$adaptive" timed adaptive "$precision" --set 'outputs.files=["npy"]'
        of="$adaptive" timed adaptive_period_only "$precision" --set 'outputs.quantities=["class"]' --set 'outputs.files=["npy"]'
        # The latency of a lane: four of them, side by side, for as many periods as the slowest of a map may take.
        side=2 timed slowest_lane "$precision" --set integration.early_stop=false \
            --set integration.transient_periods=1984 --set integration.observed_periods=128
    done
}

# What is left of eight minutes, less what comes after its budget. What it finds is a finding, too.
engines() {
    local left=$(((460 - SECONDS) * 85 / 100))
    ((left >= 60)) || left=60
    "$binary" bench engines --budget "${ENGINES_SECONDS:-$left}" --out "$out/engines" --force 2>&1 | tee "$out/engines.txt" ||
        failed "bench engines: unexplained cells, or nothing measured"
}

summary() {
    {
        echo "# rattlemap on a GPU"
        echo
        echo "$side x $side cells of scenes/e_omega.toml, medians of three runs (smallest and largest)."
        echo
        echo "| what | precision | integration, s | lane-periods/s | ns per lane-step | outputs, s |"
        echo "| --- | --- | --- | --- | --- | --- |"
        tail -n +2 "$out/speed.csv" 2>/dev/null | sort -t, -k1,2 -k5,5n | awk -F, '
            { key = $1 "," $2; count[key]++; s[key, count[key]] = $5; p[key, count[key]] = $7
              k[key, count[key]] = $8; o[key, count[key]] = $9; seen[key] = 1 }
            END { for (key in seen) { split(key, name, ",")
                  printf "| %s | %s | %s (%s, %s) | %s | %s | %s |\n", name[1], name[2], s[key, 2], s[key, 1], s[key, 3],
                         p[key, 2], k[key, 2], o[key, 2] } }' | sort
        echo
        sed 's/^/    /' "$out/devices.txt"
        echo
        sed -n '/^largest map/,$p' "$out/engines.txt" | sed 's/^/    /'
    } >"$out/summary.md"
}

touch "$out/speed.csv" "$out/engines.txt"
for part in "${parts[@]}"; do
    "$part"
    summary
done
cat "$out/summary.md"
[[ ! -e "$out/failed" ]]
