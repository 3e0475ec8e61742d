//! Dry friction: closed forms, limits and balances.

use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Contact, Domain, Friction, Law, Oscillator};
use rattlemap_dynamics::orbit::{Class, Settings, analyse_flow};
use rattlemap_dynamics::reference::{FrictionEvent, GapEvent, Observer, Trajectory};

/// A single mass on a spring, between no walls, with `m = k = 1`.
fn block(omega: f64, drive: f64, friction: f64) -> Oscillator {
    let first = |value: f64| [[value, 0.0], [0.0, 0.0]];
    let free = Domain { damping: first(0.0), stiffness: first(1.0), load: [0.0; 2], preload: 0.0 };
    let oscillator = Oscillator {
        degrees: 1,
        mass: [[1.0, 0.0], [0.0, 1.0]],
        gap: [1.0, 0.0],
        walls: [f64::INFINITY, f64::NEG_INFINITY],
        contacts: [Contact::Elastic; 2],
        omega,
        force: [drive, 0.0],
        force_sin: [0.0; 2],
        free,
        meshing: [free; 2],
        harmonics: Vec::new(),
        stages: Vec::new(),
        schedule: Vec::new(),
        outer_walls: Default::default(),
        friction: vec![Friction { row: [1.0, 0.0], force: friction, speed: 0.0 }],
    };
    oscillator.validate().unwrap();
    oscillator
}

const LAW: Law = Law { restitution: [0.0; 2], mesh_speed: [0.0; 2] };

/// Symbols of friction, with the times of all changes.
#[derive(Default)]
struct Slides(Vec<(Option<u8>, f64)>);

impl Observer for Slides {
    fn event(&mut self, _: &GapEvent) {}

    fn friction(&mut self, event: &FrictionEvent) {
        self.0.push((event.symbol, event.t));
    }
}

/// Each half swing is shorter by `2 f / k`, until the spring cannot move the block at a turn.
#[test]
fn half_swings_become_shorter_until_the_block_stops() {
    // The period is ten half swings long.
    let flow = Flow::new(&block(0.1, 0.0, 0.15));
    let mut slides = Slides::default();
    let mut motion = Trajectory::new(&flow, LAW, [1.0, 0.0, 0.0, 0.0]);
    motion.advance_period(&mut slides).unwrap();
    // Turns at -0.7, 0.4 and -0.1, where the spring's force is below 0.15.
    let turns: Vec<f64> = slides.0.iter().map(|&(_, t)| t / std::f64::consts::PI).collect();
    assert_eq!(
        slides.0.iter().map(|&(symbol, _)| symbol).collect::<Vec<_>>(),
        [Some(b'0'), Some(b'0'), None]
    );
    for (turn, expected) in turns.into_iter().zip([1.0, 2.0, 3.0]) {
        assert!((turn - expected).abs() < 1e-14, "turn at {turn} pi");
    }
    let [x, v, ..] = motion.state();
    assert!((x + 0.1).abs() < 1e-14 && v == 0.0, "stops at {x} with {v}");
    for _ in 0..100 {
        motion.advance_period(&mut slides).unwrap();
    }
    assert_eq!((slides.0.len(), motion.state()), (3, [x, 0.0, 0.0, 0.0]));
}

/// J. P. den Hartog, Forced vibrations with combined Coulomb and viscous friction, Trans. ASME 53 (1931) 107: motion without stops. With
/// `r = omega`, its amplitude is
///
/// ```text
/// sqrt(V^2 P^2 - U^2 f^2),   V = 1 / (1 - r^2),   U = sin(pi / r) / (r (1 + cos(pi / r)))
/// ```
#[test]
fn the_amplitude_of_forced_sliding_is_that_of_den_hartog() {
    for (omega, friction) in [(0.8, 0.1), (0.8, 0.4), (1.3, 0.3), (1.7, 0.2), (2.3, 0.1)] {
        let flow = Flow::new(&block(omega, 1.0, friction));
        let orbit = analyse_flow(&flow, LAW, [0.3, 0.0, 0.0, 0.0], &Settings::default(), 8);
        let angle = std::f64::consts::PI / omega;
        let (v, u) = (1.0 / (1.0 - omega * omega), angle.sin() / (omega * (1.0 + angle.cos())));
        let expected = (v * v - u * u * friction * friction).sqrt();
        assert_eq!(
            orbit.class,
            Class::Periodic { period: 1 },
            "omega = {omega}, f = {friction}: {:?}",
            orbit.status
        );
        let amplitude = orbit.quantities.unwrap().displacements[0].amplitude;
        assert!((amplitude - expected).abs() < 1e-12, "omega = {omega}: {amplitude} and {expected}");
        assert_eq!(orbit.word.time_order(), "00", "omega = {omega}");
    }
}
