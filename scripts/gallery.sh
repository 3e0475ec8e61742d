#!/usr/bin/env bash
# Makes results/gallery anew: a map of each model in scenes/gallery, and two diagrams. About a minute on two cores.
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

# Where one coordinate's response jumps, and where it begins to graze.
line() {
    "$program" bifurcation "scenes/gallery/$1.toml" --along omega --at "$2" --set axis.0.count=600 \
        --set "start.policy=$3" --out "$out/$1_line" --force
    mkdir -p "results/gallery/$1_line"
    cp "$out/$1_line/manifest.json" "$out/$1_line/bifurcation.png" "results/gallery/$1_line/"
}
line kahraman_singh F_m=0.1 both
line soft_impact a=0.7 rest
