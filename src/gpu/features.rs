//! Features of oscillators whose shader code is compiled only if it is needed.

use super::machine::{MODES, MOST_DOMAINS, MOST_GAPS, MachineShape, domain_count};
use rattlemap_dynamics::model::{Contact, DryFriction, Form, Pair, Timing};

/// The features of one or more oscillators, or the features that a shader supports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Features {
    /// Elastic or rigid walls.
    pub kinds: bool,
    /// Forces with a sine.
    pub sine: bool,
    /// Largest number of harmonics of a force besides the first.
    pub harmonics: u32,
    /// Stages: domains that change within a forcing period.
    pub stages: bool,
    /// Sizes of a machine.
    pub machine: Option<MachineShape>,
    /// Machines with more domains than a table can hold.
    pub too_many_domains: bool,
    /// Machines with more gaps than a lane's start has room for, or with gaps whose rows depend on those of others.
    pub dependent_gaps: bool,
    /// Machines without force, whose cycles have periods of their own.
    pub unforced: bool,
    /// Nonlinear springs, and friction that depends on the sliding rate or is larger at rest. No shader supports them.
    pub curves: bool,
}

impl Features {
    /// Returns the features of an oscillator.
    pub fn of(oscillator: impl Into<Form>) -> Features {
        match oscillator.into() {
            Form::Pair(pair) => Features::of_pair(&pair),
            Form::Machine(machine) => Features {
                machine: Some(MachineShape::of(&machine)),
                too_many_domains: domain_count(&machine) > MOST_DOMAINS,
                dependent_gaps: machine.gaps.len() > MOST_GAPS
                    || machine.leading_gaps().len() < machine.gaps.len(),
                unforced: machine.timing != Timing::Forced,
                curves: !machine.springs.is_empty() || !machine.friction.iter().all(DryFriction::is_constant),
                ..Features::default()
            },
        }
    }

    fn of_pair(pair: &Pair) -> Features {
        let mut walls = pair.contacts.iter().zip(pair.walls);
        Features {
            kinds: walls.any(|(&contact, wall)| contact != Contact::Impact && wall.is_finite()),
            sine: pair.force_sin != [0.0; 2],
            harmonics: pair.harmonics.len() as u32,
            stages: !pair.schedule.is_empty(),
            ..Features::default()
        }
    }

    /// Returns the union of two sets of features.
    pub fn and(self, other: Features) -> Features {
        Features {
            kinds: self.kinds || other.kinds,
            sine: self.sine || other.sine,
            harmonics: self.harmonics.max(other.harmonics),
            stages: self.stages || other.stages,
            machine: match (self.machine, other.machine) {
                (Some(own), Some(others)) => Some(own.and(others)),
                (own, others) => own.or(others),
            },
            too_many_domains: self.too_many_domains || other.too_many_domains,
            dependent_gaps: self.dependent_gaps || other.dependent_gaps,
            unforced: self.unforced || other.unforced,
            curves: self.curves || other.curves,
        }
    }

    /// Returns the description of a feature that no shader supports.
    pub fn needing_reference(self) -> Option<&'static str> {
        self.without_code().into_iter().find_map(|(is_there, feature, _)| is_there.then_some(feature))
    }

    /// Returns the numbers of a lane's state.
    pub(super) fn dim(&self) -> usize {
        self.machine.map_or(4, |shape| shape.dim())
    }

    /// Returns the numbers of a lane's start.
    pub(super) fn start_numbers(&self) -> usize {
        self.machine.map_or(4, |shape| shape.dim() + MODES)
    }

    fn without_code(self) -> [(bool, &'static str, &'static str); 4] {
        [
            (
                self.dependent_gaps,
                "more than three gaps, or gap rows that depend on each other",
                "dependent_gaps",
            ),
            (self.too_many_domains, "more than 4096 combinations of modes", "too_many_domains"),
            (self.unforced, "motion without force", "unforced"),
            (self.curves, "nonlinear springs, or friction that is not constant", "curves"),
        ]
    }

    /// Returns the description of a feature that `code` lacks, and the name of its field.
    pub(super) fn lacking_in(self, code: Features) -> Option<(&'static str, &'static str)> {
        [
            (self.kinds && !code.kinds, "an elastic or a rigid wall", "kinds"),
            (self.sine && !code.sine, "a force with a sine", "sine"),
            (self.harmonics > code.harmonics, "more harmonics of the force", "harmonics"),
            (self.stages && !code.stages, "stages", "stages"),
            (self.machine != code.machine, "a machine of other sizes", "machine"),
        ]
        .into_iter()
        .chain(self.without_code())
        .find_map(|(lacks, feature, setting)| lacks.then_some((feature, setting)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model_file::FileModel;
    use rattlemap_dynamics::model::{Model, Oscillator};
    use rattlemap_dynamics::motion::Flow;

    /// Lanes and reference use the same engine for a model, whatever its values are.
    #[test]
    fn friction_makes_a_machine_of_an_oscillator() {
        let mut model = FileModel::built_in("friction-oscillator").unwrap();
        let features = Features::of(&model.oscillator().unwrap());
        assert_eq!(features.machine.map(|shape| (shape.coordinates, shape.elements)), Some((2, 1)));
        assert!(features.needing_reference().is_none());
        model.set("f", 0.0).unwrap();
        let without_force = model.oscillator().unwrap();
        assert_eq!(Features::of(&without_force), features);
        assert!(Flow::new(&without_force).pair().is_none());
    }

    #[test]
    fn lanes_refuse_dependent_gaps() {
        let mut oscillator = FileModel::built_in("two-loose-gears").unwrap().oscillator().unwrap();
        let reason = |oscillator: &Oscillator| Features::of(oscillator).needing_reference();
        assert_eq!(reason(&oscillator), None);
        let mut third = oscillator.gaps[1].clone();
        third.row += &oscillator.gaps[0].row;
        oscillator.gaps.push(third);
        assert!(reason(&oscillator).is_some_and(|reason| reason.contains("depend on each other")));
    }
}
