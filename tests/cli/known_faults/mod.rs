//! Known faults: inputs whose answer is wrong today, with the right answer.
//!
//! Each test passes while the fault exists. When one fails, the fault has changed or is mended: then the row moves to a
//! regression test that expects the right answer. The right answers come from an independent program in 80-bit arithmetic.

use std::fs;
use std::path::Path;

use tempfile::TempDir;

use crate::common::{rattlemap, rows};

/// One wrong answer.
struct Fault {
    /// Name of the model's file, without `.toml`, or `m` and the number of a random model.
    model: &'static str,
    /// Engine and precision.
    engine: [&'static str; 2],
    /// Values of the columns `omega,x,v`: the cell's frequency and its start.
    cell: &'static str,
    /// Column of `cells.csv` that is wrong.
    column: &'static str,
    /// What the column holds today.
    today: &'static str,
    right: &'static str,
}

const CPU: [&str; 2] = ["cpu", "f64"];
const F32: [&str; 2] = ["gpu", "f32"];
const F64: [&str; 2] = ["gpu", "f64"];

const CELL_395: &str = "2.974633534287691,0.0,0.0";

const FAULTS: [Fault; 6] = [
    // Growth over the cycle exceeds the resolution, so rounding decides the period. The status must not be ok.
    Fault {
        model: "m395",
        engine: CPU,
        cell: CELL_395,
        column: "status",
        today: "ok",
        right: "below_resolution",
    },
    Fault {
        model: "m395",
        engine: F32,
        cell: CELL_395,
        column: "status",
        today: "ok",
        right: "below_resolution",
    },
    Fault {
        model: "m850",
        engine: F32,
        cell: "0.6635418077947385,0.005316001817549482,0.2904959291207107",
        column: "period",
        today: "3",
        right: "1",
    },
    Fault {
        model: "m290",
        engine: F32,
        cell: "8.842821460461206,0.08883718034853817,-0.9089918317308976",
        column: "lyapunov",
        today: "-0.0085",
        right: "-0.0090323",
    },
    Fault {
        model: "m778",
        engine: F32,
        cell: "1.3293828371264267,0.0,0.0",
        column: "lyapunov",
        today: "-14.66",
        right: "-21.288",
    },
    Fault {
        model: "m745",
        engine: F64,
        cell: "5.480728136622133,-0.007121517430873219,-0.05393708872633552",
        column: "lyapunov",
        today: "-0.01233",
        right: "-0.0107412",
    },
];

fn input(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/known_faults");
    fs::read_to_string(folder.join(format!("{name}.toml"))).unwrap()
}

/// Computes a scene in a new folder and returns a column of its first cell.
fn first_cell(scene: &str, files: &[(&str, String)], engine: [&str; 2], column: &str) -> String {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("scene.toml"), scene).unwrap();
    files.iter().for_each(|(name, text)| fs::write(folder.path().join(name), text).unwrap());
    let [engine, precision] = engine;
    let arguments =
        ["map", "scene.toml", "--engine", engine, "--precision", precision, "--out", "out", "--quiet"];
    rattlemap(&folder).args(arguments).assert().success();
    let (header, rows) = rows(&folder.path().join("out/cells.csv"));
    let index = header.split(',').position(|name| name == column).unwrap();
    rows[0][index].clone()
}

/// Checks that the faults of one engine still exist.
fn check_faults(of: [&str; 2]) {
    for Fault { model, engine, cell, column, today, right } in
        FAULTS.into_iter().filter(|fault| fault.engine == of)
    {
        let scene = "model = 'model.toml'\n[cells]\nfile = 'cells.csv'\n[outputs]\n\
                     quantities = ['class', 'lyapunov', 'impacts', 'mesh', 'symmetric', 'word']\nfiles = ['csv']\n";
        let files = [("model.toml", input(model)), ("cells.csv", format!("omega,x,v\n{cell}\n{cell}\n"))];
        let answer = first_cell(scene, &files, engine, column);
        assert!(
            answer.starts_with(today),
            "{model} on {engine:?}: {column} was {today}, is {answer} and should be {right}"
        );
    }
}

#[test]
fn wrong_labels_on_the_reference() {
    check_faults(CPU);
}

#[test]
#[ignore = "compiles five shaders; scripts/test.sh --all"]
fn wrong_labels_on_lanes() {
    check_faults(F32);
    check_faults(F64);
}

/// The cycle and its mirror image differ by 1.5e-4: y(T/2) + y(0) is not zero.
#[test]
#[ignore = "compiles a shader in f64; scripts/test.sh --all"]
fn f64_lanes_call_an_unsymmetric_cycle_symmetric() {
    let symmetric = first_cell(&input("border_symmetric_scene"), &[], F64, "symmetric");
    assert_eq!(symmetric, "true", "the right answer is false");
}
