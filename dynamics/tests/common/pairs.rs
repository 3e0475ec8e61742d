//! Pairs of models, their flows in terms of states, and their descriptions.

use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::model::{
    Drive, DryFriction, Forces, Form, GapRow, Law, Model, Oscillator, Pair, Restitution, Side, Spring, State,
    Timing, Wall, state,
};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::pair::{DomainKind, Gap, LinearFlow, PairFlow};

/// Converts a model to its pair.
pub(crate) trait AsPair {
    fn pair(&self) -> Pair;
}

impl<M: Model + ?Sized> AsPair for M {
    fn pair(&self) -> Pair {
        Pair::of(&self.oscillator().expect("valid parameters")).expect("a pair")
    }
}

/// The flow of a pair, in terms of states.
pub(crate) trait OfPair {
    fn of(&self) -> &PairFlow;

    fn walls(&self) -> [f64; 2] {
        self.of().walls
    }

    fn wall(&self, side: Side) -> f64 {
        self.of().wall(side)
    }

    fn domain(&self, kind: DomainKind) -> &LinearFlow {
        self.of().domain(kind)
    }

    fn compliance(&self) -> f64 {
        self.of().compliance()
    }

    fn to_gap(&self, y: State) -> Gap {
        self.of().to_gap(four(&y))
    }

    fn to_state(&self, q: Gap) -> State {
        state(&self.of().to_state(q))
    }

    fn kinetic_energy(&self, y: State) -> f64 {
        self.of().kinetic_energy(four(&y))
    }

    fn momentum(&self, y: State) -> f64 {
        self.of().momentum(four(&y))
    }

    fn propagate(&self, kind: DomainKind, y: State, phase: f64, tau: f64) -> State {
        state(&self.of().propagate(kind, four(&y), phase, tau))
    }
}

impl OfPair for Flow {
    fn of(&self) -> &PairFlow {
        self.pair().expect("the flow of a pair")
    }
}

fn four(y: &State) -> [f64; 4] {
    std::array::from_fn(|i| y[i])
}

/// An element with dry friction of one or two coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Friction {
    pub(crate) row: [f64; 2],
    pub(crate) force: f64,
    pub(crate) speed: f64,
}

/// A pair and dry friction, which together are a machine.
#[derive(Clone, Debug)]
pub(crate) struct Rubbing {
    pub(crate) pair: Pair,
    pub(crate) friction: Vec<Friction>,
}

impl Rubbing {
    /// Describes the pair and its friction, with a law of restitution.
    pub(crate) fn described(&self, law: Law) -> Oscillator {
        let n = self.pair.degrees;
        let element =
            |one: &Friction| DryFriction::new(DVector::from_row_slice(&one.row[..n]), one.force, one.speed);
        let friction = self.friction.iter().map(element).collect();
        Oscillator { friction, ..described(&self.pair, law) }
    }

    /// Returns the oscillator in the form that its engine takes.
    pub(crate) fn form(&self, law: Law) -> Form {
        if self.friction.is_empty() {
            Form::Pair(self.pair.clone())
        } else {
            Form::Machine(self.described(law))
        }
    }
}

impl std::ops::Deref for Rubbing {
    type Target = Pair;

    fn deref(&self) -> &Pair {
        &self.pair
    }
}

impl std::ops::DerefMut for Rubbing {
    fn deref_mut(&mut self) -> &mut Pair {
        &mut self.pair
    }
}

/// Returns the excitation frequency.
pub(crate) fn omega_of(form: &Form) -> f64 {
    match form {
        Form::Pair(pair) => pair.omega,
        Form::Machine(machine) => machine.omega,
    }
}

/// Describes a pair with a law of restitution: the inverse of [`Pair::of`].
pub(crate) fn described(pair: &Pair, law: Law) -> Oscillator {
    let n = pair.degrees;
    let matrix = |m: [[f64; 2]; 2]| DMatrix::from_fn(n, n, |i, j| m[i][j]);
    let vector = |v: [f64; 2]| DVector::from_fn(n, |i, _| v[i]);
    let stages: Vec<_> = (0..pair.stage_count()).map(|stage| pair.in_stage(stage)).collect();
    let walls = |side: Side| {
        let i = side.index();
        let spring = |stage: &Pair| {
            let [stiffness, damping] = stage.wall_stiffness_and_damping(side);
            let has_damper = stage.meshing[i].damping != stage.free.damping;
            Spring { stiffness, damping: if has_damper { damping } else { 0.0 }, preload: None }
        };
        let wall = || Wall {
            at: pair.walls[i],
            contact: pair.contacts[i],
            restitution: Restitution::Constant(law.restitution[i]),
            mesh_speed: law.mesh_speed[i],
            springs: stages.iter().map(spring).collect(),
        };
        pair.walls[i].is_finite().then(wall).into_iter().collect()
    };
    Oscillator {
        omega: pair.omega,
        mass: matrix(pair.mass),
        stages: stages
            .iter()
            .map(|stage| Forces {
                damping: matrix(stage.free.damping),
                stiffness: matrix(stage.free.stiffness),
                load: vector(stage.free.load),
            })
            .collect(),
        schedule: pair.schedule.clone(),
        drives: pair
            .all_harmonics()
            .map(|h| Drive { order: h.order, cos: vector(h.cos), sin: vector(h.sin) })
            .collect(),
        gaps: vec![GapRow { row: vector(pair.gap), walls: Side::BOTH.map(walls) }],
        friction: Vec::new(),
        springs: Vec::new(),
        signals: Vec::new(),
        timing: Timing::Forced,
    }
}
