//! A loose gear with drag, driven by a shaft through a backlash: `M x'' + c x' = M a cos(omega t) + D`, `-backlash <= x <= 0`, with
//! the inertia `M = I/rb^2`, the drag `D = drag/rb` and the acceleration `a` of the shaft on the line of action.
//!
//! The driving flanks stay in contact while the drag exceeds the inertia, `M a <= D`. Above that, contact ends at the phase with
//! `-M a cos(phase) = D`.

use rattlemap_dynamics::model::{REST, state};
use std::f64::consts::{PI, TAU};

use crate::common::apart;
use crate::common::closed_form::{Linear, Wall, Walled};
use crate::gallery::cycle::{followed, off_the_judge};
use rattlemap_dynamics::motion::EventKind;

/// Two fluctuations per revolution at 900 revolutions per minute.
const OMEGA: f64 = 2.0 * 900.0 * PI / 30.0;
const INERTIA: f64 = 5e-4 / (0.04 * 0.04);
const DRAG: f64 = 0.08 / 0.04;

/// Returns the gear of the gallery at a multiple of the acceleration at which it begins to rattle.
pub(crate) fn gear(multiple: f64, backlash: f64, e: f64) -> Walled {
    let free = Linear { m: INERTIA, c: 1.0, k: 0.0, force: multiple * DRAG, omega: OMEGA, load: DRAG };
    Walled { free, walls: [Some(Wall::Rigid { at: 0.0, e }), Some(Wall::Rigid { at: -backlash, e })] }
}

/// Returns the speed fluctuation in 1/min at a multiple of the one at which the gear begins to rattle.
pub(crate) fn swing(multiple: f64) -> f64 {
    multiple * 0.08 / (5e-4 * 2.0 * 900.0 * (PI / 30.0) * (PI / 30.0))
}

#[test]
fn the_gear_begins_to_rattle_where_inertia_exceeds_drag() {
    let leaves = |multiple: f64| {
        let (oscillator, law) = gear(multiple, 1e-4, 0.6).oscillator();
        let found = followed(&oscillator, law, REST, 2);
        let is_in_contact = (found.meshing_time - 2.0 * oscillator.period()).abs() < 1e-12;
        // The first event is the start of contact at rest.
        assert_eq!(found.events.len() > 1, !is_in_contact, "{:?}", found.events);
        !is_in_contact
    };
    assert!(!leaves(1.0 - 1e-12) && leaves(1.0 + 1e-12));
}

/// Small accelerations end each period in contact. Large ones throw the gear from one flank to the other.
#[test]
fn states_and_events_agree_with_the_closed_form() {
    for (multiple, backlash, e) in [(1.5, 1e-4, 0.0), (6.0, 1e-4, 0.0), (6.0, 5e-4, 0.0), (9.0, 1e-3, 0.5)] {
        let walled = gear(multiple, backlash, e);
        let (oscillator, law) = walled.oscillator();
        let found = followed(&oscillator, law, REST, 3);
        let (end, events) = walled.run([0.0; 2], 3);
        let ours: Vec<EventKind> = found.events.iter().map(|event| event.kind).collect();
        println!("{multiple} {backlash} {e}: {ours:?} {events:?}");
        assert!(
            ours.ends_with(&events.iter().map(|event| event.1).collect::<Vec<_>>()),
            "{ours:?} {events:?}"
        );
        let off = apart(found.end, state(&[end[0], end[1], 0.0, 0.0]));
        assert!(off < 1e-12 && off_the_judge(&oscillator, law, REST, 3) < 1e-10, "{off:e}");
        let released = found.events.iter().find(|event| event.kind == EventKind::MeshEnd).unwrap();
        let phase = (OMEGA * released.t).rem_euclid(TAU);
        assert!((multiple * phase.cos() + 1.0).abs() < 1e-11, "{phase}");
    }
}
