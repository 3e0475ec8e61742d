#!/usr/bin/env bash
# Computes results/gallery: a map of each model in scenes/gallery, its validation, and two diagrams. Takes about 30 minutes on two
# cores. results/gallery gets figures, manifests and the share of chaos that ends; everything is in out/gallery.
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
    case "$name" in
        friction_oscillator | relief_valve) publish "$name" pattern.png ;;
        *) publish "$name" map.png ;;
    esac
done

publish loose_gear impact_energy.png

# Follows 80 chaotic cells of each map for 6,000 further periods. A map with a wrong cell has this result, too.
ends=results/gallery/chaos_ends.csv
echo "map,chaotic,followed,ended,low,high,periodic" > "$ends"
for scene in scenes/gallery/*.toml; do
    name="$(basename "$scene" .toml)"
    "$program" validate "$out/$name" --samples 400 --chaos-periods 6000 --quiet || echo "$name: see validation.json"
    python3 - "$name" "$out/$name/validation.json" >> "$ends" <<'END'
import json, sys
ends = json.load(open(sys.argv[2]))["chaos_ends"]
low, high = ends["ended"]["interval"]
periodic = sum(cell["class"] == "periodic" for cell in ends["cells"])
print(sys.argv[1], ends["chaotic"], ends["followed"], ends["ended"]["count"], f"{low:.3f}", f"{high:.3f}", periodic, sep=",")
END
done

# line SCENE AT START: a bifurcation diagram along omega. One shows a jump, the other the onset of grazing.
line() {
    "$program" bifurcation "scenes/gallery/$1.toml" --along omega --at "$2" --set axis.0.count=600 \
        --set "start.policy=$3" --out "$out/$1_line" --force
    publish "$1_line" bifurcation.png
}
line kahraman_singh F_m=0.1 both
line soft_impact a=0.7 rest
