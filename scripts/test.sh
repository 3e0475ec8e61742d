#!/usr/bin/env bash
# Runs every check that a change must pass: format, lints, documentation, dependencies, WebAssembly, tests.
#
#     scripts/test.sh [--all]
#
# Installs what is missing: a software Vulkan driver, so that shader tests run on any machine, and Rust's WebAssembly
# target. With --all it also runs the tests that take minutes, checks each feature alone, checks the program for Windows and
# macOS, starts a Slurm cluster of one node, opens pages in Chromium, and installs the Python package into an environment of its
# own. It prints the time of each phase and the ten slowest tests at the end.
set -euo pipefail
cd "$(dirname "$0")/.."

say() { printf '== %s\n' "$*"; }
fail() {
    printf 'error: %s\n' "$*" >&2
    exit 1
}

# Targets that are checked but not built, so that no linker or C compiler is needed for them.
wasm=wasm32-unknown-unknown
windows=x86_64-pc-windows-gnu
macos=aarch64-apple-darwin

add_target() {
    # A distribution's Rust may include the target without rustup.
    if [[ -d "$(rustc --print sysroot)/lib/rustlib/$1/lib" ]]; then return; fi
    command -v rustup >/dev/null ||
        fail "Rust's target $1 is missing, and rustup, which would add it; install Rust from https://rustup.rs"
    rustup target add "$1" || fail "rustup could not add the target $1; is the network there?"
}

require_tools() {
    say "tools: cargo, rustfmt, clippy, ${targets[*]}"
    command -v cargo >/dev/null || fail "cargo is missing; install Rust from https://rustup.rs"
    cargo fmt --version >/dev/null 2>&1 || fail "rustfmt is missing; run: rustup component add rustfmt"
    cargo clippy --version >/dev/null 2>&1 || fail "clippy is missing; run: rustup component add clippy"
    local target
    for target in "${targets[@]}"; do add_target "$target"; done
}

# Succeeds if a Vulkan loader and the description of a driver are installed.
has_vulkan() {
    local loader_cache
    loader_cache="$( (ldconfig -p || /sbin/ldconfig -p) 2>/dev/null || true)"
    grep -q 'libvulkan\.so' <<<"$loader_cache" || return 1
    local drivers driver
    # If one of these variables is set, the loader searches nowhere else.
    drivers="${VK_DRIVER_FILES:-${VK_ICD_FILENAMES:-}}"
    if [[ -n "$drivers" ]]; then
        while IFS= read -r -d: driver; do
            if [[ -f "$driver" ]] || compgen -G "$driver/*.json" >/dev/null; then return 0; fi
        done <<<"$drivers:"
        return 1
    fi
    compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null
}

# Installs packages of Debian or Ubuntu. On failure the variable `why` holds the reason.
why=
apt_install() {
    local as_root=()
    if ! command -v apt-get >/dev/null; then
        why="there is no apt-get to install it"
        return 1
    fi
    if [[ "$(id -u)" -ne 0 ]]; then
        if ! command -v sudo >/dev/null; then
            why="installing it needs root or sudo"
            return 1
        fi
        as_root=(sudo)
    fi
    why="apt-get could not install it"
    "${as_root[@]}" apt-get update -qq &&
        "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@"
}

require_vulkan() {
    case "$(uname -s)" in
        Linux) ;;
        *)
            say "graphics: the system's own driver"
            return
            ;;
    esac
    if has_vulkan; then
        say "graphics: a Vulkan driver is installed"
        return
    fi
    local remedy="install a Vulkan driver and its loader (Debian, Ubuntu: apt-get install mesa-vulkan-drivers libvulkan1; Fedora: dnf install mesa-vulkan-drivers vulkan-loader; Arch: pacman -S vulkan-swrast vulkan-icd-loader)"
    say "graphics: no Vulkan driver; installing mesa-vulkan-drivers and libvulkan1"
    apt_install mesa-vulkan-drivers libvulkan1 || fail "no Vulkan driver found, and $why; $remedy"
    has_vulkan || fail "still no Vulkan driver after installing one; check VK_DRIVER_FILES and VK_ICD_FILENAMES"
}

# Installs Slurm for the test of scripts/slurm.sh. Its daemons are in /usr/sbin.
require_slurm() {
    [[ "$(uname -s)" == Linux ]] || return 0
    local program
    for program in sbatch slurmctld slurmd munged; do
        (PATH="$PATH:/usr/sbin:/sbin" && command -v "$program") >/dev/null && continue
        say "batch system: installing slurm-wlm and munge"
        apt_install slurm-wlm munge || fail "$program is missing, and $why"
        return
    done
}

# Installs Chromium for the tests that open pages.
require_browser() {
    local program
    for program in chromium chromium-browser google-chrome; do
        ! command -v "$program" >/dev/null || return 0
    done
    say "browser: installing chromium"
    apt_install chromium || skip "pages in a browser: no Chromium, and $why"
}

# Compiles the library with each feature alone, and without any. Every other phase has several of them.
each_feature() {
    cargo check --quiet -p rattlemap --lib --no-default-features
    local feature
    for feature in $(sed -n '/^\[features\]/,/^\[dep/s/^\([a-z]*\) = .*/\1/p' Cargo.toml); do
        cargo check --quiet -p rattlemap --lib --no-default-features --features "$feature"
    done
}

# Checks the types of the page's scripts.
page_types() {
    if ! command -v npx >/dev/null; then
        skip "types of the page's scripts: no npx (Node.js)"
        return
    fi
    npx --yes --package typescript@7 tsc -p src/show/report
}

# Runs a command under a title and records its time.
phases=()
phase() {
    local title="$1" began=$SECONDS
    shift
    say "$title: $*"
    "$@"
    phases+=("$(printf '%5d s  %s' $((SECONDS - began)) "$title")")
}

docs() { RUSTDOCFLAGS="-D warnings" cargo doc --quiet --workspace --no-deps; }

# Compiles all tests, and notes where the test of the Python package is.
compile_tests() {
    cargo test --workspace --tests --benches --no-run --message-format=json-render-diagnostics >"$log"
    pytest="$(sed -n 's/.*"name":"pytest".*"executable":"\([^"]*\)".*/\1/p' "$log")"
}

# Runs all tests, those of the Python package beside the others, because they use one processor core.
#
# Times of single tests are an unstable option of the test program, which RUSTC_BOOTSTRAP enables. A runner sets it for
# the test programs alone: if the compiler saw it, build scripts would be run again and everything compiled anew.
timed_tests() {
    local timed=(-Zunstable-options --report-time "$@") python=0 rust=0
    RUSTC_BOOTSTRAP=1 "$pytest" "${timed[@]}" >"$log.python" 2>&1 &
    cargo test --workspace --tests --no-fail-fast --config 'target."cfg(all())".runner = ["env", "RUSTC_BOOTSTRAP=1"]' \
        -- "${timed[@]}" --skip the_package_passes_its 2>&1 | tee "$log" || rust=$?
    wait $! || python=$?
    { echo "     Running python/tests/pytest.rs ($pytest)"; cat "$log.python"; } | tee -a "$log"
    return $((rust + python))
}

# Prints the ten slowest tests with their binary, from lines such as `test NAME ... ok <1.234s>`.
slowest_tests() {
    awk '
        $1 == "Running" { binary = $NF; sub(/.*\//, "", binary); sub(/-[0-9a-f]+\)$/, "", binary) }
        /^test .* <[0-9.]+s>$/ { seconds = $NF; gsub(/[<>s]/, "", seconds); print seconds, binary, $2 }
    ' "$log" | sort -rn | awk 'NR <= 10 { printf "%7.1f s  %s: %s\n", $1, $2, $3 }'
}

# Prints what tests skipped because a program is missing. They write it to stderr, past the test harness.
skipped() { grep -o 'SKIPPED: .*' "$log" | sort | uniq -c || true; }

# Checks licences, sources and advisories of all dependencies by deny.toml. Checks that cannot run are listed here and at
# the end.
unchecked=()
skip() {
    say "SKIPPED: $1"
    unchecked+=("$1")
}
dependencies() {
    if ! cargo deny --version >/dev/null 2>&1; then
        skip "licences, sources and advisories of dependencies: no cargo-deny (cargo install cargo-deny --locked)"
        return
    fi
    # cargo-deny reads the crates of every platform.
    if ! cargo fetch --locked --quiet; then
        skip "licences and sources of dependencies: crates of other platforms cannot be fetched"
        return
    fi
    cargo deny --offline check licenses bans sources
    if cargo deny fetch db; then
        cargo deny check --disable-fetch advisories
    else
        skip "advisories on dependencies: the database (github.com/rustsec/advisory-db) cannot be reached"
    fi
}

# Prints how many tests passed and how many need --all. Fails if none passed.
totals() {
    awk '/^test result:/ { passed += $4; ignored += $8 }
        END { printf "%d passed, %d ignored", passed, ignored; exit passed == 0 }' "$log"
}

all=false ignored=() targets=("$wasm")
case "${1:-}" in
    "") ;;
    --all) all=true ignored=(--include-ignored) targets+=("$windows" "$macos") ;;
    *) fail "unknown argument $1; usage: scripts/test.sh [--all]" ;;
esac

# Incremental compilation would take disk space and save no time here.
export CARGO_INCREMENTAL="${CARGO_INCREMENTAL:-0}"
# Most tests run a shader for a shorter time than Mesa's software driver takes to compile it (about five seconds). LLVM
# compiles it a third faster without optimisation. The cache serves all test processes and the next run.
export GALLIVM_PERF="${GALLIVM_PERF:-nopt}"
export MESA_SHADER_CACHE_DIR="${MESA_SHADER_CACHE_DIR:-${CARGO_TARGET_DIR:-$PWD/target}/shader-cache}"
mkdir -p "$MESA_SHADER_CACHE_DIR"
log="$(mktemp)"
trap 'rm -f "$log" "$log.python"' EXIT

require_tools
require_vulkan
if $all; then
    require_slurm
    require_browser
fi
phase "format" cargo fmt --all --check
phase "lints" cargo clippy --workspace --all-targets -- -D warnings
phase "docs, warnings denied" docs
phase "dependencies" dependencies
# This checks the dynamics and the library for a page, too.
phase "the engine of a web page" cargo check --target "$wasm" -p rattlemap-web
if $all; then
    phase "each feature alone" each_feature
    phase "types of the page's scripts" page_types
    phase "the program on Windows" cargo check --target "$windows" -p rattlemap
    phase "the program on macOS" cargo check --target "$macos" -p rattlemap
fi
phase "compilation of tests" compile_tests
phase "tests" timed_tests "${ignored[@]}"
phase "examples in docs" cargo test --workspace --doc
phase "benchmarks at tiny sizes" cargo test --quiet --workspace --bench reference
if $all; then
    phase "benchmarks of lanes at tiny sizes" cargo test --quiet --workspace --bench lane
    phase "the Python package, installed" scripts/python.sh
fi
say "time by phase"
printf '%s\n' "${phases[@]}"
say "the ten slowest tests"
slowest_tests
skipped
for what in "${unchecked[@]}"; do echo "SKIPPED: $what"; done
say "tests: $(totals)"
say "all passed"
