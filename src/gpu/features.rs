//! Features of oscillators for which shaders have code only if it is needed.

use super::pushing::has_negative_preload;
use rattlemap_dynamics::model::{Contact, Oscillator, Side};

/// Whether only the reference computes the oscillator.
pub fn needs_reference(oscillator: &Oscillator) -> bool {
    Features::of(oscillator).needing_reference().is_some()
}

/// The features that some oscillators have, or that a shader has code for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Features {
    /// Elastic or rigid walls.
    pub kinds: bool,
    /// Forces with a sine.
    pub sine: bool,
    /// Most harmonics of a force beside the first.
    pub harmonics: u32,
    /// Domains that change in a forcing period.
    pub stages: bool,
    /// Several walls on one side.
    pub intervals: bool,
    /// Walls that only push, or that have a preload.
    pub pushing: bool,
    /// Walls that only push and have a negative preload. No shader has code for these.
    pub negative_preload: bool,
    /// Dry friction. No shader has code for it.
    pub friction: bool,
    /// A [machine](rattlemap_dynamics::model::Machine). No shader has code for it.
    pub machine: bool,
}

impl Features {
    /// Returns the features of an oscillator.
    pub fn of(oscillator: &Oscillator) -> Features {
        let mut walls = oscillator.contacts.iter().zip(oscillator.walls);
        let pushing = Side::BOTH.into_iter().any(|side| oscillator.is_pushing_or_preloaded(side));
        Features {
            kinds: walls.any(|(&contact, wall)| contact != Contact::Impact && wall.is_finite()),
            sine: oscillator.force_sin != [0.0; 2],
            harmonics: oscillator.harmonics.len() as u32,
            stages: !oscillator.schedule.is_empty(),
            intervals: oscillator.has_outer_walls() || pushing,
            pushing,
            negative_preload: has_negative_preload(oscillator),
            friction: oscillator.friction.iter().any(|friction| friction.force > 0.0),
            machine: oscillator.machine.is_some(),
        }
    }

    /// Returns the features of both.
    pub fn and(self, other: Features) -> Features {
        Features {
            kinds: self.kinds || other.kinds,
            sine: self.sine || other.sine,
            harmonics: self.harmonics.max(other.harmonics),
            stages: self.stages || other.stages,
            intervals: self.intervals || other.intervals,
            pushing: self.pushing || other.pushing,
            negative_preload: self.negative_preload || other.negative_preload,
            friction: self.friction || other.friction,
            machine: self.machine || other.machine,
        }
    }

    /// Returns a feature that no shader has code for, in words.
    pub fn needing_reference(self) -> Option<&'static str> {
        self.without_code().into_iter().find_map(|(is_there, feature, _)| is_there.then_some(feature))
    }

    fn without_code(self) -> [(bool, &'static str, &'static str); 3] {
        let machine = "models of more than two coordinates, of several gaps, or with a restitution that depends on the speed";
        let preload = "a wall that only pushes and has a negative preload";
        [
            (self.machine, machine, "machine"),
            (self.negative_preload, preload, "negative_preload"),
            (self.friction, "dry friction", "friction"),
        ]
    }

    /// Returns a feature that `code` lacks, in words, and the name of its field.
    pub(super) fn lacking_in(self, code: Features) -> Option<(&'static str, &'static str)> {
        [
            (self.kinds && !code.kinds, "an elastic or a rigid wall", "kinds"),
            (self.sine && !code.sine, "a force with a sine", "sine"),
            (self.harmonics > code.harmonics, "more harmonics of the force", "harmonics"),
            (self.stages && !code.stages, "stages", "stages"),
            (self.intervals && !code.intervals, "several walls on one side", "intervals"),
            (self.pushing && !code.pushing, "a wall that only pushes or has a preload", "pushing"),
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
    use rattlemap_dynamics::model::Model;

    #[test]
    fn machines_need_the_reference() {
        let text = FileModel::built_in("impact-oscillator").unwrap().definition().text.clone();
        let text = text.replace("restitution = \"e\"", "restitution = \"e - 0.1*speed\"");
        let oscillator = FileModel::parse(&text, "m.toml").unwrap().oscillator().unwrap();
        let features = Features::default().and(Features::of(&oscillator));
        assert!(features.needing_reference().unwrap().starts_with("models of more than two coordinates"));
    }

    #[test]
    fn dry_friction_needs_the_reference() {
        let mut model = FileModel::built_in("friction-oscillator").unwrap();
        let features = Features::default().and(Features::of(&model.oscillator().unwrap()));
        assert_eq!(features.needing_reference(), Some("dry friction"));
        model.set("f", 0.0).unwrap();
        assert!(!needs_reference(&model.oscillator().unwrap()));
    }
}
