//! The motion as polylines with exact corners, merged from a trace and its events.

use std::collections::BTreeSet;

use rattlemap_dynamics::model::{MOST_GAPS, Side, State};
use rattlemap_dynamics::orbit::{Event, EventKind, Sample, is_reached};

/// The motion between two events.
pub(crate) struct Piece {
    /// For each gap the side of the wall that it is in contact with; none in free motion.
    pub(crate) contacts: [Option<Side>; MOST_GAPS],
    /// Times and states in order, at least one.
    pub(crate) points: Vec<(f64, State)>,
}

impl Piece {
    /// Whether one of these gaps is in contact.
    pub(crate) fn is_in_contact(&self, gaps: &[usize]) -> bool {
        gaps.iter().any(|gap| self.contacts[*gap].is_some())
    }

    /// Returns the times of start and end.
    pub(crate) fn span(&self) -> (f64, f64) {
        (self.points[0].0, self.points[self.points.len() - 1].0)
    }
}

/// The motion of an orbit. Its times are in forcing periods, or in the model's unit for a motion from the start.
pub(crate) struct DrawnMotion {
    pub(crate) pieces: Vec<Piece>,
    /// Events within the trace, with their times.
    pub(crate) events: Vec<(f64, Event)>,
}

impl DrawnMotion {
    /// Merges trace and events, and divides times by `unit`. `contacts` holds for each gap the side of the contact at the start of the
    /// trace. States that are not finite are skipped.
    pub(crate) fn new(
        events: &[Event],
        trace: &[Sample],
        contacts: [Option<Side>; MOST_GAPS],
        unit: f64,
    ) -> DrawnMotion {
        let unit = if unit > 0.0 { unit } else { 1.0 };
        let finite = |t: f64, state: &State| t.is_finite() && state.iter().all(|v| v.is_finite());
        // The events of a chaotic orbit may continue after the trace. Those up to one sample after its end belong to it.
        let end = match trace {
            [] => f64::INFINITY,
            [only] => only.t,
            [.., previous, last] => last.t + (last.t - previous.t),
        };
        let on_trace = |e: &&Event| e.t <= end && finite(e.t, &e.before) && finite(e.t, &e.after);
        let events: Vec<(f64, Event)> = events.iter().filter(on_trace).map(|e| (e.t / unit, *e)).collect();
        let mut pieces = Pieces::starting_in(contacts);
        let mut next = events.iter().peekable();
        for sample in trace.iter().filter(|s| finite(s.t, &s.state)) {
            while let Some((at, event)) = next.next_if(|(_, event)| is_reached(event.t, sample.t)) {
                pieces.cross(*at, event);
            }
            pieces.push(sample.t / unit, sample);
        }
        next.for_each(|(at, event)| pieces.cross(*at, event));
        DrawnMotion { pieces: pieces.finished(), events }
    }

    /// Whether the motion contains contact that lasts, of any gap.
    pub(crate) fn meshes(&self) -> bool {
        self.pieces.iter().any(|piece| piece.contacts.iter().any(Option::is_some))
    }

    /// Returns the walls of a gap with contact that lasts.
    pub(crate) fn meshing_walls(&self, gap: usize) -> BTreeSet<Side> {
        self.pieces.iter().filter_map(|piece| piece.contacts[gap]).collect()
    }

    /// Returns the kinds of events that occur, in the order of a legend.
    pub(crate) fn kinds(&self) -> Vec<EventKind> {
        let all = [EventKind::Impact, EventKind::MeshStart, EventKind::MeshEnd];
        all.into_iter().filter(|kind| self.events.iter().any(|(_, e)| e.kind == *kind)).collect()
    }

    /// Returns the walls of a gap with events or contact.
    pub(crate) fn walls(&self, gap: usize) -> BTreeSet<Side> {
        let events = self.events.iter().filter(|(_, event)| event.gap == gap);
        events.map(|(_, event)| event.side).chain(self.meshing_walls(gap)).collect()
    }

    /// Returns all states with their times.
    pub(crate) fn points(&self) -> impl Iterator<Item = (f64, &State)> {
        self.pieces.iter().flat_map(|piece| piece.points.iter().map(|(t, state)| (*t, state)))
    }
}

/// Pieces under construction. The last one is open.
struct Pieces(Vec<Piece>);

impl Pieces {
    fn starting_in(contacts: [Option<Side>; MOST_GAPS]) -> Pieces {
        Pieces(vec![Piece { contacts, points: Vec::new() }])
    }

    fn open(&mut self) -> &mut Piece {
        self.0.last_mut().expect("there is always an open piece")
    }

    /// Ends a piece at an event and starts the next.
    fn cross(&mut self, t: f64, event: &Event) {
        self.open().points.push((t, event.before));
        let mut contacts = self.open().contacts;
        contacts[event.gap] = event.meshing;
        self.0.push(Piece { contacts, points: vec![(t, event.after)] });
    }

    fn push(&mut self, t: f64, sample: &Sample) {
        let piece = self.open();
        // A sample at the time of an event may hold the state before or after it.
        if piece.points.last().is_some_and(|(last, _)| t <= *last) {
            return;
        }
        piece.points.push((t, sample.state));
        let mut contacts = piece.contacts;
        // Samples tell the contact of the first gap.
        contacts[0] = sample.meshing;
        if piece.contacts != contacts {
            // The events span less than the trace, so this change has no event.
            self.0.push(Piece { contacts, points: vec![(t, sample.state)] });
        }
    }

    fn finished(mut self) -> Vec<Piece> {
        self.0.retain(|piece| !piece.points.is_empty());
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::model::state;

    const FREE: [Option<Side>; MOST_GAPS] = [None; MOST_GAPS];

    fn event(kind: EventKind, t: f64) -> Event {
        let (before, after) = (state(&[0.5, 1.0]), state(&[0.5, 0.2, 0.0, 0.8]));
        let meshing = (kind == EventKind::MeshStart).then_some(Side::Right);
        Event { kind, gap: 0, side: Side::Right, t, t_mod_period: t % 2.0, before, after, meshing }
    }

    fn sample(t: f64, meshing: Option<Side>) -> Sample {
        Sample { t, state: state(&[t]), meshing }
    }

    #[test]
    fn pieces_end_in_the_exact_states_of_events() {
        let meshing = Some(Side::Right);
        let events = vec![
            event(EventKind::Impact, 0.5),
            event(EventKind::MeshStart, 1.0),
            event(EventKind::MeshEnd, 1.6),
        ];
        let trace = [
            sample(0.0, None),
            sample(0.8, None),
            sample(1.0, None),
            sample(1.5, meshing),
            sample(2.0, None),
        ];
        let motion = DrawnMotion::new(&events, &trace, FREE, 2.0);
        let modes: Vec<_> = motion.pieces.iter().map(|p| p.contacts[0]).collect();
        assert_eq!(modes, [None, None, meshing, None]);
        assert_eq!(motion.pieces[0].points.last().unwrap().1, state(&[0.5, 1.0]));
        assert_eq!(motion.pieces[1].points[0], (0.25, state(&[0.5, 0.2, 0.0, 0.8])));
        // The sample at the start of meshing is skipped.
        assert_eq!(motion.pieces[2].points.len(), 3);
        assert_eq!(motion.pieces[3].span(), (0.8, 1.0));
    }

    #[test]
    fn each_gap_has_contacts_of_its_own() {
        let (right, left) = (Some(Side::Right), Some(Side::Left));
        let of_second = |event: Event| Event { gap: 1, side: Side::Left, ..event };
        let events = [
            event(EventKind::MeshStart, 0.5),
            of_second(event(EventKind::MeshEnd, 1.0)),
            event(EventKind::MeshEnd, 1.5),
        ];
        let trace = [sample(0.0, None), sample(0.7, right), sample(1.2, right), sample(2.0, None)];
        let motion = DrawnMotion::new(&events, &trace, [None, left, None, None, None, None], 2.0);
        let contacts: Vec<_> =
            motion.pieces.iter().map(|piece| [piece.contacts[0], piece.contacts[1]]).collect();
        assert_eq!(contacts, [[None, left], [right, left], [right, None], [None; 2]]);
        assert_eq!(motion.meshing_walls(1).len(), 1);
        assert!(motion.pieces[2].is_in_contact(&[0, 1]) && !motion.pieces[2].is_in_contact(&[1]));
        assert_eq!([0, 1, 2].map(|gap| motion.walls(gap).len()), [1, 1, 0]);
    }

    #[test]
    fn incomplete_data_are_accepted() {
        assert!(DrawnMotion::new(&[], &[], FREE, 2.0).pieces.is_empty());
        let late = DrawnMotion::new(
            &[event(EventKind::Impact, 9.0)],
            &[sample(0.0, None), sample(1.0, None)],
            FREE,
            2.0,
        );
        assert!(late.events.is_empty());
        let without_event = [sample(0.0, None), sample(1.0, Some(Side::Left)), sample(2.0, None)];
        assert_eq!(DrawnMotion::new(&[], &without_event, FREE, 2.0).pieces.len(), 3);
        let mut broken = sample(1.0, None);
        broken.state[2] = f64::NAN;
        assert_eq!(DrawnMotion::new(&[], &[sample(0.0, None), broken], FREE, 2.0).points().count(), 1);
    }
}
