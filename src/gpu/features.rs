//! Features of oscillators for which shaders have code only if it is needed.

use super::pushing::needs_reference;
use rattlemap_dynamics::model::{Contact, Oscillator, Side};

/// What no shader has code for.
pub const NEGATIVE_PRELOAD: &str = "a wall that only pushes and has a negative preload";

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
            negative_preload: needs_reference(oscillator),
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
        }
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
            (self.negative_preload, NEGATIVE_PRELOAD, "negative_preload"),
        ]
        .into_iter()
        .find_map(|(lacks, feature, setting)| lacks.then_some((feature, setting)))
    }
}
