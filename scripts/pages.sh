#!/usr/bin/env bash
# Writes pages that compute into a folder: main map, gallery models, a basin, and an index. Takes a minute.
# Usage: scripts/pages.sh DIR
set -euo pipefail
cd "$(dirname "$0")/.."
out="${1:?give a folder}"
mkdir -p "$out"
cargo build --release --quiet
program="${CARGO_TARGET_DIR:-target}/release/rattlemap"
{
    echo '<!doctype html><html lang="en"><meta charset="utf-8"><title>rattlemap: maps that compute</title>'
    echo '<style>body { font: 16px/1.5 system-ui, sans-serif; margin: 40px auto; max-width: 640px; padding: 0 20px; }</style>'
    echo '<h1>Maps that compute</h1><p>Open a map, zoom in, move a slider, click a cell. Everything is computed in your browser.</p><ul>'
    for scene in scenes/e_omega.toml scenes/basin.toml scenes/gallery/*.toml; do
        name="$(basename "$scene" .toml)"
        "$program" explore "$scene" --no-open --quiet --out "$out/$name.html" --force
        title="$(grep -m 1 -o '<title>[^<]*' "$out/$name.html")"
        echo "<li><a href=\"$name.html\">${title#<title>}</a></li>"
    done
    echo '</ul></html>'
} > "$out/index.html.partial"
mv "$out/index.html.partial" "$out/index.html"
