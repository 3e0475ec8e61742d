//! Measured quantities of lanes: against the reference, and the balance of energy.

use crate::common::gpu::open;
use crate::common::linear::{Linear, with_wall};
use crate::common::pairs::AsPair;
use crate::common::{BUDGET, REST, near, paper};
use rattlemap::gpu::{Features, Lane, LaneResult, LaneSettings, Measures, Precision};
use rattlemap_dynamics::model::{Contact, Law, Pair, Side, State};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Budget, Quantities, measure};

/// Everything that lanes measure.
pub(super) const MEASURES: Measures = Measures { periods: 128, extremes: true, moments: true };

pub(super) type Case = (Pair, Law, State);

/// Runs one lane per case. Returns quantities, multiplier and period of each.
pub(super) fn lanes(
    cases: &[Case],
    precision: Precision,
    measures: Option<Measures>,
) -> Vec<(Option<Quantities>, Option<[f64; 2]>, u32)> {
    let mut gpu = open(precision);
    let flows: Vec<Pair> = cases.iter().map(|case| case.0.clone()).collect();
    let laws: Vec<Law> = cases.iter().map(|case| case.1).collect();
    let default = LaneSettings::default();
    let features = flows.iter().map(Features::of).fold(default.features, Features::and);
    let settings = LaneSettings { measures, multiplier: true, features, ..default };
    pollster::block_on(async {
        let tables = gpu.load(&flows, &laws, None).await.unwrap();
        let mut pool = gpu.pool(&settings).await.unwrap();
        let lane =
            |(i, case): (usize, &Case)| (i as u32, Lane { flow: i as u32, law: i as u32, start: case.2 });
        let all: Vec<_> = cases.iter().enumerate().map(lane).collect();
        pool.begin(&gpu, &tables, &all).await.unwrap();
        let mut ended: Vec<LaneResult> = Vec::new();
        while pool.under_way() > 0 {
            ended.extend(pool.advance(&gpu, &tables, 0).await.unwrap());
        }
        ended.sort_by_key(LaneResult::number);
        let constants = tables.constants();
        let result = |lane: &LaneResult| {
            (lane.quantities(constants), lane.multiplier(constants), lane.record(constants).period)
        };
        ended.iter().map(result).collect()
    })
}

fn cases() -> Vec<Case> {
    let pair = |e, omega| {
        let pair = paper(e, omega);
        (pair.pair(), pair.law(), REST)
    };
    let free = Linear { gamma: 0.05, square: 1.0, force: 1.0, load: 0.0, omega: 2.1 };
    let table = Linear { gamma: 0.0, square: 0.0, force: 1.2, load: 1.0, omega: 1.0 };
    vec![
        pair(0.06, 5.6),
        pair(0.3, 3.0),
        pair(0.8, 4.4),
        pair(0.5, 11.5),
        pair(0.72, 1.5),
        (
            with_wall(free.oscillator(), Side::Right, 0.1, Contact::Elastic, [24.0, 1.5]),
            Law::both(0.5, 0.0),
            REST,
        ),
        (
            with_wall(table.oscillator(), Side::Right, 0.3, Contact::Rigid, [0.0; 2]),
            Law::both(0.4, 0.0),
            REST,
        ),
    ]
}

/// Whether all numbers agree within `within`, relative to the size of the motion.
pub(super) fn agree(a: &Quantities, b: &Quantities, omega: f64, within: f64) -> bool {
    let size = b.displacements.iter().map(|d| d.rms).fold(0.0, f64::max);
    let speed = size * omega;
    let power = b.dissipated + b.impact_energy;
    let displacements = a.displacements.iter().zip(&b.displacements).all(|(a, b)| {
        let [[ca, sa], [cb, sb]] =
            [a, b].map(|d| [d.harmonic[0] * d.harmonic[1].cos(), d.harmonic[0] * d.harmonic[1].sin()]);
        [(a.amplitude, b.amplitude), (a.mean, b.mean), (a.rms, b.rms), (ca, cb), (sa, sb)]
            .iter()
            .all(|&(a, b)| near(a, b, within * size))
    });
    let force = match (a.contact_force, b.contact_force) {
        (Some(a), Some(b)) => (0..2).all(|i| near(a[i], b[i], 100.0 * within * b[i].abs())),
        (a, b) => a.is_none() && b.is_none(),
    };
    displacements
        && force
        && a.approaches[2].count == b.approaches[2].count
        && near(a.approaches[2].mean, b.approaches[2].mean, within * speed)
        && near(a.approaches[2].largest, b.approaches[2].largest, within * speed)
        && near(a.dissipated, b.dissipated, within * power)
        && near(a.impact_energy, b.impact_energy, within * power)
}

#[test]
fn lanes_measure_what_the_reference_measures() {
    let cases = cases();
    for (precision, within) in [(Precision::F32, 3e-5), (Precision::F64, 1e-9)] {
        let results = lanes(&cases, precision, Some(MEASURES));
        for ((oscillator, law, start), (of, multiplier, period)) in cases.iter().zip(results) {
            let budget = Budget { quantities: true, ..BUDGET };
            let expected = measure(&Flow::new(oscillator), *law, *start, &budget);
            let case = format!("{precision:?} {oscillator:?} {law:?}:\n{of:?}\n{:?}", expected.quantities);
            assert_eq!(expected.period.unwrap_or(0), period, "{case}");
            let (of, reference) = (of.expect("measured"), expected.quantities.expect("measured"));
            if period == 0 {
                let size = reference.displacements[2].rms;
                assert!(near(of.displacements[2].rms, size, 0.2 * size), "{case}");
                let energy = reference.impact_energy;
                assert!(near(of.impact_energy, energy, 0.3 * energy), "{case}");
            } else {
                assert!(agree(&of, &reference, oscillator.omega, within), "{case}");
                let [modulus, argument] = multiplier.expect("a cycle");
                let [expected_modulus, expected_argument] = expected.multiplier.expect("a cycle");
                assert!(
                    near(modulus, expected_modulus, 30.0 * within),
                    "{modulus} {expected_modulus} {case}"
                );
                let is_sharp = expected_modulus > 1e-3 && precision == Precision::F64;
                assert!(
                    !is_sharp || near(argument, expected_argument.abs(), 1e-5),
                    "{argument} {expected_argument} {case}"
                );
                let [size, phase] = of.displacements[0].harmonic;
                let work = -0.5 * oscillator.force[0] * oscillator.omega * size * phase.sin();
                let bar = if precision == Precision::F64 { 1e-10 } else { 2e-5 };
                assert!(near(work, of.dissipated + of.impact_energy, bar * work.abs()), "{work} {case}");
            }
        }
    }
}

/// Measures of one kind equal those of a lane that measures everything, and records stay the same.
#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn what_is_not_requested_is_not_measured() {
    let cases = cases();
    let all = lanes(&cases, Precision::F32, Some(MEASURES));
    let none = lanes(&cases, Precision::F32, None);
    let impacts =
        lanes(&cases, Precision::F32, Some(Measures { extremes: false, moments: false, ..MEASURES }));
    for ((all, none), impacts) in all.iter().zip(none).zip(impacts) {
        assert_eq!((none.0, none.2), (None, all.2));
        let (all, impacts) = (all.0.unwrap(), impacts.0.unwrap());
        assert_eq!(impacts.approaches, all.approaches);
        assert_eq!((impacts.dissipated, impacts.displacements[0].rms), (0.0, 0.0));
    }
}
