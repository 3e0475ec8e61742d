#!/usr/bin/env bash
# Makes results/gallery anew: a map of each model in scenes/gallery. About a minute on two cores.
# What is kept there is figures and manifests; everything else is left in out/gallery.
set -euo pipefail
cd "$(dirname "$0")/.."

cargo build --release --package rattlemap
program=target/release/rattlemap
out=out/gallery
mkdir -p "$out"

keep() {
    mkdir -p "results/gallery/$1"
    cp "$out/$1/manifest.json" "results/gallery/$1/"
    cp "$out/$1/map.png" "results/gallery/$1/"
}

for scene in scenes/gallery/*.toml; do
    name="$(basename "$scene" .toml)"
    "$program" map "$scene" --engine cpu --out "$out/$name" --force
    keep "$name"
done
