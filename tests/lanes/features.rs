//! Further harmonics of the force, and domains that change in a forcing period, on lanes and on the reference.
//!
//! The lanes need an adapter; without one the tests fail (see `scripts/test.sh`).

use crate::common::linear::Linear;
use crate::common::pairs::{AsPair, Friction, Rubbing};
use crate::common::{BUDGET, apart, built_in};
use crate::lanes::kinds::draw::{Numbers, random_cell};
use crate::lanes::kinds::{self, Cell};
use crate::lanes::measures::{self, MEASURES};
use rattlemap::gpu::{Features, GpuError, LaneSettings, Precision};
use rattlemap::map::engine::measured_record;
use rattlemap::map::plan::Needs;
use rattlemap::record::Record;
use rattlemap::record::classify::classify;
use rattlemap_dynamics::model::{Contact, Domain, Harmonic, Law, Model, Pair, REST, Stage, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Budget, Class, measure};
use rayon::prelude::*;

const SEEDS: u64 = 48;

/// Returns settings that include what these cells need.
fn settings(cells: &[Cell]) -> LaneSettings {
    let default = LaneSettings::default();
    let features = cells.iter().map(|cell| Features::of(&cell.0)).fold(default.features, Features::and);
    LaneSettings { undecided_periods: 1584, features, ..default }
}

/// Adds one or two harmonics of random orders.
fn with_harmonics(seed: u64, (mut oscillator, law, start): Cell) -> Cell {
    let mut draw = Numbers(seed ^ 0x5eed);
    let mut order = 1;
    for _ in 0..draw.one_of(&[1, 2]) {
        order += draw.one_of(&[1, 1, 2, 5]);
        let mut factors = || {
            let size = draw.between(-4.0, 4.0);
            let second = if oscillator.degrees == 1 { 0.0 } else { draw.between(-1.0, 1.0) };
            [size, second]
        };
        let harmonic = Harmonic { order, cos: factors(), sin: factors() };
        oscillator.harmonics.push(harmonic);
    }
    (oscillator, law, start)
}

/// Returns a domain whose stiffness and damping have another part along the gap.
fn changed(domain: &Domain, gap: [f64; 2], stiffness: f64, damping: f64, load: [f64; 2]) -> Domain {
    let along = |a: [[f64; 2]; 2], by: f64| {
        [0, 1].map(|i: usize| [0, 1].map(|j: usize| a[i][j] + by * (gap[i] * gap[j])))
    };
    Domain {
        damping: along(domain.damping, damping),
        stiffness: along(domain.stiffness, stiffness),
        load: [0, 1].map(|i| domain.load[i] + load[i]),
    }
}

/// Adds one or two stages with other free motion and other springs behind the walls, and two to four changes.
fn with_stages(seed: u64, (mut oscillator, law, start): Cell) -> Cell {
    let mut draw = Numbers(seed ^ 0x57a6e);
    let count = draw.one_of(&[1, 2]);
    let Pair { free, meshing, gap, walls, contacts, .. } = oscillator.clone();
    for _ in 0..count {
        let (k, c) = (draw.between(0.0, 4.0), draw.between(0.0, 0.3));
        let pull = draw.between(-1.0, 1.0);
        let free = changed(&free, gap, k, c, [0, 1].map(|i: usize| pull * gap[i]));
        let meshing = [0, 1].map(|side: usize| {
            if contacts[side] == Contact::Rigid || walls[side].is_infinite() {
                return free;
            }
            let (spring, damper) = (draw.between(10.0, 400.0), draw.between(0.0, 4.0));
            let load = [0, 1].map(|i: usize| spring * walls[side] * gap[i]);
            changed(&free, gap, spring, damper, load)
        });
        oscillator.stages.push(Stage { free, meshing });
    }
    let mut phases: Vec<f64> = (0..draw.one_of(&[2, 3, 4])).map(|_| draw.between(0.0, 1.0)).collect();
    phases.sort_by(f64::total_cmp);
    phases[0] *= draw.one_of(&[0.0, 1.0]);
    let stages: Vec<usize> = (0..=count).collect();
    oscillator.schedule = phases.into_iter().map(|phase| (phase, draw.one_of(&stages))).collect();
    assert_eq!(meshing, oscillator.meshing);
    (oscillator, law, start)
}

fn harmonic_cells() -> Vec<Cell> {
    (0..SEEDS).map(|seed| with_harmonics(seed, random_cell(seed))).collect()
}

fn staged_cells() -> Vec<Cell> {
    (0..SEEDS).map(|seed| with_stages(seed, random_cell(seed))).collect()
}

fn cells_with_everything() -> Vec<Cell> {
    (0..SEEDS).map(|seed| with_harmonics(seed, with_stages(seed, random_cell(seed)))).collect()
}

/// Returns the reference's record of a cell.
pub(crate) fn reference((oscillator, law, start): &Cell) -> Record {
    measured_record(&measure(&Flow::new(oscillator), *law, *start, &BUDGET), &Needs::EVERYTHING)
}

/// A precision, the largest difference of a cycle's numbers, and how many cells may differ in other ways.
const IN_F64: (Precision, f64, usize) = (Precision::F64, 1e-8, 1);
const IN_F32: (Precision, f64, usize) = (Precision::F32, 1e-3, 2);

/// Compares lanes with the reference.
fn check(what: &str, cells: &[Cell], precisions: &[(Precision, f64, usize)]) {
    let expected: Vec<Record> = cells.par_iter().map(reference).collect();
    for &(precision, bar, most) in precisions {
        let found = kinds::run(precision, cells, &settings(cells)).unwrap();
        let (mut differing, mut cycles, mut worst) = (Vec::new(), 0, 0.0f64);
        for (seed, (ours, theirs)) in found.iter().zip(&expected).enumerate() {
            let mut differs = |how: String| differing.push(format!("seed {seed}: {how}"));
            let classes = [classify(ours), classify(theirs)];
            if classes[0] != classes[1] {
                differs(format!("{classes:?}"));
                continue;
            }
            let Class::Periodic { period, .. } = classes[1] else { continue };
            cycles += 1;
            // Longer cycles may end at another of their strobes.
            let error = if period == 1 { apart(ours.strobe(), theirs.strobe()) } else { 0.0 };
            let contact = (ours.mesh_fraction - theirs.mesh_fraction).abs();
            let growth =
                if ours.lyapunov == theirs.lyapunov { 0.0 } else { (ours.lyapunov - theirs.lyapunov).abs() };
            let errors = [error, contact, growth];
            if !errors.iter().all(|&error| error < bar) {
                differs(format!("state {error:.1e}, contact {contact:.1e}, exponent {growth:.1e}"));
            } else if ours.spelling() != theirs.spelling() {
                differs(format!("{:?} {:?}", ours.spelling(), theirs.spelling()));
            } else {
                worst = errors.into_iter().fold(worst, f64::max);
            }
        }
        println!("{what}, {precision:?}: {cycles} cycles, worst {worst:.1e}, {differing:#?}");
        assert!(differing.len() <= most, "{what}, {precision:?}: {differing:#?}");
        assert!(cycles >= 24, "{what}: {cycles} cycles");
    }
}

/// Cells with one feature each.
fn features() -> [(&'static str, Vec<Cell>); 2] {
    [("harmonics", harmonic_cells()), ("stages", staged_cells())]
}

#[test]
#[ignore = "compiles large shaders; scripts/test.sh --all"]
fn each_feature_agrees_with_the_reference() {
    for (what, cells) in features() {
        check(what, &cells, &[IN_F64, IN_F32]);
    }
}

#[test]
#[ignore = "compiles large shaders; scripts/test.sh --all"]
fn everything_together_agrees_with_the_reference() {
    check("everything", &cells_with_everything(), &[IN_F64, IN_F32]);
}

/// Where all stages are equal, only the changes' instants interrupt the motion.
#[test]
#[ignore = "compiles large shaders; scripts/test.sh --all"]
fn equal_stages_give_the_motion_without_stages() {
    let cells: Vec<Cell> = (0..24).map(random_cell).collect();
    let staged = cells.iter().map(|(oscillator, law, start)| {
        let Pair { free, meshing, .. } = *oscillator;
        let schedule = vec![(0.123, 1), (0.5, 0), (0.877, 1)];
        let staged = Pair { stages: vec![Stage { free, meshing }], schedule, ..oscillator.clone() };
        (staged, *law, *start)
    });
    let staged: Vec<Cell> = staged.collect();
    for (precision, bar) in [(Precision::F64, 1e-9), (Precision::F32, 1e-3)] {
        let run = |cells: &[Cell]| kinds::run(precision, cells, &settings(cells)).unwrap();
        for (seed, (plain, staged)) in run(&cells).iter().zip(&run(&staged)).enumerate() {
            assert_eq!(classify(plain), classify(staged), "{precision:?}, seed {seed}");
            // Longer cycles may end at another of their strobes, and motion without contact before it is steady.
            if plain.period == 1 && !plain.is_contact_free() {
                let off = apart(plain.strobe(), staged.strobe());
                assert!(off < bar, "{precision:?}, seed {seed}: off by {off:e}");
                assert_eq!(plain.spelling(), staged.spelling(), "{precision:?}, seed {seed}");
            }
        }
    }
}

/// A force may also be written as the second harmonic of half its frequency. A cycle of an even number of periods then has half as
/// many, and another one as many as before.
#[test]
#[ignore = "compiles large shaders; scripts/test.sh --all"]
fn a_force_of_second_order_has_twice_the_frequency() {
    let cells: Vec<Cell> = (0..24).map(random_cell).collect();
    let slower = cells.iter().map(|(oscillator, law, start)| {
        let Pair { force, force_sin, omega, .. } = *oscillator;
        let second = Harmonic { order: 2, cos: force, sin: force_sin };
        let (force, force_sin, omega) = ([0.0; 2], [0.0; 2], 0.5 * omega);
        let slower = Pair { force, force_sin, omega, harmonics: vec![second], ..oscillator.clone() };
        (slower, *law, *start)
    });
    let slower: Vec<Cell> = slower.collect();
    let run = |cells: &[Cell]| kinds::run(Precision::F64, cells, &settings(cells)).unwrap();
    let mut compared = 0;
    for (seed, (plain, slower)) in run(&cells).iter().zip(&run(&slower)).enumerate() {
        let (Class::Periodic { period, .. }, Class::Periodic { period: slow, .. }) =
            (classify(plain), classify(slower))
        else {
            continue;
        };
        let expected = if period % 2 == 0 { period / 2 } else { period };
        assert_eq!(slow, expected, "seed {seed}");
        // Longer cycles may end at another of their strobes, and motion without contact before it is steady.
        if period == 1 && !plain.is_contact_free() {
            let off = apart(plain.strobe(), slower.strobe());
            assert!(off < 1e-8, "seed {seed}: off by {off:e}");
            compared += 1;
        }
    }
    assert!(compared > 4, "{compared} cells");
}

/// A mass on a rigid wall, which the load of stage 0 presses and that of stage 1 pulls off.
fn pressed_and_released() -> Vec<Cell> {
    let (oscillator, ..) = (0..).map(random_cell).find(|cell| cell.0.degrees == 1).unwrap();
    let domain = |load: f64| Domain {
        damping: [[0.3, 0.0], [0.0, 0.0]],
        stiffness: [[1.0, 0.0], [0.0, 0.0]],
        load: [load, 0.0],
    };
    let [pressed, pulled] = [domain(4.0), domain(-4.0)];
    let of = |i: u32| {
        let released = 0.3 + 0.02 * f64::from(i);
        let oscillator = Pair {
            mass: [[1.0, 0.0], [0.0, 1.0]],
            gap: [1.0, 0.0],
            walls: [0.5, f64::NEG_INFINITY],
            contacts: [Contact::Rigid; 2],
            omega: 0.8,
            force: [1.0, 0.0],
            force_sin: [0.0; 2],
            free: pressed,
            meshing: [pressed; 2],
            stages: vec![Stage { free: pulled, meshing: [pulled; 2] }],
            schedule: vec![(0.0, 0), (released, 1)],
            ..oscillator.clone()
        };
        (oscillator, Law::both(0.2, 0.0), REST)
    };
    (0..12).map(of).collect()
}

#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn a_change_of_the_stage_releases_a_gap_at_rest() {
    let cells = pressed_and_released();
    let expected: Vec<Record> = cells.par_iter().map(reference).collect();
    for (precision, bar) in [(Precision::F64, 1e-9), (Precision::F32, 1e-4)] {
        let found = kinds::run(precision, &cells, &settings(&cells)).unwrap();
        for (i, (ours, theirs)) in found.iter().zip(&expected).enumerate() {
            let at = format!("{precision:?}, {i}: {ours:?} {theirs:?}");
            assert_eq!(classify(ours), classify(theirs), "{at}");
            assert!(theirs.mesh_fraction > 0.05, "{at}");
            assert!((ours.mesh_fraction - theirs.mesh_fraction).abs() < bar, "{at}");
            assert!(apart(ours.strobe(), theirs.strobe()) < bar, "{at}");
            assert_eq!(ours.spelling(), theirs.spelling(), "{at}");
        }
    }
}

/// Motion that decays to rest is decided as soon as it is small against the distance of the walls.
#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn decaying_motion_with_stages_is_decided() {
    let cells: Vec<Cell> = [(0.6, 0.1), (1.7, 0.12), (2.4, 0.6), (2.0, 1.1), (0.18, 0.06)]
        .into_iter()
        .map(|(delta, epsilon)| {
            let model = built_in("meissner", &[("delta", delta), ("epsilon", epsilon)]);
            (model.pair(), model.law(), state(&[0.01]))
        })
        .collect();
    let expected: Vec<Record> = cells.par_iter().map(reference).collect();
    let found = kinds::run(Precision::F64, &cells, &settings(&cells)).unwrap();
    for (ours, theirs) in found.iter().zip(&expected) {
        assert_eq!(classify(ours), classify(theirs), "{ours:?} {theirs:?}");
        assert!(ours.period == 1 && ours.impacts_per_period == 0.0, "{ours:?}");
        assert!((ours.lyapunov - theirs.lyapunov).abs() < 1e-9, "{ours:?} {theirs:?}");
    }
}

/// Amplitudes, forces and energies of cycles agree, too.
#[test]
#[ignore = "compiles large shaders; scripts/test.sh --all"]
fn quantities_agree_with_the_reference() {
    let budget = Budget { quantities: true, ..BUDGET };
    for (what, cells) in features() {
        let measured =
            |(oscillator, law, start): &Cell| measure(&Flow::new(oscillator), *law, *start, &budget);
        let expected: Vec<_> = cells.par_iter().map(measured).collect();
        let found = measures::lanes(&cells, Precision::F64, Some(MEASURES));
        let mut compared = 0;
        for (seed, ((ours, _, period), theirs)) in found.iter().zip(&expected).enumerate() {
            if *period == 0 || theirs.period != Some(*period) {
                continue;
            }
            compared += 1;
            let (ours, theirs) = (ours.unwrap(), theirs.quantities.unwrap());
            let are_alike = measures::agree(&ours, &theirs, cells[seed].0.omega, 1e-7);
            assert!(are_alike, "{what}, seed {seed}: {ours:#?} {theirs:#?} {:?}", cells[seed]);
        }
        assert!(compared > 24, "{what}: {compared} cells");
    }
}

#[test]
fn excluded_features_are_refused() {
    for (excluded, cells) in features() {
        let error = kinds::run(Precision::F32, &cells[..1], &LaneSettings::only(1)).unwrap_err();
        let is_named = matches!(error, GpuError::NotCompiled { flow: 0, setting, .. } if setting == excluded);
        assert!(is_named, "{excluded}: {error}");
    }
    let free = Linear { gamma: 0.05, square: 1.0, force: 1.0, load: 0.0, omega: 2.1 };
    let friction = vec![Friction { row: [1.0, 0.0], force: 0.1, speed: 0.0 }];
    let machine = Rubbing { pair: free.oscillator(), friction }.described(Law::both(0.5, 0.0));
    let (mut gpu, laws) = (crate::common::gpu::open(Precision::F32), [Law::both(0.0, 0.0)]);
    let lanes = [rattlemap::gpu::Lane { flow: 0, law: 0, start: REST }];
    let error = pollster::block_on(gpu.run(&[machine], &laws, &lanes, &LaneSettings::only(1))).unwrap_err();
    assert!(matches!(error, GpuError::NotCompiled { flow: 0, setting: "machine", .. }), "{error}");
}
