//! docs/python/read_map.py: what it says of a map, and that it draws one.
//!
//! Without python3, its `venv` or what it installs this is skipped, which is said on stderr.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::Command;

use assert_cmd::Command as Cargo;

fn docs(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/python").join(name)
}

/// The interpreter of an environment with what the script needs, kept for the next run; else why there is none.
fn python() -> Result<PathBuf, String> {
    let at = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-venv");
    let (wanted, installed) = (docs("requirements.txt"), at.join("installed.txt"));
    let programs = at.join(if cfg!(windows) { "Scripts" } else { "bin" });
    let python = programs.join("python");
    let is_there = fs::read(&installed).is_ok_and(|have| have == fs::read(&wanted).unwrap());
    if !is_there {
        run(Command::new("python3").args(["-m", "venv"]).arg(&at))?;
        let install =
            ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-compile", "-r"];
        run(Command::new(&python).args(install).arg(&wanted))?;
        fs::copy(&wanted, &installed).unwrap();
    }
    Ok(python)
}

/// What a program prints; what it says last, if it fails.
fn run(command: &mut Command) -> Result<String, String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|error| format!("{name}: {error}"))?;
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let last = said.lines().last().unwrap_or_default().to_owned();
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned()).ok_or(last)
}

#[test]
fn a_map_is_read_and_drawn() {
    let python = match python() {
        Ok(python) => python,
        Err(why) => {
            // Past the harness, which keeps what tests that pass print.
            let mut stderr = io::stderr();
            writeln!(stderr, "SKIPPED: no Python to read a map with ({why})").unwrap();
            return;
        }
    };
    let folder = tempfile::tempdir().unwrap();
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/e_omega.toml");
    let mut map = Cargo::cargo_bin("rattlemap").unwrap();
    map.current_dir(folder.path()).arg("map").arg(scene).args(["--engine", "cpu", "--quiet", "--out", "map"]);
    map.args([
        "--set",
        "axis.0.count=24",
        "--set",
        "axis.1.count=18",
        "--set",
        "outputs.files=['csv', 'npy']",
    ]);
    map.assert().code(0);
    let picture = folder.path().join("map.png");
    let said = run(Command::new(python)
        .arg(docs("read_map.py"))
        .arg(folder.path().join("map"))
        .arg(&picture)
        .env("MPLCONFIGDIR", folder.path()));
    let said = said.unwrap_or_else(|why| panic!("{why}"));
    // What the table says in Rust.
    let mut table = csv::Reader::from_path(folder.path().join("map/cells.csv")).unwrap();
    let place = table.headers().unwrap().iter().position(|name| name == "pattern").unwrap();
    let rows: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
    let mut patterns: Vec<&str> =
        rows.iter().map(|row| &row[place]).filter(|text| !text.is_empty()).collect();
    patterns.sort_unstable();
    patterns.dedup();
    assert!(said.contains(&format!("pattern: {} of them, w36 most often", patterns.len())), "{said}");
    let chaotic = rows.iter().filter(|row| &row[4] == "chaotic").count();
    assert!(said.lines().any(|line| line.split_whitespace().eq(["chaotic", &chaotic.to_string()])), "{said}");
    let drawn = image::open(&picture).unwrap().to_rgb8();
    let colors: std::collections::HashSet<_> = drawn.pixels().collect();
    assert!(drawn.width() == 1800 && colors.len() > 200, "{} colours", colors.len());
}
