//! Bifurcation curves that are found from maps, compared with closed forms.

use std::f64::consts::PI;
use std::sync::atomic::AtomicBool;

use crate::common::built_in;
use rattlemap::job::{self, Processor};
use rattlemap::map::curves::{Curve, Curves, Kind, Meeting, Search, Watch, With, curves};
use rattlemap::map::scene::{Quantity, Scene, Start};
use rattlemap::model_file::{FileModel, subjects};
use rattlemap::record::measures;
use rattlemap_dynamics::model::{Model, REST};

/// Finds the curves of a small map.
fn found(model: &str, axes: [(&str, [f64; 2]); 2], longest: u32, start: Start) -> Curves {
    found_of(built_in(model, &[]), axes, longest, start)
}

/// Finds the curves of a small map of a model.
fn found_of(
    model: impl Model + 'static,
    [(x, [left, right]), (y, [low, high])]: [(&str, [f64; 2]); 2],
    longest: u32,
    start: Start,
) -> Curves {
    let scene = Scene::builder(model)
        .axis(x, left..=right, 20)
        .axis(y, low..=high, 20)
        .start(start)
        .quantities(&[Quantity::Class, Quantity::Word, Quantity::ImpactSpeedMax])
        .build()
        .unwrap();
    found_in(&scene, &Search { longest, ..SEARCH })
}

/// Finds everything.
const SEARCH: Search<'_> = Search {
    longest: 1,
    kinds: &[],
    word: None,
    unstable: false,
    condition: None,
    through: &[],
    from: None,
    most_curves: 100,
    most_points: 1000,
};

/// Computes the map of a scene, and finds its curves.
fn found_in(scene: &Scene, search: &Search<'_>) -> Curves {
    let map = job::run(scene, Processor::Cpu).unwrap();
    let watch = Watch { progress: &|_, _| (), found: &|_| (), halt: &AtomicBool::new(false) };
    curves(scene, map.plan(), map.records(), search, Curves::default(), &watch)
}

/// Returns the curves of a kind and period whose cycles have one event in each cycle, or none.
fn of(found: &Curves, kind: Kind, period: u32) -> Vec<&Curve> {
    found
        .curves
        .iter()
        .filter(|curve| curve.kind == kind && curve.period == period && curve.word.len() <= 1)
        .collect()
}

/// Returns the largest distance of the points of curves from a closed form, relative to the axis.
fn largest_error(curves: &[&Curve], range: [f64; 2], closed: impl Fn(f64) -> f64) -> f64 {
    let error = |curve: &Curve| {
        let off = curve.points.iter().map(|point| (point.values[1] - closed(point.values[0])).abs());
        off.fold(0.0, f64::max) / (range[1] - range[0])
    };
    curves.iter().map(|curve| error(curve)).fold(0.0, f64::max)
}

/// COCO's impact oscillator, x'' + 0.1 x' + x = A cos(omega t) with a stop at 1 and e = 0.8: the largest displacement without contact is
/// A / |1 - omega^2 + 0.1 i omega|, and cycles with one impact in n periods fold at a share of this amplitude (Dankowicz and Schilder 2013,
/// section 15.2).
#[test]
fn folds_and_grazes_of_an_impact_oscillator_lie_on_their_closed_forms() {
    let (z, e) = (0.05, 0.8);
    let grazing = |omega: f64| (1.0 - omega * omega).hypot(2.0 * z * omega);
    let fold = |n: f64, omega: f64| {
        let w = f64::sqrt(1.0 - z * z);
        let tau = 2.0 * PI * n / omega;
        let (decay, (s, c)) = ((-z * tau).exp(), (w * tau).sin_cos());
        let b = (1.0 - decay * c) / (decay * s);
        let (h0, h1) = (-z + w * b, -z + w * decay * (b * c - s));
        let g = (h0 + e * h1) / (omega * (1.0 + e));
        grazing(omega) * g.abs() / g.hypot(1.0)
    };
    let amplitudes = [0.05, 1.5];
    let near = found("coco-impact", [("omega", [1.02, 1.5]), ("A", amplitudes)], 1, Start::Rest);
    let ends = of(&near, Kind::ContactEnd, 1);
    assert!(!ends.is_empty() && largest_error(&ends, amplitudes, grazing) < 1e-9, "{ends:?}");
    let folds = of(&near, Kind::Fold, 1);
    assert!(!folds.is_empty(), "{:?}", near.failures);
    assert!(largest_error(&folds, amplitudes, |omega| fold(1.0, omega)) < 1e-9);
    let twice = found("coco-impact", [("omega", [2.1, 2.9]), ("A", [0.5, 6.0])], 2, Start::Rest);
    let folds = of(&twice, Kind::Fold, 2);
    assert!(!folds.is_empty(), "{:?}", twice.failures);
    assert!(largest_error(&folds, [0.5, 6.0], |omega| fold(2.0, omega)) < 1e-9);
    // Along the end of contact nothing else happens; each curve crosses the whole map.
    assert!(
        ends.iter()
            .any(|curve| curve.points[0].values[0].min(curve.points.last().unwrap().values[0]) < 1.021)
    );
}

/// At the resonances omega = 2 n w / m of the oscillator above, with w^2 = 1 - z^2, the fold of a cycle with one impact in n periods touches
/// the curve of grazing: their distance grows with the square of the distance from resonance. The factors follow from the closed form of
/// the fold. At n = 2, m = 3 the orbit of the closed form passes through the wall, so there is no fold.
#[test]
fn folds_touch_grazing_at_resonance() {
    let z: f64 = 0.05;
    let grazing = |omega: f64| (1.0 - omega * omega).hypot(2.0 * z * omega);
    let cases = [
        (1, 2.0, 1.0, [0.995, 1.1], [0.05, 0.6], -18.68186),
        (1, 1.0, -1.0, [1.9, 2.0], [2.0, 3.3], -101.84728),
        (2, 2.0, 1.0, [1.99, 3.0], [0.5, 8.0], -560.35825),
    ];
    for (n, m, side, [left, right], [low, high], factor) in cases {
        let resonance = 2.0 * f64::from(n) * f64::sqrt(1.0 - z * z) / m;
        let through = [1.0, 2.0, 4.0].map(|k| (0, resonance + side * k * 0.002));
        let scene = Scene::builder(built_in("coco-impact", &[]))
            .axis("omega", left..=right, 20)
            .axis("A", low..=high, 20)
            .quantities(&[Quantity::Class, Quantity::Word])
            .build()
            .unwrap();
        let found = found_in(&scene, &Search { longest: n, through: &through, ..SEARCH });
        let at = |omega: f64| {
            let is_there = |meeting: &&Meeting| {
                let curve = &found.curves[meeting.curve - 1];
                meeting.with == With::Value
                    && (curve.kind, curve.period) == (Kind::Fold, n)
                    && (meeting.at.values[0] - omega).abs() < 1e-9
            };
            let meeting =
                found.meetings.iter().find(is_there).unwrap_or_else(|| panic!("n {n}, m {m}, {omega}"));
            let [omega, amplitude] = meeting.at.values;
            (amplitude - grazing(omega)) / (omega - resonance).powi(2)
        };
        // The limit, as a parabola through three values.
        let [near, middle, far] = through.map(|(_, omega)| at(omega));
        let limit = (8.0 * near - 6.0 * middle + far) / 3.0;
        assert!((limit / factor - 1.0).abs() < 1e-3, "n {n}, m {m}: {limit} instead of {factor}");
    }
}

/// The pitchfork at omega = 5.6 of the gear pair is met from cycles with the symmetry and from cycles without it, and both searches find the
/// same curve (Fang et al. 2023: e = 0.5419).
#[test]
fn a_curve_is_the_same_from_wherever_it_begins() {
    let scene = Scene::builder(built_in("gear-pair", &[]))
        .axis("e", 0.4..=0.7, 4)
        .axis("omega", 5.0..=6.5, 4)
        .quantities(&[Quantity::Class, Quantity::Word])
        .build()
        .unwrap();
    let through = [(1, 5.1), (1, 5.6), (1, 6.1)];
    let at = |from: [f64; 2]| {
        let search = Search { from: Some(from), kinds: &[Kind::Pitchfork], through: &through, ..SEARCH };
        let found = found_in(&scene, &search);
        through.map(|(_, omega)| {
            let is_there = |meeting: &&Meeting| (meeting.at.values[1] - omega).abs() < 1e-9;
            found.meetings.iter().find(is_there).unwrap_or_else(|| panic!("{from:?}, {omega}")).at.values[0]
        })
    };
    let starts = [[0.5, 5.6], [0.55, 5.6], [0.59, 6.0]].map(at);
    assert!((starts[0][1] - 0.541908).abs() < 1e-6, "{starts:?}");
    for other in &starts[1..] {
        let off = starts[0].iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-9 * 0.3, "{starts:?}");
    }
}

/// A ball on a shaking table with g = omega = 1 (Holmes 1982; Luck and Mehta 1993): one bounce in n periods begins at the fold
/// A = n pi (1 - e) / (1 + e), and its period doubles at A^2 = A_fold^2 + (2 (1 + e^2) / (1 + e)^2)^2.
#[test]
fn folds_and_flips_of_a_bouncing_ball_lie_on_their_closed_forms() {
    let range = [0.2, 4.0];
    // A ball that lies on the table at first would stay near it.
    let mut thrown = REST;
    thrown[1] = 3.0;
    let found = found("shaking-table", [("e", [0.1, 0.85]), ("A", range)], 1, Start::State(thrown));
    let fold = |e: f64| PI * (1.0 - e) / (1.0 + e);
    let flip = |e: f64| fold(e).hypot(2.0 * (1.0 + e * e) / (1.0 + e).powi(2));
    for (kind, closed) in [(Kind::Fold, &fold as &dyn Fn(f64) -> f64), (Kind::Flip, &flip)] {
        let curves = of(&found, kind, 1);
        assert!(!curves.is_empty(), "{kind:?}: {:?}", found.failures);
        let error = largest_error(&curves, range, closed);
        assert!(error < 1e-9, "{kind:?}: {error}");
    }
}

/// The ball of the test above leaves the table with the speed 2 pi e / (1 + e), whatever the amplitude is. Contact lasts if this is at most
/// mesh_speed, and if the table does not accelerate away faster than gravity: up to A^2 = A_fold^2 + 1.
#[test]
fn contact_of_a_bouncing_ball_lasts_between_its_limits() {
    let rigid = include_str!("../../models/shaking_table.toml")
        .replace("[motion]", "s = { default = 2.0, meaning = \"mesh_speed\" }\n[motion]")
        .replace("A = { default = 1.5", "A = { default = 1.8")
        + "mesh_speed = \"s\"\n";
    let elastic = rigid.clone() + "stiffness = \"400\"\ndamping = \"4\"\n";
    let leaving = |e: f64| 2.0 * PI * e / (1.0 + e);
    let pressing = |e: f64| (PI * (1.0 - e) / (1.0 + e)).hypot(1.0);
    // Starts near the cycles: contact of a ball that comes from elsewhere would last soon.
    let cases = [
        ("s", [1.0, 2.0], [1.8923, 1.9753], leaving as fn(f64) -> f64),
        ("A", [1.7, 2.3], [1.513, 2.24], pressing),
    ];
    for text in [rigid, elastic] {
        for (parameter, range, [x, v], closed) in cases {
            let mut start = REST;
            (start[0], start[1]) = (x, v);
            let model = FileModel::parse(&text, "ball").unwrap();
            let found = found_of(model, [("e", [0.28, 0.34]), (parameter, range)], 1, Start::State(start));
            let curves = of(&found, Kind::MeshingBorder, 1);
            assert!(!curves.is_empty(), "{parameter}: {:?}", found.failures);
            let error = largest_error(&curves, range, closed);
            assert!(error < 1e-9, "{parameter}: {error}");
        }
    }
}

/// The ball of the tests above hits the table with the speed 2 pi / (1 + e), whatever the amplitude is.
#[test]
fn impacts_of_a_bouncing_ball_have_a_given_speed_on_a_line() {
    let (mut thrown, speed) = (REST, 4.2);
    thrown[1] = 3.0;
    let scene = Scene::builder(built_in("shaking-table", &[]))
        .axis("e", 0.4..=0.6, 12)
        .axis("A", 1.1..=1.4, 12)
        .start(Start::State(thrown))
        .quantities(&[Quantity::Class, Quantity::Word, Quantity::ImpactSpeedMax])
        .build()
        .unwrap();
    let names = subjects(scene.base());
    let measure = measures::all().find(|measure| measure.name(&names) == "impact_speed_max").unwrap();
    let search = Search {
        condition: Some((measure, speed)),
        kinds: &[Kind::Condition],
        through: &[(1, 1.25)],
        ..SEARCH
    };
    let found = found_in(&scene, &search);
    let lines = of(&found, Kind::Condition, 1);
    assert!(!lines.is_empty(), "{:?}", found.failures);
    for point in lines.iter().flat_map(|line| &line.points) {
        assert!((point.values[0] - (2.0 * PI / speed - 1.0)).abs() < 1e-9, "{point:?}");
    }
    let at: Vec<f64> = found
        .meetings
        .iter()
        .filter(|meeting| meeting.with == With::Value && found.curves[meeting.curve - 1].word.len() == 1)
        .map(|meeting| meeting.at.values[1])
        .collect();
    assert!(!at.is_empty() && at.iter().all(|value| (value - 1.25).abs() < 1e-9), "{at:?}");
}

/// Beyond its folds and flips, an oscillator that touches a stiffer spring has unstable cycles that graze.
#[test]
fn curves_of_unstable_cycles_are_found_on_request() {
    let scene = Scene::builder(built_in("bilinear", &[]))
        .axis("omega", 0.5..=2.0, 10)
        .axis("zeta", 0.01..=0.1, 10)
        .quantities(&[Quantity::Class, Quantity::Word])
        .build()
        .unwrap();
    let count = |unstable: bool| {
        let found = found_in(&scene, &Search { longest: 4, unstable, ..SEARCH });
        let of_kind = |kind: Kind| found.curves.iter().filter(|curve| curve.kind == kind).count();
        [Kind::Fold, Kind::Grazing].map(of_kind)
    };
    let (stable, all) = (count(false), count(true));
    assert!(all[0] >= stable[0] && all[1] > stable[1], "{stable:?}, {all:?}");
}
