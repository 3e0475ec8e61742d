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
    for figure in map.png bifurcation.png; do
        if [[ -f "$out/$1/$figure" ]]; then cp "$out/$1/$figure" "results/gallery/$1/"; fi
    done
}

for scene in scenes/gallery/*.toml; do
    name="$(basename "$scene" .toml)"
    "$program" map "$scene" --engine cpu --out "$out/$name" --force
    keep "$name"
done

"$program" bifurcation scenes/gallery/kahraman_singh.toml --along omega --at F_m=0.1 --set axis.0.count=600 \
    --set start.policy=both --out "$out/kahraman_singh_line" --force
keep kahraman_singh_line
"$program" bifurcation scenes/gallery/soft_impact.toml --along omega --at a=0.7 --set axis.0.count=600 \
    --out "$out/soft_impact_line" --force
keep soft_impact_line
