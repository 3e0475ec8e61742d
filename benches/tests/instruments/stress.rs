//! The parts of `stress`. Each must pass.

use std::io::Write;

use rattlemap::gpu::AdapterChoice;
use rattlemap_bench::stress::{self, Checks, Lanes};

fn lanes() -> Lanes {
    pollster::block_on(Lanes::open(&AdapterChoice::default())).unwrap()
}

#[track_caller]
fn check(checks: &Checks) {
    let failures = checks.failures();
    assert!(failures.is_empty() && checks.count() > 0, "of {}: {failures:#?}", checks.count());
}

#[test]
fn errors_do_not_grow_with_time() {
    check(&stress::long_runs::check(&mut lanes()).unwrap());
}

#[test]
fn impacts_keep_momentum_and_the_law_of_energy() {
    check(&stress::impacts::check(&mut lanes()).unwrap());
}

#[test]
fn grazing_obeys_the_square_root_law() {
    check(&stress::grazing::check(&mut lanes()).unwrap());
}

#[test]
fn chatter_ends_as_restitution_goes_to_one() {
    check(&stress::chatter::check(&mut lanes()).unwrap());
}

#[test]
fn stiff_meshing_costs_steps_and_nothing_else() {
    check(&stress::stiffness::check(&mut lanes()).unwrap());
}

#[test]
fn no_grid_is_too_coarse_to_see_an_event() {
    check(&stress::grid::check(&mut lanes()).unwrap());
}

/// `RATTLEMAP_TORTURE=N` tries N cells.
#[test]
fn every_cell_ends_soon() {
    let count = std::env::var("RATTLEMAP_TORTURE").ok().and_then(|n| n.parse().ok()).unwrap_or(1000);
    let checks = stress::work::check(count);
    // A script reads this line; `println!` would be captured.
    writeln!(std::io::stdout(), "torture: cells {count}, faults {}", checks.failures().len()).unwrap();
    check(&checks);
}

#[test]
fn random_parameters_end_as_on_the_reference() {
    check(&stress::fuzz::check(200, &mut lanes()).unwrap());
}

#[test]
#[ignore = "a minute; scripts/test.sh --all"]
fn more_random_parameters_end_as_on_the_reference() {
    check(&stress::fuzz::check(1000, &mut lanes()).unwrap());
}
