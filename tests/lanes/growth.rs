//! Oscillators whose energy grows by negative damping or stiffness, and gyroscopic ones, on the reference and on lanes.
//!
//! The lanes need an adapter; without one the tests fail (see `scripts/test.sh`).

use crate::common::pairs::AsPair;
use crate::lanes::features::reference;
use crate::lanes::kinds::{self, Cell};
use rattlemap::gpu::{LaneSettings, Precision};
use rattlemap::model_file::FileModel;
use rattlemap::record::Record;
use rattlemap::record::classify::{classify, status};
use rattlemap_dynamics::model::{Model, state};
use rattlemap_dynamics::orbit::{Class, Status};
use rayon::prelude::*;

/// Equations and contacts of one coordinate: `c` is the damping and `k` the stiffness.
const SINGLE: &str = "coordinates = ['x']\nmass = [[1]]\ndamping = [['c']]\nstiffness = [['k']]\nforce = ['F']\n\
                      frequency = 'omega'\ngap = [1]\n";
/// A rotor, whose coordinates the gyroscopic moment couples. One of them has stops.
const ROTOR: &str = "coordinates = ['x', 'y']\nmass = [[1, 0], [0, 1]]\ndamping = [['c', 'G'], ['-G', 'c']]\n\
                     stiffness = [['k', 0], [0, 'k']]\nforce = ['F', 0]\nforce_sin = [0, 'F']\n\
                     frequency = 'omega'\ngap = [1, 0]\n";
const IMPACTS: &str = "[[contact]]\nside = 'right'\nat = 1\nlaw = 'impact'\nrestitution = 'e'\n\
                       [[contact]]\nside = 'left'\nat = -1\nlaw = 'impact'\nrestitution = 'e'\n";
const SPRINGS: &str = "[[contact]]\nside = 'right'\nat = 1\nlaw = 'elastic'\nstiffness = 60\ndamping = 1.5\n\
                       [[contact]]\nside = 'left'\nat = -1\nlaw = 'elastic'\nstiffness = 60\ndamping = 1.5\n";
const ONE_WALL: &str = "[[contact]]\nside = 'left'\nat = -0.1\nlaw = 'impact'\nrestitution = 'e'\n";

/// Returns a model with these values of damping, stiffness and gyroscopic moment.
fn model(motion: &str, contacts: &str, [c, k, gyroscopic]: [f64; 3]) -> FileModel {
    let text = format!(
        "name = 'm'\n[parameters]\nc = {c:?}\nk = {k:?}\nG = {gyroscopic:?}\nF = 0.4\nomega = 1.0\ne = 0.7\n\
         [motion]\n{motion}{contacts}"
    );
    // Parameters without use are refused.
    let used = |line: &&str| {
        let name = line.split(' ').next().unwrap_or_default();
        !matches!(name, "G" | "e") || format!("{motion}{contacts}").contains(&format!("{name}'"))
    };
    FileModel::parse(&text.lines().filter(used).collect::<Vec<_>>().join("\n"), "m.toml").unwrap()
}

fn cell(model: &FileModel, sets: &[(&str, f64)]) -> Cell {
    let mut model = model.clone();
    sets.iter().for_each(|&(parameter, value)| model.set(parameter, value).unwrap());
    // On top of a hill, rounding would choose the side.
    (model.pair(), model.law(), state(&[0.5]))
}

/// `most` is the number of cells of 64 that may differ: two more than measured. They lie near bifurcations, in transient chaos or
/// on a torus.
#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn lanes_have_the_classes_of_the_reference() {
    let models = [
        ("self-excited between stops", model(SINGLE, IMPACTS, [-0.05, 1.0, 0.0]), 3),
        ("self-excited between springs", model(SINGLE, SPRINGS, [-0.05, 1.0, 0.0]), 2),
        ("a hill between stops", model(SINGLE, IMPACTS, [0.1, -1.0, 0.0]), 6),
        ("a hill between springs", model(SINGLE, SPRINGS, [0.1, -1.0, 0.0]), 2),
        ("a rotor between stops", model(ROTOR, IMPACTS, [0.1, 4.0, 0.6]), 2),
        ("a rotor with negative damping", model(ROTOR, SPRINGS, [-0.02, 4.0, 0.6]), 8),
    ];
    let settings = LaneSettings { undecided_periods: 1584, ..LaneSettings::default() };
    for (what, model, most) in models {
        let place = |n: u32| [("F", 0.21 + 0.2 * f64::from(n % 8)), ("omega", 0.7 + 0.31 * f64::from(n / 8))];
        let cells: Vec<Cell> = (0..64).map(|n| cell(&model, &place(n))).collect();
        let expected: Vec<Record> = cells.par_iter().map(reference).collect();
        for precision in Precision::ALL {
            let found = kinds::run(precision, &cells, &settings).unwrap();
            let name =
                |record: &Record| format!("{:?} {:?} {}", classify(record), status(record), record.lyapunov);
            let pairs = found.iter().zip(&expected).enumerate();
            let differing: Vec<String> = pairs
                .filter(|(_, (ours, theirs))| classify(ours) != classify(theirs))
                .map(|(n, (ours, theirs))| format!("{n}: {} | {}", name(ours), name(theirs)))
                .collect();
            assert!(differing.len() <= most, "{what}, {precision:?}: {differing:#?}");
        }
    }
}

#[test]
fn motion_that_nothing_stops_escapes_on_every_engine() {
    let cases = [
        ("a hill beside one wall", cell(&model(SINGLE, ONE_WALL, [0.1, -1.0, 0.0]), &[("e", 0.0)])),
        ("negative damping beside one wall", cell(&model(SINGLE, ONE_WALL, [-0.2, 1.0, 0.0]), &[("e", 1.0)])),
    ];
    let cells = cases.clone().map(|case| case.1);
    let expect = |engine: &str, records: &[Record]| {
        for ((what, _), record) in cases.iter().zip(records) {
            assert_eq!(
                (classify(record), status(record)),
                (Class::Failed, Status::Escape),
                "{engine}, {what}: {record:?}"
            );
        }
    };
    expect("reference", &cells.each_ref().map(reference));
    for precision in Precision::ALL {
        expect(&format!("{precision:?}"), &kinds::run(precision, &cells, &LaneSettings::default()).unwrap());
    }
}
