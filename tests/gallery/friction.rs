//! Dry friction: Den Hartog's border of stops, the border of rattle of a gear that sticks to its shaft, and a closed valve.

use crate::common::built_in;
use rattlemap_dynamics::model::{Model, REST, State};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Class, Orbit, Settings, analyse_flow};

fn motion(name: &str, values: &[(&str, f64)], start: State) -> Orbit {
    let model = built_in(name, values);
    analyse_flow(&Flow::of(&model).unwrap(), model.law(), start, &Settings::default(), 8)
}

/// J. P. den Hartog, Trans. ASME 53 (1931) 107. Sliding without stops has the amplitude `a = sqrt(V^2 F^2 - U^2 f^2)`. At its turns the
/// force must reverse the motion at once, `a omega^2 > f`. Its border is
///
/// ```text
/// f = F |V| / sqrt(U^2 + omega^-4),   V = 1 / (1 - omega^2),   U = sin(pi / omega) / (omega (1 + cos(pi / omega)))
/// ```
#[test]
fn stops_begin_at_the_border_of_den_hartog() {
    for omega in [0.6, 0.8, 1.2, 1.5, 1.9] {
        let angle = std::f64::consts::PI / omega;
        let (v, u) = (1.0 / (1.0 - omega * omega), angle.sin() / (omega * (1.0 + angle.cos())));
        let border = v.abs() / u.hypot(1.0 / (omega * omega));
        for (f, word) in [(border * (1.0 - 1e-6), "00"), (border * (1.0 + 1e-6), "77")] {
            let orbit = motion("friction-oscillator", &[("omega", omega), ("f", f)], REST);
            assert_eq!(
                orbit.class,
                Class::Periodic { period: 1 },
                "omega = {omega}, f = {f}: {:?}",
                orbit.status
            );
            assert_eq!(orbit.word.time_order(), word, "omega = {omega}, f = {f}");
        }
    }
}

/// The shaft accelerates by `a cos(omega t)`, and friction can accelerate the gear by `f`.
#[test]
fn a_gear_sticks_to_its_shaft_up_to_the_limit_of_friction() {
    for (a, never_slides) in [(1.0 - 1e-9, true), (1.0 + 1e-9, false)] {
        let orbit = motion("drag-gear", &[("a", a), ("f", 1.0)], REST);
        assert_eq!(orbit.word.is_empty(), never_slides, "a = {a}: {}", orbit.word);
        let of = orbit.quantities.and_then(|of| of.friction).unwrap();
        assert_eq!(of.sticking > 1.0 - 1e-12, never_slides, "a = {a}: {of:?}");
    }
}

/// The pressure opens the valve if its largest force exceeds spring and friction: `p_m + p > F_0 + f`.
#[test]
fn a_valve_opens_against_spring_and_friction() {
    for (p, opens) in [(0.4 - 1e-9, false), (0.4 + 1e-9, true)] {
        let values = [("p", p), ("p_m", 0.8), ("f", 0.2)];
        let orbit = motion("relief-valve", &values, REST);
        let lift = orbit.quantities.unwrap().displacements[0].amplitude;
        assert_eq!(lift > 0.0, opens, "p = {p}: {lift}");
    }
}
