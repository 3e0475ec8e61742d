//! The gaps of a model with their labels and walls.

use crate::show::wall_labels::WallLabels;
use rattlemap_dynamics::model::{Contact, MOST_GAPS, Model, Oscillator, Side};
use rattlemap_dynamics::orbit::{Event, EventKind, Sample};

/// Distance from a wall, relative to the length scale, up to which a gap counts as resting on it.
const RESTING: f64 = 1e-9;
/// Widths of the lines of the first wall of a side and of those behind it.
const FIRST_WALL: f64 = 2.0;
const OUTER_WALL: f64 = 1.0;

/// A gap that a figure shows.
pub(crate) struct PlotGap {
    /// Index of the gap in the model.
    pub(crate) index: usize,
    pub(crate) labels: WallLabels,
    /// Positions and contact laws of the walls on the right and on the left, from the inside to the outside.
    walls: [Vec<(f64, Contact)>; 2],
    /// Half the distance of its two walls; the length scale of the model if there are no two walls at a distance.
    pub(crate) length: f64,
}

impl PlotGap {
    /// Returns all gaps of a model, at least one.
    pub(crate) fn all(model: &dyn Model, oscillator: &Oscillator) -> Vec<PlotGap> {
        let of = |index: usize| {
            let walls = Side::BOTH.map(|side| walls(oscillator, index, side));
            let half = match &walls {
                [right, left] if !right.is_empty() && !left.is_empty() => 0.5 * (right[0].0 - left[0].0),
                _ => 0.0,
            };
            let length = if half > 0.0 { half } else { oscillator.length_scale() };
            PlotGap { index, labels: WallLabels::of(model, index), walls, length }
        };
        (0..oscillator.gaps.len()).map(of).collect()
    }

    /// Returns the position of the first wall of a side; infinite without a wall.
    pub(crate) fn wall(&self, side: Side) -> f64 {
        self.walls[side.index()].first().map_or(side.sign() * f64::INFINITY, |(at, _)| *at)
    }

    /// Returns the contact law of the first wall of a side; none without a wall.
    pub(crate) fn contact(&self, side: Side) -> Option<Contact> {
        self.walls[side.index()].first().map(|(_, contact)| *contact)
    }

    /// Whether the first wall of a side is elastic.
    pub(crate) fn is_elastic(&self, side: Side) -> bool {
        self.contact(side).is_some_and(Contact::is_elastic)
    }

    /// Whether there are walls on both sides.
    pub(crate) fn has_two_walls(&self) -> bool {
        self.walls.iter().all(|walls| !walls.is_empty())
    }

    /// Returns the positions of the walls of a side and the widths of their lines, the first wall first.
    pub(crate) fn wall_lines(&self, side: Side) -> impl Iterator<Item = (f64, f64)> {
        let widths = std::iter::once(FIRST_WALL).chain(std::iter::repeat(OUTER_WALL));
        self.walls[side.index()].iter().map(|(at, _)| *at).zip(widths)
    }

    /// Returns the displacements of a motion that counts as decayed: a tenth of half the backlash. With a single wall, which may
    /// be far away, it is a thousandth of the length scale.
    pub(crate) fn decayed(&self) -> f64 {
        let share = if self.has_two_walls() { 0.1 } else { 1e-3 };
        share * self.length
    }

    /// Returns the side of the contact in which a trace starts, if there is one. The first sample tells it of the first gap, except of a
    /// machine, which decides on gaps at rest when it moves. Any other gap starts in contact if its first event ends a contact, if it is
    /// behind an elastic wall, or if it rests on a wall and has no events.
    pub(crate) fn contact_at_start(
        &self,
        oscillator: &Oscillator,
        events: &[Event],
        trace: &[Sample],
    ) -> Option<Side> {
        let start = trace.first()?;
        if self.index == 0 && (start.meshing.is_some() || oscillator.tells_contact_at_start()) {
            return start.meshing;
        }
        let first = events.iter().find(|event| event.gap == self.index);
        if let Some(event) = first.filter(|event| event.kind == EventKind::MeshEnd) {
            return Some(event.side);
        }
        let gap = oscillator.gap_value(self.index, &start.state, 0);
        let depth = |side: Side| side.sign() * (gap - self.wall(side));
        let is_in_contact = |side: &Side| match self.is_elastic(*side) {
            true => depth(*side) > 0.0,
            false => first.is_none() && depth(*side) >= -RESTING * self.length,
        };
        Side::BOTH.into_iter().find(is_in_contact)
    }
}

/// Returns the side of the contact of each gap in which a trace starts.
pub(crate) fn contacts_at_start(
    gaps: &[PlotGap],
    oscillator: &Oscillator,
    events: &[Event],
    trace: &[Sample],
) -> [Option<Side>; MOST_GAPS] {
    let mut contacts = [None; MOST_GAPS];
    for gap in gaps {
        contacts[gap.index] = gap.contact_at_start(oscillator, events, trace);
    }
    contacts
}

/// Returns the positions and the contact laws of the walls on a side of a gap.
fn walls(oscillator: &Oscillator, gap: usize, side: Side) -> Vec<(f64, Contact)> {
    oscillator.gaps[gap].walls[side.index()].iter().map(|wall| (wall.at, wall.contact)).collect()
}
