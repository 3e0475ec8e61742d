#!/usr/bin/env bash
# Computes results/gallery: a map of each model in scenes/gallery, and two diagrams. Takes about a minute on two cores.
# results/gallery gets figures and manifests; everything is in out/gallery.
set -euo pipefail
cd "$(dirname "$0")/.."

cargo build --release --package rattlemap
program=target/release/rattlemap
out=out/gallery
mkdir -p "$out"

# publish NAME FIGURE
publish() {
    mkdir -p "results/gallery/$1"
    cp "$out/$1/manifest.json" "$out/$1/$2" "results/gallery/$1/"
}

for scene in scenes/gallery/*.toml; do
    name="$(basename "$scene" .toml)"
    "$program" map "$scene" --engine cpu --out "$out/$name" --force
    publish "$name" map.png
done

publish loose_gear impact_energy.png

# line SCENE AT START: a bifurcation diagram along omega. One shows a jump, the other the onset of grazing.
line() {
    "$program" bifurcation "scenes/gallery/$1.toml" --along omega --at "$2" --set axis.0.count=600 \
        --set "start.policy=$3" --out "$out/$1_line" --force
    publish "$1_line" bifurcation.png
}
line kahraman_singh F_m=0.1 both
line soft_impact a=0.7 rest
