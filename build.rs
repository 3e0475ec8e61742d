//! Sets three environment variables that the sources read at compile time: `RATTLEMAP_SOURCES`, a hash of what decides the
//! bits of a record; `RATTLEMAP_TARGET`, the processor that the code is compiled for; and `RATTLEMAP_COMMIT`.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

use sha2::{Digest, Sha256};

/// Files and folders that decide the bits of a record or the order in which a resumed run repeats its cells.
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

/// Packages whose arithmetic or code for a device decides the bits of a record.
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

/// Files and folders that the program is built from. A change in one of them makes the commit `-modified`.
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
    println!("cargo::rustc-env=RATTLEMAP_COMMIT={}", commit().unwrap_or_else(|| "unknown".to_owned()));
}

/// Returns a hash of everything that decides what a record holds: sources by name and text, packages by version.
fn sources() -> String {
    let mut hasher = Sha256::new();
    let mut add = |name: &str, text: &[u8]| {
        hasher.update(name.as_bytes());
        hasher.update((text.len() as u64).to_le_bytes());
        hasher.update(text);
    };
    for source in DECIDING {
        println!("cargo::rerun-if-changed={source}");
        for file in files(Path::new(source)) {
            let name = file.to_string_lossy().replace('\\', "/");
            add(&name, &fs::read(&file).unwrap_or_default());
        }
    }
    println!("cargo::rerun-if-changed=Cargo.lock");
    let lock = fs::read_to_string("Cargo.lock").unwrap_or_default();
    for package in lock.split("[[package]]") {
        let field =
            |key: &str| package.lines().find_map(|line| line.strip_prefix(key)).unwrap_or_default().trim();
        let name = field("name = ").trim_matches('"');
        if PACKAGES.contains(&name) {
            add(name, field("version = ").as_bytes());
        }
    }
    hasher.finalize().iter().take(8).fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// Returns a file, or all files in a folder sorted by name; nothing where the path does not exist.
fn files(path: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(path) else {
        return if path.is_file() { vec![path.to_owned()] } else { Vec::new() };
    };
    let mut entries: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    // Tests do not decide records.
    entries.retain(|entry| !entry.ends_with("tests.rs"));
    entries.sort();
    entries.iter().flat_map(|entry| files(entry)).collect()
}

/// Returns the target triple and the processor's extensions that the compiler may use, sorted.
fn target() -> String {
    let variable = |name: &str| env::var(name).unwrap_or_default();
    let mut features: Vec<String> =
        variable("CARGO_CFG_TARGET_FEATURE").split(',').map(ToOwned::to_owned).collect();
    features.sort();
    format!("{} {}", variable("TARGET"), features.join(",")).trim().to_owned()
}

/// Returns the commit that the program is built from, with `-modified` added if its sources differ from it.
fn commit() -> Option<String> {
    // A package from `cargo package` and an archive from `git archive` name their commit in a file.
    if let Some(commit) = [".cargo_vcs_info.json", ".git_archival.txt"].into_iter().find_map(recorded) {
        return Some(commit);
    }
    // Development builds do not ask git: each commit would recompile the library and every test.
    if env::var("PROFILE").is_ok_and(|profile| profile == "release") { checked_out() } else { None }
}

/// Reads a commit from a file. In a checkout, `.git_archival.txt` has a placeholder in its place.
fn recorded(file: &str) -> Option<String> {
    let text = fs::read_to_string(file).ok()?;
    println!("cargo::rerun-if-changed={file}");
    let is_commit = |word: &&str| word.len() == 40 && word.bytes().all(|byte| byte.is_ascii_hexdigit());
    text.split(|letter: char| !letter.is_ascii_alphanumeric()).find(is_commit).map(ToOwned::to_owned)
}

/// Asks git for the commit of this package's own repository.
fn checked_out() -> Option<String> {
    // A copy inside another repository must not take the commit of that repository.
    if !git(&["rev-parse", "--show-prefix"])?.is_empty() {
        return None;
    }
    // Git adds a line to this file whenever HEAD changes.
    println!("cargo::rerun-if-changed={}", git(&["rev-parse", "--git-path", "logs/HEAD"])?);
    SOURCES.iter().for_each(|source| println!("cargo::rerun-if-changed={source}"));
    let commit = git(&["rev-parse", "HEAD"])?;
    let changes = git(&[&["status", "--porcelain", "--"], &SOURCES[..]].concat())?;
    Some(if changes.is_empty() { commit } else { format!("{commit}-modified") })
}

/// Runs git and returns what it prints, or `None` if it fails.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
