//! Machines from oscillators, and machines from machines.

use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::model::{Drive, DryFriction, Forces, GapRow, Oscillator, Timing};

/// Returns the machine of machines side by side that do not touch each other. It has the frequency and the schedule of the first one, and
/// all others have one stage.
pub(crate) fn side_by_side(machines: &[Oscillator]) -> Oscillator {
    let n: usize = machines.iter().map(Oscillator::degrees).sum();
    let stages = machines[0].stages.len();
    let (mut at, mut offsets) = (0, Vec::new());
    for machine in machines {
        offsets.push(at);
        at += machine.degrees();
    }
    let matrix = |of: &dyn Fn(&Oscillator) -> DMatrix<f64>| {
        let mut all = DMatrix::zeros(n, n);
        for (machine, &at) in machines.iter().zip(&offsets) {
            all.view_mut((at, at), (machine.degrees(), machine.degrees())).copy_from(&of(machine));
        }
        all
    };
    let wide = |v: &DVector<f64>, at: usize| {
        let mut all = DVector::zeros(n);
        all.rows_mut(at, v.len()).copy_from(v);
        all
    };
    let forces = |stage: usize| {
        let of = |machine: &Oscillator| machine.stages[stage.min(machine.stages.len() - 1)].clone();
        Forces {
            damping: matrix(&|machine| of(machine).damping),
            stiffness: matrix(&|machine| of(machine).stiffness),
            load: machines.iter().zip(&offsets).map(|(machine, &at)| wide(&of(machine).load, at)).sum(),
        }
    };
    let (mut drives, mut gaps, mut friction) = (Vec::<Drive>::new(), Vec::new(), Vec::new());
    for (machine, &at) in machines.iter().zip(&offsets) {
        for drive in &machine.drives {
            let (cos, sin) = (wide(&drive.cos, at), wide(&drive.sin, at));
            match drives.iter_mut().find(|other| other.order == drive.order) {
                Some(other) => {
                    other.cos += cos;
                    other.sin += sin;
                }
                None => drives.push(Drive { order: drive.order, cos, sin }),
            }
        }
        for gap in &machine.gaps {
            let mut gap = GapRow { row: wide(&gap.row, at), walls: gap.walls.clone() };
            for wall in gap.walls.iter_mut().flatten() {
                let last = wall.springs[wall.springs.len() - 1];
                wall.springs.resize(stages, last);
            }
            gaps.push(gap);
        }
        let moved = machine.friction.iter().map(|one| DryFriction { row: wide(&one.row, at), ..one.clone() });
        friction.extend(moved);
    }
    drives.sort_by_key(|drive| drive.order);
    Oscillator {
        omega: machines[0].omega,
        mass: matrix(&|machine| machine.mass.clone()),
        stages: (0..stages).map(forces).collect(),
        schedule: machines[0].schedule.clone(),
        drives,
        gaps,
        friction,
        springs: Vec::new(),
        signals: Vec::new(),
        timing: Timing::Forced,
    }
}

/// Returns the machine in coordinates `q` with `x = t q`.
pub(crate) fn in_coordinates(machine: &Oscillator, t: &DMatrix<f64>) -> Oscillator {
    let square = |m: &DMatrix<f64>| {
        let all = t.transpose() * m * t;
        // Rounding must not make a symmetric matrix unsymmetric.
        let is_symmetric = *m == m.transpose();
        if is_symmetric { (&all + all.transpose()) * 0.5 } else { all }
    };
    let vector = |v: &DVector<f64>| t.transpose() * v;
    Oscillator {
        omega: machine.omega,
        mass: square(&machine.mass),
        stages: (machine.stages.iter())
            .map(|forces| Forces {
                damping: square(&forces.damping),
                stiffness: square(&forces.stiffness),
                load: vector(&forces.load),
            })
            .collect(),
        schedule: machine.schedule.clone(),
        drives: (machine.drives.iter())
            .map(|drive| Drive { order: drive.order, cos: vector(&drive.cos), sin: vector(&drive.sin) })
            .collect(),
        gaps: (machine.gaps.iter())
            .map(|gap| GapRow { row: vector(&gap.row), walls: gap.walls.clone() })
            .collect(),
        friction: (machine.friction.iter())
            .map(|one| DryFriction { row: vector(&one.row), ..one.clone() })
            .collect(),
        springs: Vec::new(),
        signals: Vec::new(),
        timing: Timing::Forced,
    }
}
