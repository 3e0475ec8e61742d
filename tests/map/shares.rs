//! Shares of attractors, compared with closed forms and with a program of its own.

use std::sync::Arc;

use rattlemap::map::engine::{Cpu, Engine};
use rattlemap::map::plan::Plan;
use rattlemap::map::random::Random;
use rattlemap::map::scene::{FileText, Purpose, Scene};
use rattlemap::map::shares::{self, CellShares, Kind, Watch};

/// Returns the shares of all cells, in order of their numbers.
fn shares_of(scene: &Scene) -> Vec<CellShares> {
    let plan = Plan::new(scene);
    let mut cells = Vec::new();
    let mut done = |new: &[CellShares]| {
        cells.extend_from_slice(new);
        Ok(())
    };
    let watch = Watch { done: &mut done, halt: &Arc::default() };
    assert!(shares::run(scene, &plan, &mut Engine::Cpu(Cpu::new(&plan)), |_| false, watch).unwrap());
    cells.sort_by_key(|cell| cell.cell);
    cells
}

/// A mass on a hill between two valleys: `x'' + c x' - x = 0` between two elastic walls at 1 and -1, without force. Starts on the hill roll
/// into the right valley if `v > l x`, where `l` is the negative root of `l^2 + c l - 1`.
const HILL: &str = r#"
name = "hill"
parameters = { c = 1.0, k = 4.0 }
contact = [
    { side = "right", at = 1, law = "elastic", stiffness = "k" },
    { side = "left", at = -1, law = "elastic", stiffness = "k" },
]
[motion]
coordinates = ["x"]
mass = [[1]]
damping = [["c"]]
stiffness = [[-1]]
gap = [1]
"#;

/// Returns a map over the hill's damping and the stiffness of its valleys.
fn hill(more: &str) -> Scene {
    let text = format!(
        r#"
model = "hill.toml"
axis = [
    {{ parameter = "c", min = 0.9, max = 1.6, count = 5 }},
    {{ parameter = "k", min = 4, max = 6, count = 4 }},
]
start = {{ sample = "box", low = [-0.3, -0.6], high = [0.5, 0.4], count = 1024{more} }}
outputs = {{ quantities = ["class"] }}
"#
    );
    let find = |_, _: &str| Ok(FileText { name: "hill.toml".to_owned(), text: HILL.to_owned() });
    Scene::parse_with_files(&text, "scene", &[], Purpose::Map, None, &find).unwrap()
}

#[test]
fn shares_of_two_valleys_are_those_of_the_closed_form() {
    let scene = hill("");
    let cells = shares_of(&scene);
    let mut outside = 0;
    for cell in &cells {
        let c = scene.axes()[0].value(cell.cell as usize % 5);
        let slope = 0.5 * (-c - f64::hypot(c, 2.0));
        // The mean over x of the part of the velocities above the line.
        let count = 100_000;
        let above = |i: usize| {
            let x = -0.3 + 0.8 * (i as f64 + 0.5) / count as f64;
            (0.4 - slope * x).clamp(0.0, 1.0)
        };
        let truth = (0..count).map(above).sum::<f64>() / count as f64;
        assert_eq!(cell.attractors.len(), 2, "{cell:?}");
        assert_eq!(cell.undecided().mean, 0.0);
        let right = cell.attractors.iter().find(|attractor| attractor.strobe[0] > 0.0).unwrap();
        let share = cell.share(&right.starts);
        assert!((share.mean - truth).abs() < 5e-3, "{c}: {share:?} instead of {truth}");
        outside += usize::from(!(share.interval[0]..=share.interval[1]).contains(&truth));
    }
    assert!(outside <= 3, "{outside} of {} intervals do not hold the truth", cells.len());
}

/// Follows `x'' + 0.1 x' + x = A cos(omega t)` with a stop at 1 and restitution 0.8 by Runge-Kutta steps. Returns whether it hits the stop
/// in the last periods.
fn rattles(omega: f64, amplitude: f64, [mut x, mut v]: [f64; 2]) -> bool {
    let (periods, last, steps) = (160, 20, 64);
    let h = std::f64::consts::TAU / omega / f64::from(steps);
    let slope = |t: f64, [x, v]: [f64; 2]| [v, amplitude * (omega * t).cos() - x - 0.1 * v];
    let step = |t: f64, y: [f64; 2], h: f64| {
        let along = |k: [f64; 2], h: f64| [y[0] + h * k[0], y[1] + h * k[1]];
        let a = slope(t, y);
        let b = slope(t + 0.5 * h, along(a, 0.5 * h));
        let c = slope(t + 0.5 * h, along(b, 0.5 * h));
        let d = slope(t + h, along(c, h));
        [0, 1].map(|i| y[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
    };
    let mut hits = false;
    for n in 0..periods * steps {
        let (mut t, end) = (f64::from(n) * h, f64::from(n + 1) * h);
        // A step may have several impacts; after many, the mass rests at the stop until the next step.
        for _ in 0..20 {
            let next = step(t, [x, v], end - t);
            if next[0] <= 1.0 {
                [x, v] = next;
                break;
            }
            let (mut low, mut high) = (0.0, end - t);
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                if step(t, [x, v], middle)[0] > 1.0 { high = middle } else { low = middle }
            }
            let [_, hit] = step(t, [x, v], low);
            (x, v, t) = (1.0, -0.8 * hit.max(0.0), t + low);
            hits |= n >= (periods - last) * steps;
        }
    }
    hits
}

#[test]
fn shares_of_motion_without_contact_agree_with_another_program() {
    let text = r#"
model = "coco-impact"
axis = [
    { parameter = "omega", min = 1.03, max = 1.3, count = 40 },
    { parameter = "A", min = 0.05, max = 1.3, count = 40 },
]
start = { sample = "box", low = [-2, -2], high = [1, 2], count = 256 }
outputs = { quantities = ["class"] }
"#;
    let scene = Scene::parse(text, "scene", &[], Purpose::Map).unwrap();
    let mut random = Random::new(5);
    let mut ids: Vec<u32> = (0..1600).collect();
    random.draw(&mut ids, 100);
    let plan = Plan::new(&scene);
    let mut cells = Vec::new();
    let mut done = |new: &[CellShares]| {
        cells.extend_from_slice(new);
        Ok(())
    };
    let watch = Watch { done: &mut done, halt: &Arc::default() };
    let is_left = |id: u32| !ids[..100].contains(&id);
    shares::run(&scene, &plan, &mut Engine::Cpu(Cpu::new(&plan)), is_left, watch).unwrap();
    assert_eq!(cells.len(), 100);
    let (mut far, mut mixed) = (Vec::new(), 0);
    for cell in &cells {
        let [i, j] = plan.indices(cell.cell);
        let (omega, amplitude) = (scene.axes()[0].value(i), scene.axes()[1].value(j));
        let count = 96;
        let mut quiet = 0;
        for _ in 0..count {
            let start = [-2.0 + 3.0 * random.unit(), -2.0 + 4.0 * random.unit()];
            quiet += u32::from(!rattles(omega, amplitude, start));
        }
        let other = f64::from(quiet) / f64::from(count);
        let free = cell.attractors.iter().find(|attractor| attractor.kind == Kind::Free);
        let share = cell.share(&free.map_or([0; 8], |attractor| attractor.starts));
        mixed += usize::from(share.mean > 0.05 && share.mean < 0.95);
        // The standard deviations of both; a few starts of 96 may still settle.
        let own = (share.interval[1] - share.interval[0]) / (2.0 * 1.96);
        let deviation = (share.mean * (1.0 - share.mean) / f64::from(count) + own * own).sqrt();
        if (share.mean - other).abs() > 3.0 * deviation {
            far.push((omega, amplitude, share.mean, other));
        }
    }
    assert!(mixed > 10, "{mixed}");
    assert!(far.len() <= 1, "{far:?}");
}

#[test]
fn a_cell_stops_when_its_intervals_are_narrow() {
    let all = shares_of(&hill(""));
    let narrow = shares_of(&hill(", width = 0.1"));
    let starts = |cells: &[CellShares]| cells.iter().map(|cell| cell.count).sum::<u32>();
    assert!(starts(&narrow) < starts(&all) / 2, "{}", starts(&narrow));
    for (cell, whole) in narrow.iter().zip(&all) {
        for attractor in &cell.attractors {
            let share = cell.share(&attractor.starts);
            let [low, high] = share.interval;
            assert!(cell.count == 1024 || high - low <= 0.1, "{cell:?}");
            let same = whole.attractors.iter().find(|other| other.strobe[0] * attractor.strobe[0] > 0.0);
            assert!((share.mean - whole.share(&same.unwrap().starts).mean).abs() < 0.08, "{share:?}");
        }
    }
}
