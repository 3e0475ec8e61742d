//! Cycles of models in `models/` whose equations of motion are linear in pieces. Their equations are written here again.

use crate::common::built_in;
use crate::common::pairs::omega_of;
use rattlemap_dynamics::model::Form;
use rattlemap_dynamics::model::{Law, Model, Pair, state};

use crate::common::apart;
use crate::common::closed_form::Linear;
use crate::gallery::cycle::{eigenvalues, followed};
use crate::gallery::elastic;
use crate::gallery::pieces::{self, End, Field, Pieces, rubbing};

/// A cycle.
pub(crate) struct Cycle {
    pub(crate) what: String,
    pub(crate) oscillator: Form,
    pub(crate) law: Law,
    pub(crate) period: u32,
    /// Displacement and velocity at phase 0.
    pub(crate) strobe: [f64; 2],
    /// Modulus of the largest multiplier.
    pub(crate) radius: f64,
    pub(crate) impacts: u32,
    /// Whether it is in contact all the time.
    pub(crate) stays: bool,
}

/// A model, its equations, and the state from which the reference reaches the cycle.
struct Case {
    what: String,
    oscillator: Form,
    law: Law,
    pieces: Pieces,
    start: [f64; 2],
}

impl Case {
    fn new(name: &str, values: &[(&str, f64)], pieces: Pieces, start: [f64; 2]) -> Case {
        let model = built_in(name, values);
        let values: Vec<_> = values.iter().map(|(name, value)| format!("{name} = {value:.4}")).collect();
        Case {
            what: format!("{name}, {}", values.join(", ")),
            oscillator: Form::from(&model.oscillator().unwrap()),
            law: model.law(),
            pieces,
            start,
        }
    }
}

const FREE: Linear = Linear { m: 1.0, c: 0.0, k: 0.0, force: 0.0, omega: 1.0, load: 0.0 };

/// A gear with backlash and a stiffness that changes between two values, under three harmonics. A harmonic of the transmission error is
/// in `errors`.
fn mesh(free: Linear, errors: [f64; 3], eps: f64, half: f64, stiffness: [f64; 2]) -> Pieces {
    let [first, second, third] = errors.map(|e| free.m * e * free.omega * free.omega);
    let field = Field {
        linear: Linear { force: first, ..free },
        drives: vec![(2, [4.0 * second, 0.0]), (3, [9.0 * third, 0.0])],
    };
    let springs = stiffness.map(|k| [k, 0.0]);
    pieces::backlash(&[field.clone(), field], &[0.0, eps - 1.0], half, &springs, true)
}

/// Meissner's equation with the stiffness `delta + epsilon` in the first half of the period and `delta - epsilon` in the second.
fn meissner(delta: f64, epsilon: f64, e: f64) -> Pieces {
    let field = |k: f64| Field::from(Linear { c: 0.02, k, ..FREE });
    let fields = [field(delta + epsilon), field(delta - epsilon)];
    pieces::between(&fields, &[0.0, 0.5], [[1.0, e], [-1.0, e]])
}

fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (omega, load) in [(0.5, 0.1), (0.9, 0.1), (0.7, 0.2), (1.4, 0.05)] {
        let free = Linear { c: 0.1, load, omega, ..FREE };
        let pieces = mesh(free, [0.05, 0.01, 0.005], 1.6, 1.0, [1.0, 0.6]);
        cases.push(Case::new("mesh-stiffness", &[("omega", omega), ("F_m", load)], pieces, [0.0; 2]));
    }
    for (omega, load) in [(2e4, 3800.0), (4e4, 800.0), (6e4, 300.0)] {
        let free = Linear { m: 0.23, c: 935.0, load, omega, ..FREE };
        let pieces = mesh(free, [1e-6, 4e-7, 2e-7], 1.6, 1e-4, [3.8e8, 0.6 * 3.8e8]);
        cases.push(Case::new("turbine-gears", &[("omega", omega), ("T", load)], pieces, [1.2e-4, 0.0]));
    }
    for (delta, epsilon, e) in [(0.25, 0.3, 0.3), (0.3, 0.4, 0.6), (0.25, 0.5, 0.7)] {
        let values = [("delta", delta), ("epsilon", epsilon), ("e", e)];
        cases.push(Case::new("meissner", &values, meissner(delta, epsilon, e), [0.01, 0.0]));
    }
    for (omega, torque) in [(20.0, 2000.0), (8.0, 100.0), (12.0, 2000.0), (40.0, 8000.0)] {
        let half = std::f64::consts::FRAC_PI_8;
        let field = Field::from(Linear { m: 5.0, force: torque, omega, ..FREE });
        let pieces = pieces::backlash(&[field], &[0.0], half, &[[20_000.0, 50.0]], false);
        let values = [("omega", omega), ("T", torque), ("b", 2.0 * half)];
        cases.push(Case::new("backlash", &values, pieces, [0.0, 1.0]));
    }
    // Both flanks between stops of one oscillator, whose force has another phase at phase 0.
    for phase in [0.7, 4.4_f64] {
        let walled = elastic::backlash(1.1);
        let (sin, cos) = phase.sin_cos();
        let [cos, sin] = [walled.free.force * cos, -walled.free.force * sin];
        let (oscillator, law) = walled.oscillator();
        let oscillator = Form::Pair(Pair { force: [cos, 0.0], force_sin: [sin, 0.0], ..oscillator });
        let field = Field { linear: Linear { force: 0.0, ..walled.free }, drives: vec![(1, [cos, sin])] };
        let pieces = pieces::backlash(&[field], &[0.0], 1.0, &[[1.0, 0.0]], true);
        let what = format!("backlash, phase {phase}");
        cases.push(Case { what, oscillator, law, pieces, start: [0.8, 0.0] });
    }
    for (omega, f) in [(0.5, 0.5), (0.8, 0.5), (0.3, 0.4), (1.5, 0.2)] {
        let free = Linear { k: 1.0, force: 1.0, omega, ..FREE };
        let values = [("omega", omega), ("f", f)];
        cases.push(Case::new("friction-oscillator", &values, rubbing(&free, f, [None; 2]), [0.0; 2]));
    }
    let (omega, a, f) = (1.0, 1.0, 0.3);
    let free = Linear { c: 0.02, force: a, omega, ..FREE };
    let values = [("omega", omega), ("a", a), ("f", f)];
    let walls = [Some([0.5, 0.6]), Some([-0.5, 0.6])];
    cases.push(Case::new("drag-gear", &values, rubbing(&free, f, walls), [0.0; 2]));
    // The valve with plastic seat and stop rests on both.
    for (omega, p, e) in [(0.5, 0.8, [0.0; 2]), (0.5, 0.4, [0.0; 2]), (2.0, 0.9, [0.0, 0.6])] {
        let free = Linear { c: 0.1, k: 1.0, force: p, omega, ..FREE };
        let values = [("omega", omega), ("p", p), ("e_seat", e[0]), ("e_stop", e[1])];
        let walls = [Some([0.5, e[1]]), Some([0.0, e[0]])];
        cases.push(Case::new("relief-valve", &values, rubbing(&free, 0.1, walls), [0.0; 2]));
    }
    cases
}

/// Returns all cycles.
pub(crate) fn cycles() -> Vec<Cycle> {
    let cycle = |case: Case| {
        let Case { what, oscillator, law, pieces, start } = case;
        let (strobe, period, end) = pieces.settled(&what, &oscillator, law, start);
        let End { tangent, impacts, stays, modes, .. } = end;
        let [[a, b], [c, d]] = [[tangent.m11, tangent.m12], [tangent.m21, tangent.m22]];
        let radius = eigenvalues([[a, b], [c, d]])[0].norm();
        println!("{what}: period {period}, {strobe:?}, radius {radius}, modes {modes:?}");
        Cycle { what, oscillator, law, period, strobe, radius, impacts, stays }
    };
    cases().into_iter().map(cycle).collect()
}

/// Transients agree with the closed forms over three periods, too.
#[test]
fn motion_from_the_start_agrees_with_closed_forms() {
    for Case { what, oscillator, law, pieces, start } in cases() {
        let omega = omega_of(&oscillator);
        let found = followed(&oscillator, law, state(&start), 3).end;
        let end = pieces.run(start, 3);
        let size = end.y[0].abs().max(end.y[1].abs() / omega);
        let off = apart([found[0], found[1] / omega, 0.0, 0.0], [end.y[0], end.y[1] / omega, 0.0, 0.0]);
        let m = end.tangent;
        // Contacts amplify rounding errors.
        let growth =
            [m.m11, m.m12 * omega, m.m21 / omega, m.m22].map(f64::abs).into_iter().fold(10.0, f64::max);
        println!("{what}: {off:.1e} of {size:.1e}, amplified {growth:.0e} times, {:?}", end.modes);
        assert!(off < 1e-13 * growth * size, "{what}: {off:e} of {size:e}, amplified {growth:e} times");
    }
}
