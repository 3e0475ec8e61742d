//! The parts of `rattlemap bench stability` in small: each must hold.

use rattlemap::bench::stability::{self, Lanes, Size, Verdict};
use rattlemap::gpu::AdapterChoice;

const SEED: u64 = 1;

fn lanes() -> Lanes {
    pollster::block_on(Lanes::open(&AdapterChoice::default())).unwrap()
}

#[track_caller]
fn holds(verdict: &Verdict) {
    println!("{}: {}", verdict.part, verdict.sentence);
    assert!(verdict.holds, "{}: {}", verdict.part, verdict.sentence);
}

#[test]
fn errors_do_not_grow_with_time() {
    let rows = stability::long_runs::measure(Size::Small, &mut lanes(), &()).unwrap();
    rows.iter().for_each(|row| println!("{row:?}"));
    holds(&stability::long_runs::judge(&rows));
}

#[test]
fn impacts_keep_momentum_and_the_law_of_energy() {
    let rows = stability::impacts::measure(Size::Small, SEED, &mut lanes()).unwrap();
    rows.iter().for_each(|row| println!("{row:?}"));
    holds(&stability::impacts::judge(&rows));
}

#[test]
fn grazing_obeys_the_square_root_law() {
    let rows = stability::grazing::measure(Size::Small, SEED, &mut lanes()).unwrap();
    rows.iter().for_each(|row| println!("{row:?}"));
    holds(&stability::grazing::judge(&rows));
}

#[test]
fn chatter_ends_as_restitution_goes_to_one() {
    let rows = stability::chatter::measure(Size::Small, &mut lanes()).unwrap();
    rows.iter().for_each(|row| println!("{row:?}"));
    holds(&stability::chatter::judge(&rows));
}

#[test]
fn stiff_meshing_costs_steps_and_nothing_else() {
    let rows = stability::stiffness::measure(Size::Small, &mut lanes()).unwrap();
    rows.iter().for_each(|row| println!("{row:?}"));
    holds(&stability::stiffness::judge(&rows));
}

#[test]
fn no_grid_is_too_coarse_to_see_an_event() {
    let rows = stability::grid::measure(Size::Small, SEED, &mut lanes(), &()).unwrap();
    rows.swings.iter().for_each(|row| println!("{row:?}"));
    rows.motions.iter().for_each(|row| println!("{row:?}"));
    holds(&stability::grid::judge(&rows));
}

#[test]
fn random_parameters_end_as_on_the_reference() {
    let rows = stability::fuzz::measure(Size::Small, SEED, &mut lanes(), &()).unwrap();
    rows.counts.iter().for_each(|row| println!("{row:?}"));
    rows.mismatches.iter().for_each(|row| println!("{row:?}"));
    holds(&stability::fuzz::judge(&rows));
}
