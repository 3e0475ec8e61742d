#!/usr/bin/env bash
# Everything that must hold before a change is taken: formatting, lints, docs, dependencies, checks for other systems, tests.
# Installs what is missing: a software Vulkan driver, so that shader tests run anywhere, Rust's targets, and Slurm, whose
# daemons run in the tests' own folders only.
# With --all the tests run, too, that take minutes each, all of the program is checked for macOS, and the Python package is
# installed in an environment of its own. Ends with the time of each phase and the ten slowest tests.
set -euo pipefail
cd "$(dirname "$0")/.."

say() { printf '== %s\n' "$*"; }
fail() {
    printf 'error: %s\n' "$*" >&2
    exit 1
}

# Checked, not built: no linker and no C compiler is wanted for them.
wasm=wasm32-unknown-unknown
windows=x86_64-pc-windows-gnu
macos=aarch64-apple-darwin

add_target() {
    # Rust without rustup may come with the target.
    if [[ -d "$(rustc --print sysroot)/lib/rustlib/$1/lib" ]]; then return; fi
    command -v rustup >/dev/null ||
        fail "Rust's target $1 is missing, and rustup, which would add it; install Rust from https://rustup.rs"
    rustup target add "$1" || fail "rustup could not add the target $1; is the network there?"
}

require_tools() {
    say "tools: cargo, rustfmt, clippy, $wasm, $windows, $macos"
    command -v cargo >/dev/null || fail "cargo is missing; install Rust from https://rustup.rs"
    cargo fmt --version >/dev/null 2>&1 || fail "rustfmt is missing; run: rustup component add rustfmt"
    cargo clippy --version >/dev/null 2>&1 || fail "clippy is missing; run: rustup component add clippy"
    local target
    for target in "$wasm" "$windows" "$macos"; do add_target "$target"; done
}

# True if the Vulkan loader would find both itself and the description of a driver.
has_vulkan() {
    local loader_cache
    loader_cache="$( (ldconfig -p || /sbin/ldconfig -p) 2>/dev/null || true)"
    grep -q 'libvulkan\.so' <<<"$loader_cache" || return 1
    local drivers driver
    # The loader reads nothing else where one of these is set.
    drivers="${VK_DRIVER_FILES:-${VK_ICD_FILENAMES:-}}"
    if [[ -n "$drivers" ]]; then
        while IFS= read -r -d: driver; do
            if [[ -f "$driver" ]] || compgen -G "$driver/*.json" >/dev/null; then return 0; fi
        done <<<"$drivers:"
        return 1
    fi
    compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null
}

# Packages of Debian and its kin. False where there is no installing them; `why` says the reason.
why=
apt_install() {
    local as_root=()
    if ! command -v apt-get >/dev/null; then
        why="no apt-get to install one"
        return 1
    fi
    if [[ "$(id -u)" -ne 0 ]]; then
        if ! command -v sudo >/dev/null; then
            why="neither root nor sudo to install one"
            return 1
        fi
        as_root=(sudo)
    fi
    why="apt-get could not install one"
    "${as_root[@]}" apt-get update -qq &&
        "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@"
}

require_vulkan() {
    case "$(uname -s)" in
        Linux) ;;
        *)
            say "graphics: the system's own"
            return
            ;;
    esac
    if has_vulkan; then
        say "graphics: a Vulkan driver is there"
        return
    fi
    local remedy="install a Vulkan driver and its loader (Debian, Ubuntu: apt-get install mesa-vulkan-drivers libvulkan1; Fedora: dnf install mesa-vulkan-drivers vulkan-loader; Arch: pacman -S vulkan-swrast vulkan-icd-loader)"
    say "graphics: no Vulkan driver; installing mesa-vulkan-drivers and libvulkan1"
    apt_install mesa-vulkan-drivers libvulkan1 || fail "no Vulkan driver found, and $why; $remedy"
    has_vulkan || fail "still no Vulkan driver after installing one; check VK_DRIVER_FILES and VK_ICD_FILENAMES"
}

# For tests of scripts/slurm, which say so where it is missing. Its daemons live in /usr/sbin.
require_slurm() {
    [[ "$(uname -s)" == Linux ]] || return 0
    local program missing=''
    for program in sbatch slurmctld slurmd munged; do
        (PATH="$PATH:/usr/sbin:/sbin" && command -v "$program") >/dev/null || missing="$program"
    done
    if [[ -z "$missing" ]]; then
        say "batch system: Slurm is there"
        return
    fi
    say "batch system: no $missing; installing slurm-wlm and munge"
    apt_install slurm-wlm munge || say "tests of scripts/slurm will be skipped: $why"
}

# Runs a command under a title, and notes how long it took.
phases=()
phase() {
    local title="$1" began=$SECONDS
    shift
    say "$title: $*"
    "$@"
    phases+=("$(printf '%5d s  %s' $((SECONDS - began)) "$title")")
}

docs() { RUSTDOCFLAGS="-D warnings" cargo doc --quiet --workspace --no-deps; }

# Times of single tests are an unstable option of the test program. The compiler must not see what unlocks it, or
# build scripts that look for it would have everything compiled anew: a runner sets it for the test program alone.
timed_tests() {
    cargo test --workspace --tests --no-fail-fast --config 'target."cfg(all())".runner = ["env", "RUSTC_BOOTSTRAP=1"]' \
        -- -Zunstable-options --report-time "$@" 2>&1 | tee "$log"
}

# The ten slowest of `test NAME ... ok <1.234s>`, with the binary that they are in.
slowest_tests() {
    awk '
        $1 == "Running" { binary = $NF; sub(/.*\//, "", binary); sub(/-[0-9a-f]+\)$/, "", binary) }
        /^test .* <[0-9.]+s>$/ { seconds = $NF; gsub(/[<>s]/, "", seconds); print seconds, binary, $2 }
    ' "$log" | sort -rn | awk 'NR <= 10 { printf "%7.1f s  %s: %s\n", $1, $2, $3 }'
}

# What tests could not do for want of a program: they say so past the harness, which keeps what passing tests print.
skipped() { grep -o 'SKIPPED: .*' "$log" | sort | uniq -c || true; }

# Licences, sources and advisories of all dependencies: deny.toml. What cannot be looked at is told here and at the end.
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
    # It reads the crates of every platform.
    if ! cargo fetch --locked --quiet; then
        skip "licences and sources of dependencies: crates of other platforms are not here and cannot be fetched"
        return
    fi
    cargo deny --offline check licenses bans sources
    if cargo deny fetch db; then
        cargo deny check --disable-fetch advisories
    else
        skip "advisories on dependencies: the database (github.com/rustsec/advisory-db) cannot be reached"
    fi
}

# How many tests passed and how many wait for --all, over all binaries.
totals() {
    awk '/^test result:/ { passed += $4; ignored += $8 }
        END { printf "%d passed, %d ignored", passed, ignored; exit passed == 0 }' "$log"
}

case "${1:-}" in
    "") ignored=() ;;
    --all) ignored=(--include-ignored) ;;
    *) fail "unknown argument $1; usage: scripts/test.sh [--all]" ;;
esac

# Between runs either nothing is compiled, or what makes the second time fast would only take room.
export CARGO_INCREMENTAL="${CARGO_INCREMENTAL:-0}"
# Mesa's software driver takes some five seconds to compile a lane's shader, a third less where LLVM does not optimise it:
# most tests run a shader for less time than that. Every process finds it here, and the next run.
export GALLIVM_PERF="${GALLIVM_PERF:-nopt}"
export MESA_SHADER_CACHE_DIR="${MESA_SHADER_CACHE_DIR:-${CARGO_TARGET_DIR:-$PWD/target}/shader-cache}"
mkdir -p "$MESA_SHADER_CACHE_DIR"
log="$(mktemp)"
trap 'rm -f "$log"' EXIT

require_tools
require_vulkan
require_slurm
phase "format" cargo fmt --all --check
phase "lints" cargo clippy --workspace --all-targets -- -D warnings
phase "docs, warnings denied" docs
phase "dependencies" dependencies
phase "one motion in a web page" cargo check --target "$wasm" -p rattlemap-dynamics
phase "the library in a web page" cargo check --target "$wasm" -p rattlemap --no-default-features --features gpu,figures --lib
phase "the program on Windows" cargo check --target "$windows" -p rattlemap
if [[ "${#ignored[@]}" -eq 0 ]]; then
    phase "the library on macOS" cargo check --target "$macos" -p rattlemap --no-default-features --features gpu --lib
else
    phase "the program on macOS" cargo check --target "$macos" -p rattlemap
fi
phase "compilation of tests" cargo test --workspace --tests --benches --no-run
phase "tests" timed_tests "${ignored[@]}"
phase "examples in docs" cargo test --workspace --doc
phase "benchmarks at tiny sizes" cargo test --quiet --workspace --bench reference --bench lane
if [[ "${#ignored[@]}" -ne 0 ]]; then
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
