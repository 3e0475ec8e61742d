//! The machine that a model file defines, if its oscillator has more than two coordinates, several gaps, or a restitution
//! that depends on the approach speed.

use nalgebra::{DMatrix, DVector};
use rattlemap_dynamics::model::{
    self, Drive, Forces, GapRow, Machine, Oscillator, OscillatorError, Restitution, Side, Spring,
};

use super::contact::{Wall, WallLaw, WallSpring};
use super::definition::Definition;
use super::entry::Staged;
use crate::text::expression::Expression;

/// Values of the parameters.
struct Values<'a>(&'a [f64]);

impl Values<'_> {
    fn of(&self, entry: &Expression) -> f64 {
        entry.evaluate(&|index| self.0[index])
    }

    fn vector<'e>(&self, entries: impl ExactSizeIterator<Item = &'e Expression>) -> DVector<f64> {
        DVector::from_iterator(entries.len(), entries.map(|entry| self.of(entry)))
    }

    fn matrix<'e, T: 'e>(&self, rows: &'e [Vec<T>], entry: impl Fn(&'e T) -> &'e Expression) -> DMatrix<f64> {
        let entries = rows.iter().flatten().map(|value| self.of(entry(value)));
        DMatrix::from_row_iterator(rows.len(), rows.len(), entries)
    }

    fn spring(&self, spring: &WallSpring, stage: usize) -> Spring {
        let of = |entry: &Staged| self.of(entry.in_stage(stage));
        Spring {
            stiffness: of(&spring.stiffness),
            damping: of(&spring.damping),
            preload: of(&spring.preload),
        }
    }

    /// Returns restitution; none if it has not the form of [`Restitution`].
    fn restitution(&self, law: &WallLaw) -> Option<Restitution> {
        match law {
            WallLaw::Elastic { .. } => Some(Restitution::constant(0.0)),
            WallLaw::Impact { restitution, by_speed: false, .. } => {
                Some(Restitution::constant(self.of(restitution)))
            }
            WallLaw::Impact { restitution, by_speed: true, .. } => {
                let law = restitution.power_law(self.0.len(), &|index| self.0[index])?;
                Some(Restitution { constant: law.constant, factor: law.factor, power: law.power })
            }
        }
    }

    /// Builds a wall. `place` names it in messages.
    fn wall(&self, wall: &Wall, stages: usize, place: &str) -> Result<model::Wall, OscillatorError> {
        let restitution = self.restitution(&wall.law).ok_or_else(|| OscillatorError::OutOfRange {
            quantity: format!("restitution of {place}"),
            value: f64::NAN,
            requirement: "c + f*speed^p, where c, f and p do not contain speed",
        })?;
        let spring = |stage| wall.spring.as_ref().map_or(Spring::default(), |own| self.spring(own, stage));
        Ok(model::Wall {
            at: self.of(&wall.at),
            contact: wall.contact(),
            restitution,
            mesh_speed: match &wall.law {
                WallLaw::Impact { mesh_speed, .. } => self.of(mesh_speed),
                WallLaw::Elastic { .. } => 0.0,
            },
            springs: (0..stages).map(spring).collect(),
        })
    }
}

impl Definition {
    /// Whether only a machine can describe the oscillator.
    pub(super) fn is_machine(&self) -> bool {
        let walls = || self.walls.iter().flatten().flatten();
        self.motion.degrees() > 2 || self.motion.gaps.len() > 1 || walls().any(Wall::is_by_speed)
    }

    /// Builds the machine for values of the parameters. The caller validates it.
    pub(super) fn machine(&self, values: &[f64]) -> Result<Machine, OscillatorError> {
        let (motion, values) = (&self.motion, Values(values));
        let stages = motion.stages.len().max(1);
        let forces = |stage: usize| Forces {
            damping: values.matrix(&motion.damping, |entry| entry.in_stage(stage)),
            stiffness: values.matrix(&motion.stiffness, |entry| entry.in_stage(stage)),
            load: values.vector(motion.load.iter().map(|entry| entry.in_stage(stage))),
        };
        let drive = |order: u32, cos: &[Expression], sin: &[Expression]| Drive {
            order,
            cos: values.vector(cos.iter()),
            sin: values.vector(sin.iter()),
        };
        let first = drive(1, &motion.force, &motion.force_sin);
        let acts = first.cos.iter().chain(&first.sin).any(|&factor| factor != 0.0);
        let further = motion.harmonics.iter().map(|h| drive(h.order, &h.cos, &h.sin));
        let gap = |nth: usize| {
            let side = |side: Side| {
                let walls = (1..).zip(&self.walls[nth][side.index()]);
                let built = walls.map(|(i, wall)| {
                    let word = ["right", "left"][side.index()];
                    values.wall(wall, stages, &format!("{word} wall {i} of gap {}", nth + 1))
                });
                built.collect::<Result<Vec<_>, _>>()
            };
            Ok(GapRow {
                row: values.vector(motion.gaps[nth].row.iter()),
                walls: [side(Side::Right)?, side(Side::Left)?],
            })
        };
        let phases: Vec<f64> = motion.stages.iter().map(|phase| values.of(phase)).collect();
        Ok(Machine {
            omega: values.of(&motion.frequency),
            mass: values.matrix(&motion.mass, |entry| entry),
            stages: (0..stages).map(forces).collect(),
            schedule: Oscillator::repeated(&phases, motion.repeat)?,
            drives: acts.then_some(first).into_iter().chain(further).collect(),
            gaps: (0..motion.gaps.len()).map(gap).collect::<Result<_, OscillatorError>>()?,
            friction: self.friction.iter().map(|own| own.of_machine(|entry| values.of(entry))).collect(),
        })
    }
}
