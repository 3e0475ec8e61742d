#!/usr/bin/env bash
# Counts what the shader of the main map costs a card, without a card: registers, spilled bytes and code size of each kernel, instructions
# by phase, and accesses to memory by kernel. counts.md has the output without arguments.
# Needs python3 with pip, g++ and naga (cargo install naga-cli --version 30.0.1). Downloads NVIDIA's compiler (125 MB) into out/warps.
#
#     benches/warps/run.sh [PERIODS [GROUPS LANES]]
#
# Lists are made again after PERIODS periods. GROUPS groups of LANES neighbouring lanes are spread over the map.
set -euo pipefail
cd "$(dirname "$0")/../.."

periods="${1:-1}" groups="${2:-127}" lanes="${3:-128}"
here="benches/warps" out="out/warps"
cuda="$out/cuda/nvidia/cu13/bin"

[ -x "$cuda/nvcc" ] ||
    python3 -m pip install --quiet --target "$out/cuda" nvidia-cuda-nvcc==13.5.37 nvidia-cuda-runtime==13.5.37
mkdir -p "$out"
cargo run --quiet -p rattlemap-bench --example warps -- "$out" "$groups" "$lanes" scenes/e_omega.toml \
    axis.0.count=1024 axis.1.count=1024
for entry in begin keys sweep reading observe judge_cycles; do
    source=shader && [ "$entry" != reading ] || source=reading
    naga --compact --entry-point "$entry" "$out/$source.wgsl" "$out/$entry.metal"
    python3 "$here/cuda.py" "$out/$entry.metal" "$out/$entry.cu"
done

echo "| kernel for sm_90 | registers | spilled bytes | bytes of code |"
echo "| --- | --- | --- | --- |"
for kernel in sweep reading observe judge_cycles; do
    "$cuda/nvcc" -w -std=c++17 -arch=sm_90 -I "$here" -ptx -lineinfo -prec-div=false -prec-sqrt=false \
        "$out/$kernel.cu" -o "$out/$kernel.ptx"
    "$cuda/ptxas" -arch=sm_90 -v "$out/$kernel.ptx" -o "$out/$kernel.cubin" 2>"$out/$kernel.txt"
    registers="$(grep -oP 'Used \K\d+' "$out/$kernel.txt")"
    spilled="$(grep -oP '\d+(?= bytes spill stores)' "$out/$kernel.txt")"
    code="$(readelf -SW "$out/$kernel.cubin" 2>/dev/null | grep -oP "\.text\.$kernel +PROGBITS +\w+ +\w+ +\K\w+")"
    echo "| $kernel | $registers | $spilled | $((16#$code)) |"
done
python3 "$here/lockstep.py" "$out"
g++ -O1 -w -std=c++20 -mfma -ffp-contract=off -I "$here" -I "$out" "$here/simulate.cpp" "$out"/{sweep,reading,observe,judge_cycles}.cpp -o "$out/simulate"
for map in brute decided; do
    echo && "$out/simulate" "$out" "$map" "$periods"
done
