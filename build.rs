//! Tells the program which commit it is built from, for the manifests of what it makes.

use std::path::Path;
use std::process::Command;

/// What the program is made of.
const SOURCES: [&str; 7] =
    ["src", "dynamics/src", "dynamics/Cargo.toml", "shaders", "Cargo.toml", "Cargo.lock", "build.rs"];

fn main() {
    let commit = commit().unwrap_or_else(|| "unknown".to_owned());
    println!("cargo::rustc-env=RATTLEMAP_COMMIT={commit}");
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
