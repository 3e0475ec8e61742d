//! Counts of work, which do not depend on the speed of the machine.
//!
//! A snapshot that differs is a change in cost. If it is intended, accept it with `INSTA_UPDATE=always cargo test
//! --test library counters` (or `cargo insta review`) and give the reason in the commit. Counts are means over 100
//! forcing periods of settled cycles, to three significant digits. Other drivers and processors give the same counts,
//! but 2 % more work shows.

use std::fmt::Write;

use crate::common::gpu::{open, run_from_rest};
use crate::common::{REST, flow_of, paper, work_since};
use crate::lanes::counting::{LOOPS, counting};
use rattlemap::gpu::{LaneSettings, Precision};
use rattlemap_dynamics::model::GearPair;
use rattlemap_dynamics::motion::Trajectory;

/// Stable cycles of every kind: description, restitution, frequency, meshing speed.
const CELLS: [(&str, f64, f64, f64); 8] = [
    ("no contact", 0.5, 11.0, 0.01),
    ("one impact a side", 0.56, 5.6, 0.01),
    ("impacts, chatter, meshing", 0.06, 5.6, 0.01),
    ("plastic, meshing", 0.0, 4.2, 0.01),
    ("chatter into meshing", 0.56, 1.5, 0.01),
    ("long chatter", 0.72, 1.5, 0.01),
    ("longer chatter", 0.72, 1.5, 1e-5),
    ("infinite chatter", 0.72, 1.5, 0.0),
];

fn pairs() -> [GearPair; CELLS.len()] {
    CELLS.map(|(_, e, omega, mesh_speed)| GearPair { mesh_speed, ..paper(e, omega) })
}

/// Forcing periods before counting, and during it.
const SETTLING: u32 = 200;
const COUNTED: u32 = 100;

/// Returns a count with three significant digits.
fn rounded(count: f64) -> String {
    if count == 0.0 {
        return "0".to_owned();
    }
    let digits = (2.0 - count.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{count:.digits$}")
}

/// Returns a table of work per forcing period.
fn table(heads: &[&str], rows: impl Iterator<Item = (String, Vec<f64>)>) -> String {
    let mut text = format!("{:<28}", "");
    heads.iter().for_each(|head| write!(text, "{head:>17}").unwrap());
    for (name, counts) in rows {
        write!(text, "\n{name:<28}").unwrap();
        counts.iter().for_each(|&count| write!(text, "{:>17}", rounded(count)).unwrap());
    }
    text
}

/// One certificate judges every step that is tried.
#[test]
fn the_reference_does_as_much_work_as_before() {
    let rows = pairs().into_iter().zip(CELLS).map(|(pair, (name, ..))| {
        let flow = flow_of(&pair);
        let mut trajectory = Trajectory::new(&flow, pair.law(), REST);
        let advance = |trajectory: &mut Trajectory<'_>, periods: u32| {
            (0..periods).for_each(|_| trajectory.advance_period(&mut ()).expect("an ordinary cell"));
            trajectory.work()
        };
        let before = advance(&mut trajectory, SETTLING);
        let work = work_since(advance(&mut trajectory, COUNTED), before);
        let counts = [work.steps, work.halvings, work.events, work.root_iterations];
        (name.to_owned(), counts.map(|count| count as f64 / f64::from(COUNTED)).to_vec())
    });
    let heads = ["certificates", "halvings", "events", "root iterations"];
    insta::assert_snapshot!(table(&heads, rows));
}

/// Counts loop iterations by function. Modified shaders report them in place of impacts.
fn work_of_lanes(precisions: &[Precision], functions: &[(&str, &str)]) -> String {
    let settings = LaneSettings { transient_periods: SETTLING, ..LaneSettings::only(SETTLING + COUNTED) };
    let mut rows = Vec::new();
    for &precision in precisions {
        let mut gpu = open(precision);
        let mut counts = Vec::new();
        for (function, _) in functions {
            gpu.rewrite_shaders(counting(function));
            let records = run_from_rest(&mut gpu, &pairs(), &settings);
            counts.push(records.iter().map(|record| record.impacts_per_period).collect::<Vec<_>>());
        }
        for (i, (name, ..)) in CELLS.iter().enumerate() {
            let of_cell = counts.iter().map(|by_cell| by_cell[i]).collect();
            rows.push((format!("{} {name}", precision.name()), of_cell));
        }
    }
    let heads: Vec<&str> = functions.iter().map(|(_, what)| *what).collect();
    table(&heads, rows.into_iter())
}

/// Each count needs one shader: here those of scans and careful passes, which are nearly all of a lane's work.
#[test]
fn lanes_scan_as_much_as_before() {
    insta::assert_snapshot!(work_of_lanes(&[Precision::F32], &LOOPS[..2]));
}

#[test]
#[ignore = "compiles ten shaders; scripts/test.sh --all"]
fn lanes_do_as_much_work_as_before() {
    insta::assert_snapshot!(work_of_lanes(&Precision::ALL, &LOOPS));
}
