#!/usr/bin/env bash
# Builds the engine of reports from web/: src/show/report/engine.wasm.gz and engine.js. Installs the target, wasm-bindgen's command
# line and zopfli, which compresses 4 % better than gzip, if they are missing. A test runs the committed engine under Node.js and compares its answers with those of today's
# sources: run this script when that test fails, at most once per change that is merged. Takes a minute on two cores, the first
# time four.
set -euo pipefail
cd "$(dirname "$0")/.."

[[ -d "$(rustc --print sysroot)/lib/rustlib/wasm32-unknown-unknown/lib" ]] || rustup target add wasm32-unknown-unknown
version="$(sed -n '/^name = "wasm-bindgen"$/{n;s/version = "\(.*\)"/\1/p}' Cargo.lock)"
target="${CARGO_TARGET_DIR:-target}"
bindgen="$target/tools/bin/wasm-bindgen"
if [[ "$("$bindgen" --version 2>/dev/null || true)" != "wasm-bindgen $version" ]]; then
    cargo install wasm-bindgen-cli --version "$version" --root "$target/tools"
fi
zopfli="$target/tools/bin/zopfli"
[[ -x "$zopfli" ]] || cargo install zopfli --version 0.8.2 --root "$target/tools"

RUSTFLAGS="-Ctarget-feature=+simd128" cargo build --package rattlemap-web --profile web --target wasm32-unknown-unknown
out="$target/wasm"
rm -rf "$out"
"$bindgen" "$target/wasm32-unknown-unknown/web/rattlemap_web.wasm" --target no-modules --no-typescript \
    --remove-name-section --remove-producers-section --out-dir "$out"
report=src/show/report
"$zopfli" "$out/rattlemap_web_bg.wasm"
mv "$out/rattlemap_web_bg.wasm.gz" "$report/engine.wasm.gz"
# Comments have addresses of web sites; the page must have none. The others are those of web/src.
sed '/^ *\/\/ /d; /^ *\/\*\*/,/\*\//d' "$out/rattlemap_web.js" > "$report/engine.js"
