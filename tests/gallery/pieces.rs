//! One coordinate whose equation of motion is linear in pieces, in closed form from event to event: springs, stages, walls that only push,
//! stops, dry friction and several harmonics. Only the times of events are searched for, by bisection.

use nalgebra::{Matrix2, RowVector2, Vector2};
use rattlemap_dynamics::model::Form;
use rattlemap_dynamics::model::{Law, state};

use crate::common::closed_form::{Linear, first_time};
use crate::gallery::cycle::followed;

/// Instants per period at which a motion is compared with the ends of its mode.
const PLACES: usize = 4000;

/// A linear oscillator under several harmonics.
#[derive(Clone, Debug)]
pub(crate) struct Field {
    /// The oscillator, its load, and the cosine of the first harmonic.
    pub(crate) linear: Linear,
    /// Order, cosine and sine of further parts of the force.
    pub(crate) drives: Vec<(u32, [f64; 2])>,
}

impl From<Linear> for Field {
    fn from(linear: Linear) -> Field {
        Field { linear, drives: Vec::new() }
    }
}

impl Field {
    /// Returns the response to all drives together.
    fn steady(&self, t: f64) -> Vector2<f64> {
        let of = |&(order, [cos, sin]): &(u32, [f64; 2])| {
            let omega = f64::from(order) * self.linear.omega;
            let alone = Linear { force: cos.hypot(sin), omega, load: 0.0, ..self.linear };
            Vector2::from(alone.steady(t - sin.atan2(cos) / omega))
        };
        self.drives.iter().map(of).sum()
    }

    /// Returns the state a time `tau` after the state `y` at time `t`.
    fn after(&self, t: f64, y: Vector2<f64>, tau: f64) -> Vector2<f64> {
        let rest = y - self.steady(t);
        Vector2::from(self.linear.after(t, [rest[0], rest[1]], tau)) + self.steady(t + tau)
    }

    fn acceleration(&self, t: f64, y: Vector2<f64>) -> f64 {
        let of = |&(order, [cos, sin]): &(u32, [f64; 2])| {
            let (s, c) = (f64::from(order) * self.linear.omega * t).sin_cos();
            cos * c + sin * s
        };
        let force: f64 = self.drives.iter().map(of).sum();
        self.linear.acceleration(t, [y[0], y[1]]) + force / self.linear.m
    }

    /// Returns the same oscillator with a spring and a damper that are at rest at `at`.
    fn with_spring(&self, k: f64, c: f64, at: f64) -> Field {
        let linear = self.linear;
        let linear = Linear { k: linear.k + k, c: linear.c + c, load: linear.load + k * at, ..linear };
        Field { linear, ..self.clone() }
    }

    fn with_load(&self, load: f64) -> Field {
        Field { linear: Linear { load: self.linear.load + load, ..self.linear }, ..self.clone() }
    }
}

type Function<T> = Box<dyn Fn(f64, Vector2<f64>) -> T>;

/// An end of a mode.
struct Exit {
    /// Positive within the mode. Arguments are time since phase 0 and state.
    within: Function<f64>,
    /// Derivative of `within` by the state. `None` if acceleration and state are continuous at the exit.
    gradient: Option<[f64; 2]>,
    /// Position and restitution of an impact.
    impact: Option<[f64; 2]>,
    /// The next mode, from the state after the impact.
    next: Function<usize>,
}

/// Motion between two events.
struct Mode {
    /// Equation of motion in each stage. `None` if the mass rests.
    fields: Option<Vec<Field>>,
    exits: Vec<Exit>,
    /// Whether there is contact.
    in_contact: bool,
}

/// A piecewise linear oscillator.
pub(crate) struct Pieces {
    modes: Vec<Mode>,
    omega: f64,
    /// Phases at which the stages begin, in turns. The first one is 0.
    stages: Vec<f64>,
    /// The mode of a state at phase 0.
    mode_of: Box<dyn Fn(Vector2<f64>) -> usize>,
}

/// The end of a motion.
pub(crate) struct End {
    pub(crate) y: Vector2<f64>,
    pub(crate) tangent: Matrix2<f64>,
    pub(crate) impacts: u32,
    /// Whether the motion was in contact all the time.
    pub(crate) stays: bool,
    /// Modes in the order of their begin.
    pub(crate) modes: Vec<usize>,
}

impl Pieces {
    /// Follows a motion from phase 0 over so many periods.
    pub(crate) fn run(&self, start: [f64; 2], periods: u32) -> End {
        let period = std::f64::consts::TAU / self.omega;
        let h = period / PLACES as f64;
        let y = Vector2::from(start);
        let mut n = (self.mode_of)(y);
        let mut end = End { y, tangent: Matrix2::identity(), impacts: 0, stays: true, modes: vec![n] };
        let last = |stage: usize| self.stages.get(stage + 1).map_or(period, |phase| phase * period);
        for stage in (0..periods).flat_map(|_| 0..self.stages.len()) {
            let mut t = self.stages[stage] * period;
            loop {
                let mode = &self.modes[n];
                end.stays &= mode.in_contact;
                let (from, rest, field) =
                    (end.y, last(stage) - t, mode.fields.as_ref().map(|fields| &fields[stage]));
                let after = |tau: f64| field.map_or(from, |field| field.after(t, from, tau));
                let left = |tau: f64| mode.exits.iter().find(|exit| (exit.within)(t + tau, after(tau)) < 0.0);
                let flown = first_time(h, rest, |tau| left(tau).is_some()).unwrap_or(rest);
                let exit = left(flown);
                end.y = after(flown);
                if let Some(field) = field {
                    let [[a, b], [c, d]] = field.linear.propagator(flown);
                    end.tangent = Matrix2::new(a, b, c, d) * end.tangent;
                }
                t += flown;
                let Some(exit) = exit else { break };
                let velocity = |mode: usize, y: Vector2<f64>| {
                    let fields = self.modes[mode].fields.as_ref();
                    fields.map_or(Vector2::zeros(), |all| Vector2::new(y[1], all[stage].acceleration(t, y)))
                };
                let before = velocity(n, end.y);
                let mut rate = 1.0;
                if let Some([at, e]) = exit.impact {
                    rate = -e;
                    end.y = Vector2::new(at, rate * end.y[1]);
                    end.impacts += u32::from(e > 0.0);
                }
                n = (exit.next)(t, end.y);
                if self.modes[n].fields.is_none() {
                    end.y[1] = 0.0;
                }
                end.modes.push(n);
                assert!(end.modes.len() < 1000, "infinitely many events");
                if let Some(gradient) = exit.gradient.map(RowVector2::from) {
                    let kept = if self.modes[n].fields.is_none() { 0.0 } else { rate };
                    let jump = Matrix2::new(1.0, 0.0, 0.0, kept);
                    let late = (velocity(n, end.y) - jump * before) / (gradient * before)[0];
                    end.tangent = (jump + late * gradient) * end.tangent;
                }
            }
        }
        end
    }

    /// Returns state, period and end of a cycle near the last state of the reference, which starts at `start`.
    pub(crate) fn settled(
        &self,
        what: &str,
        oscillator: impl Into<Form>,
        law: Law,
        start: [f64; 2],
    ) -> ([f64; 2], u32, End) {
        let [x, v, ..] = followed(oscillator, law, state(&start), 1200).end;
        let size = x.hypot(v / self.omega);
        let closes = |period: &u32| {
            let [a, b] = self.run([x, v], *period).y.into();
            (x - a).hypot((v - b) / self.omega) <= 1e-12 * size
        };
        let period = (1..=8).find(closes).unwrap_or_else(|| panic!("{what}: no cycle near {x}, {v}"));
        let strobe = self.run([x, v], period).y.into();
        (strobe, period, self.run(strobe, period))
    }
}

/// Returns the exit where the mass reaches a position in the direction `side`, with the restitution of an impact there.
fn reaches(side: f64, at: f64, restitution: Option<f64>, next: usize) -> Exit {
    Exit {
        within: Box::new(move |_, y| side * (at - y[0])),
        gradient: Some([-side, 0.0]),
        impact: restitution.map(|e| [at, e]),
        next: Box::new(move |_, _| next),
    }
}

/// Returns an oscillator between two rigid walls with positions and restitution. `fields` are those of each stage.
pub(crate) fn between(fields: &[Field], stages: &[f64], walls: [[f64; 2]; 2]) -> Pieces {
    let stop = |side: f64, [at, e]: [f64; 2]| reaches(side, at, Some(e), 0);
    let exits = vec![stop(1.0, walls[0]), stop(-1.0, walls[1])];
    Pieces {
        omega: fields[0].linear.omega,
        modes: vec![Mode { fields: Some(fields.to_vec()), exits, in_contact: false }],
        stages: stages.to_vec(),
        mode_of: Box::new(|_| 0),
    }
}

/// Returns an oscillator between two walls of springs. `fields` are those of the free motion in each stage, and `springs` have stiffness
/// and damping in each stage.
pub(crate) fn backlash(
    fields: &[Field],
    stages: &[f64],
    half: f64,
    springs: &[[f64; 2]],
    pulls: bool,
) -> Pieces {
    let omega = fields[0].linear.omega;
    let contact = |side: f64| {
        let of = |(field, &[k, c]): (&Field, &[f64; 2])| field.with_spring(k, c, side * half);
        let push = move |[k, c]: [f64; 2], y: Vector2<f64>| k * (side * y[0] - half) + c * side * y[1];
        let last = springs[0];
        let beyond = if side > 0.0 { 3 } else { 4 };
        let exit = match pulls {
            true => reaches(-side, side * half, None, 0),
            // The force is 0 where contact ends.
            false => Exit {
                within: Box::new(move |_, y| push(last, y)),
                gradient: None,
                impact: None,
                next: Box::new(move |_, _| beyond),
            },
        };
        Mode {
            fields: Some(fields.iter().zip(springs).map(of).collect()),
            exits: vec![exit],
            in_contact: true,
        }
    };
    let open = |exits: Vec<Exit>| Mode { fields: Some(fields.to_vec()), exits, in_contact: false };
    let opened = |side: f64| {
        let back = Exit { gradient: None, ..reaches(-side, side * half, None, 0) };
        open(vec![back])
    };
    Pieces {
        modes: vec![
            open(vec![reaches(1.0, half, None, 1), reaches(-1.0, -half, None, 2)]),
            contact(1.0),
            contact(-1.0),
            opened(1.0),
            opened(-1.0),
        ],
        omega,
        stages: stages.to_vec(),
        mode_of: Box::new(move |y| {
            if y[0].abs() < half {
                0
            } else if y[0] > 0.0 {
                1
            } else {
                2
            }
        }),
    }
}

/// Modes of [`rubbing`].
const STICKS: usize = 2;
const RESTS: [usize; 2] = [3, 4];

/// Returns an oscillator with dry friction `f` between rigid walls with positions and restitution.
pub(crate) fn rubbing(field: &Linear, f: f64, walls: [Option<[f64; 2]>; 2]) -> Pieces {
    let field = Field::from(*field);
    let m = field.linear.m;
    let force = {
        let field = field.clone();
        move |t: f64, x: f64| m * field.acceleration(t, Vector2::new(x, 0.0))
    };
    let slide = |i: usize| {
        let s = [1.0, -1.0][i];
        let stops = {
            let force = force.clone();
            move |t: f64, y: Vector2<f64>| if force(t, y[0]).abs() <= f { STICKS } else { 1 - i }
        };
        let turn = Exit {
            within: Box::new(move |_, y| s * y[1]),
            gradient: Some([0.0, s]),
            impact: None,
            next: Box::new(stops),
        };
        let wall = walls[i].map(|[at, e]| reaches(s, at, Some(e), if e > 0.0 { 1 - i } else { RESTS[i] }));
        Mode {
            fields: Some(vec![field.with_load(-s * f)]),
            exits: [turn].into_iter().chain(wall).collect(),
            in_contact: false,
        }
    };
    // The force that moves the mass in the direction `s` exceeds friction.
    let breaks = |i: usize| {
        let (s, force) = ([1.0, -1.0][i], force.clone());
        Exit {
            within: Box::new(move |t, y: Vector2<f64>| f - s * force(t, y[0])),
            gradient: None,
            impact: None,
            next: Box::new(move |_, _| i),
        }
    };
    let rests = |exits: Vec<Exit>, in_contact: bool| Mode { fields: None, exits, in_contact };
    let on_wall = move |y: Vector2<f64>| (0..2).find(|&i| walls[i].is_some_and(|[at, _]| at == y[0]));
    Pieces {
        modes: vec![
            slide(0),
            slide(1),
            rests(vec![breaks(0), breaks(1)], false),
            rests(vec![breaks(1)], true),
            rests(vec![breaks(0)], true),
        ],
        omega: field.linear.omega,
        stages: vec![0.0],
        mode_of: Box::new(move |y| match y[1] {
            0.0 => on_wall(y).map_or(STICKS, |i| RESTS[i]),
            v => usize::from(v < 0.0),
        }),
    }
}
