//! A machine as tables of numbers, for lanes, which cannot build domains: the equations of motion of all domains, and the modes of a start.
//!
//! A point is listed as `(d1, w1, d2, w2, ..., cos and sin of each harmonic, 1)`.

use super::domain::{DomainKey, Functional, LinearDomain};
use super::domains::System;
use super::frame::{Element, Frame};
use super::modes::{GapMode, Pieces};
use super::motion::MachineMotion;
use super::{Numbers, SIZE};
use crate::model::{Contact, MOST_GAPS, Oscillator, Side};
use crate::motion::{Slip, Slips};

/// A frequency that does not limit [`Equations::radian`].
const LOWEST_FREQUENCY: f64 = 1e-100;

/// Largest order of a root that lanes distinguish; higher orders are reported as this one.
const MOST_ORDER_OF_LANES: usize = 7;

/// The equations of motion of one domain.
#[derive(Clone, Debug)]
pub struct Equations {
    /// Time in which the fastest rate turns by one radian.
    pub radian: f64,
    /// For each coordinate, whether constraints hold it.
    pub is_still: Vec<bool>,
    /// Rows of the accelerations.
    pub accelerations: Vec<Vec<f64>>,
    /// Rows of the forces with which rigid walls push gaps that rest on them; none where nothing rests.
    pub pushes: Vec<Option<Vec<f64>>>,
    /// Rows of the forces that hold sticking elements; none where other constraints hold them.
    pub holds: Vec<Option<Vec<f64>>>,
}

/// The modes at the start of a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StartModes {
    /// State in the coordinates of the flow, `(d1, w1, d2, w2, ...)`.
    pub state: Numbers,
    /// Modes of the gaps: 4 between the first walls, plus 1 for each wall passed on the right, minus 1 for each on the left. At the last
    /// right wall: 9 in contact onset, 11 pressed, 13 open, 15 at rest. At the last left wall these numbers are larger by 1.
    pub gaps: [u32; MOST_GAPS],
    /// Modes of friction: 0 sticks, 1 slides forward, 2 backward.
    pub slips: [u32; 2],
    /// Stage of the forces.
    pub stage: u32,
    /// Side of the wall that each gap comes from: 0 right, 1 left, 2 none.
    pub origins: [u32; MOST_GAPS],
    /// Direction of the wall that each gap lies on, as in `origins`, and the order of the root of its distance.
    pub walls: [(u32, u32); MOST_GAPS],
    /// Orders of the roots of pushing forces.
    pub from_force: [u32; MOST_GAPS],
    /// Orders of the roots of sliding rates.
    pub from_rate: [u32; 2],
}

fn side_code(side: Side) -> u32 {
    side.index() as u32
}

fn gap_code(mode: GapMode) -> u32 {
    match mode {
        GapMode::Beyond(passed) => (4 + i32::from(passed)) as u32,
        GapMode::Onset(side) => 9 + side_code(side),
        GapMode::Pressed(side) => 11 + side_code(side),
        GapMode::Open(side) => 13 + side_code(side),
        GapMode::Stuck(side) => 15 + side_code(side),
    }
}

impl Frame {
    /// Returns the modes of a gap with different equations of motion: the numbers of acting springs, from left to right, then rest on a
    /// rigid right wall and on a rigid left wall.
    fn modes_of_gap(&self, gap: usize) -> Vec<(i8, Option<Side>)> {
        let is_rigid =
            |side: Side| self.walls(gap, side).last().is_some_and(|wall| wall.contact == Contact::Rigid);
        let reach = |side: Side| self.walls(gap, side).len() as i8 - i8::from(is_rigid(side));
        let [right, left] = Side::BOTH.map(reach);
        let at_rest = Side::BOTH.into_iter().filter(|&side| is_rigid(side));
        let engaged = |side: Side| if side == Side::Right { right } else { -left };
        (-left..=right)
            .map(|count| (count, None))
            .chain(at_rest.map(|side| (engaged(side), Some(side))))
            .collect()
    }

    /// Returns the number of domains.
    pub fn domain_count(&self) -> usize {
        let of_gaps: usize = (0..self.gaps()).map(|gap| self.modes_of_gap(gap).len()).product();
        self.stages.len() * of_gaps * Slip::ALL.len().pow(self.elements.len() as u32)
    }

    /// Returns the equations of all domains. The index of a domain is `((stage * modes + mode) * modes + mode) ...` over the gaps and the
    /// elements with friction, in their order.
    pub fn equations(&self) -> Vec<Equations> {
        let modes: Vec<_> = (0..self.gaps()).map(|gap| self.modes_of_gap(gap)).collect();
        let of_number = |number: usize| {
            let mut key = DomainKey {
                stage: 0,
                engaged: [0; MOST_GAPS],
                held: [None; MOST_GAPS],
                slips: Slips::default(),
                pieces: Pieces::default(),
            };
            let mut rest = number;
            for i in (0..self.elements.len()).rev() {
                key.slips[i] = Slip::ALL[rest % Slip::ALL.len()];
                rest /= Slip::ALL.len();
            }
            for (gap, modes) in modes.iter().enumerate().rev() {
                (key.engaged[gap], key.held[gap]) = modes[rest % modes.len()];
                rest /= modes.len();
            }
            key.stage = rest;
            self.equations_of(&LinearDomain::new(self, key))
        };
        (0..self.domain_count()).map(of_number).collect()
    }

    fn equations_of(&self, domain: &LinearDomain) -> Equations {
        let row = |row: &Functional| self.listed(&row.0);
        Equations {
            radian: domain.radian(),
            is_still: domain.is_still[..self.n].to_vec(),
            accelerations: domain.accelerations.iter().map(row).collect(),
            pushes: domain.pushes[..self.gaps()].iter().map(|push| push.as_ref().map(row)).collect(),
            holds: domain.holds[..self.elements.len()].iter().map(|hold| hold.as_ref().map(row)).collect(),
        }
    }

    /// Lists the entries of a point: each displacement followed by its rate, then the phasors and 1.
    fn listed(&self, point: &[f64]) -> Vec<f64> {
        let states = (0..self.n).flat_map(|i| [point[i], point[self.n + i]]);
        states.chain(point[2 * self.n..self.width()].iter().copied()).collect()
    }

    /// Returns the row of the sliding rate of each element with friction, and its friction force.
    pub fn sliding_rates(&self) -> Vec<(Vec<f64>, f64)> {
        let row = |element: &Element| {
            let mut point = [0.0; super::WIDTH];
            (0..self.n).for_each(|j| point[self.n + j] = element.row[j]);
            point[self.width() - 1] = -element.speed;
            (self.listed(&point), element.static_force)
        };
        self.elements.iter().map(row).collect()
    }

    /// Returns the mobility matrix, row by row: the changes of the rates by unit impulses.
    pub fn mobilities(&self) -> Vec<f64> {
        (0..self.n * self.n).map(|k| self.mobility[(k / self.n, k % self.n)]).collect()
    }

    /// Returns the mass matrix and the stiffness matrix of free motion in stage 0, in the coordinates of the flow, row by row.
    pub fn energy_forms(&self) -> [Vec<f64>; 2] {
        [&self.mass, &self.stages[0].stiffness]
            .map(|matrix| (0..self.n * self.n).map(|k| matrix[(k / self.n, k % self.n)]).collect())
    }

    /// Converts a state `(x1, v1, ...)` to `(d1, w1, ...)`.
    pub fn listed_state(&self, state: &[f64]) -> Numbers {
        self.in_turn(&self.to_flow(state))
    }

    /// Lists each displacement followed by its rate.
    fn in_turn(&self, y: &[f64]) -> Numbers {
        let mut listed = [0.0; SIZE];
        for i in 0..self.n {
            (listed[2 * i], listed[2 * i + 1]) = (y[i], y[self.n + i]);
        }
        listed
    }

    /// Whether a wall only pushes and has a damper or a preload.
    pub fn is_pushing(&self, gap: usize, side: Side) -> bool {
        self.pushing(gap, side).is_some()
    }

    /// Converts a state `(d1, w1, ...)` of the flow's coordinates to `(x1, v1, ...)`.
    pub fn state_of(&self, listed: &[f64]) -> Numbers {
        let mut y = [0.0; SIZE];
        for i in 0..self.n {
            (y[i], y[self.n + i]) = (listed[2 * i], listed[2 * i + 1]);
        }
        self.to_state(&y)
    }
}

impl System {
    /// Returns the modes and the state of a start, for the state `(x1, v1, ...)`.
    pub fn start(&self, state: &[f64]) -> StartModes {
        MachineMotion::new(self, state).start_modes()
    }
}

impl MachineMotion<'_> {
    fn start_modes(&self) -> StartModes {
        let system = self.system();
        let side = |side: Option<Side>| side.map_or(2, side_code);
        let slip =
            |slip: Slip| Slip::ALL.iter().position(|&other| other == slip).expect("all are listed") as u32;
        let of_lanes = |order: usize| order.min(MOST_ORDER_OF_LANES) as u32;
        StartModes {
            state: system.in_turn(&self.point),
            gaps: self.modes.gaps.map(gap_code),
            slips: self.modes.slips.map(slip),
            stage: self.modes.stage as u32,
            origins: self.origin.map(side),
            walls: self
                .roots
                .at_wall
                .map(|at| at.map_or((2, 0), |(side, order)| (side_code(side), of_lanes(order)))),
            from_force: self.roots.from_force.map(of_lanes),
            from_rate: self.roots.from_rate.map(of_lanes),
        }
    }
}

impl Oscillator {
    /// Returns the machine with restitution and mesh speeds of 0 and with a frequency that does not limit [`Equations::radian`]. Machines
    /// for which this is equal have equal equations.
    pub fn without_laws(&self) -> Oscillator {
        let mut machine = self.clone();
        machine.omega = LOWEST_FREQUENCY;
        for wall in machine.gaps.iter_mut().flat_map(|gap| gap.walls.iter_mut().flatten()) {
            wall.restitution = crate::model::Restitution::Constant(0.0);
            wall.mesh_speed = 0.0;
        }
        machine
    }
}
