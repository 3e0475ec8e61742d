//! Cycles as boundary value problems: derivatives by parameters, and branches with their special points.

use std::f64::consts::{PI, TAU};
use std::sync::atomic::AtomicBool;

use crate::common::built_in;
use rattlemap::map::bifurcation;
use rattlemap::map::branches::branches;
use rattlemap::map::scene::Start;
use rattlemap::model_file::FileModel;
use rattlemap_dynamics::cycle::{
    Branch, BranchEnd, BranchLimits, Cycle, Itinerary, Solution, Special, follow_on, switch,
};
use rattlemap_dynamics::model::{Model, REST};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Class, Orbit, Settings, analyse, quantities_on};
use rattlemap_dynamics::stability::multipliers;

/// Returns a periodic motion from rest with its period, and the model with its time.
fn cycle(model: &FileModel) -> Option<(Orbit, u32, Box<dyn Model>)> {
    let orbit = analyse(model, REST, &Settings::default()).unwrap();
    let Class::Periodic { period } = orbit.class else { return None };
    let model = (model as &dyn Model).on_cycle(orbit.cycle_time);
    Some((orbit, period, model))
}

/// Returns the derivative of a function of the cycle by a parameter from differences of cycles; none if a cycle has other flights, or does
/// not exist.
fn slope(
    (model, itinerary, at): (&dyn Model, &Itinerary, &Solution),
    parameter: usize,
    step: f64,
    of: &dyn Fn(&Solution) -> f64,
) -> Option<f64> {
    let value = model.value(parameter);
    let h = step * value.abs().max(1e-2);
    let moved = |share: f64| {
        let mut moved = model.clone_model();
        moved.set_at(parameter, value + share * h).ok()?;
        itinerary.solve(&*moved, at).ok().map(|solution| of(&solution))
    };
    let pair = |share: f64| Some(moved(share)? - moved(-share)?);
    Some((45.0 * pair(1.0)? - 9.0 * pair(2.0)? + pair(3.0)?) / (60.0 * h))
}

/// All models of the gallery that settle on a cycle from rest: pairs and machines, with impacts, series of impacts, elastic contact, meshing,
/// stages, friction, curves, and without a force.
#[test]
fn cycles_and_their_derivatives_agree_with_the_engines_and_with_differences() {
    let (mut cycles, mut compared) = (0, 0);
    for model in FileModel::all_built_in() {
        let name = model.name().to_owned();
        // Impacts of two gaps alternate there: a series of series.
        let Some((orbit, period, model)) = cycle(&model).filter(|_| name != "two-loose-gears") else {
            continue;
        };
        let (itinerary, seed) = Itinerary::of(&*model, &orbit.strobe, 2 * period).unwrap();
        let solution = itinerary.solve(&*model, &seed).unwrap();
        let sizes: [f64; 2] = [0, 1]
            .map(|first| orbit.strobe.iter().skip(first).step_by(2).fold(1e-6, |a: f64, b| a.max(b.abs())));
        for (i, (a, b)) in solution.state().iter().zip(&orbit.strobe).enumerate() {
            assert!(
                (a - b).abs() < 1e-11 * sizes[i % 2],
                "{name}: {:?}, {:?}",
                solution.state(),
                orbit.strobe
            );
        }
        assert!(itinerary.is_followed(&*model, &solution), "{name}");
        assert_eq!(itinerary.word(&*model, &solution).unwrap(), orbit.word, "{name}");
        let found = multipliers(&itinerary.monodromy(&*model, &solution).unwrap()).unwrap();
        for [re, im] in orbit.floquet.iter().flatten() {
            let nearest = found.iter().map(|m| (m[0] - re).hypot(m[1] - im)).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-8, "{name}: {re} + {im} i, {found:?}");
        }
        cycles += 1;
        for parameter in 0..model.parameters().len() {
            let Ok([states, _]) = itinerary.derivatives(&*model, &solution, &[parameter]) else { continue };
            let n = states.nrows() / 2;
            let entry =
                |i: usize| move |at: &Solution| at.state()[if i < n { 2 * i } else { 2 * (i - n) + 1 }];
            // Long steps have errors of the seventh order, short ones those of rounding.
            let error = |step: f64| {
                let expected = |i: usize| slope((&*model, &itinerary, &solution), parameter, step, &entry(i));
                let expected = (0..2 * n).map(expected).collect::<Option<Vec<f64>>>()?;
                let size = expected.iter().fold(1e-3, |most: f64, x| most.max(x.abs()));
                Some((0..2 * n).map(|i| (states[(i, 0)] - expected[i]).abs() / size).fold(0.0, f64::max))
            };
            let Some(error) = [1e-3, 1e-4].into_iter().filter_map(error).reduce(f64::min) else { continue };
            assert!(error < 1e-8, "{name}, {}: {error:e}", model.parameters()[parameter].name);
            compared += 1;
        }
    }
    assert!(cycles >= 20 && compared >= 90, "{cycles} cycles, {compared} derivatives");
}

/// Returns the amplitudes of the force at which the cycle with one impact in each period of `coco-impact` has its fold, and at which the motion
/// without contact grazes the stop, as Dankowicz and Schilder state them.
fn closed_form(omega: f64) -> [f64; 2] {
    let (z, e) = (0.05f64, 0.8);
    let (rate, tau) = ((1.0 - z * z).sqrt(), TAU / omega);
    let (decay, (sin, cos)) = ((-z * tau).exp(), (rate * tau).sin_cos());
    let b = (1.0 - decay * cos) / (decay * sin);
    let [h0, h1] = [-z + rate * b, -z + rate * decay * (b * cos - sin)];
    let g = (h0 + e * h1) / (omega * (1.0 + e));
    let grazing = (1.0 - omega * omega).hypot(2.0 * z * omega);
    [grazing * g.abs() / g.hypot(1.0), grazing]
}

/// Follows the branch of the cycle with impacts of `coco-impact` over the amplitude of the force.
fn coco(omega: f64, rises: bool) -> Vec<Branch> {
    let model = built_in("coco-impact", &[("omega", omega), ("A", 0.9)]);
    let (orbit, period, model) = cycle(&model).unwrap();
    let (itinerary, seed) = Itinerary::of(&*model, &orbit.strobe, 2 * period).unwrap();
    let (halt, amplitude) = (AtomicBool::new(false), model.index("A").unwrap());
    let limits = BranchLimits::new(&halt);
    follow_on(&*model, &itinerary, &seed, amplitude, ([0.01, 1.0], rises), &limits).unwrap()
}

/// From the stable cycle the branch goes down to the fold, back up as an unstable one to the graze, and from there down again as the motion
/// without contact.
#[test]
fn a_branch_turns_at_its_fold_and_at_its_graze() {
    for omega in [1.05, 1.1, 1.2, 1.3] {
        let [fold, grazing] = closed_form(omega);
        let parts = coco(omega, false);
        let special: Vec<_> =
            parts.iter().flat_map(|part| &part.special).map(|at| (at.kind, at.at.value)).collect();
        let [(Special::Fold, at), (Special::Grazing, end)] = special[..] else {
            panic!("{omega}: {special:?}")
        };
        assert!((at - fold).abs() < 1e-12, "omega = {omega}: {at}, {fold}");
        assert!((end - grazing).abs() < 1e-11, "omega = {omega}: {end}, {grazing}");
        let [impacts, free] = &parts[..] else { panic!("{} parts", parts.len()) };
        assert_eq!((impacts.word.to_string(), free.word.to_string()), ("2".to_owned(), String::new()));
        assert_eq!(free.end, BranchEnd::Range);
        let before = |point: &&_| rattlemap_dynamics::cycle::BranchPoint::is_stable(point);
        let stable = impacts.points.iter().take_while(before).count();
        assert!(impacts.points[stable..].iter().all(|point| !point.is_stable()), "omega = {omega}");
        assert!((impacts.points[stable - 1].value - fold).abs() < 0.02, "omega = {omega}");
        assert!(free.points.iter().all(|point| point.is_stable()), "omega = {omega}");
        assert_eq!(coco(omega, true).last().unwrap().end, BranchEnd::Range);
    }
}

/// At omega = 5.6 of the paper the symmetric cycle loses its symmetry at e = 0.541908. Both cycles without it, mirror images of each other, reach
/// a further contact at e = 0.60521. The phase of the impacts of one of them passes 0 on the way.
#[test]
fn the_cycles_that_leave_a_pitchfork_are_followed_to_their_graze() {
    let model = built_in("gear-pair", &[("omega", 5.6), ("e", 0.53)]);
    let (orbit, period, model) = cycle(&model).unwrap();
    let (itinerary, seed) = Itinerary::of(&*model, &orbit.strobe, 2 * period).unwrap();
    let (halt, e, range) = (AtomicBool::new(false), model.index("e").unwrap(), [0.5, 0.62]);
    let limits = BranchLimits::new(&halt);
    let parts = follow_on(&*model, &itinerary, &seed, e, (range, true), &limits).unwrap();
    let [part] = &parts[..] else { panic!("{} parts", parts.len()) };
    let [pitchfork] = &part.special[..] else { panic!("{:?}", part.special) };
    assert_eq!(pitchfork.kind, Special::Pitchfork);
    assert!((pitchfork.at.value - 0.541908).abs() < 1e-6, "{}", pitchfork.at.value);
    assert!(!part.points.last().unwrap().is_stable());
    let arms = switch(&*model, part, pitchfork, e, range, &limits).unwrap();
    assert_eq!(arms.len(), 2);
    for arm in arms {
        assert!(arm[0].points[1..].iter().all(|point| point.is_stable()));
        let special: Vec<_> =
            arm.iter().flat_map(|part| &part.special).map(|at| (at.kind, at.at.value)).collect();
        let (kind, at) = special[0];
        assert!(kind == Special::Grazing && (at - 0.60521).abs() < 5e-6, "{special:?}");
    }
}

/// A ball on a shaking table with g = omega = 1 that bounces once in a period hits it with the speed 2 pi / (1 + e), at the time t at which
/// the table's speed -A sin t is pi (1 - e) / (1 + e). The product of its multipliers is e^2.
#[test]
fn derivatives_of_a_bouncing_ball_are_those_of_its_closed_form() {
    let (e, a) = (0.5, 1.2);
    let model = built_in("shaking-table", &[("e", e), ("A", a)]);
    let (u, mut near) = (PI * (1.0 - e) / (1.0 + e), REST);
    let since = (u / a).asin();
    near[0] = a * (since.cos() - 1.0) + PI * since - 0.5 * since * since;
    near[1] = PI - since;
    let cycle = Cycle::near(&model, &near, 1).unwrap();
    let speed = |model: &dyn Model, cycle: &Cycle| {
        let flow = Flow::of(model).unwrap();
        let found = quantities_on(&flow, model.law(), cycle.solution.state(), 1);
        vec![found.map(|found| found.approaches[2].largest)]
    };
    let by = |name: &str| cycle.derivatives(&model, model.index(name).unwrap(), (&speed, &[0])).unwrap();
    let (by_e, by_a) = (by("e"), by("A"));
    let close = |x: f64, y: f64| assert!((x - y).abs() < 1e-8, "{x}, {y}");
    close(by_e.numbers[0].unwrap().unwrap(), -2.0 * PI / (1.0 + e).powi(2));
    close(by_a.numbers[0].unwrap().unwrap(), 0.0);
    let t = 2.0 * PI * cycle.event_times()[0];
    close(2.0 * PI * by_a.event_times[0], u / (a * a * t.cos()));
    let complex = |pair: [f64; 2]| nalgebra::Complex::new(pair[0], pair[1]);
    let values: Vec<_> = cycle.multipliers.iter().map(|&pair| complex(pair)).collect();
    let slopes: Vec<_> = by_e.multipliers.iter().map(|pair| complex(pair.map(Result::unwrap))).collect();
    close((values[0] * slopes[1] + values[1] * slopes[0]).re, 2.0 * e);
}

/// The impacts of a gear on both flanks are equally fast without a load. With a load, those on one of them are faster.
#[test]
fn a_tie_of_two_maxima_has_no_derivative() {
    let model = built_in("drag-gear", &[]);
    let orbit = analyse(&model, REST, &Settings::default()).unwrap();
    let Class::Periodic { period } = orbit.class else { panic!("{:?}", orbit.class) };
    let cycle = Cycle::near(&model, &orbit.strobe, period).unwrap();
    let largest = |model: &dyn Model, cycle: &Cycle| {
        let flow = Flow::of(model).unwrap();
        let found = quantities_on(&flow, model.law(), cycle.solution.state(), cycle.periods);
        vec![found.map(|found| found.approaches[2].largest)]
    };
    let slope = |name: &str| {
        let found = cycle.derivatives(&model, model.index(name).unwrap(), (&largest, &[0])).unwrap();
        found.numbers[0].unwrap()
    };
    let [below, above] = slope("T").unwrap_err().sides;
    assert!((below + above).abs() < 1e-3 * above && above > 0.1, "{below}, {above}");
    assert!(slope("e").is_ok());
}

/// Without damping and with constant sliding friction, a mass on a belt sticks and slides with the period
/// 2 (fs - f0) / u + pi + 2 atan(u / (fs - f0)) (Galvanetto and Bishop 1999). Its branch is one line over the speed of the belt. If friction
/// falls with the sliding rate up to w, steady sliding is unstable at belt speeds below w and stable beyond.
#[test]
fn branches_without_force_are_single_lines() {
    let never = AtomicBool::new(false);
    let of = |model: FileModel, speeds: &[f64]| {
        let at = |&speed: &f64| {
            let mut model = model.clone();
            model.set("u", speed).unwrap();
            (speed, Box::new(model) as Box<dyn Model>)
        };
        let cells: Vec<_> = speeds.iter().map(at).collect();
        let columns = bifurcation::run_until(&cells, Start::Rest, &Settings::default(), &|_| (), &never)
            .unwrap()
            .unwrap();
        branches(&cells, &columns, "u", &never).unwrap().rows
    };
    let rows = of(built_in("belt-oscillator", &[("fd", 0.8), ("r", 0.0)]), &[0.2, 0.35, 0.5, 0.7]);
    let (low, high) = rows.iter().fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), row| {
        (low.min(row.column.value), high.max(row.column.value))
    });
    assert!(low < 0.201 && high > 0.699, "{low} {high}");
    for row in &rows {
        assert!(row.branch == 1 && row.stable, "{row:?}");
        let (u, time) = (row.column.value, row.column.cycle_time().unwrap());
        let closed = 2.0 * 0.2 / u + PI + 2.0 * f64::atan(u / 0.2);
        assert!((time - closed).abs() < 1e-9 * closed, "{u}: {time} instead of {closed}");
    }
    let rows = of(built_in("belt-oscillator", &[]), &[0.5, 0.8, 1.45, 1.5]);
    assert_eq!(rows.last().unwrap().branch, 2);
    for row in rows.iter().filter(|row| row.branch == 2 && (row.column.value - 1.0).abs() > 1e-6) {
        assert_eq!(row.stable, row.column.value > 1.0, "{row:?}");
    }
}
