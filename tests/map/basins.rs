//! Basins of attraction: every start gets its attractor.
//!
//! The lanes need an adapter; without one the tests fail: see `scripts/test.sh`.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use crate::common::gpu;
use rattlemap::findings::attractors::{self, Attractor, Basins, NONE};
use rattlemap::gpu::Precision;
use rattlemap::job;
use rattlemap::job::Processor;
use rattlemap::map::engine::{Cpu, Engine};
use rattlemap::map::plan::Plan;
use rattlemap::map::random::Random;
use rattlemap::map::scene::{Quantity, Refine, Scene, SceneBuilder, Start};
use rattlemap::map::schedule::{Refined, Schedule};
use rattlemap::record::{Record, valid};
use rattlemap_dynamics::model::{GearPair, State, Stops, state};
use rattlemap_dynamics::orbit::Class;

fn basins(scene: &Scene) -> Basins {
    let map = job::run(scene, Processor::Cpu).unwrap();
    map.basins().expect("a map of basins")
}

/// Checks the numbers of cells per label, and the order of the attractors.
#[track_caller]
fn check_counts(basins: &Basins) {
    let mut counts: BTreeMap<u16, usize> = BTreeMap::new();
    basins.labels().iter().for_each(|&label| *counts.entry(label).or_default() += 1);
    counts.remove(&NONE);
    let list = basins.attractors();
    assert_eq!(counts.len(), list.len());
    for (label, attractor) in (0..).zip(list) {
        assert_eq!(counts[&label], attractor.cells, "{attractor:?}");
        assert_eq!(basins.labels()[attractor.cell], label);
    }
    assert!(list.windows(2).all(|pair| pair[0].cells >= pair[1].cells));
}

fn off(a: State, b: State) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Computes the state at phase 0 of the fast symmetric orbit with one impact at each wall per period, in closed form:
/// flights are those of a damped oscillator.
fn impacting(stops: &Stops) -> State {
    let Stops { m, r, k, force, omega, b, e, .. } = *stops;
    let (alpha, half) = (r / (2.0 * m), std::f64::consts::PI / omega);
    let nu = (k / m - alpha * alpha).sqrt();
    let (re, im) = (k - m * omega * omega, r * omega);
    let (p, response) = (force / re.hypot(im), -im.atan2(re));
    // x = p cos(omega u + phi) + exp(-alpha u) (a cos(nu u) + c sin(nu u)) from the left wall, u = 0, to the right.
    let (decay, (sin, cos)) = ((-alpha * half).exp(), (nu * half).sin_cos());
    // c, the speeds of the transient at both ends, the leaving speed and y = p omega sin(phi), over a.
    let c = -(1.0 + decay * cos) / (decay * sin);
    let first = nu * c - alpha;
    let last = decay * ((nu * c - alpha) * cos - (alpha * c + nu) * sin);
    let leaving = (first + last) / (1.0 + 1.0 / e);
    let y = first - leaving;
    // (b + a)^2 + (y a / omega)^2 = p^2.
    let (square, linear, rest) = (1.0 + (y / omega).powi(2), 2.0 * b, b * b - p * p);
    let root = (linear * linear - 4.0 * square * rest).sqrt();
    let all = [1.0, -1.0].map(|sign| (-linear + sign * root) / (2.0 * square));
    let a = all.into_iter().max_by(|a, b| (leaving * a).total_cmp(&(leaving * b))).unwrap();
    let phi = (y * a / omega).atan2(-b - a);
    // The time since the left wall at phase 0, where omega u + phi is the phase of the response.
    let mut u = ((response - phi) / omega).rem_euclid(2.0 * half);
    let sign = if u >= half { -1.0 } else { 1.0 };
    u -= if u >= half { half } else { 0.0 };
    let (s, t) = (nu * u).sin_cos();
    let transient = (-alpha * u).exp() * a;
    let x = p * (omega * u + phi).cos() + transient * (t + c * s);
    let v = -p * omega * (omega * u + phi).sin() + transient * (nu * (c * t - s) - alpha * (t + c * s));
    state(&[sign * x, sign * v])
}

fn rattling() -> Stops {
    Stops { r: 0.1, k: 1.0, force: 1.0, omega: 2.0, ..Stops::with_restitution(0.8) }
}

fn plane(stops: Stops, side: u32) -> SceneBuilder {
    Scene::builder(stops)
        .start_axis("x", -0.5..=0.5, side)
        .start_axis("v", -3.0..=3.0, side)
        .quantities(&[Quantity::Class])
}

/// Both attractors have closed forms: contact-free motion, and impacts at alternating walls.
#[test]
fn attractors_agree_with_closed_forms() {
    let stops = rattling();
    let found = basins(&plane(stops, 48).build().unwrap());
    check_counts(&found);
    let [ref first, ref second] = found.attractors()[..] else { panic!("{:?}", found.attractors()) };
    let (free, impacts) =
        if first.word.as_ref().unwrap().is_empty() { (first, second) } else { (second, first) };
    let (re, im) = (stops.k - stops.omega * stops.omega, stops.r * stops.omega);
    let size = stops.force / re.hypot(im);
    let phase = -im.atan2(re);
    let steady = state(&[size * phase.cos(), -size * stops.omega * phase.sin()]);
    assert!(off(free.strobe.unwrap(), steady) < 1e-12, "{free:?} {steady:?}");
    let period = std::f64::consts::TAU / stops.omega;
    assert!((free.exponent.unwrap() + 0.5 * stops.r).abs() < 1e-9, "{free:?}");
    assert!((free.multiplier.unwrap() - (-0.5 * stops.r * period).exp()).abs() < 1e-9, "{free:?}");
    assert!(off(impacts.strobe.unwrap(), impacting(&stops)) < 1e-10, "{impacts:?} {:?}", impacting(&stops));
    assert_eq!((impacts.class, impacts.symmetric), (Class::Periodic { period: 1 }, Some(true)));
    assert_eq!(impacts.word.as_ref().unwrap().time_order(), "36");
    // Starts with little energy cannot reach a wall.
    let free_label = found.attractors().iter().position(|other| other == free).unwrap() as u16;
    let scene = plane(stops, 48).build().unwrap();
    let (mut proven, room) = (0, (0.5 - size).powi(2) * stops.k);
    for (id, &label) in found.labels().iter().enumerate() {
        let [x, v] = [scene.axes()[0].value(id % 48), scene.axes()[1].value(id / 48)];
        let energy = (v - steady[1]).powi(2) + stops.k * (x - steady[0]).powi(2);
        if energy < room {
            assert_eq!(label, free_label, "{x} {v}");
            proven += 1;
        }
    }
    assert!(proven > 3 && impacts.cells > 100 && free.cells > proven, "{proven} {:?}", found.attractors());
}

fn gears(pair: GearPair, side: u32) -> SceneBuilder {
    Scene::builder(pair)
        .start_axis("x1", -0.75..=0.75, side)
        .start_axis("v1", -6.0..=6.0, side)
        .quantities(&[Quantity::Class])
}

/// Parameters at which symmetry-conjugate orbits and contact-free motion coexist.
fn coexisting() -> GearPair {
    GearPair { omega: 9.2, ..GearPair::paper(0.98) }
}

/// The opposite force is the force half a period later, so mirrored starts lead to mirrored attractors.
#[test]
fn mirrored_starts_lead_to_mirrored_attractors() {
    const SIDE: usize = 40;
    let pair = coexisting();
    let ours = basins(&gears(pair, SIDE as u32).build().unwrap());
    let theirs = basins(&gears(GearPair { force: -pair.force, ..pair }, SIDE as u32).build().unwrap());
    check_counts(&ours);
    let image = |attractor: &Attractor| {
        let is_image = |other: &Attractor| {
            // Only for period 1 is the mirror image of the smallest strobe state the smallest again.
            let both = attractor.strobe.zip(other.strobe);
            other.cells == attractor.cells
                && other.class == attractor.class
                && (attractor.class != Class::Periodic { period: 1 }
                    || both.is_none_or(|(a, b)| off(a, b.map(|x| -x)) < 1e-9))
        };
        theirs.attractors().iter().position(is_image).unwrap_or_else(|| panic!("{attractor:?}")) as u16
    };
    let images: Vec<u16> = ours.attractors().iter().map(image).collect();
    assert!(images.len() >= 2, "{:?}", ours.attractors());
    for (id, &label) in ours.labels().iter().enumerate() {
        let mirrored = theirs.labels()[SIDE * SIDE - 1 - id];
        assert_eq!(mirrored, if label == NONE { NONE } else { images[usize::from(label)] }, "{id}");
    }
}

const SIDE: u32 = 96;

fn refined_scene() -> Scene {
    gears(coexisting(), SIDE).refine(Refine { max_error: 0.02, ..Refine::default() }).build().unwrap()
}

/// Records of that map with every cell integrated.
static WHOLE: LazyLock<Vec<Record>> = LazyLock::new(|| {
    let scene = gears(coexisting(), SIDE).build().unwrap();
    job::run(&scene, Processor::Cpu).unwrap().records().iter().collect()
});

/// Computes the adaptive map. `next` removes the cell whose record arrives next from those under way.
fn refined(plan: &Plan, mut next: impl FnMut(&mut Vec<u32>) -> u32) -> (Vec<Record>, Refined) {
    let mut schedule = Schedule::new(plan);
    let mut records = vec![Record::default(); plan.cell_count()];
    let mut waiting = Vec::new();
    while !schedule.is_finished() {
        waiting.extend(schedule.next(plan, usize::MAX).iter().map(|cell| cell.id));
        let id = next(&mut waiting);
        records[id as usize] = WHOLE[id as usize].clone();
        schedule.take(id, &records);
    }
    let refined = schedule.finish(&mut records).unwrap();
    (records, refined)
}

/// The order of the records changes neither integrated cells nor labels, and few filled cells have a wrong label.
#[test]
fn adaptive_basins_do_not_depend_on_the_order_and_agree_with_the_whole_map() {
    let plan = Plan::new(&refined_scene());
    let (records, first) = refined(&plan, |waiting| waiting.remove(0));
    let of = |records: &[Record], refined: &Refined| {
        attractors::basins(&plan, records, &refined.filled_from).unwrap()
    };
    let ours = of(&records, &first);
    check_counts(&ours);
    for seed in 0..3 {
        let mut random = Random::new(seed);
        let (others, other) = refined(&plan, |waiting| waiting.swap_remove(random.below(waiting.len())));
        assert_eq!(first, other);
        assert!(records == others);
        assert!(ours.labels() == of(&others, &other).labels());
    }
    let whole = attractors::basins(&plan, &**WHOLE, &[]).unwrap();
    let filled = first.filled;
    assert!(filled > 1000 && first.integrated + filled == WHOLE.len(), "{first:?}");
    // Attractors are matched by state, because their numbers may differ.
    let by_state = |basins: &Basins| -> Vec<usize> {
        let same = |attractor: &Attractor| {
            let is_same = |other: &Attractor| {
                attractor.class == other.class
                    && attractor.strobe.zip(other.strobe).is_none_or(|(a, b)| off(a, b) < 1e-9)
            };
            whole.attractors().iter().position(is_same).unwrap_or(usize::MAX)
        };
        basins.attractors().iter().map(same).collect()
    };
    let names = by_state(&ours);
    let differs = |id: &usize| {
        let label = ours.labels()[*id];
        (label != NONE).then(|| names[usize::from(label)])
            != Some(whole.labels()[*id]).filter(|&label| label != NONE).map(usize::from)
    };
    let wrong: Vec<usize> = (0..WHOLE.len()).filter(differs).collect();
    assert!(wrong.iter().all(|&id| records[id].valid & valid::FILLED != 0), "an integrated cell has its own");
    let rate = wrong.len() as f64 / filled as f64;
    assert!(rate < 0.03, "{} of {filled}", wrong.len());
    assert!(first.audits.last().unwrap().rate() <= 0.02, "{first:?}");
}

#[test]
fn lanes_label_as_the_reference_does() {
    check_labels(Precision::F32);
}

#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn lanes_in_double_precision_label_as_the_reference_does() {
    check_labels(Precision::F64);
}

/// Lanes and reference give equal labels, except at borders of basins.
fn check_labels(precision: Precision) {
    const SIDE: usize = 32;
    let scene = gears(coexisting(), SIDE as u32).build().unwrap();
    let plan = Plan::new(&scene);
    let reference = job::run(&scene, Processor::Cpu).unwrap();
    let expected = reference.basins().unwrap();
    let records = crate::map::computed(&plan, &mut gpu::engine(&plan, precision), plan.cell_count());
    let lanes = attractors::basins(&plan, &records, &[]).unwrap();
    check_counts(&lanes);
    let mut differing = 0;
    for (id, record) in records.iter().enumerate() {
        // Labels depend on shares, so the attractor of the record in the reference's map is compared.
        let own = expected.label(id, record);
        let label = Some(expected.labels()[id]).filter(|&label| label != NONE);
        if own != label {
            let (i, j) = (id % SIDE, id / SIDE);
            let at = |i: usize, j: usize| expected.labels()[j.min(SIDE - 1) * SIDE + i.min(SIDE - 1)];
            let neighbours =
                [at(i + 1, j), at(i.saturating_sub(1), j), at(i, j + 1), at(i, j.saturating_sub(1))];
            assert!(neighbours.iter().any(|&other| Some(other) != label), "{precision:?} {id}: no border");
            differing += 1;
        }
    }
    assert!(differing <= 8, "{precision:?}: {differing} of 1024");
}

/// If a parameter is swept, an attractor keeps its label from value to value.
#[test]
fn attractors_keep_their_labels_along_a_parameter() {
    let scene = Scene::builder(rattling())
        .axis("F", 0.8..=1.05, 6)
        .start_axis("v", -3.0..=3.0, 40)
        .start(Start::State(state(&[-0.3, 9.0])))
        .quantities(&[Quantity::Class])
        .build()
        .unwrap();
    let found = basins(&scene);
    check_counts(&found);
    assert_eq!(found.attractors().len(), 2, "{:?}", found.attractors());
    let free = found.attractors().iter().position(|a| a.word.as_ref().unwrap().is_empty()).unwrap() as u16;
    let column = |i: usize| (0..40).map(move |j| 6 * j + i);
    for i in 0..6 {
        let labels: Vec<u16> = column(i).map(|id| found.labels()[id]).collect();
        assert!(labels.contains(&free) && labels.contains(&(1 - free)), "{i}: {labels:?}");
        // A map of one column has the same basins.
        let value = scene.axes()[0].value(i);
        let line = Scene::builder(Stops { force: value, ..rattling() });
        let line = line.start_axis("v", -3.0..=3.0, 40).start_axis("x", -0.3..=-0.25, 2);
        let own = basins(&line.quantities(&[Quantity::Class]).build().unwrap());
        let own_free = own.attractors().iter().position(|a| a.word.as_ref().unwrap().is_empty()).unwrap();
        for (j, &label) in labels.iter().enumerate() {
            assert_eq!(usize::from(own.labels()[j]) == own_free, label == free, "{i} {j}");
        }
    }
}

#[test]
fn maps_over_parameters_have_no_basins() {
    let scene =
        Scene::builder(rattling()).axis("F", 0.5..=1.5, 3).axis("omega", 1.0..=3.0, 3).build().unwrap();
    let map = job::run(&scene, Processor::Cpu).unwrap();
    assert!(map.basins().is_none());
    let plan = Plan::new(&scene);
    let mut engine = Engine::Cpu(Cpu::new(&plan));
    let records = pollster::block_on(engine.run(&plan.cells(0..9))).unwrap();
    assert!(attractors::basins(&plan, &records, &[]).is_none());
}
