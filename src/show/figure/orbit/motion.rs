//! The motion as polylines with exact corners, merged from a trace and its events.

use std::collections::BTreeSet;

use rattlemap_dynamics::model::{Side, State};
use rattlemap_dynamics::orbit::{Event, EventKind, Orbit, Sample};

/// The motion between two events.
pub(crate) struct Piece {
    /// Wall that the teeth mesh on; none in free motion.
    pub(crate) meshing: Option<Side>,
    /// Times in forcing periods and states in order, at least one.
    pub(crate) points: Vec<(f64, State)>,
}

impl Piece {
    /// Returns start and end in forcing periods.
    pub(crate) fn span(&self) -> (f64, f64) {
        (self.points[0].0, self.points[self.points.len() - 1].0)
    }
}

/// The motion of an orbit.
pub(crate) struct Motion {
    pub(crate) pieces: Vec<Piece>,
    /// Events within the trace, with their times in forcing periods.
    pub(crate) events: Vec<(f64, Event)>,
}

impl Motion {
    /// Merges trace and events. States that are not finite are skipped.
    pub(crate) fn new(orbit: &Orbit, trace: &[Sample]) -> Motion {
        let period = if orbit.forcing_period > 0.0 { orbit.forcing_period } else { 1.0 };
        let finite = |t: f64, state: &State| t.is_finite() && state.iter().all(|v| v.is_finite());
        // The events of a chaotic orbit may continue after the trace. Those up to one sample after its end belong to it.
        let end = match trace {
            [] => f64::INFINITY,
            [only] => only.t,
            [.., previous, last] => last.t + (last.t - previous.t),
        };
        let on_trace = |e: &&Event| e.t <= end && finite(e.t, &e.before) && finite(e.t, &e.after);
        let events: Vec<(f64, Event)> =
            orbit.events.iter().filter(on_trace).map(|e| (e.t / period, *e)).collect();
        let mut pieces = Pieces::starting_in(trace.first().and_then(|s| s.meshing));
        let mut next = events.iter().peekable();
        for sample in trace.iter().filter(|s| finite(s.t, &s.state)) {
            let t = sample.t / period;
            while let Some((at, event)) = next.next_if(|(at, _)| *at <= t) {
                pieces.cross(*at, event);
            }
            pieces.push(t, sample);
        }
        next.for_each(|(at, event)| pieces.cross(*at, event));
        Motion { pieces: pieces.finished(), events }
    }

    /// Whether the motion contains meshing.
    pub(crate) fn meshes(&self) -> bool {
        self.pieces.iter().any(|piece| piece.meshing.is_some())
    }

    /// Returns the kinds of events that occur, in the order of a legend.
    pub(crate) fn kinds(&self) -> Vec<EventKind> {
        let all = [EventKind::Impact, EventKind::MeshStart, EventKind::MeshEnd];
        all.into_iter().filter(|kind| self.events.iter().any(|(_, e)| e.kind == *kind)).collect()
    }

    /// Returns the walls with events or meshing.
    pub(crate) fn walls(&self) -> BTreeSet<Side> {
        let meshing = self.pieces.iter().filter_map(|piece| piece.meshing);
        self.events.iter().map(|(_, e)| e.side).chain(meshing).collect()
    }

    /// Returns all states with their times in forcing periods.
    pub(crate) fn points(&self) -> impl Iterator<Item = (f64, &State)> {
        self.pieces.iter().flat_map(|piece| piece.points.iter().map(|(t, state)| (*t, state)))
    }
}

/// Pieces under construction. The last one is open.
struct Pieces(Vec<Piece>);

impl Pieces {
    fn starting_in(meshing: Option<Side>) -> Pieces {
        Pieces(vec![Piece { meshing, points: Vec::new() }])
    }

    fn open(&mut self) -> &mut Piece {
        self.0.last_mut().expect("there is always an open piece")
    }

    /// Ends a piece at an event and starts the next.
    fn cross(&mut self, t: f64, event: &Event) {
        self.open().points.push((t, event.before));
        let meshing = (event.kind == EventKind::MeshStart).then_some(event.side);
        self.0.push(Piece { meshing, points: vec![(t, event.after)] });
    }

    fn push(&mut self, t: f64, sample: &Sample) {
        let piece = self.open();
        // A sample at the time of an event may hold the state before or after it.
        if piece.points.last().is_some_and(|(last, _)| t <= *last) {
            return;
        }
        piece.points.push((t, sample.state));
        if piece.meshing != sample.meshing {
            // The events span less than the trace, so this change has no event.
            self.0.push(Piece { meshing: sample.meshing, points: vec![(t, sample.state)] });
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
    use rattlemap_dynamics::model::{GearPair, REST};
    use rattlemap_dynamics::orbit::{Settings, analyse};

    fn orbit(events: Vec<Event>) -> Orbit {
        let orbit = analyse(&GearPair::paper(0.605), REST, &Settings::default()).unwrap();
        Orbit { events, strobe_meshing: None, forcing_period: 2.0, ..orbit }
    }

    fn event(kind: EventKind, t: f64) -> Event {
        let (before, after) = ([0.5, 1.0, 0.0, 0.0], [0.5, 0.2, 0.0, 0.8]);
        Event { kind, side: Side::Right, t, t_mod_period: t % 2.0, before, after }
    }

    fn sample(t: f64, meshing: Option<Side>) -> Sample {
        Sample { t, state: [t, 0.0, 0.0, 0.0], meshing }
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
        let motion = Motion::new(&orbit(events), &trace);
        let modes: Vec<_> = motion.pieces.iter().map(|p| p.meshing).collect();
        assert_eq!(modes, [None, None, meshing, None]);
        assert_eq!(motion.pieces[0].points.last().unwrap().1, [0.5, 1.0, 0.0, 0.0]);
        assert_eq!(motion.pieces[1].points[0], (0.25, [0.5, 0.2, 0.0, 0.8]));
        // The sample at the start of meshing is skipped.
        assert_eq!(motion.pieces[2].points.len(), 3);
        assert_eq!(motion.pieces[3].span(), (0.8, 1.0));
    }

    #[test]
    fn incomplete_data_are_accepted() {
        assert!(Motion::new(&orbit(vec![]), &[]).pieces.is_empty());
        let late =
            Motion::new(&orbit(vec![event(EventKind::Impact, 9.0)]), &[sample(0.0, None), sample(1.0, None)]);
        assert!(late.events.is_empty());
        let without_event = [sample(0.0, None), sample(1.0, Some(Side::Left)), sample(2.0, None)];
        assert_eq!(Motion::new(&orbit(vec![]), &without_event).pieces.len(), 3);
        let mut broken = sample(1.0, None);
        broken.state[2] = f64::NAN;
        assert_eq!(Motion::new(&orbit(vec![]), &[sample(0.0, None), broken]).points().count(), 1);
    }
}
