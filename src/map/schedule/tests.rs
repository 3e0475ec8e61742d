//! Adaptive maps of test pictures, with the number of integrated cells.

use super::*;
use crate::map::plan::test_plan;
use crate::record::classify::classify;
use crate::record::valid;
use rattlemap_dynamics::orbit::Class;
use rattlemap_dynamics::word::Word;

/// Added to the period in a picture's number: a symmetric cycle.
const SYMMETRIC: u32 = 1000;
/// Added to the period in a picture's number: another word.
const OTHER_WORD: u32 = 2000;

/// Converts a number of a picture to a record.
fn record_of(number: u32) -> Record {
    let mut record = Record {
        period: number % SYMMETRIC,
        symmetric: number / SYMMETRIC % 2,
        valid: valid::PERIOD | valid::SYMMETRIC,
        periods_run: 7,
        ..Record::default()
    };
    record.set_word(&Word::cyclic(&[b'1' + (number / OTHER_WORD) as u8]));
    record
}

fn plan([columns, rows]: [usize; 2], refine: &str) -> Plan {
    test_plan([("e", columns), ("omega", rows)], &format!("[refine]\n{refine}"))
}

/// Runs a schedule on a picture, a function that gives every cell a number.
fn run(plan: &Plan, picture: impl Fn(usize, usize) -> u32) -> (Vec<Record>, Refined) {
    run_in(plan, std::mem::take, |i, j| record_of(picture(i, j)))
}

/// Runs a schedule. `record` computes a record; `arrive` removes the cells whose records arrive next from those under
/// way.
fn run_in(
    plan: &Plan,
    mut arrive: impl FnMut(&mut Vec<u32>) -> Vec<u32>,
    record: impl Fn(usize, usize) -> Record,
) -> (Vec<Record>, Refined) {
    let mut schedule = Schedule::new(plan);
    let mut records = vec![Record::default(); plan.cell_count()];
    let mut waiting = Vec::new();
    while !schedule.is_finished() {
        waiting.extend(schedule.next(plan, usize::MAX).iter().map(|cell| cell.id));
        for id in arrive(&mut waiting) {
            let [i, j] = plan.indices(id);
            assert_eq!(records[id as usize].periods_run, 0, "cell {id} was requested twice");
            records[id as usize] = record(i, j);
            assert!(schedule.is_waiting_for(id));
            schedule.take(id, &records);
        }
    }
    assert!(waiting.is_empty() && schedule.next(plan, 1).is_empty(), "cells were begun without a request");
    let refined = schedule.finish(&mut records).unwrap();
    assert_eq!(refined.integrated + refined.filled, plan.cell_count());
    assert!(records.iter().all(|r| (r.periods_run == 0) == (r.valid & valid::FILLED != 0)));
    (records, refined)
}

fn wrong(records: &[Record], columns: usize, period: impl Fn(usize, usize) -> u32) -> usize {
    let is_wrong = |(id, record): (usize, &Record)| {
        classify(record) != Class::Periodic { period: period(id % columns, id / columns) }
    };
    records.iter().enumerate().filter(|&cell| is_wrong(cell)).count()
}

#[test]
fn a_smooth_border_is_found_cell_by_cell() {
    let disc = |i: usize, j: usize| if i * i + j * j < 150 * 150 { 1 } else { 2 };
    let plan = plan([257, 230], "minimum_grid = 16");
    let (records, refined) = run(&plan, disc);
    assert_eq!(wrong(&records, 257, disc), 0);
    assert!(refined.integrated * 14 < plan.cell_count(), "{refined:?}");
    assert_eq!(refined.audits.len(), 1);
    assert_eq!(refined.audits[0].wrong, 0);
}

/// A winding band narrower than the blocks is followed to its ends from a corner that meets it.
#[test]
fn a_narrow_band_is_followed() {
    let band = |i: usize, j: usize| {
        let middle = 120.0 + 40.0 * (i as f64 / 40.0).sin();
        if (j as f64 - middle).abs() < 2.5 { 3 } else { 1 }
    };
    let plan = plan([257, 257], "minimum_grid = 16\naudit = 1");
    let (records, refined) = run(&plan, band);
    assert_eq!(wrong(&records, 257, band), 0);
    assert!(refined.integrated * 6 < plan.cell_count(), "{refined:?}");
    assert!(refined.rounds < 24, "{refined:?}");
}

#[test]
fn a_uniform_map_costs_the_coarse_grid_and_the_audit() {
    let plan = plan([101, 101], "minimum_grid = 20\naudit = 50");
    let (records, refined) = run(&plan, |_, _| 4);
    assert_eq!((refined.integrated, refined.rounds), (36 + 50, 2));
    assert_eq!(wrong(&records, 101, |_, _| 4), 0);
}

/// An audit of all filled cells would cancel the saving.
#[test]
fn the_audit_of_a_small_map_leaves_most_of_it_filled() {
    let small = plan([40, 40], "minimum_grid = 8");
    let (_, refined) = run(&small, |_, _| 4);
    let [audit] = refined.audits[..] else { panic!("{refined:?}") };
    assert_eq!((audit.filled, audit.sampled), (1600 - 36, 391), "{refined:?}");
    assert_eq!(refined.filled, 1600 - 36 - 391);
    // The scene can request a larger audit.
    let (_, refined) = run(&plan([40, 40], "minimum_grid = 8\naudit = 2000"), |_, _| 4);
    assert_eq!((refined.audits[0].sampled, refined.filled), (1564, 0), "{refined:?}");
    // A large map has the default sample.
    let (_, refined) = run(&plan([200, 200], "minimum_grid = 8"), |_, _| 4);
    assert_eq!(refined.audits[0].sampled, crate::map::scene::DEFAULT_AUDIT as usize);
}

/// Islands smaller than a block, which the coarse grid misses.
#[test]
fn the_audit_finds_planted_islands_and_mends_the_map() {
    let islands =
        |i: usize, j: usize| if (2..7).contains(&(i % 16)) && (3..9).contains(&(j % 16)) { 5 } else { 1 };
    let plan = plan([241, 241], "minimum_grid = 16\nmax_error = 0.01");
    let (records, refined) = run(&plan, islands);
    assert!(refined.audits[0].rate() > 0.05, "{refined:?}");
    assert!(refined.audits.len() > 1, "{refined:?}");
    let last = refined.audits[refined.audits.len() - 1];
    assert!(last.rate() <= 0.01);
    assert!(wrong(&records, 241, islands) <= refined.filled / 100, "{refined:?}");
    // One island below the allowed error: its cells in the audit are mended.
    let one = |i: usize, j: usize| if (40..48).contains(&i) && (40..48).contains(&j) { 5 } else { 1 };
    let plan = self::plan([241, 241], "minimum_grid = 48\naudit = 4000");
    let (records, refined) = run(&plan, one);
    assert_eq!((refined.audits.len(), refined.audits[0].wrong > 0), (1, true), "{refined:?}");
    assert_eq!(wrong(&records, 241, one), 0, "{refined:?}");
}

/// If only classes are borders, narrow blocks are not halved for touching one until an audit fails. Here islands near a
/// border meet no corner of the blocks.
#[test]
fn after_a_failed_audit_borders_are_first_followed_in_narrower_blocks() {
    let beaded = |i: usize, j: usize| {
        let is_bead = (1..4).contains(&(i % 8)) && (97..103).contains(&j);
        if j < 96 || is_bead { 1 } else { 2 }
    };
    let run_with = |quantities: &str| {
        let outputs = format!("minimum_grid = 8\nmax_error = 0.002\n[outputs]\nquantities = [{quantities}]");
        run(&plan([241, 241], &outputs), beaded)
    };
    let (records, refined) = run_with("'class'");
    let [first, second] = refined.audits[..] else { panic!("{refined:?}") };
    assert!(first.rate() > 0.002 && second.rate() <= 0.002, "{refined:?}");
    assert_eq!(
        first.sampled,
        crate::map::scene::DEFAULT_AUDIT as usize,
        "mended before more is audited: {refined:?}"
    );
    // The result is that of a scene with symmetries, except for cells of audits.
    let (closely, by_symmetry) = run_with("'class', 'symmetric'");
    assert_eq!(by_symmetry.audits.len(), 1, "{by_symmetry:?}");
    assert!(refined.integrated < by_symmetry.integrated + 2100, "{refined:?}, {by_symmetry:?}");
    assert!(wrong(&records, 241, beaded) <= wrong(&closely, 241, beaded));
}

/// Scattered wrong cells, fewer than allowed: if the first sample contains too many by chance, a larger one decides.
#[test]
fn an_audit_goes_on_if_its_result_may_be_due_to_chance() {
    let plan = plan([301, 301], "minimum_grid = 8\n[outputs]\nquantities = ['class', 'symmetric']");
    let (mut prolonged, mut passed) = (0, 0);
    for salt in 0..40u64 {
        let strewn = |i: usize, j: usize| {
            let id = (j * 301 + i) as u64 + (salt << 32);
            let is_odd = crate::map::random::Random::new(id).unit() < 0.0022;
            if is_odd { 5 } else { 1 }
        };
        let (_, refined) = run(&plan, strewn);
        let first = refined.audits[0];
        let is_prolonged = first.sampled > crate::map::scene::DEFAULT_AUDIT as usize;
        prolonged += u32::from(is_prolonged);
        passed += u32::from(is_prolonged && refined.audits.len() == 1);
        assert!(
            first.sampled <= 16 * crate::map::scene::DEFAULT_AUDIT as usize && first.rate() > 0.0,
            "{refined:?}"
        );
    }
    assert!((2..20).contains(&prolonged) && 2 * passed >= prolonged, "{passed} of {prolonged}");
    // A significant result is mended at once.
    let (_, refined) = run(&plan, |i, j| if (2..7).contains(&(i % 16)) && j % 16 > 8 { 5 } else { 1 });
    assert_eq!(refined.audits[0].sampled, crate::map::scene::DEFAULT_AUDIT as usize, "{refined:?}");
}

/// A uniform region is not refined for wrong cells elsewhere.
#[test]
fn only_kinds_with_too_many_wrong_cells_are_refined() {
    let islands = |i: usize, j: usize| match (i < 121, i % 16, j % 16) {
        (true, ..) => 1,
        (false, 2..7, 3..9) => 5,
        (false, ..) => 2,
    };
    let plan = plan([241, 241], "minimum_grid = 16\nmax_error = 0.01");
    let (records, refined) = run(&plan, islands);
    assert!(refined.audits.len() > 1 && refined.audits[0].rate() > 0.02);
    assert!(wrong(&records, 241, islands) <= refined.filled / 100, "{refined:?}");
    // Centres of the uniform region's blocks: a few are audited, none is requested by a halving.
    let centres = (8..241).step_by(16).flat_map(|j| (8..96).step_by(16).map(move |i| 241 * j + i));
    let (all, integrated) =
        (centres.clone().count(), centres.filter(|&id| records[id].periods_run > 0).count());
    assert!(4 * integrated < all, "{integrated} of {all}");
}

#[test]
fn rounds_bound_the_refinement() {
    let plan = plan([129, 129], "minimum_grid = 16\nrounds = 2\nmax_error = 0.9\naudit = 1");
    let half = |i: usize, _| if i < 57 { 1 } else { 2 };
    let (records, refined) = run(&plan, half);
    assert!(wrong(&records, 129, half) > 0);
    assert!(refined.rounds <= 4, "{refined:?}");
    // The bound also holds if more cells are wrong than allowed.
    let plan = self::plan([129, 129], "minimum_grid = 16\nrounds = 2\nmax_error = 1e-3\naudit = 500");
    let (_, refined) = run(&plan, half);
    assert!(refined.audits.len() == 1 && refined.audits[0].rate() > 1e-3, "{refined:?}");
    // The block of a wrong cell is halved further; other blocks are still halved.
    let islands = |i: usize, j: usize| {
        if (2..7).contains(&(i % 16)) && (3..9).contains(&(j % 16)) { 5 } else { half(i, j) }
    };
    let plan = self::plan([129, 129], "minimum_grid = 16\nrounds = 3\nmax_error = 1e-3\naudit = 500");
    let (_, islanded) = run(&plan, islands);
    assert!(islanded.audits.len() > 1 && islanded.audits[0].rate() > 1e-3, "{islanded:?}");
    // Only the wrong cells of the audit are mended.
    assert!(refined.integrated < 1000, "{refined:?}");
}

/// The order of the records changes neither the integrated cells nor the audits, for discs, bands and scattered cells,
/// and with failed and prolonged audits.
#[test]
fn integrated_cells_do_not_depend_on_the_order_of_records() {
    let picture = |i: usize, j: usize| {
        let strewn = crate::map::random::Random::new((j * 203 + i) as u64).unit() < 0.01;
        let band = (j as f64 - 60.0 - 20.0 * (i as f64 / 17.0).sin()).abs() < 1.5;
        let disc = (i as f64 - 150.0).hypot(j as f64 - 110.0) < 31.0;
        let slope = (j as f64 - 0.3 * i as f64 - 80.0).abs() < 2.5;
        let corner = i + 2 * j > 420;
        let period = 1 + u32::from(strewn && disc) + 2 * u32::from(band) + 4 * u32::from(disc);
        period + SYMMETRIC * u32::from(slope) + OTHER_WORD * u32::from(corner)
    };
    let everything = "[outputs]\nquantities = ['class', 'symmetric', 'word']";
    for (refine, outputs) in [
        ("minimum_grid = 16\nmax_error = 0.003", ""),
        ("minimum_grid = 8\nrounds = 2\naudit = 100", ""),
        ("minimum_grid = 16\nmax_error = 0.003", everything),
        ("minimum_grid = 16\nmax_error = 0.003\nword = true", everything),
    ] {
        let plan = plan([203, 170], &format!("{refine}\n{outputs}"));
        let (records, refined) = run(&plan, picture);
        assert!(refined.audits.iter().any(|audit| audit.wrong > 0), "{refined:?}");
        for seed in 0..20 {
            let mut random = crate::map::random::Random::new(seed);
            // A random one of the waiting cells, the last ones, or all but the first.
            let arrive = |waiting: &mut Vec<u32>| match seed % 3 {
                0 => vec![waiting.swap_remove(random.below(waiting.len()))],
                1 => waiting.split_off(waiting.len() - (waiting.len() / 3).max(1)),
                _ => waiting.split_off(usize::from(waiting.len() > 1)),
            };
            let (others, other) = run_in(&plan, arrive, |i, j| record_of(picture(i, j)));
            assert_eq!(refined, other, "{seed}");
            assert!(records == others, "{seed}");
        }
    }
}

/// Exponents are constant except in bands that no corner meets; impacts change at a border.
#[test]
fn the_audit_reports_errors_of_filled_values() {
    let outputs = |refine: &str| {
        let quantities = "[outputs]\nquantities = ['class', 'lyapunov', 'impacts']";
        plan([129, 129], &format!("minimum_grid = 16\naudit = 4000\n{refine}\n{quantities}"))
    };
    let stepped = |i: usize| (5..10).contains(&(i % 16));
    let number = |i: usize, _| 1 + u32::from(stepped(i)) * SYMMETRIC + u32::from(i > 64) * OTHER_WORD;
    // The symmetry of the picture becomes a step of the exponent, its word a number of impacts.
    let record = |number: u32| {
        let counted = record_of(number);
        Record {
            lyapunov: -1.0 - 0.25 * f64::from(counted.symmetric),
            impacts_per_period: f64::from(2 + 3 * (number / OTHER_WORD)),
            valid: valid::PERIOD | valid::LYAPUNOV | valid::IMPACTS,
            symmetric: 0,
            ..counted
        }
    };
    let audit_of = |plan: &Plan| {
        let (_, refined) = run_in(plan, std::mem::take, |i, j| record(number(i, j)));
        let [audit] = refined.audits[..] else { panic!("{refined:?}") };
        audit
    };
    let audit = audit_of(&outputs(""));
    assert_eq!((audit.wrong, audit.sampled), (0, 4000), "classes and periods are right");
    let errors = audit.errors;
    let exponents = errors.lyapunov.unwrap();
    assert_eq!((exponents.compared, exponents.empty), (4000, 0));
    assert_eq!((exponents.median, exponents.p95, exponents.worst), (0.0, 0.25, 0.25));
    // The corners of blocks at column 64 have different counts, so the impacts inside are empty.
    let impacts = errors.impacts.unwrap();
    assert_eq!((impacts.compared + impacts.empty, impacts.worst, impacts.off_by_one), (4000, 0.0, 0));
    assert!((300..650).contains(&impacts.empty), "{impacts:?}");
    assert_eq!(errors.mesh, None, "not requested");
    // Empty quantities have no errors.
    assert_eq!(audit_of(&outputs("continuous = 'empty'")).errors, Errors::default());
}

#[test]
fn thin_maps_are_covered() {
    for counts in [[2, 2], [2, 300], [300, 3], [9, 9]] {
        let stripes = |i: usize, j: usize| 1 + ((i + j) / 5 % 2) as u32;
        let (records, _) = run(&plan(counts, "minimum_grid = 8\nmax_error = 1e-6"), stripes);
        assert_eq!(records.len(), counts[0] * counts[1]);
    }
}
