//! The cells of the independent program's table.

use crate::common::table::{LYAPUNOV_DECIMALS, MESH_DECIMALS, Row, STROBE_DECIMALS, prints, rows};
use crate::common::{REST, apart, flow_of};
use rattlemap_dynamics::model::State;
use rattlemap_dynamics::motion::Trajectory;
use rattlemap_dynamics::orbit::{Orbit, Settings, analyse};
use rattlemap_dynamics::stability::StrobeMap;
use rayon::prelude::*;

fn orbit_of(row: &Row) -> Orbit {
    let observed_periods = if row.is_chaotic() { 20_000 } else { 128 };
    analyse(&row.pair(), REST, &Settings { transient_periods: 3000, observed_periods, max_period: 64 })
        .unwrap()
}

/// Returns the strobe state, of the orbit or its symmetry-conjugate orbit, that is nearest to the table's.
fn nearest_strobe(orbit: &Orbit, row: &Row, strobe: State) -> State {
    let pair = row.pair();
    let flow = flow_of(&pair);
    let seed = Trajectory::new(&flow, pair.law(), orbit.strobe);
    let mut nearest = orbit.strobe;
    let mut y = orbit.strobe;
    let mut conjugate = StrobeMap::MirroredHalves(1).apply(&seed, y).unwrap().state;
    for _ in 0..orbit.cycle_periods {
        for near in [y, conjugate] {
            if apart(near, strobe) < apart(nearest, strobe) {
                nearest = near;
            }
        }
        y = StrobeMap::Periods(1).apply(&seed, y).unwrap().state;
        conjugate = StrobeMap::Periods(1).apply(&seed, conjugate).unwrap().state;
    }
    nearest
}

fn check_periodic(row: &Row, orbit: &Orbit) {
    let at = row.place();
    let strobe = row.strobe().unwrap();
    let nearest = nearest_strobe(orbit, row, strobe);
    let check = |what: &str, value: f64, printed: f64, decimals: i32| {
        assert!(prints(value, printed, decimals), "{at}: {what} {value} instead of {printed}");
    };
    check("exponent", orbit.lyapunov, row.lyapunov, LYAPUNOV_DECIMALS);
    check("meshing", orbit.mesh_fraction, row.mesh_fraction, MESH_DECIMALS);
    for (value, printed) in nearest.into_iter().zip(strobe) {
        check("strobe", value, printed, STROBE_DECIMALS);
    }
    assert!((orbit.impacts_per_period - row.impacts_per_period).abs() < 1e-9, "{at}");
    if let Some(word) = row.word() {
        assert!(orbit.word == word || orbit.word.mirrored() == word, "{at}: {} {word}", orbit.word);
    }
}

fn check_chaotic(row: &Row, orbit: &Orbit) {
    let at = row.place();
    let error = row.lyapunov_error.unwrap().hypot(orbit.lyapunov_error.unwrap());
    assert!((orbit.lyapunov - row.lyapunov).abs() < 4.0 * error, "{at}: {} +- {error}", orbit.lyapunov);
    assert!((orbit.impacts_per_period / row.impacts_per_period - 1.0).abs() < 0.01, "{at}");
    assert!((orbit.mesh_fraction - row.mesh_fraction).abs() <= 0.01 * row.mesh_fraction, "{at}");
}

#[test]
fn orbits_agree_with_the_independent_program() {
    rows().par_iter().for_each(|row| {
        let orbit = orbit_of(row);
        assert_eq!(orbit.class, row.class(), "{}", row.place());
        let check = if row.is_chaotic() { check_chaotic } else { check_periodic };
        check(row, &orbit);
    });
}
