//! Tells the program what it is made of: which sources decide the bits of a record, for what processor, and, for
//! releases, which commit.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

use sha2::{Digest, Sha256};

/// What decides the bits of a record, or the order of work that records are replayed in.
const DECIDING: [&str; 23] = [
    "dynamics/src",
    "models/gear_pair.toml",
    "shaders",
    "src/gpu",
    "src/record",
    "src/map/catalogue.rs",
    "src/map/cycle.rs",
    "src/map/engine.rs",
    "src/map/engine",
    "src/map/plan.rs",
    "src/map/plan",
    "src/map/random.rs",
    "src/map/scene/axis.rs",
    "src/map/scene/derived.rs",
    "src/map/scene/list.rs",
    "src/map/scene/points.rs",
    "src/map/schedule.rs",
    "src/map/schedule",
    "src/map/shard.rs",
    "src/map/statistics.rs",
    "src/model_file",
    "src/text/expression.rs",
    "src/text/expression",
];

/// Packages whose arithmetic, or whose code for a device, goes into a record.
const PACKAGES: [&str; 13] = [
    "bytemuck",
    "libm",
    "matrixmultiply",
    "naga",
    "nalgebra",
    "num-complex",
    "rattlemap-dynamics",
    "safe_arch",
    "simba",
    "wgpu",
    "wgpu-core",
    "wgpu-hal",
    "wide",
];

/// What the program is made of.
const SOURCES: [&str; 8] = [
    "src",
    "dynamics/src",
    "dynamics/Cargo.toml",
    "models",
    "shaders",
    "Cargo.toml",
    "Cargo.lock",
    "build.rs",
];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-env=RATTLEMAP_SOURCES={}", sources());
    println!("cargo::rustc-env=RATTLEMAP_TARGET={}", target());
    // Elsewhere every commit would have the library compiled anew, and each of its tests.
    let is_release = env::var("PROFILE").is_ok_and(|profile| profile == "release");
    let commit = is_release.then(commit).flatten().unwrap_or_else(|| "unknown".to_owned());
    println!("cargo::rustc-env=RATTLEMAP_COMMIT={commit}");
}

/// A hash of all that decides what a record holds: sources by name and text, packages by version.
fn sources() -> String {
    let mut hasher = Sha256::new();
    let mut tell = |name: &str, text: &[u8]| {
        hasher.update(name.as_bytes());
        hasher.update((text.len() as u64).to_le_bytes());
        hasher.update(text);
    };
    for source in DECIDING {
        println!("cargo::rerun-if-changed={source}");
        for file in files(Path::new(source)) {
            let name = file.to_string_lossy().replace('\\', "/");
            tell(&name, &fs::read(&file).unwrap_or_default());
        }
    }
    println!("cargo::rerun-if-changed=Cargo.lock");
    let lock = fs::read_to_string("Cargo.lock").unwrap_or_default();
    for package in lock.split("[[package]]") {
        let of =
            |key: &str| package.lines().find_map(|line| line.strip_prefix(key)).unwrap_or_default().trim();
        let name = of("name = ").trim_matches('"');
        if PACKAGES.contains(&name) {
            tell(name, of("version = ").as_bytes());
        }
    }
    hasher.finalize().iter().take(8).fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// A file, or all in a folder, by name; none where it is not.
fn files(path: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(path) else {
        return if path.is_file() { vec![path.to_owned()] } else { Vec::new() };
    };
    let mut entries: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    // Tests decide nothing.
    entries.retain(|entry| !entry.ends_with("tests.rs"));
    entries.sort();
    entries.iter().flat_map(|entry| files(entry)).collect()
}

/// The processor and system that code is made for, and the processor's extensions that it may use.
fn target() -> String {
    let of = |name: &str| env::var(name).unwrap_or_default();
    let mut features: Vec<String> =
        of("CARGO_CFG_TARGET_FEATURE").split(',').map(ToOwned::to_owned).collect();
    features.sort();
    format!("{} {}", of("TARGET"), features.join(",")).trim().to_owned()
}

/// The commit of this package's own repository; none in a copy without one, or without git.
fn commit() -> Option<String> {
    // A copy inside some other repository must not take that one's commit for its own.
    if !git(&["rev-parse", "--show-prefix"])?.is_empty() {
        return None;
    }
    let branch = git(&["symbolic-ref", "--quiet", "HEAD"]);
    for name in [Some("HEAD"), branch.as_deref(), Some("packed-refs")].into_iter().flatten() {
        let path = git(&["rev-parse", "--git-path", name])?;
        // Cargo builds every time for a file that is not there.
        if Path::new(&path).exists() {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    let commit = git(&["rev-parse", "HEAD"])?;
    // What is built of other sources is not that commit's.
    SOURCES.iter().for_each(|source| println!("cargo::rerun-if-changed={source}"));
    let changes = git(&[&["status", "--porcelain", "--"], &SOURCES[..]].concat())?;
    Some(if changes.is_empty() { commit } else { format!("{commit}-modified") })
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
