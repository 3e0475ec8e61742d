//! Runs the tests of the Python package (`test_*.py` in this folder) with the module that Cargo has just built.
//!
//! If python3, its `venv` or a package that the tests need is missing, the tests are skipped with a message on stderr.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};

/// Returns a path in the folder of the Python package.
fn source(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// Returns the path of a folder that remains for the next run.
fn cache(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// Returns the interpreter of an environment that has the packages of `requirements.txt`; otherwise an error message.
fn python() -> Result<PathBuf, String> {
    let environment = cache("python-venv");
    let (required, installed) = (source("tests/requirements.txt"), environment.join("installed.txt"));
    let python = environment.join(if cfg!(windows) { "Scripts" } else { "bin" }).join("python");
    if !fs::read(&installed).is_ok_and(|installed| installed == fs::read(&required).unwrap()) {
        run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&environment))?;
        let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"];
        run(Command::new(&python).args(install).arg(&required))?;
        fs::copy(&required, &installed).unwrap();
    }
    Ok(python)
}

/// Runs a program. The error is the last line on its stderr.
fn run(command: &mut Command) -> Result<(), String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|error| format!("{name}: {error}"))?;
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    output.status.success().then_some(()).ok_or(stderr.lines().last().unwrap_or(&name).to_owned())
}

/// Creates a folder with the files of a wheel: the Python sources and the native module that was built with this test.
fn package() -> PathBuf {
    let root = cache("python-package");
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
    let test = std::env::current_exe().unwrap();
    let built = test.with_file_name(format!("{DLL_PREFIX}_native{DLL_SUFFIX}"));
    let name = if cfg!(windows) { "_native.pyd" } else { "_native.abi3.so" };
    fs::copy(&built, package.join(name)).unwrap_or_else(|error| panic!("{}: {error}", built.display()));
    root
}

#[test]
fn the_package_passes_its_tests() {
    pass("not long");
}

#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn the_package_passes_its_long_tests() {
    pass("long");
}

/// Both tests use the same environment and the same copy of the package.
static ENVIRONMENT: Mutex<()> = Mutex::new(());

/// Runs the tests with these marks.
fn pass(marks: &str) {
    let _held = ENVIRONMENT.lock().unwrap_or_else(PoisonError::into_inner);
    // Rust's test harness hides the output of print macros of passing tests, but not these lines.
    let mut stderr = io::stderr();
    let python = match python() {
        Ok(python) => python,
        Err(reason) => {
            writeln!(stderr, "SKIPPED: no Python to test the package with ({reason})").unwrap();
            return;
        }
    };
    let work = tempfile::tempdir().unwrap();
    let arguments = [
        "-m",
        "pytest",
        "-q",
        "-rs",
        "-p",
        "no:cacheprovider",
        "--durations=10",
        "--durations-min=1",
        "-m",
        marks,
    ];
    let mut tests = Command::new(python);
    tests.args(arguments).arg(source("tests")).current_dir(work.path()).stdin(Stdio::null());
    tests.env("PYTHONPATH", package()).env("PYTHONDONTWRITEBYTECODE", "1").env("MPLBACKEND", "Agg");
    tests.env("MPLCONFIGDIR", cache("python-matplotlib")).env("MYPY_CACHE_DIR", cache("python-mypy"));
    let output = tests.output().unwrap();
    let report = String::from_utf8_lossy(&output.stdout);
    // Skipped tests and the durations of the slowest ones.
    for line in report.lines().filter(|line| line.starts_with("SKIPPED") || line.contains("s call ")) {
        writeln!(stderr, "{}", line.replacen("SKIPPED ", "SKIPPED: ", 1)).unwrap();
    }
    assert!(output.status.success(), "{report}\n{}", String::from_utf8_lossy(&output.stderr));
    assert!(report.lines().last().is_some_and(|line| line.contains(" passed")), "{report}");
}
