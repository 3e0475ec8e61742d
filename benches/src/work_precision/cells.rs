//! The cells, their starts, and the reference's results.

use serde::Serialize;

use super::flight::Flight;
use super::outcome::Outcome;
use super::{EVENTS, PERIODS};
use rattlemap_dynamics::model::{GearPair, Law, Pair, REST, State, state};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::{GapEvent, Observer, States, Trajectory};

/// Number of variants of a cell, next to each other as in a map. Their restitution grows by [`RESTITUTION_STEP`], or their
/// distance from grazing by an eighth.
pub const VARIANTS: u32 = 8;

/// Difference of restitution: a quarter of that between columns of a map of 1024 columns.
pub const RESTITUTION_STEP: f64 = 1.0 / 4096.0;

/// Forcing periods from rest to the measured motion.
const SETTLING_PERIODS: u32 = 200;

/// Kinds of motion, in the order of tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Periodic, with impacts but no meshing.
    Impacts,
    /// Periodic, meshing on both sides.
    Meshing,
    /// Periodic, with series of impacts that end in meshing.
    Chatter,
    /// Symmetric steady motion that misses the walls, or reaches behind them, by a given distance.
    Grazing,
    /// Chaotic.
    Chaos,
}

/// Cells with the parameters of Table 1: kind, restitution, frequency.
const SETTLED: [(Kind, f64, f64); 20] = [
    (Kind::Impacts, 0.45, 5.6),
    (Kind::Impacts, 0.56, 5.6),
    (Kind::Impacts, 0.3, 9.0),
    (Kind::Impacts, 0.8, 7.0),
    (Kind::Impacts, 0.56, 3.4),
    (Kind::Meshing, 0.0, 5.6),
    (Kind::Meshing, 0.06, 5.6),
    (Kind::Meshing, 0.0, 2.0),
    (Kind::Meshing, 0.0, 1.0),
    (Kind::Meshing, 0.1, 2.5),
    (Kind::Chatter, 0.2, 1.5),
    (Kind::Chatter, 0.56, 1.5),
    (Kind::Chatter, 0.7, 1.5),
    (Kind::Chatter, 0.5, 1.0),
    (Kind::Chatter, 0.3, 2.0),
    (Kind::Chaos, 0.72, 5.6),
    (Kind::Chaos, 0.7, 5.4),
    (Kind::Chaos, 0.65, 5.6),
    (Kind::Chaos, 0.8, 5.6),
    (Kind::Chaos, 0.62, 5.6),
];

/// Distances that the contact-free steady motion at e = 0.5, omega = 5.6 would reach behind the walls; negative ones miss
/// them. The amplitude of the force is set accordingly.
const BEYOND: [f64; 5] = [-1e-3, -1e-5, 1e-2, 1e-3, 1e-4];

/// One lane that every method integrates, and the reference's result.
#[derive(Clone, Debug)]
pub struct Subject {
    /// Number of the cell, equal for all variants.
    pub cell: u32,
    /// The kind of motion.
    pub kind: Kind,
    /// Distance behind the walls; `None` for cells that do not graze.
    pub beyond: Option<f64>,
    /// The parameters.
    pub pair: GearPair,
    /// The oscillator.
    pub oscillator: Pair,
    /// The contact law.
    pub law: Law,
    /// State at phase 0, exact in f32.
    pub start: State,
    /// The reference's result.
    pub exact: Outcome,
    /// Frobenius norm of the derivative of the last state with respect to the start.
    pub amplification: f64,
}

/// Returns the subjects of `cells_per_kind` cells of each kind, with [`VARIANTS`] of each cell next to each other.
pub fn subjects(cells_per_kind: usize) -> Vec<Subject> {
    let mut all = Vec::new();
    for (n, (kind, e, omega)) in table().into_iter().enumerate() {
        let place = n % (SETTLED.len() / 4);
        if place >= cells_per_kind {
            continue;
        }
        for variant in 0..VARIANTS {
            let share = f64::from(variant);
            let (pair, beyond) = match kind {
                Kind::Grazing => {
                    let beyond = BEYOND[place] * (1.0 + share / 8.0);
                    (grazing(GearPair { omega, ..GearPair::paper(e) }, beyond), Some(beyond))
                }
                _ => (GearPair { omega, ..GearPair::paper(e + share * RESTITUTION_STEP) }, None),
            };
            all.push(subject(n as u32, kind, beyond, pair));
        }
    }
    all
}

fn table() -> Vec<(Kind, f64, f64)> {
    let grazing = BEYOND.map(|_| (Kind::Grazing, 0.5, 5.6));
    let mut all: Vec<_> = SETTLED.into_iter().chain(grazing).collect();
    all.sort_by_key(|(kind, ..)| *kind);
    all
}

/// Returns the pair with the force at which gear 1 alone swings by `b + beyond`.
fn grazing(pair: GearPair, beyond: f64) -> GearPair {
    GearPair { force: (pair.b + beyond) / compliance(&pair), ..pair }
}

/// Returns the amplitude of gear 1 per unit of force, without contact.
fn compliance(pair: &GearPair) -> f64 {
    (pair.k1 - pair.m1 * pair.omega * pair.omega).hypot(pair.r1 * pair.omega).recip()
}

fn subject(cell: u32, kind: Kind, beyond: Option<f64>, pair: GearPair) -> Subject {
    let oscillator = Pair::of(&pair.oscillator().expect("the table is valid")).expect("a pair");
    let flow = Flow::new(&oscillator);
    let law = pair.law();
    let start = match kind {
        Kind::Grazing => steady(&pair),
        _ => {
            let mut trajectory = Trajectory::new(&flow, law, REST);
            for _ in 0..SETTLING_PERIODS {
                trajectory.advance_period(&mut ()).expect("an ordinary cell");
            }
            trajectory.state()
        }
    };
    let start = start.map(|x| f64::from(x as f32));
    let (exact, amplification) = (by_reference(&flow, law, start), amplification(&flow, law, start));
    Subject { cell, kind, beyond, pair, oscillator, law, start, exact, amplification }
}

/// Returns the contact-free steady motion at phase 0: `x1 = Re(F exp(i omega t) / (k1 - m1 omega^2 + i r1 omega))`.
fn steady(pair: &GearPair) -> State {
    let amplitude = pair.force * compliance(pair);
    let lag = (pair.r1 * pair.omega).atan2(pair.k1 - pair.m1 * pair.omega * pair.omega);
    state(&[amplitude * lag.cos(), amplitude * pair.omega * lag.sin()])
}

/// Times of the latest events, the last one first; NaN if there is none.
#[derive(Clone, Copy, Debug)]
pub struct Latest(pub [f64; EVENTS]);

impl Default for Latest {
    fn default() -> Latest {
        Latest([f64::NAN; EVENTS])
    }
}

impl Latest {
    /// Returns the latest events of a flight.
    pub fn of(flight: &Flight) -> Latest {
        let mut latest = Latest::default();
        flight.events.iter().for_each(|&t| latest.add(t));
        latest
    }

    /// Adds an event at a time since phase 0.
    #[inline]
    fn add(&mut self, t: f64) {
        self.0.rotate_right(1);
        self.0[0] = t;
    }
}

impl Observer for Latest {
    #[inline]
    fn event(&mut self, event: &GapEvent, _: States<'_>) {
        self.add(event.t);
    }
}

/// Integrates with the reference.
pub fn by_reference(flow: &Flow, law: Law, start: State) -> Outcome {
    let mut latest = Latest::default();
    let mut trajectory = Trajectory::new(flow, law, start);
    for _ in 0..PERIODS {
        if trajectory.advance_period(&mut latest).is_err() {
            return Outcome::lost();
        }
    }
    Outcome { state: trajectory.state(), events: latest.0 }
}

fn amplification(flow: &Flow, law: Law, start: State) -> f64 {
    let columns = std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }));
    let mut trajectory: Trajectory<'_, 4> = Trajectory::with_tangents(flow, law, start, columns);
    for _ in 0..PERIODS {
        trajectory.advance_period(&mut ()).expect("an ordinary cell");
    }
    let squares: f64 = trajectory.tangents().iter().flatten().map(|x| x * x).sum();
    squares.sqrt() * trajectory.log_scale().exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::motion::EventKind::{Impact, MeshEnd, MeshStart};
    use rattlemap_dynamics::pair::DomainKind;

    #[test]
    fn cells_have_the_motion_of_their_kind() {
        for subject in subjects(5) {
            let flow = Flow::new(&subject.oscillator);
            let mut events: Vec<GapEvent> = Vec::new();
            let mut trajectory = Trajectory::new(&flow, subject.law, subject.start);
            for _ in 0..PERIODS {
                trajectory.advance_period(&mut events).unwrap();
            }
            // Peers need not implement the rarest rule: a contact force that changes sign during contact onset.
            let ends_off_the_wall =
                |e: &GapEvent| e.kind == MeshEnd && e.before[0] != flow.pair().unwrap().wall(e.side);
            assert!(!events.iter().any(ends_off_the_wall), "{:?}", subject.pair);
            let count = |kind| events.iter().filter(|event| event.kind == kind).count();
            let at = format!("{:?}", subject.pair);
            match subject.kind {
                Kind::Impacts | Kind::Chaos => assert!(count(Impact) > 8 && count(MeshStart) == 0, "{at}"),
                Kind::Meshing => assert!(count(MeshStart) >= 16, "{at}"),
                Kind::Chatter => assert!(count(Impact) >= 32 && count(MeshStart) >= 16, "{at}"),
                Kind::Grazing => assert_eq!(subject.beyond > Some(0.0), count(Impact) > 0, "{at}"),
            }
            assert!(subject.amplification < 1e3, "{at}: {:e}", subject.amplification);
        }
    }

    #[test]
    fn grazing_cells_reach_the_given_distance() {
        for subject in subjects(5).iter().filter(|subject| subject.kind == Kind::Grazing) {
            let flow = Flow::new(&subject.oscillator);
            let samples = 10_000;
            let gap = |i: i32| {
                let tau = flow.period * f64::from(i) / f64::from(samples);
                let start = std::array::from_fn(|i| subject.start[i]);
                let y = flow.pair().unwrap().propagate(DomainKind::Free, start, 0.0, tau);
                y[0] - y[2]
            };
            let widest = (0..samples).map(gap).fold(0.0f64, |m, z| m.max(z.abs()));
            let beyond = subject.beyond.unwrap();
            // The tolerance covers half a sample of distance from the turning point, and rounding of the start.
            assert!((widest - subject.pair.b - beyond).abs() < 2e-7, "{widest} {beyond}");
        }
    }
}
