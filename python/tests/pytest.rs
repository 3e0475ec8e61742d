//! The Python package: its tests are Python's (`test_*.py` beside this file), run on the module that Cargo has just built.
//!
//! Without python3, its `venv` or what it installs they are skipped, which is said on stderr.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The folder of the package and of its tests.
fn source(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// A folder that is kept for the next run.
fn kept(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// The interpreter of an environment with what tests need; else why there is none.
fn python() -> Result<PathBuf, String> {
    let at = kept("python-venv");
    let (wanted, installed) = (source("tests/requirements.txt"), at.join("installed.txt"));
    let python = at.join(if cfg!(windows) { "Scripts" } else { "bin" }).join("python");
    let is_there = fs::read(&installed).is_ok_and(|have| have == fs::read(&wanted).unwrap());
    if !is_there {
        run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&at))?;
        let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"];
        run(Command::new(&python).args(install).arg(&wanted))?;
        fs::copy(&wanted, &installed).unwrap();
    }
    Ok(python)
}

/// Runs a program; what it says last, if it fails.
fn run(command: &mut Command) -> Result<(), String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|error| format!("{name}: {error}"))?;
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    output.status.success().then_some(()).ok_or(said.lines().last().unwrap_or(&name).to_owned())
}

/// A folder with the package as a wheel has it: the sources, and the native module that this test was built beside.
fn package() -> PathBuf {
    let root = kept("python-package");
    let package = root.join("rattlemap");
    let _ = fs::remove_dir_all(&package);
    fs::create_dir_all(&package).unwrap();
    for entry in fs::read_dir(source("rattlemap")).unwrap() {
        let path = entry.unwrap().path();
        let is_source = path.extension().is_some_and(|end| end == "py" || end == "pyi" || end == "typed");
        if is_source {
            fs::copy(&path, package.join(path.file_name().unwrap())).unwrap();
        }
    }
    let program = std::env::current_exe().unwrap();
    let built = program.with_file_name(format!("{DLL_PREFIX}_native{DLL_SUFFIX}"));
    let name = if cfg!(windows) { "_native.pyd" } else { "_native.abi3.so" };
    fs::copy(&built, package.join(name)).unwrap_or_else(|error| panic!("{}: {error}", built.display()));
    root
}

#[test]
fn the_package_passes_its_tests() {
    // Past the harness, which keeps what tests that pass print.
    let mut stderr = io::stderr();
    let python = match python() {
        Ok(python) => python,
        Err(why) => {
            writeln!(stderr, "SKIPPED: no Python to test the package with ({why})").unwrap();
            return;
        }
    };
    let nowhere = tempfile::tempdir().unwrap();
    // What a test asks of this machine and does not find it tells as skipped; of others it tells the time.
    let arguments =
        ["-m", "pytest", "-q", "-rs", "-p", "no:cacheprovider", "--durations=10", "--durations-min=1"];
    let mut tests = Command::new(python);
    tests.args(arguments).arg(source("tests")).current_dir(nowhere.path()).stdin(Stdio::null());
    tests.env("PYTHONPATH", package()).env("PYTHONDONTWRITEBYTECODE", "1").env("MPLBACKEND", "Agg");
    tests.env("MPLCONFIGDIR", kept("python-matplotlib")).env("MYPY_CACHE_DIR", kept("python-mypy"));
    let output = tests.output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    for line in said.lines().filter(|line| line.starts_with("SKIPPED") || line.contains("s call ")) {
        let line = line.replacen("SKIPPED ", "SKIPPED: ", 1);
        writeln!(stderr, "{line}").unwrap();
    }
    assert!(output.status.success(), "{said}\n{}", String::from_utf8_lossy(&output.stderr));
    assert!(said.lines().last().is_some_and(|line| line.contains(" passed")), "{said}");
}
