//! Backlash that does not pull: the released inertia of the Modelica library's example, and a cycle in closed form.

use crate::common::apart;
use crate::common::closed_form::Linear;
use rattlemap::model_file::FileModel;
use rattlemap_dynamics::model::{Model, State, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Class, EventKind, Settings, Status, analyse_flow, state_at};

fn backlash(values: &[(&str, f64)]) -> FileModel {
    let mut model = FileModel::built_in("backlash").expect("built in");
    values.iter().for_each(|&(name, value)| model.set(name, value).unwrap());
    model
}

/// Angle and speed at 1 s after a release at 90 degrees, by an integrator of order 8 that switches at the events.
#[test]
fn the_released_inertia_has_the_trace_of_the_example() {
    let model = backlash(&[("T", 0.0), ("b", std::f64::consts::FRAC_PI_4)]);
    let flow = Flow::of(&model).unwrap();
    let start = state(&[std::f64::consts::FRAC_PI_2]);
    let halt = std::sync::atomic::AtomicBool::new(false);
    let [phi, speed, ..] = state_at(&flow, model.law(), start, 1.0, &halt).unwrap().unwrap();
    assert!((phi - 0.10348).abs() < 1e-5 && (speed + 6.21340).abs() < 1e-5, "{phi} {speed}");
}

/// On a symmetric cycle the inertia flies from flank to flank, stays in contact until the force of spring and damper is 0, and leaves
/// the flank behind the wall. Both flights are linear.
#[test]
fn a_cycle_agrees_with_its_linear_flights() {
    let (omega, torque) = (20.0, 2000.0);
    let (j, c, d, half) = (5.0, 20_000.0, 50.0, std::f64::consts::FRAC_PI_8);
    let model = backlash(&[("omega", omega), ("T", torque), ("b", 2.0 * half)]);
    let flow = Flow::of(&model).unwrap();
    let orbit = analyse_flow(&flow, model.law(), state(&[0.0, 1.0]), &Settings::default(), 8);
    assert!(matches!(orbit.class, Class::Periodic { .. }) && orbit.status == Status::Ok, "{orbit:?}");
    let free = Linear { m: j, c: 0.0, k: 0.0, force: torque, omega, load: 0.0 };
    let mut opened_behind = 0;
    for pair in orbit.events.windows(2) {
        let [from, to] = [&pair[0], &pair[1]];
        let side = from.side.sign();
        let field = match from.kind {
            EventKind::MeshStart => Linear { c: d, k: c, load: side * c * half, ..free },
            _ => free,
        };
        let at = |y: State| [y[0], y[1]];
        let end = field.after(from.t, at(from.after), to.t - from.t);
        let off = apart([end[0], end[1], 0.0, 0.0], [to.before[0], to.before[1], 0.0, 0.0]);
        assert!(off < 1e-11, "{off:e}: {from:?} {to:?}");
        if to.kind == EventKind::MeshEnd {
            let depth = to.side.sign() * to.before[0] - half;
            let force = c * depth + d * to.side.sign() * to.before[1];
            assert!(force.abs() < 1e-8 * torque && depth > 0.0, "{force:e} {depth:e}");
            opened_behind += 1;
        }
    }
    assert!(opened_behind > 1, "{orbit:?}");
}
