//! The parts of `stress` at small size. Each must pass.

use rattlemap::gpu::AdapterChoice;
use rattlemap_bench::stress::{self, EngineName, Lanes, Size, Verdict};

const SEED: u64 = 1;

fn lanes() -> Lanes {
    pollster::block_on(Lanes::open(&AdapterChoice::default())).unwrap()
}

#[track_caller]
fn check(verdict: Verdict) {
    assert!(verdict.holds, "{}", verdict.sentence);
}

#[test]
fn errors_do_not_grow_with_time() {
    check(stress::long_runs::judge(&stress::long_runs::measure(Size::Small, &mut lanes(), &()).unwrap()));
}

#[test]
fn impacts_keep_momentum_and_the_law_of_energy() {
    check(stress::impacts::judge(&stress::impacts::measure(Size::Small, SEED, &mut lanes()).unwrap()));
}

#[test]
fn grazing_obeys_the_square_root_law() {
    check(stress::grazing::judge(&stress::grazing::measure(Size::Small, SEED, &mut lanes()).unwrap()));
}

#[test]
fn chatter_ends_as_restitution_goes_to_one() {
    check(stress::chatter::judge(&stress::chatter::measure(Size::Small, &mut lanes()).unwrap()));
}

#[test]
fn stiff_meshing_costs_steps_and_nothing_else() {
    check(stress::stiffness::judge(&stress::stiffness::measure(Size::Small, &mut lanes()).unwrap()));
}

#[test]
fn no_grid_is_too_coarse_to_see_an_event() {
    check(stress::grid::judge(&stress::grid::measure(Size::Small, SEED, &mut lanes(), &()).unwrap()));
}

/// 1,000 cells. `stress_judges_every_part_and_writes_its_folder` has 200 of them, and the full run 100,000.
#[test]
fn every_cell_ends_soon() {
    check(stress::work::judge(&stress::work::measure_cells(Size::Small, SEED, &())));
}

/// 1,000 cells. `stress_judges_every_part_and_writes_its_folder` has 200 of them.
#[test]
#[ignore = "a minute; scripts/test.sh --all"]
fn random_parameters_end_as_on_the_reference() {
    check(stress::fuzz::judge(&stress::fuzz::measure(Size::Small, SEED, &mut lanes(), &()).unwrap()));
}

#[test]
fn an_error_that_is_not_finite_fails_every_verdict() {
    use stress::{chatter, grazing, impacts, long_runs, stiffness};
    for error in [f64::NAN, f64::INFINITY] {
        let engine = EngineName::LanesF64;
        let run = |periods| long_runs::Row { e: 0.5, omega: 5.6, engine, periods, error, size: 1.0 };
        assert!(!long_runs::judge(&[10, 30, 100].map(run)).holds, "long runs: {error}");
        let graze =
            grazing::Row { engine, distance: 0.03, cells: 1, contacts: 1, speed_error: error, law: 1e-9 };
        assert!(
            !grazing::judge(&[grazing::Row { speed_error: 0.0, ..graze }, graze]).holds,
            "grazing: {error}"
        );
        let impact = impacts::Row {
            engine,
            e: 0.5,
            m1: 1.0,
            m2: 1.0,
            contacts: 1,
            momentum_error: error,
            energy_error: 0.0,
        };
        assert!(!impacts::judge(&[impact]).holds, "impacts: {error}");
        let (status, bar) = ("ok", Some(1e-9));
        let series =
            chatter::Row { e: 0.5, mesh_speed: 0.01, engine, status, impacts: 3, error: Some(0.0), bar };
        assert!(chatter::judge(&[series; 3]).holds);
        // The error fails even if any finite error is allowed.
        let lost = chatter::Row { error: Some(error), bar: Some(f64::INFINITY), ..series };
        assert!(!chatter::judge(&[series, series, lost]).holds, "chatter: {error}");
        let stiff = stiffness::Row {
            k: 1e3,
            e: 0.5,
            omega: 5.6,
            engine,
            status,
            error: Some(error),
            spread: Some(0.0),
            conditioning: 1e-9,
            scatter: f64::INFINITY,
            steps_per_period: 100.0,
        };
        assert!(!stiffness::judge(&[stiff]).holds, "stiffness: {error}");
    }
}
