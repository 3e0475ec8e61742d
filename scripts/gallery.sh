#!/usr/bin/env bash
# Computes results/gallery: a map of each model in scenes/gallery, its validation, and two diagrams. Takes about 50 minutes on two
# cores. results/gallery gets figures, manifests, the share of chaos that ends and the rate of wrong classes; everything is in out/gallery.
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
        belt_oscillator) publish "$name" stick_fraction.png ;;
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

# Computes 4,096 cells of each map with and without early stops, 1,024 cells if a period takes long. A class is wrong if both are decided
# and differ.
stops=results/gallery/early_stops.csv
echo "map,cells,wrong,low,high,undecided,periods,all_periods" > "$stops"
for scene in scenes/gallery/*.toml; do
    name="$(basename "$scene" .toml)"
    case "$name" in absorber_chain | two_loose_gears) side=32 ;; *) side=64 ;; esac
    for early in true false; do
        "$program" map "$scene" --engine cpu --out "$out/early_stops/$early" --force --quiet --set axis.0.count=$side \
            --set axis.1.count=$side --set "integration.early_stop=$early" --set 'outputs.files=["csv"]'
    done
    python3 - "$name" "$out/early_stops" >> "$stops" <<'END'
import csv, sys
early, whole = (list(csv.DictReader(open(f"{sys.argv[2]}/{one}/cells.csv"))) for one in ("true", "false"))
changed = [{a["class"], b["class"]} for a, b in zip(early, whole) if a["class"] != b["class"]]
n, wrong = len(early), sum("undecided" not in classes for classes in changed)
centre, half = wrong + 1.92, (3.84 * (wrong * (n - wrong) / n + 0.96)) ** 0.5  # Wilson's interval
low, high = ((centre - half) / (n + 3.84), (centre + half) / (n + 3.84))
means = [sum(float(cell["periods_run"]) for cell in cells) / n for cells in (early, whole)]
became = sum(a["class"] == "chaotic" and b["class"] == "undecided" for a, b in zip(early, whole))
print(sys.argv[1], n, wrong, f"{max(low, 0):.5f}", f"{high:.5f}", became, *(f"{mean:.1f}" for mean in means), sep=",")
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
