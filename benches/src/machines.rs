//! Motions of a chain of masses for other programs (`benches/peers`), with the reference's results and its time.

use cpu_time::ThreadTime;
use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::machine::{MachineMotion, System};
use rattlemap_dynamics::model::{Oscillator, REST, Side, State, state};
use rattlemap_dynamics::motion::{EventKind, GapEvent};
use serde::Serialize;

use crate::shapes::Chain;
use crate::work_precision::PERIODS;

/// The chain.
pub const CHAIN: Chain = Chain { coordinates: 4, gaps: 2, harmonics: 2, stages: 1 };

/// Forcing periods from rest to the measured motion.
const SETTLING_PERIODS: u32 = 100;

/// Largest amplification of errors, so that results do not depend on rounding.
const MOST_AMPLIFICATION: f64 = 1e3;

/// A motion with impacts alone.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    omega: f64,
    restitution: f64,
    /// Forcing periods of the motion.
    periods: u32,
    /// State `(x1, v1, x2, v2, ...)` at phase 0.
    start: Vec<f64>,
    /// State after all periods.
    state: Vec<f64>,
    impacts: usize,
    #[serde(skip)]
    machine: Oscillator,
}

/// What all cells share.
#[derive(Clone, Debug, Serialize)]
struct Description {
    mass: Vec<Vec<f64>>,
    damping: Vec<Vec<f64>>,
    stiffness: Vec<Vec<f64>>,
    /// Order and factor of the cosine of each harmonic.
    drives: Vec<(u32, Vec<f64>)>,
    /// Row, position of the right wall and of the left wall of each gap.
    gaps: Vec<(Vec<f64>, [f64; 2])>,
}

/// The file for other programs.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Seconds of processor time of the reference, per forcing period of one cell.
    pub seconds_per_lane_period: f64,
    machine: Description,
    /// The cells.
    pub cells: Vec<Cell>,
}

/// Returns the motion of a machine, if it has impacts, no lasting contact and no chaos.
fn cell(machine: &Oscillator) -> Option<Cell> {
    let system = System::new(machine);
    let mut settled = MachineMotion::new(&system, &REST);
    (0..SETTLING_PERIODS).try_for_each(|_| settled.advance_period(&mut ())).ok()?;
    let start = settled.state();
    let mut motion = MachineMotion::new(&system, &start);
    motion.set_tangents(MachineMotion::unit_tangents(&system));
    let mut events: Vec<GapEvent> = Vec::new();
    (0..PERIODS).try_for_each(|_| motion.advance_period(&mut events)).ok()?;
    let has_impacts_alone = !events.is_empty() && events.iter().all(|event| event.kind == EventKind::Impact);
    let numbers = |state: State| state[..2 * machine.degrees()].to_vec();
    (has_impacts_alone && motion.derivative().norm() < MOST_AMPLIFICATION).then(|| Cell {
        omega: machine.omega,
        restitution: machine.gaps[0].walls[0][0].restitution.at(0.0)[0],
        periods: PERIODS,
        start: numbers(start),
        state: numbers(motion.state()),
        impacts: events.len(),
        machine: machine.clone(),
    })
}

/// Integrates cells of a grid with this number of rows and columns, repeatedly for at least `least` seconds.
pub fn run(side: usize, least: f64) -> Report {
    let cells: Vec<_> = CHAIN.cells(side).iter().filter_map(cell).collect();
    let systems: Vec<_> = cells.iter().map(|cell| System::new(&cell.machine)).collect();
    let starts: Vec<_> = cells.iter().map(|cell| state(&cell.start)).collect();
    let (clock, mut rounds) = (ThreadTime::now(), 0);
    let seconds = loop {
        for (system, start) in systems.iter().zip(&starts) {
            let mut motion = MachineMotion::new(system, start);
            (0..PERIODS).for_each(|_| motion.advance_period(&mut ()).expect("it was computed before"));
        }
        rounds += 1;
        let elapsed = clock.elapsed().as_secs_f64();
        if elapsed >= least {
            break elapsed / f64::from(rounds);
        }
    };
    let machine = CHAIN.machine(0.0, 1.0);
    let rows = |matrix: &DMatrix<f64>| matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
    let entries = |vector: &DVector<f64>| vector.iter().copied().collect::<Vec<_>>();
    let machine = Description {
        mass: rows(&machine.mass),
        damping: rows(&machine.stages[0].damping),
        stiffness: rows(&machine.stages[0].stiffness),
        drives: machine.drives.iter().map(|drive| (drive.order, entries(&drive.cos))).collect(),
        gaps: machine
            .gaps
            .iter()
            .map(|gap| (entries(&gap.row), Side::BOTH.map(|side| gap.walls[side.index()][0].at)))
            .collect(),
    };
    let lane_periods = (cells.len() * PERIODS as usize) as f64;
    Report { seconds_per_lane_period: seconds / lane_periods, machine, cells }
}
