#!/usr/bin/env bash
# Everything that is claimed of a GPU, measured in one go on a machine that has one.
#
#     scripts/measure_gpu.sh BINARY OUT [SIDE [STEP...]]
#
# BINARY is a release build of rattlemap; nothing else of the repository is needed but scenes/, so that both can be
# carried to a machine without Rust or a network. In steps, all of them unless some are named, what a reader of results
# wants first before the rest; f32 before f64:
#
#     right       the lanes are right, cell by cell against the reference: 128 x 128 cells, 2,000 of them (of 16 x 16
#                 a quarter, where there is no time for more)
#     main        the main map as it is, 512 x 512 cells, all quantities and files
#     classes     SIDE x SIDE cells (1024 unless given), decided: classes alone
#     brute       the same cells by brute force: no early stops
#     own_flow    the same number of cells, each with a flow of its own: meshing stiffness against frequency
#     adaptive    the adaptive map of the same plane, classes alone
#     cards       the same as brute, by all cards that are like this one, where there are several
#     latency     four lanes side by side, for as many periods as the slowest of a map may take
#     compile     from start to files of 2 x 2 cells: with a fresh shader cache (cold), and with one that was kept (warm)
#     engines     the main plane on every engine, from 10^3 lanes on (`rattlemap bench engines`): share of the device's
#                 time, longest dispatch, idle gaps
#     again       what was timed, a second and a third time
#
# All of it takes MEASURE_SECONDS at most (480, eight minutes), be the card ever so slow: every run has a time limit of
# its own, what does not end is cut, and what time is left for nothing is said to be missing. The first hardware adapter
# is measured, or the one that WGPU_ADAPTER_NAME names, be it a software one; PRECISIONS (both) narrows it down. OUT is
# written anew after every run, so that a script that is killed leaves what it has:
#
#     summary.md              the table: medians, and what they were measured on
#     speed.csv               one row per timed run
#     validation_*.json       correctness, per precision
#     engines/                throughput against lanes on every engine: tables and figures
#     devices.txt driver.txt  adapters and limits; what the driver says of the card
#     failed                  what did not go well, if anything: the exit code is 1 then. No time left is no failure
set -euo pipefail
export LC_ALL=C

[[ $# -ge 2 ]] || { sed -n '2,/^set -/s/^# \{0,1\}//p' "$0"; exit 2; }
binary="$(realpath "$1")"
out="$2"
side="${3:-1024}"
steps=("${@:4}")
all=(right main classes brute own_flow adaptive cards latency compile engines again)
((${#steps[@]})) || steps=("${all[@]}")
for step in "${steps[@]}"; do
    [[ " ${all[*]} " == *" $step "* ]] || { echo "error: no step $step; there are ${all[*]}" >&2; exit 2; }
done
command -v timeout >/dev/null || { echo "error: timeout is missing; install GNU coreutils" >&2; exit 2; }
scenes="$(cd "$(dirname "$0")/.." && pwd)/scenes"
mkdir -p "$out"
# In memory where there is enough: a disk is not what is timed, but for itself.
free="$(df --output=avail -k /dev/shm 2>/dev/null | tail -n 1 || true)"
if ((${free:-0} > 4000000)); then work="$(mktemp -d -p /dev/shm)"; else work="$(mktemp -d)"; fi
trap 'rm -rf "$work"' EXIT
rm -rf "$out"/{failed,missing,speed.csv,engines,engines.txt,right.txt,summary.md,validation_f32.json,validation_f64.json}

# What fails is a finding; the machine is there to be measured all the same.
failed() { echo "$*" | tee -a "$out/failed" >&2; }

# What there was no time for.
missing() { echo "$*" | tee -a "$out/missing" >&2; }

now() { echo "${EPOCHREALTIME:-$(date +%s.%N)}"; }
since() { awk -v from="$1" -v to="$(now)" 'BEGIN { printf "%.3f", to - from }'; }

# A run that is cut has five seconds to write what it has.
deadline=$((${MEASURE_SECONDS:-480} - 7))
left() { echo $((deadline - SECONDS)); }
longest_run=$((deadline / 8 > 20 ? deadline / 8 : 20))

# limited SECONDS COMMAND...: cut after that time, or when none is left. 124 and 137 say that it was cut, 125 that it was
# not begun.
limited() {
    local most="$1" rest
    rest="$(left)"
    shift
    ((most <= rest)) || most="$rest"
    ((most >= 1)) || return 125
    timeout --signal=INT --kill-after=5 "$most" "$@"
}

# Drivers keep what they have compiled in the home folder, and some images say nowhere where the driver is.
export HOME="$work" XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-$work}"
nvidia=/usr/local/nvidia/share/vulkan/icd.d/nvidia_icd.json
[[ -n "${VK_DRIVER_FILES:-}" || ! -e "$nvidia" || -e /usr/share/vulkan/icd.d/nvidia_icd.json || -e /etc/vulkan/icd.d/nvidia_icd.json ]] ||
    export VK_DRIVER_FILES="$nvidia"

# Where drivers keep what they have compiled: NVIDIA's, Mesa's, others'.
cache_in() { export __GL_SHADER_DISK_CACHE_PATH="$1" MESA_SHADER_CACHE_DIR="$1" XDG_CACHE_HOME="$1" && mkdir -p "$1"; }
cache_in "${MESA_SHADER_CACHE_DIR:-$work/cache}"

# It lists them at once; what it says then of `auto` may take a trial.
limited "$((deadline > 90 ? 30 : 3))" "$binary" devices | tee "$out/devices.txt" || true

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
    echo "drivers: $(find /usr/share/vulkan/icd.d /etc/vulkan/icd.d -name '*.json' 2>/dev/null | tr '\n' ' ')" >&2
    exit 1
fi
WGPU_ADAPTER_NAME="$(sed -n '1s/^gpu: //p' <<<"$adapter")"
export WGPU_ADAPTER_NAME
cards="$(grep -cxF -- "gpu: $WGPU_ADAPTER_NAME" "$out/devices.txt")"

precisions=()
for precision in ${PRECISIONS:-f32 f64}; do
    ! grep -q "^  precision .*$precision" <<<"$adapter" || precisions+=("$precision")
done

# What the card's own tools say, as far as it bears on figures.
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
            echo "no nvidia-smi, rocm-smi or vulkaninfo here: rattlemap devices says"
            echo "$adapter"
        fi || true
        echo "processor: $(sed -n 's/^model name.*: //p' /proc/cpuinfo 2>/dev/null | head -n 1), $(nproc 2>/dev/null) threads"
    } >"$out/driver.txt"
}

# How fast the folder of results takes bytes, to the disk.
disk() {
    local megabytes=256 began took
    ((deadline > 60)) || megabytes=16
    began="$(now)"
    if limited "$((deadline > 90 ? 20 : 3))" dd if=/dev/zero of="$out/.disk" bs=1M count="$megabytes" conv=fsync 2>"$work/said"; then
        took="$(since "$began")"
        disk_told="$(awk -v mb="$megabytes" -v s="$took" 'BEGIN { printf "%.0f MB/s (%d MiB in %.2f s, written through)", mb * 1.048576 / s, mb, s }')"
    else
        disk_told="not measured, $(tail -n 1 "$work/said" | grep . || echo "there was not enough time")"
    fi
    rm -f "$out/.disk"
}

square() { sets+=(--set "axis.0.count=$1" --set "axis.1.count=$1"); }

# As many cells as there is time for.
right() {
    local precision="$1" cells
    for cells in $((side < 128 ? side : 128)) 16; do
        ! right_of "$precision" "$cells" || return 0
    done
    missing "right, $precision: there was not enough time"
}

# False if it was cut.
right_of() {
    local precision="$1" cells="$2" code=0 sets=() samples=2000 until=$((SECONDS + longest_run))
    ((cells * cells / 4 >= samples)) || samples=$(((cells * cells + 3) / 4))
    square "$cells"
    limited "$longest_run" "$binary" map "$scenes/e_omega.toml" --engine gpu --precision "$precision" \
        --out "$work/right" --force "${sets[@]}" 2>"$work/said" || code=$?
    ((code)) || limited $((until - SECONDS)) "$binary" validate "$work/right" --samples "$samples" 2>"$work/said" || code=$?
    case $code in
        0) ;;
        124 | 125 | 137) return 1 ;;
        *) failed "map or validate, $precision, $cells x $cells: $(tail -n 1 "$work/said")" ;;
    esac
    cp "$work/right/validation.json" "$out/validation_$precision.json" 2>/dev/null || true
    # Strata and rates, in words.
    grep -E 'cells differ|judged by|to the bit|lanes are off' "$work/said" | sed "s/^/$precision, $cells x $cells: /" >>"$out/right.txt" || true
}

# timed STEP PRECISION ROW SETTING...: a row of speed.csv.
timed() {
    local what="$1" precision="$2" row="$3" began wall code=0 told
    shift 3
    began="$(now)"
    limited "$longest_run" "$binary" map "$scene" --engine gpu --precision "$precision" --out "$work/timed" --force "$@" \
        2>"$work/said" || code=$?
    wall="$(since "$began")"
    # "N cells in S s on gpu (f32): C cells/s, P forcing periods/s, K ns per step; files written in O s"
    told="$(grep -E '^[0-9]+ cells.* on gpu' "$work/said" |
        sed -E 's/^([0-9]+) cells.* in ([0-9.]+) s on .*: ([0-9]+) cells\/s, ([0-9]+) forcing periods\/s, ([0-9.]+) ns per step; files written in ([0-9.]+) s.*/\1,\2,\3,\4,\5,\6/' || true)"
    case $code in
        0) [[ -n "$told" ]] || { failed "map: $what, $precision says no times" && told=",,,,,,says no times"; } ;;
        124 | 137)
            told="$(grep -oE '[0-9]+ of (at most )?[0-9]+ cells' "$work/said" | tail -n 1 || true)"
            told=",,,,,,cut after ${wall%.*} s${told:+ at $told}"
            ;;
        125) wall="" told=",,,,,,no time was left" ;;
        *) failed "map: $what, $precision: $(tail -n 1 "$work/said")" && told=",,,,,,failed" ;;
    esac
    [[ "$told" == *,*,*,*,*,*,* ]] || told="$told,"
    echo "$what,$precision,$row,$wall,$told" >>"$out/speed.csv"
}

# The scene and settings of a step.
settings() {
    scene="$scenes/e_omega.toml" sets=()
    local classes=(--set 'outputs.quantities=["class"]' --set 'outputs.files=["npy"]')
    case $1 in
        main) ((side >= 512)) || square "$side" ;;
        classes) square "$side" && sets+=("${classes[@]}") ;;
        brute) square "$side" && sets+=(--set integration.early_stop=false) ;;
        cards) square "$side" && sets+=(--set integration.early_stop=false --adapter all) ;;
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

compile() {
    local precision="$1" kept="$MESA_SHADER_CACHE_DIR"
    scene="$scenes/e_omega.toml" sets=()
    square 2
    cache_in "$work/fresh_$precision"
    timed compile_cold "$precision" 1 "${sets[@]}"
    timed compile_warm "$precision" 1 "${sets[@]}"
    cache_in "$kept"
}

# What it finds is a finding, too. It ends soon after its budget.
engines() {
    local rest budget code=0
    rest="$(left)"
    budget="${ENGINES_SECONDS:-$((rest / 2))}"
    if ((budget < 20)); then
        missing "engines: no time was left"
        return
    fi
    limited $((budget * 3 / 2)) "$binary" bench engines --budget "$budget" --out "$out/engines" --force >"$out/engines.txt" 2>&1 || code=$?
    case $code in
        0) ;;
        124 | 137) missing "engines: cut after its time" ;;
        *) failed "bench engines: $(tail -n 1 "$out/engines.txt")" ;;
    esac
}

# Of every timed run that ended and that time allows again.
again() {
    local row what precision wall
    for row in 2 3; do
        while IFS=, read -r what precision _ wall _; do
            awk -v wall="$wall" -v rest="$(left)" 'BEGIN { exit !(wall != "" && 1.5 * wall + 1 < rest) }' || continue
            settings "$what"
            timed "$what" "$precision" "$row" "${sets[@]}"
            summary
        done < <(grep -E '^[a-z_]+,f(32|64),1,[0-9.]+,[0-9]' "$out/speed.csv" | grep -v ^compile)
    done
}

# Medians of what ended; else why not.
speed_table() {
    echo "| what | precision | runs | cells | start to files, s | integration, s | cells/s | lane-periods/s | ns per lane-step | outputs, s |"
    echo "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"
    tail -n +2 "$out/speed.csv" | awk -F, '
        function sorted(list, n,   i, j, x) {
            for (i = 2; i <= n; i++) for (j = i; j > 1 && list[j - 1] + 0 > list[j] + 0; j--) { x = list[j]; list[j] = list[j - 1]; list[j - 1] = x } }
        function median(field, key, is_spread,   i, n, list, middle) {
            n = count[key]
            for (i = 1; i <= n; i++) list[i] = value[key, i, field]
            sorted(list, n)
            middle = list[int((n + 1) / 2)]
            return is_spread && n > 1 ? middle " (" list[1] ", " list[n] ")" : middle }
        { key = $1 "," $2
          if (!(key in seen)) { seen[key] = 1; order[++keys] = key }
          if ($5 == "") { note[key] = $11 == "" ? "failed" : $11; next }
          count[key]++
          for (field = 4; field <= 10; field++) value[key, count[key], field] = $field }
        END { for (i = 1; i <= keys; i++) { key = order[i]; split(key, name, ",")
              if (!count[key]) { printf "| %s | %s | 0 | %s | | | | | | |\n", name[1], name[2], note[key]; continue }
              printf "| %s | %s | %d | %s | %s | %s | %s | %s | %s | %s |\n", name[1], name[2], count[key], median(5, key),
                     median(4, key, 1), median(6, key, 1), median(7, key), median(8, key), median(9, key), median(10, key) } }'
}

# The largest map of each precision by the device's own clock. Device names have commas, and are taken out.
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

# Written after every run; what is there is whole at any time.
summary() {
    {
        echo "# rattlemap on a GPU"
        echo
        echo "$WGPU_ADAPTER_NAME, measured for $SECONDS of $((deadline + 7)) s; $side x $side cells where nothing else is said."
        echo "Medians (smallest, largest); what each row is, scripts/measure_gpu.sh says."
        echo
        [[ ! -s "$out/right.txt" ]] || { sed 's/^/- /' "$out/right.txt" && echo; }
        speed_table
        echo
        [[ ! -s "$out/engines/engines.csv" ]] || { device_table && echo; }
        echo "- disk: $disk_told"
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

echo "what,precision,run,start_to_files_s,cells,integration_s,cells_per_s,lane_periods_per_s,ns_per_lane_step,outputs_s,note" >"$out/speed.csv"
report
disk
summary
for step in "${steps[@]}"; do
    case $step in
        engines | again) "$step" && summary ;;
        *)
            for precision in "${precisions[@]}"; do
                case $step in
                    right | compile) "$step" "$precision" ;;
                    cards) ((cards < 2)) || { settings cards && timed cards "$precision" 1 "${sets[@]}"; } ;;
                    *) settings "$step" && timed "$step" "$precision" 1 "${sets[@]}" ;;
                esac
                summary
            done
            ;;
    esac
done
cat "$out/summary.md"
[[ ! -e "$out/failed" ]]
