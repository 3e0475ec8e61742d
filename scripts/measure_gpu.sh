#!/usr/bin/env bash
# Measures a GPU: correctness, speed and latency.
#
#     scripts/measure_gpu.sh BINARY OUT [SIDE [STEP...]]
#
# BINARY is a release build of rattlemap. Only scenes/ is needed besides, so both can be copied to a machine without Rust or a
# network. By default all steps run, the most important first, in f32 before f64:
#
#     right       compares lanes with the reference, cell by cell: 2,000 cells of 128 x 128 (a quarter of 16 x 16 if time is
#                 short)
#     main        the main map: 512 x 512 cells, all quantities and files
#     classes     SIDE x SIDE cells (1024 by default) with their classes only
#     sizes       the main map with 32, 100, 316, 1,000 and 3,162 cells along each axis, classes only
#     window      a window of 256 x 256 cells of the main map, all quantities
#     basin       a map of basins of attraction
#     brute       the main map with SIDE x SIDE cells and without early stops
#     no_events   like brute, with a small force, so that no gap meets a wall. The difference from brute is the cost of events
#     no_tangents like brute, with impacts and contact time alone. The difference from brute is the cost of tangent vectors and classes
#     workgroups  like brute, with 32 and with 128 invocations per workgroup instead of 64
#     own_flow    as many cells, each with its own flow: meshing stiffness against frequency
#     adaptive    the adaptive map of the main plane, classes only
#     latency     four lanes, for as many periods as the slowest lane of a map may take
#     compile     the time from start to files of 2 x 2 cells, with an empty shader cache (cold) and with a filled one (warm)
#     engines     the main plane on every engine, from 10^3 lanes (`rattlemap bench engines`): utilisation of the device,
#                 longest dispatch, idle gaps
#     again       each timed run a second and a third time. The table has the run with the middle time from start to files
#
# Why warps wait is not measured: ncu, NVIDIA's profiler of kernels, profiles CUDA and not Vulkan.
#
# Everything takes at most MEASURE_SECONDS (480), even on a slow card: each run has a time limit, and steps without time are
# reported as missing. The script measures the first hardware adapter, or the adapter named by WGPU_ADAPTER_NAME, which may be
# a software driver. PRECISIONS selects f32 or f64 instead of both. OUT is updated after every run, so a killed script leaves
# its results:
#
#     summary.md              the table: the run with the middle time of each row, and the hardware
#     speed.csv               one row per timed run
#     validation_*.json       correctness, per precision
#     engines/                throughput against lanes on every engine: tables and figures
#     devices.txt driver.txt  adapters and limits, and the report of the card's driver
#     failed                  errors, if any; then the exit code is 1. Missing time is not an error
set -euo pipefail
export LC_ALL=C

[[ $# -ge 2 ]] || { sed -n '2,/^set -/s/^# \{0,1\}//p' "$0"; exit 2; }
binary="$(realpath "$1")"
out="$2"
side="${3:-1024}"
steps=("${@:4}")
all=(right main classes sizes window basin brute no_events no_tangents workgroups own_flow adaptive latency compile engines again)
((${#steps[@]})) || steps=("${all[@]}")
for step in "${steps[@]}"; do
    [[ " ${all[*]} " == *" $step "* ]] || { echo "error: there is no step $step; the steps are ${all[*]}" >&2; exit 2; }
done
command -v timeout >/dev/null || { echo "error: timeout is missing; install GNU coreutils" >&2; exit 2; }
scenes="$(cd "$(dirname "$0")/.." && pwd)/scenes"
mkdir -p "$out"
# Maps go to memory if there is enough, because the disk has its own measurement.
free="$(df --output=avail -k /dev/shm 2>/dev/null | tail -n 1 || true)"
if ((${free:-0} > 4000000)); then work="$(mktemp -d -p /dev/shm)"; else work="$(mktemp -d)"; fi
trap 'rm -rf "$work"' EXIT
rm -rf "$out"/{failed,missing,speed.csv,engines,engines.txt,right.txt,summary.md,validation_f32.json,validation_f64.json}

# Reports a failure. The measurement goes on.
failed() { echo "$*" | tee -a "$out/failed" >&2; }

# Reports a measurement without time.
missing() { echo "$*" | tee -a "$out/missing" >&2; }

now() { echo "${EPOCHREALTIME:-$(date +%s.%N)}"; }
since() { awk -v from="$1" -v to="$(now)" 'BEGIN { printf "%.3f", to - from }'; }

# A run that is stopped has five seconds to write its results.
deadline=$((${MEASURE_SECONDS:-480} - 7))
remaining() { echo $((deadline - SECONDS)); }
# A run may take its share of the time, and at least 20 s.
shares=$((${#steps[@]} < 8 ? ${#steps[@]} : 8))
longest_run=$((deadline / shares > 20 ? deadline / shares : 20))

# limited SECONDS COMMAND...: stops the command after that time or at the deadline. Exit codes: 124 and 137 for a stopped
# command, 125 for one that was not started.
limited() {
    local seconds="$1" rest
    rest="$(remaining)"
    shift
    ((seconds <= rest)) || seconds="$rest"
    ((seconds >= 1)) || return 125
    timeout --signal=INT --kill-after=5 "$seconds" "$@"
}

# Drivers store compiled shaders in the home folder. Some container images do not declare the driver.
export HOME="$work" XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-$work}"
nvidia=/usr/local/nvidia/share/vulkan/icd.d/nvidia_icd.json
[[ -n "${VK_DRIVER_FILES:-}" || ! -e "$nvidia" || -e /usr/share/vulkan/icd.d/nvidia_icd.json || -e /etc/vulkan/icd.d/nvidia_icd.json ]] ||
    export VK_DRIVER_FILES="$nvidia"

# Sets the folder in which drivers store compiled shaders: NVIDIA, Mesa, others.
cache_in() { export __GL_SHADER_DISK_CACHE_PATH="$1" MESA_SHADER_CACHE_DIR="$1" XDG_CACHE_HOME="$1" && mkdir -p "$1"; }
cache_in "${MESA_SHADER_CACHE_DIR:-$work/cache}"

limited "$((deadline > 90 ? 30 : 3))" "$binary" devices | tee "$out/devices.txt" || true

# The description of an adapter: its name, then lines "  key  value". A software driver must not be measured instead of the
# hardware.
if [[ -n "${WGPU_ADAPTER_NAME:-}" ]]; then
    adapter="$(grep -iF -A3 -- "$WGPU_ADAPTER_NAME" <(grep -A3 '^gpu:' "$out/devices.txt") | head -n 4 || true)"
else
    adapter="$(grep -A3 '^gpu:' "$out/devices.txt" | grep -B1 -A2 '^  kind  *hardware' | head -n 4 || true)"
fi
if [[ "$adapter" != gpu:* ]]; then
    echo "error: no hardware adapter; install its Vulkan driver, or name an adapter by WGPU_ADAPTER_NAME" >&2
    echo "libraries: $(ldconfig -p 2>/dev/null | grep -E 'libvulkan|libGLX_nvidia' | tr -s '[:space:]' ' ')" >&2
    echo "drivers: $(find /usr/share/vulkan/icd.d /etc/vulkan/icd.d -name '*.json' 2>/dev/null | tr '\n' ' ')" >&2
    exit 1
fi
WGPU_ADAPTER_NAME="$(sed -n '1s/^gpu: //p' <<<"$adapter")"
export WGPU_ADAPTER_NAME

precisions=()
for precision in ${PRECISIONS:-f32 f64}; do
    ! grep -q "^  precision .*$precision" <<<"$adapter" || precisions+=("$precision")
done

# Writes facts about the card and the processor that affect speed.
report() {
    local facts='Product Name|Driver Version|CUDA Version|VBIOS|MIG Mode|Current *:|Persistence|Performance State|Link|Gen|'
    facts+='Clocks|Graphics|SM |Memory  |Power Limit|GPU Current Temp|Compute Mode|Total'
    {
        if command -v nvidia-smi >/dev/null; then
            echo "nvidia-smi -q, in part:"
            limited 15 nvidia-smi -q | grep -E "$facts" | head -n 80
        elif command -v rocm-smi >/dev/null; then
            echo "rocm-smi:"
            limited 15 rocm-smi
        elif command -v vulkaninfo >/dev/null; then
            echo "vulkaninfo --summary:"
            limited 15 vulkaninfo --summary 2>/dev/null
        else
            echo "there is no nvidia-smi, rocm-smi or vulkaninfo; rattlemap devices reports"
            echo "$adapter"
        fi || true
        echo "processor: $(sed -n 's/^model name.*: //p' /proc/cpuinfo 2>/dev/null | head -n 1), $(nproc 2>/dev/null) threads"
    } >"$out/driver.txt"
}

# Measures the speed of writing to the disk of the results.
disk() {
    local megabytes=256 began took
    ((deadline > 60)) || megabytes=16
    began="$(now)"
    if limited "$((deadline > 90 ? 20 : 3))" dd if=/dev/zero of="$out/.disk" bs=1M count="$megabytes" conv=fsync 2>"$work/messages"; then
        took="$(since "$began")"
        disk_speed="$(awk -v mb="$megabytes" -v s="$took" 'BEGIN { printf "%.0f MB/s (%d MiB in %.2f s, written to the disk)", mb * 1.048576 / s, mb, s }')"
    else
        disk_speed="not measured, $(tail -n 1 "$work/messages" | grep . || echo "there was not enough time")"
    fi
    rm -f "$out/.disk"
}

square() { sets+=(--set "axis.0.count=$1" --set "axis.1.count=$1"); }

# Compares as many cells with the reference as there is time for.
right() {
    local precision="$1" cells
    for cells in $((side < 128 ? side : 128)) 16; do
        ! right_of "$precision" "$cells" || return 0
    done
    missing "right, $precision: there was not enough time"
}

# Returns 1 if it was stopped.
right_of() {
    local precision="$1" cells="$2" code=0 sets=() samples=2000 until=$((SECONDS + longest_run))
    ((cells * cells / 4 >= samples)) || samples=$(((cells * cells + 3) / 4))
    square "$cells"
    limited "$longest_run" "$binary" map "$scenes/e_omega.toml" --engine gpu --precision "$precision" \
        --out "$work/right" --force "${sets[@]}" 2>"$work/messages" || code=$?
    ((code)) || limited $((until - SECONDS)) "$binary" validate "$work/right" --samples "$samples" 2>"$work/messages" || code=$?
    case $code in
        0) ;;
        124 | 125 | 137) return 1 ;;
        *) failed "map or validate, $precision, $cells x $cells: $(tail -n 1 "$work/messages")" ;;
    esac
    cp "$work/right/validation.json" "$out/validation_$precision.json" 2>/dev/null || true
    # Lines with strata and rates.
    grep -E 'of [0-9]+ (random )?cells|to the bit|lanes after' "$work/messages" | sed "s/^/$precision, $cells x $cells: /" >>"$out/right.txt" || true
}

# timed STEP PRECISION RUN SETTING...: computes a map and writes a row of speed.csv.
timed() {
    local what="$1" precision="$2" run="$3" began wall code=0 result
    shift 3
    began="$(now)"
    limited "$longest_run" "$binary" map "$scene" --engine gpu --precision "$precision" --out "$work/timed" --force "$@" \
        2>"$work/messages" || code=$?
    wall="$(since "$began")"
    # "N cells in S s on gpu (f32): C cells/s, P forcing periods/s, K ns per step; files written in O s", and
    # "time in seconds: plan A, device B, flows C, compile D, integrate S (records R), files O"
    result="$(grep -E '^[0-9]+ cells.* on gpu' "$work/messages" |
        sed -E 's/^([0-9]+) cells.* in ([0-9.]+) s on .*: ([0-9]+) cells\/s, ([0-9]+) forcing periods\/s, ([0-9.]+) ns per step; files written in ([0-9.]+) s.*/\1,\2,\3,\4,\5,\6/' || true)"
    [[ -z "$result" ]] || result+=",$(sed -nE 's/^time in seconds:.* device ([0-9.]+), .* compile ([0-9.]+), .*/\1,\2/p' "$work/messages")"
    case $code in
        0) [[ -n "$result" ]] || { failed "map: $what, $precision prints no times" && result=",,,,,,,,prints no times"; } ;;
        124 | 137)
            result="$(grep -oE '[0-9]+ of (at most )?[0-9]+ cells' "$work/messages" | tail -n 1 || true)"
            result=",,,,,,,,stopped after ${wall%.*} s${result:+ at $result}"
            ;;
        125) wall="" result=",,,,,,,,no time was left" ;;
        *) failed "map: $what, $precision: $(tail -n 1 "$work/messages")" && result=",,,,,,,,failed" ;;
    esac
    [[ "$result" == *,*,*,*,*,*,*,*,* ]] || result="$result,"
    echo "$what,$precision,$run,$wall,$result" >>"$out/speed.csv"
}

# Sets the scene and the settings of a step.
settings() {
    scene="$scenes/e_omega.toml" sets=()
    unset RATTLEMAP_WORKGROUP
    local classes=(--set 'outputs.quantities=["class"]' --set 'outputs.files=["npy"]')
    case $1 in
        main) ((side >= 512)) || square "$side" ;;
        classes) square "$side" && sets+=("${classes[@]}") ;;
        size_*) square "${1#size_}" && sets+=("${classes[@]}") ;;
        window)
            square 256
            sets+=(--set axis.0.min=0.5 --set axis.0.max=0.7 --set axis.1.min=5 --set axis.1.max=6.5)
            ;;
        basin) scene="$scenes/basin.toml" ;;
        brute | brute_*)
            square "$side" && sets+=(--set integration.early_stop=false)
            [[ $1 == brute ]] || export RATTLEMAP_WORKGROUP="${1#brute_}"
            ;;
        no_events) square "$side" && sets+=(--set integration.early_stop=false --set F=0.1) ;;
        no_tangents) square "$side" && sets+=(--set integration.early_stop=false --set 'outputs.quantities=["impacts", "mesh"]') ;;
        own_flow)
            square "$side"
            sets+=("${classes[@]}" --set e=0.6 --set axis.0.parameter=k --set axis.0.min=500 --set axis.0.max=2000)
            ;;
        adaptive) scene="$scenes/adaptive.toml" && square "$side" && sets+=("${classes[@]}") ;;
        latency)
            square 2
            sets+=(--set integration.early_stop=false --set integration.transient_periods=1984 --set integration.observed_periods=128)
            ;;
    esac
}

sizes() {
    local precision="$1" cells
    for cells in 32 100 316 1000 3162; do
        settings "size_$cells" && timed "size_$cells" "$precision" 1 "${sets[@]}"
    done
}

workgroups() {
    local precision="$1" size
    for size in 32 128; do
        settings "brute_$size" && timed "brute_$size" "$precision" 1 "${sets[@]}"
    done
    unset RATTLEMAP_WORKGROUP
}

compile() {
    local precision="$1" cache="$MESA_SHADER_CACHE_DIR"
    scene="$scenes/e_omega.toml" sets=()
    square 2
    cache_in "$work/fresh_$precision"
    timed compile_cold "$precision" 1 "${sets[@]}"
    timed compile_warm "$precision" 1 "${sets[@]}"
    cache_in "$cache"
}

# Runs `bench engines`, which ends soon after its budget.
engines() {
    local rest budget code=0
    rest="$(remaining)"
    budget="${ENGINES_SECONDS:-$((rest / 2))}"
    if ((budget < 20)); then
        missing "engines: no time was left"
        return
    fi
    limited $((budget * 3 / 2)) "$binary" bench engines --budget "$budget" --out "$out/engines" --force >"$out/engines.txt" 2>&1 || code=$?
    case $code in
        0) ;;
        124 | 137) missing "engines: stopped after its time" ;;
        *) failed "bench engines: $(tail -n 1 "$out/engines.txt")" ;;
    esac
}

# Repeats every timed run that ended, if there is time.
again() {
    local run what precision wall
    for run in 2 3; do
        while IFS=, read -r what precision _ wall _; do
            awk -v wall="$wall" -v rest="$(remaining)" 'BEGIN { exit !(wall != "" && 1.5 * wall + 1 < rest) }' || continue
            settings "$what"
            timed "$what" "$precision" "$run" "${sets[@]}"
            summary
        done < <(grep -E '^[a-z_0-9]+,f(32|64),1,[0-9.]+,[0-9]' "$out/speed.csv" | grep -v ^compile)
    done
}

# Prints the whole run with the middle time from start to files of each row, else the reason why no run ended.
speed_table() {
    local header="| what | precision | runs | cells | start to files, s | opening, s | compilation, s | integration, s | outputs, s"
    echo "$header | cells/s | lane-periods/s | ns per lane-step |"
    sed 's/[^|]\+/ --- /g' <<<"$header | | | |"
    tail -n +2 "$out/speed.csv" | awk -F, '
        # Sorts the runs of a row by their time from start to files.
        function sort(key,   i, j) {
            for (i = 1; i <= count[key]; i++) {
                for (j = i; j > 1 && value[key, list[j - 1], 4] + 0 > value[key, i, 4] + 0; j--) list[j] = list[j - 1]
                list[j] = i
            }
        }
        { key = $1 "," $2
          if (!(key in known)) { known[key] = 1; order[++keys] = key }
          if ($5 == "") { note[key] = $13 == "" ? "failed" : $13; next }
          count[key]++
          for (field = 4; field <= 12; field++) value[key, count[key], field] = $field }
        END { for (i = 1; i <= keys; i++) { key = order[i]; split(key, name, ",")
              if (!count[key]) { printf "| %s | %s | 0 | %s | | | | | | | | |\n", name[1], name[2], note[key]; continue }
              sort(key)
              n = count[key]; middle = list[int((n + 1) / 2)]
              wall = value[key, middle, 4] (n > 1 ? " (" value[key, list[1], 4] ", " value[key, list[n], 4] ")" : "")
              printf "| %s | %s | %d | %s | %s", name[1], name[2], n, value[key, middle, 5], wall
              split("11 12 6 10 7 8 9", fields, " ")
              for (k = 1; k <= 7; k++) printf " | %s", value[key, middle, fields[k]]
              print " |" } }'
}

# Prints the device times of the largest map of each precision. Device names contain commas and are removed first.
device_table() {
    echo "| precision | lanes | device busy | longest dispatch, s | idle between submissions, s | longest gap, s |"
    echo "| --- | --- | --- | --- | --- | --- |"
    local table="$out/engines/engines.csv"
    { head -n 1 "$table" && { grep -F -- "$WGPU_ADAPTER_NAME" "$table" || true; }; } | sed -E 's/"[^"]*"/device/' | awk -F, '
        NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; next }
        $1 == "gpu" { if (!($2 in row)) order[++n] = $2
                      row[$2] = sprintf("| %s | %s | %.0f %% | %s | %s | %s |", $2, $at["lanes"], 100 * $at["device_share"],
                                        $at["longest_dispatch_s"], $at["idle_s"], $at["longest_gap_s"]) }
        END { for (i = 1; i <= n; i++) print row[order[i]] }'
}

# Replaces summary.md, which is complete at any time.
summary() {
    {
        echo "# rattlemap on a GPU"
        echo
        echo "$WGPU_ADAPTER_NAME, measured for $SECONDS of $((deadline + 7)) s; $side x $side cells by default."
        echo "Each row is one run, with the middle time of (smallest, largest). scripts/measure_gpu.sh describes the rows."
        echo
        [[ ! -s "$out/right.txt" ]] || { sed 's/^/- /' "$out/right.txt" && echo; }
        speed_table
        echo
        [[ ! -s "$out/engines/engines.csv" ]] || { device_table && echo; }
        echo "- disk: $disk_speed"
        [[ ! -s "$out/missing" ]] || sed 's/^/- missing: /' "$out/missing"
        [[ ! -s "$out/failed" ]] || sed 's/^/- failed: /' "$out/failed"
        echo
        sed 's/^/    /' "$out/driver.txt" "$out/devices.txt"
        if [[ -s "$out/engines.txt" ]]; then
            echo
            sed -n '/^largest map/,$p' "$out/engines.txt" | sed 's/^/    /'
        fi
    } >"$out/summary.md.new"
    mv "$out/summary.md.new" "$out/summary.md"
}

echo "what,precision,run,start_to_files_s,cells,integration_s,cells_per_s,lane_periods_per_s,ns_per_lane_step,outputs_s,opening_s,compilation_s,note" >"$out/speed.csv"
report
disk
summary
for step in "${steps[@]}"; do
    case $step in
        engines | again) "$step" && summary ;;
        *)
            for precision in "${precisions[@]}"; do
                case $step in
                    right | sizes | workgroups | compile) "$step" "$precision" ;;
                    *) settings "$step" && timed "$step" "$precision" 1 "${sets[@]}" ;;
                esac
                summary
            done
            ;;
    esac
done
cat "$out/summary.md"
[[ ! -e "$out/failed" ]]
