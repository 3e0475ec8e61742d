//! The reference: an event-driven f64 integrator on the exact flow.
//!
//! A [`Trajectory`] jumps along one oscillator. Between events it takes the longest steps
//! that the certificate can show to be free of events, whatever the forcing does;
//! a step that crosses is cut at the event, converged to rounding on the Taylor polynomial
//! of the solution itself. There is no time-stepping error and no event is missed.
//!
//! # What it costs
//!
//! A clear step is one 4 x 7 product, one bound and one certificate; an event adds the two
//! Taylor polynomials, a root and the contact law.
//!
//! # How it can end
//!
//! Every loop has a cap and every ending a name: see [`Stop`].

mod chatter;
mod contact;
mod landing;
mod tangent;

use crate::certificate::{Bracket, Hermite, ROOMY, Verdict, judge, stays_between};
use crate::flow::{DomainKind, Flow, Gap, LinearFlow, Phasor, add};
use crate::model::{Law, Side, State};

/// Events allowed in one forcing period.
pub const EVENTS_PER_PERIOD_CAP: u64 = 1_000_000;

/// Steps allowed in one forcing period, halved ones included.
pub const STEPS_PER_PERIOD_CAP: u64 = 200_000_000;

/// States beyond this are taken for a loss of finiteness.
const HUGE: f64 = 1e150;

/// Why a trajectory could not be continued.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Stop {
    /// More than [`EVENTS_PER_PERIOD_CAP`] events in one period.
    #[error("more than {EVENTS_PER_PERIOD_CAP} events in one forcing period")]
    CapEvents,
    /// A root that does not converge, or more than [`STEPS_PER_PERIOD_CAP`] steps in one period.
    #[error("more than {STEPS_PER_PERIOD_CAP} steps in one forcing period, or a root that does not converge")]
    CapRoot,
    /// The state is not finite any more.
    #[error("the state is not finite any more")]
    NonFinite,
}

/// What an event is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EventKind {
    /// A contact after which motion stays free.
    Impact,
    /// A contact after which the teeth mesh.
    MeshStart,
    /// Meshing ends and free motion follows.
    MeshEnd,
}

/// An event as the integrator meets it, in gap coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Happening {
    /// What happened.
    pub kind: EventKind,
    /// At which wall.
    pub side: Side,
    /// Symbol `b'1'..=b'6'` of the flight that ends here; none for the first flight of all,
    /// which comes from no wall.
    pub symbol: Option<u8>,
    /// Forcing periods completed before.
    pub period: u64,
    /// Time since the last phase 0, in `[0, T]`.
    pub t: f64,
    /// Gap coordinates just before.
    pub before: Gap,
    /// Gap coordinates just after.
    pub after: Gap,
}

/// Is told of every event. `()` ignores them.
pub trait Observer {
    /// Called once per event, in order of time.
    fn event(&mut self, happening: &Happening);
}

impl Observer for () {
    #[inline]
    fn event(&mut self, _: &Happening) {}
}

impl Observer for Vec<Happening> {
    fn event(&mut self, happening: &Happening) {
        self.push(*happening);
    }
}

/// Work done so far: what a change in cost shows up in first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Steps tried, halved ones included.
    pub steps: u64,
    /// Steps that had to be halved.
    pub halvings: u64,
    /// Events: impacts, starts and ends of meshing.
    pub events: u64,
    /// Impacts among them.
    pub impacts: u64,
    /// Iterations on exact Taylor polynomials.
    pub root_iterations: u64,
}

/// What governs the motion at present.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Free,
    /// Meshing has begun with a leaving speed: the gap is still short of the wall.
    Dip(Side),
    /// Meshing, pressed beyond the wall.
    Pressed(Side),
}

impl Mode {
    #[inline]
    fn domain(self) -> DomainKind {
        match self {
            Mode::Free => DomainKind::Free,
            Mode::Dip(side) | Mode::Pressed(side) => DomainKind::Meshing(side),
        }
    }
}

/// What ends a flight, as seen by the certificate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Crossing {
    /// Free motion reaches a wall.
    Contact(Side),
    /// The dip at the start of meshing is over; no event.
    Emerge(Side),
    /// Pressing ceases inside the dip.
    PressingEnds(Side),
    /// Meshing falls back through the wall.
    MeshEnds(Side),
}

/// What a step holds, over all that is watched.
enum Outlook {
    Clear { roomy: bool },
    Crossing(Crossing, Bracket),
    Unclear,
}

/// One oscillator on its way, with `N` tangent vectors (0, 1 for an exponent, 4 for a
/// monodromy matrix).
#[derive(Clone, Debug)]
pub struct Trajectory<'f, const N: usize = 0> {
    flow: &'f Flow,
    law: Law,
    mode: Mode,
    /// The wall of the last event: the first half of the next flight's symbol.
    origin: Option<Side>,
    /// The wall the gap starts from, and the order of that root of the distance.
    from_wall: Option<(Side, usize)>,
    /// A contact to act on before anything else: a start on a wall.
    pending: Option<Side>,
    q: Gap,
    phasor: Phasor,
    t: f64,
    period: u64,
    level: [usize; 2],
    tangents: [Gap; N],
    events_in_period: u64,
    steps_in_period: u64,
    meshing_time: f64,
    near_grazing: bool,
    work: Work,
}

impl<'f> Trajectory<'f, 0> {
    /// A trajectory that starts at phase 0 in the state `y`.
    ///
    /// A start beyond a wall is meshing on it; on a wall and closing it is a contact.
    pub fn new(flow: &'f Flow, law: Law, y: State) -> Self {
        Self::with_tangents(flow, law, y, [])
    }
}

impl<'f, const N: usize> Trajectory<'f, N> {
    /// A trajectory that carries tangent vectors, given in the coordinates of [`State`].
    pub fn with_tangents(flow: &'f Flow, law: Law, y: State, tangents: [State; N]) -> Self {
        let levels =
            [DomainKind::Free, DomainKind::Meshing(Side::Right)].map(|d| flow.domain(d).taylor_level);
        let mut trajectory = Trajectory {
            flow,
            law,
            mode: Mode::Free,
            origin: None,
            from_wall: None,
            pending: None,
            q: flow.to_gap(y),
            phasor: [1.0, 0.0],
            t: 0.0,
            period: 0,
            level: levels,
            tangents: tangents.map(|u| flow.to_gap(u)),
            events_in_period: 0,
            steps_in_period: 0,
            meshing_time: 0.0,
            near_grazing: false,
            work: Work::default(),
        };
        trajectory.enter();
        trajectory
    }

    /// The same trajectory from here on with other tangent vectors.
    pub fn carrying<const M: usize>(&self, tangents: [State; M]) -> Trajectory<'f, M> {
        Trajectory {
            flow: self.flow,
            law: self.law,
            mode: self.mode,
            origin: self.origin,
            from_wall: self.from_wall,
            pending: self.pending,
            q: self.q,
            phasor: self.phasor,
            t: self.t,
            period: self.period,
            level: self.level,
            tangents: tangents.map(|u| self.flow.to_gap(u)),
            events_in_period: self.events_in_period,
            steps_in_period: self.steps_in_period,
            meshing_time: self.meshing_time,
            near_grazing: self.near_grazing,
            work: self.work,
        }
    }

    /// The present state.
    pub fn state(&self) -> State {
        self.flow.to_state(self.q)
    }

    /// The tangent vectors, in the coordinates of [`State`].
    pub fn tangents(&self) -> [State; N] {
        self.tangents.map(|u| self.flow.to_state(u))
    }

    /// Replaces the tangent vectors, to keep them within range.
    pub fn set_tangents(&mut self, tangents: [State; N]) {
        self.tangents = tangents.map(|u| self.flow.to_gap(u));
    }

    /// The wall the teeth mesh on, if they do.
    pub fn meshing(&self) -> Option<Side> {
        match self.mode {
            Mode::Free => None,
            Mode::Dip(side) | Mode::Pressed(side) => Some(side),
        }
    }

    /// Forcing periods completed.
    pub fn period(&self) -> u64 {
        self.period
    }

    /// Time since the last phase 0.
    pub fn time_in_period(&self) -> f64 {
        self.t
    }

    /// Time spent meshing so far.
    pub fn meshing_time(&self) -> f64 {
        self.meshing_time
    }

    /// Whether any event so far was too near to grazing for the linearisation to mean much.
    pub fn near_grazing(&self) -> bool {
        self.near_grazing
    }

    /// Forgets earlier near-grazing events.
    pub fn clear_near_grazing(&mut self) {
        self.near_grazing = false;
    }

    /// Work done so far.
    pub fn work(&self) -> Work {
        self.work
    }

    /// Integrates to the next phase 0.
    ///
    /// # Errors
    /// A [`Stop`] if the trajectory cannot be continued.
    pub fn advance_period(&mut self, observer: &mut impl Observer) -> Result<(), Stop> {
        let period = self.flow.period;
        self.advance_to(period, observer)?;
        self.t = 0.0;
        self.phasor = [1.0, 0.0];
        self.period += 1;
        self.events_in_period = 0;
        self.steps_in_period = 0;
        Ok(())
    }

    /// Integrates to the time `until` since the last phase 0, at most the forcing period.
    ///
    /// # Errors
    /// A [`Stop`] if the trajectory cannot be continued.
    pub fn advance_to(&mut self, until: f64, observer: &mut impl Observer) -> Result<(), Stop> {
        if let Some(side) = self.pending.take() {
            self.contact(side, observer);
        }
        while self.t < until {
            self.step(until, observer)?;
        }
        let finite = self.q.iter().all(|x| x.abs() < HUGE);
        if finite { Ok(()) } else { Err(Stop::NonFinite) }
    }

    /// One step: as far as it is clear, or to its event, or to `until`.
    #[inline(always)]
    fn step(&mut self, until: f64, observer: &mut impl Observer) -> Result<(), Stop> {
        let flow = self.flow;
        let linear = flow.domain(self.mode.domain());
        let remaining = until - self.t;
        let slot = usize::from(self.mode != Mode::Free);
        let mut level = self.level[slot];
        // Steps beyond the Taylor table cannot be cut, so they must end before `until`.
        while level < linear.taylor_level && linear.steps[level].h > remaining {
            level += 1;
        }
        loop {
            self.work.steps += 1;
            self.steps_in_period += 1;
            if self.steps_in_period > STEPS_PER_PERIOD_CAP {
                return Err(Stop::CapRoot);
            }
            match self.outlook(linear, level) {
                Outlook::Clear { roomy } => {
                    self.level[slot] = if roomy && level > 0 { level - 1 } else { level };
                    self.clear_step(linear, level, until);
                    return Ok(());
                }
                Outlook::Crossing(crossing, bracket) if level >= linear.taylor_level => {
                    self.level[slot] = level;
                    return self.cross(linear, linear.steps[level].u, crossing, bracket, until, observer);
                }
                Outlook::Unclear if self.settle_start(observer) => return Ok(()),
                Outlook::Unclear if level + 1 == linear.steps.len() => {
                    self.settle_graze(linear, level, until, observer);
                    return Ok(());
                }
                Outlook::Crossing(..) | Outlook::Unclear => {
                    self.work.halvings += 1;
                    level += 1;
                }
            }
        }
    }

    /// Judges everything that could end the flight within one step.
    #[inline(always)]
    fn outlook(&self, linear: &LinearFlow, level: usize) -> Outlook {
        let step = &linear.steps[level];
        let (q0, p0) = (&self.q, &self.phasor);
        let (q1, p1) = (step.columns.apply(q0, p0), step.columns.rotate(p0));
        let jet = |q: &Gap, p: &Phasor| [q[0], q[1], linear.acceleration(q, p)];
        let gap = Hermite::new(jet(q0, p0), jet(&q1, &p1), step.h);
        let remainder = step.u6 * linear.gap_bound.remainder(q0, p0, step.u);
        if self.from_wall.is_none() && self.mode == Mode::Free {
            let [above, below] = self.flow.walls;
            if let Some(room) = stays_between(&gap, below, above, remainder) {
                return Outlook::Clear { roomy: ROOMY * remainder < room };
            }
        }
        if level < linear.taylor_level && self.mode == Mode::Free && self.from_wall.is_none() {
            return Outlook::Unclear;
        }
        let distance = |side: Side, inwards: f64| {
            let order = self.from_wall.map_or(0, |(from, order)| if from == side { order } else { 0 });
            judge(&gap, self.flow.wall(side), inwards * side.sign(), order, remainder)
        };
        match self.mode {
            Mode::Free => {
                let right = (distance(Side::Right, -1.0), Crossing::Contact(Side::Right));
                let left = (distance(Side::Left, -1.0), Crossing::Contact(Side::Left));
                first_of(right, left)
            }
            Mode::Pressed(side) => match distance(side, 1.0) {
                Verdict::Clear { roomy } => Outlook::Clear { roomy },
                Verdict::Crossing(bracket) => Outlook::Crossing(Crossing::MeshEnds(side), bracket),
                Verdict::Unclear => Outlook::Unclear,
            },
            Mode::Dip(side) => {
                let rates = |q: &Gap, p: &Phasor| linear.acceleration_rates(q, p);
                let pressing = Hermite::new(rates(q0, p0), rates(&q1, &p1), step.h);
                let remainder = step.u6 * linear.pressing_bound.remainder(q0, p0, step.u);
                let ceases = judge(&pressing, 0.0, side.sign(), 0, remainder);
                first_of(
                    (distance(side, -1.0), Crossing::Emerge(side)),
                    (ceases, Crossing::PressingEnds(side)),
                )
            }
        }
    }

    /// Takes a step that is clear, cut at `until`.
    #[inline(always)]
    fn clear_step(&mut self, linear: &LinearFlow, level: usize, until: f64) {
        let step = &linear.steps[level];
        let remaining = until - self.t;
        self.from_wall = None;
        if step.h < remaining {
            let q = step.columns.apply(&self.q, &self.phasor);
            self.phasor = step.columns.rotate(&self.phasor);
            self.q = q;
            self.t += step.h;
            if N > 0 {
                self.tangents = self.tangents.map(|u| step.columns.apply_tangent(&u));
            }
            self.count_meshing(step.h);
        } else {
            self.move_to(linear, remaining, until);
        }
    }

    /// Moves everything to `until`, the rest `s` of a step away that is clear so far.
    #[inline(always)]
    fn move_to(&mut self, linear: &LinearFlow, s: f64, until: f64) {
        self.move_within(linear, s);
        self.from_wall = None;
        self.t = until;
    }

    /// Moves everything by a time of at most one Taylor step.
    #[inline(always)]
    fn move_within(&mut self, linear: &LinearFlow, s: f64) {
        let partial = linear.partial(s / linear.unit);
        self.q = add(&self.q, &partial.increment(&self.q, &self.phasor));
        self.phasor = partial.rotate(&self.phasor);
        if N > 0 {
            self.tangents = self.tangents.map(|u| partial.apply_tangent(&u));
        }
        self.count_meshing(s);
    }

    #[inline(always)]
    fn count_meshing(&mut self, s: f64) {
        if self.mode != Mode::Free {
            self.meshing_time += s;
        }
    }
}

/// The earlier of two things that may happen on a step.
#[inline(always)]
fn first_of((a, crossing_a): (Verdict, Crossing), (b, crossing_b): (Verdict, Crossing)) -> Outlook {
    match (a, b) {
        (Verdict::Clear { roomy: a }, Verdict::Clear { roomy: b }) => Outlook::Clear { roomy: a && b },
        (Verdict::Crossing(bracket), Verdict::Clear { .. }) => Outlook::Crossing(crossing_a, bracket),
        (Verdict::Clear { .. }, Verdict::Crossing(bracket)) => Outlook::Crossing(crossing_b, bracket),
        (Verdict::Crossing(a), Verdict::Crossing(b)) if a.hi < b.lo => Outlook::Crossing(crossing_a, a),
        (Verdict::Crossing(a), Verdict::Crossing(b)) if b.hi < a.lo => Outlook::Crossing(crossing_b, b),
        _ => Outlook::Unclear,
    }
}
