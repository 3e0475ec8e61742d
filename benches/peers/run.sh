#!/usr/bin/env bash
# Times peers and the one-core engine alternately on the same cells. Installs numba and heyoka in a virtual environment.
# Writes out/bench/peers/peers.csv, for `rattlemap-bench work-precision --peers`, steps.csv and machines.csv. Arguments go to
# the Python programs: --rounds N, --quick.
set -euo pipefail
cd "$(dirname "$0")/../.."

environment="out/peers-venv"
binary="${CARGO_TARGET_DIR:-target}/release/rattlemap-bench"

command -v python3 >/dev/null || { echo "error: python3 is missing" >&2; exit 1; }
cargo build --release -p rattlemap-bench
if ! cmp -s benches/peers/requirements.txt "$environment/installed.txt"; then
    python3 -m venv "$environment"
    "$environment/bin/pip" install --quiet --requirement benches/peers/requirements.txt
    cp benches/peers/requirements.txt "$environment/installed.txt"
fi
# Every program gets one core.
export NUMBA_NUM_THREADS=1 OMP_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE=1
export NUMBA_CACHE_DIR="$PWD/out/peers-venv/cache"
for program in measure heyoka_machine; do
    "$environment/bin/python" "benches/peers/$program.py" "$binary" out/bench/peers "$@"
done
