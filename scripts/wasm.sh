#!/usr/bin/env bash
# Builds the engine of reports from web/: src/show/report/engine.wasm.gz and engine.js. Installs the target and wasm-bindgen's
# command line if they are missing. engine.sources is a hash of the sources; a test fails if they have changed since. Takes about
# three minutes on two cores.
set -euo pipefail
cd "$(dirname "$0")/.."

rustup target add wasm32-unknown-unknown
version="$(sed -n '/^name = "wasm-bindgen"$/{n;s/version = "\(.*\)"/\1/p}' Cargo.lock)"
bindgen=target/tools/bin/wasm-bindgen
if [[ "$("$bindgen" --version 2>/dev/null || true)" != "wasm-bindgen $version" ]]; then
    cargo install wasm-bindgen-cli --version "$version" --root target/tools
fi

RUSTFLAGS="-Ctarget-feature=+simd128" cargo build --package rattlemap-web --profile web --target wasm32-unknown-unknown
out=target/wasm
rm -rf "$out"
"$bindgen" "target/wasm32-unknown-unknown/web/rattlemap_web.wasm" --target no-modules --no-typescript \
    --remove-name-section --remove-producers-section --out-dir "$out"
gzip -9 --no-name --stdout "$out/rattlemap_web_bg.wasm" > src/show/report/engine.wasm.gz
cp "$out/rattlemap_web.js" src/show/report/engine.js
sources=(
    dynamics/src src/text src/model_file src/map/scene src/show/drawing src/show/figure/orbit web/src
    src/show/{orbit_summary,orbit_quantities,orbit_spectrum,symbols,wall_labels,names}.rs
)
find "${sources[@]}" -name '*.rs' | LC_ALL=C sort | xargs sha256sum | sha256sum | cut -d ' ' -f 1 > src/show/report/engine.sources
