#!/usr/bin/env bash
# Everything that must hold before a change is taken: formatting, lints, docs, tests.
# Installs a software Vulkan driver where there is none, so that shader tests run anywhere.
# With --all the tests run, too, that take minutes each.
set -euo pipefail
cd "$(dirname "$0")/.."

say() { printf '== %s\n' "$*"; }
fail() {
    printf 'error: %s\n' "$*" >&2
    exit 1
}

require_tools() {
    say "tools: cargo, rustfmt, clippy"
    command -v cargo >/dev/null || fail "cargo is missing; install Rust from https://rustup.rs"
    cargo fmt --version >/dev/null 2>&1 || fail "rustfmt is missing; run: rustup component add rustfmt"
    cargo clippy --version >/dev/null 2>&1 || fail "clippy is missing; run: rustup component add clippy"
}

# True if the Vulkan loader would find both itself and the description of a driver.
has_vulkan() {
    local loader_cache
    loader_cache="$( (ldconfig -p || /sbin/ldconfig -p) 2>/dev/null || true)"
    grep -q 'libvulkan\.so' <<<"$loader_cache" || return 1
    local drivers driver
    # The loader looks at nothing else where one of these is set.
    drivers="${VK_DRIVER_FILES:-${VK_ICD_FILENAMES:-}}"
    if [[ -n "$drivers" ]]; then
        while IFS= read -r -d: driver; do
            if [[ -f "$driver" ]] || compgen -G "$driver/*.json" >/dev/null; then return 0; fi
        done <<<"$drivers:"
        return 1
    fi
    compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null
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
    command -v apt-get >/dev/null || fail "no Vulkan driver found; $remedy"
    local as_root=()
    if [[ "$(id -u)" -ne 0 ]]; then
        command -v sudo >/dev/null || fail "no Vulkan driver found, and neither root nor sudo to install one; $remedy"
        as_root=(sudo)
    fi
    say "graphics: no Vulkan driver; installing mesa-vulkan-drivers and libvulkan1"
    "${as_root[@]}" apt-get update -qq || fail "apt-get update failed; $remedy"
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y -qq --no-install-recommends mesa-vulkan-drivers libvulkan1 ||
        fail "apt-get could not install the driver; $remedy"
    has_vulkan || fail "still no Vulkan driver after installing one; check VK_DRIVER_FILES and VK_ICD_FILENAMES"
}

# Nothing here is compiled twice, so that what makes the second time fast would only take room.
export CARGO_INCREMENTAL="${CARGO_INCREMENTAL:-0}"

require_tools
require_vulkan
say "format: cargo fmt --check"
cargo fmt --check
say "lints: cargo clippy --all-targets -- -D warnings"
cargo clippy --all-targets -- -D warnings
say "docs: cargo doc --no-deps, warnings denied"
RUSTDOCFLAGS="-D warnings" cargo doc --no-deps
say "tests: cargo test"
cargo test
if [[ "${1:-}" == --all ]]; then
    say "tests: those that take minutes each"
    cargo test -- --ignored
fi
say "benchmarks: tiny sizes, so that they cannot rot"
cargo test --quiet --bench reference
cargo test --quiet --bench lane
say "all passed"
