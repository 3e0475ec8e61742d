//! The parts that figures of an orbit share: axes, lines, markers, legend entries. Lengths are in pixels.

use std::collections::BTreeSet;

use crate::model_file::subjects;
use crate::show::color::Color;
use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::Frame;
use crate::show::drawing::legend::{Entry, Key};
use crate::show::drawing::{Canvas, DARK, FAINT, MESHING, Marker, Point, Shape, wall_color};
use crate::show::figure::orbit::gaps::{PlotGap, contacts_at_start};
use crate::show::figure::orbit::heading;
use crate::show::figure::orbit::motion::DrawnMotion;
use crate::show::names;
use crate::show::symbols::{symbol, with_unit};
use crate::show::table::orbit_tables;
use rattlemap_dynamics::model::{Contact, Model, ModelError, Oscillator, Side, State, Units};
use rattlemap_dynamics::orbit::{
    Class, Event, EventKind, History, Orbit, Sample, SlipKind, SlipPoint, is_reached,
};

/// Default width of all figures of an orbit, and least distance of panels from the left edge.
pub(crate) const ORBIT_WIDTH: f64 = 1600.0;
pub(crate) const ORBIT_LEFT: f64 = 130.0;
/// Widths of the lines of free motion and of meshing.
pub(crate) const FREE_LINE: f64 = 2.2;
const MESHING_LINE: f64 = 4.0;

/// An orbit and its labels.
pub struct OrbitPlot<'a> {
    /// Symbols of the state's components.
    pub(crate) names: Vec<String>,
    pub(crate) units: Units,
    pub(crate) bodies: Vec<&'a str>,
    pub(crate) oscillator: Oscillator,
    pub(crate) gaps: Vec<PlotGap>,
    pub(crate) motion: DrawnMotion,
    /// Events of friction within the trace, with their times.
    slips: Vec<(f64, SlipPoint)>,
    /// Names of the signals with their units, and their values with times.
    signals: Vec<(String, Vec<Point>)>,
    /// Label of the axis of time.
    time: String,
    /// Length of the cycle in forcing periods; none if the motion is not periodic.
    pub(crate) cycle: Option<f64>,
    pub(crate) title: String,
    pub(crate) subtitle: String,
}

impl<'a> OrbitPlot<'a> {
    /// Prepares the figures of an orbit.
    ///
    /// `trace` holds samples in order of time, from phase 0 on, over at least one forcing period. The events of `orbit` are
    /// merged into it, so that corners and velocity jumps are exact. There may be no events and no samples; states that are not
    /// finite are skipped.
    ///
    /// # Errors
    /// [`ModelError`] if the model is not valid.
    pub fn new(model: &'a dyn Model, orbit: &Orbit, trace: &[Sample]) -> Result<OrbitPlot<'a>, ModelError> {
        let cycle = matches!(orbit.class, Class::Periodic { .. }).then_some(f64::from(orbit.cycle_periods));
        let turns = trace.last().map_or(1.0, |last| last.t / orbit.forcing_period);
        let samples_per_period = ((trace.len() as f64 - 1.0) / turns).round().max(1.0) as usize;
        let history = orbit_tables::sampled(orbit, trace.to_vec(), samples_per_period);
        let plot = OrbitPlot::of(model, &history, orbit.forcing_period, heading::character(model, orbit))?;
        Ok(OrbitPlot { cycle, ..plot })
    }

    /// Prepares the figure of a motion from `start`. Its times are not divided by the forcing period.
    ///
    /// # Errors
    /// [`ModelError`] if the model is not valid.
    pub fn of_history(
        model: &'a dyn Model,
        start: &State,
        history: &History,
    ) -> Result<OrbitPlot<'a>, ModelError> {
        let plot = OrbitPlot::of(model, history, 1.0, heading::from_start(model, start))?;
        Ok(OrbitPlot { time: with_unit("time, t", plot.units.time.as_deref()), ..plot })
    }

    fn of(
        model: &'a dyn Model,
        history: &History,
        unit_of_time: f64,
        subtitle: String,
    ) -> Result<OrbitPlot<'a>, ModelError> {
        let History { samples: trace, events, slips, .. } = history;
        let oscillator = model.oscillator()?;
        let gaps = PlotGap::all(model, &oscillator);
        let contacts = contacts_at_start(&gaps, &oscillator, events, trace);
        Ok(OrbitPlot {
            names: model.state_names().into_iter().map(symbol).collect(),
            units: model.units(),
            bodies: model.bodies(),
            motion: DrawnMotion::new(events, trace, contacts, unit_of_time),
            slips: slips_within(slips, trace, unit_of_time),
            signals: signals(model, history, unit_of_time)?,
            time: format!("time in {}, t / T", oscillator.timing.names()[1]),
            oscillator,
            gaps,
            cycle: None,
            title: heading::parameters(model),
            subtitle,
        })
    }

    /// Returns the gaps whose contact colours the motion of a displacement: those that depend on it. With one gap it is that one.
    pub(crate) fn gaps_of(&self, displacement: usize) -> Vec<usize> {
        let depends = |gap: &usize| self.oscillator.gap_row(*gap)[displacement] != 0.0;
        (0..self.gaps.len()).filter(|gap| self.gaps.len() == 1 || depends(gap)).collect()
    }

    /// Draws the motion in its colours, free and in contact at one of these gaps.
    pub(crate) fn draw_lines(
        &self,
        canvas: &Canvas,
        frame: &Frame,
        gaps: &[usize],
        (free, meshing): (Color, Color),
        at: impl Fn(f64, &State) -> Point,
    ) {
        // Many turns in one panel need a thinner line.
        let thin = if self.motion.pieces.len() > 100 { 0.6 } else { 1.0 };
        for piece in &self.motion.pieces {
            let (color, width) = match free != meshing && piece.is_in_contact(gaps) {
                true => (meshing, MESHING_LINE),
                false => (free, FREE_LINE),
            };
            let path = piece.points.iter().map(|(t, state)| at(*t, state)).map(|(x, y)| frame.at(x, y));
            let path: Vec<_> = path.collect();
            canvas.stroke(&path, width * thin, color);
            // A motion at rest is a point that needs a larger marker to be visible.
            if path.iter().all(|p| (p.0 - path[0].0).hypot(p.1 - path[0].1) < 3.0)
                && self.motion.pieces.len() == 1
            {
                canvas.marker(path[0], Marker::dot(color, 6.0));
            }
        }
    }

    /// Draws the velocity jumps of events.
    pub(crate) fn draw_jumps(&self, canvas: &Canvas, frame: &Frame, at: impl Fn(f64, &State) -> Point) {
        for (t, event) in &self.motion.events {
            let [from, to] = [at(*t, &event.before), at(*t, &event.after)].map(|(x, y)| frame.at(x, y));
            canvas.dashes(&[from, to], 1.3, FAINT);
        }
    }

    /// Draws markers of the events of these gaps, meshing above impacts. With `both`, impacts have markers before and after.
    pub(crate) fn draw_markers(
        &self,
        canvas: &Canvas,
        frame: &Frame,
        gaps: &[usize],
        both: bool,
        at: impl Fn(f64, &State) -> Point,
    ) {
        for kind in self.motion.kinds() {
            let is_shown = |event: &Event| event.kind == kind && gaps.contains(&event.gap);
            for (t, event) in self.motion.events.iter().filter(|(_, event)| is_shown(event)) {
                let marker = self.marker(kind, wall_color(event.side));
                let [before, after] =
                    [at(*t, &event.before), at(*t, &event.after)].map(|(x, y)| frame.at(x, y));
                let twice = both && kind == EventKind::Impact;
                if twice {
                    canvas.marker(before, marker);
                }
                canvas.marker(after, Marker { hollow: twice, ..marker });
            }
        }
        for (t, slip) in &self.slips {
            let (x, y) = at(*t, &slip.state);
            canvas.marker(frame.at(x, y), self.slip_marker(slip.kind));
        }
    }

    /// Returns the marker of an event.
    fn marker(&self, kind: EventKind, color: Color) -> Marker {
        Marker { shape: Shape::of(kind), ..Marker::dot(color, self.radius()) }
    }

    /// Returns the marker of a change of friction: filled where sticking begins, hollow where it ends, small where sliding reverses.
    fn slip_marker(&self, kind: SlipKind) -> Marker {
        let radius = if kind == SlipKind::Reversal { 0.6 * self.radius() } else { self.radius() };
        let dot = Marker::dot(DARK, radius);
        Marker { shape: Shape::Diamond, hollow: kind == SlipKind::Slip, ..dot }
    }

    /// Returns the radius of markers, which are smaller if there are many events.
    fn radius(&self) -> f64 {
        match self.motion.events.len() + self.slips.len() {
            0..=40 => 7.0,
            41..=150 => 5.0,
            _ => 3.5,
        }
    }

    /// Returns the legend: the motion, the events, and the walls. With `both`, impacts have states before and after.
    pub(crate) fn legend(&self, motion: Vec<Entry>, both: bool) -> Vec<Entry> {
        let mut entries = motion;
        for kind in self.motion.kinds() {
            let marker = Marker { radius: 7.0, ..self.marker(kind, DARK) };
            let (key, text) = match kind {
                EventKind::Impact if both => (Key::MarkerPair(marker), "impact: before, after".to_owned()),
                EventKind::Impact => (Key::Marker(marker), "impact".to_owned()),
                EventKind::MeshStart => (Key::Marker(marker), format!("{} starts", self.contact_name())),
                EventKind::MeshEnd => (Key::Marker(marker), format!("{} ends", self.contact_name())),
            };
            entries.push(Entry::new(key, &text));
        }
        let names = ["sticking begins", "sticking ends", "sliding reverses"];
        for (kind, name) in SlipKind::ALL.into_iter().zip(names) {
            let occurs = self.slips.iter().any(|(_, slip)| slip.kind == kind);
            entries.extend(occurs.then(|| Entry::new(Key::Marker(self.slip_marker(kind)), name)));
        }
        if both && self.motion.events.iter().any(|(_, event)| event.before != event.after) {
            entries.push(Entry::new(Key::Dashes { color: FAINT }, "velocity jump"));
        }
        let reached: BTreeSet<Side> = self.gaps.iter().flat_map(|gap| self.motion.walls(gap.index)).collect();
        for side in reached {
            let patch = Key::Patch { color: wall_color(side), opacity: 1.0 };
            entries.push(Entry::new(patch, &format!("{} wall", names::side(side))));
        }
        entries
    }

    /// Returns the legend entries of free motion and, if it occurs, of meshing.
    pub(crate) fn motion_entries(&self, free: &str) -> Vec<Entry> {
        let mut entries = vec![Entry::new(Key::Line { color: DARK, width: FREE_LINE }, free)];
        let key = Key::Line { color: MESHING, width: MESHING_LINE };
        entries.extend(self.motion.meshes().then(|| Entry::new(key, self.contact_name())));
        entries
    }

    /// Returns the name of sustained contact: meshing if a wall has impacts, else contact.
    pub(crate) fn contact_name(&self) -> &'static str {
        let has_impacts =
            |gap: &PlotGap| Side::BOTH.iter().any(|side| gap.contact(*side) == Some(Contact::Impact));
        if self.gaps.iter().any(has_impacts) { "meshing" } else { "contact" }
    }

    /// Returns the indices of all gaps.
    pub(crate) fn all_gaps(&self) -> Vec<usize> {
        self.gaps.iter().map(|gap| gap.index).collect()
    }

    /// Returns the displacements of a motion that counts as decayed, the smallest of all gaps.
    pub(crate) fn decayed(&self) -> f64 {
        self.gaps.iter().map(PlotGap::decayed).fold(f64::INFINITY, f64::min)
    }

    /// Returns the axis of time.
    pub(crate) fn time_axis(&self) -> Axis {
        let mut times = self.motion.points().map(|(t, _)| t);
        let first = times.next().unwrap_or(0.0);
        let last = times.fold(first, f64::max);
        let end = if last > first { last } else { first + 1.0 };
        Axis::exact(&self.time, first, end)
    }

    /// Returns the axes of the signals.
    pub(crate) fn signal_axes(&self) -> impl Iterator<Item = Axis> + '_ {
        let values = |line: &[Point]| line.iter().map(|point| point.1).collect::<Vec<_>>();
        self.signals
            .iter()
            .map(move |(label, line)| Axis::around(label, values(line).into_iter(), self.decayed()))
    }

    /// Draws each signal in one of these panels.
    pub(crate) fn draw_signals(&self, canvas: &Canvas, frames: &[Frame]) {
        for (frame, (_, line)) in frames.iter().zip(&self.signals) {
            frame.draw_grid(canvas);
            let path: Vec<_> = line.iter().map(|&(t, value)| frame.at(t, value)).collect();
            canvas.stroke(&path, FREE_LINE, DARK);
        }
    }

    /// Returns an axis for components of the state, with their unit if they have the same one. `scale` is their scale
    /// relative to a displacement.
    pub(crate) fn state_axis(&self, label: &str, components: &[usize], scale: f64) -> Axis {
        let values = self.motion.points().flat_map(|(_, state)| components.iter().map(|i| state[*i]));
        let mut units = components.iter().map(|i| self.units.component(*i));
        let unit = units.next().flatten().filter(|first| units.all(|unit| unit.as_ref() == Some(first)));
        Axis::around(&with_unit(label, unit.as_deref()), values, self.decayed() * scale)
    }
}

/// Returns the signals along a motion, with times divided by `unit`.
fn signals(model: &dyn Model, history: &History, unit: f64) -> Result<Vec<(String, Vec<Point>)>, ModelError> {
    let (names, units) = (subjects(model).signals, model.units().signals);
    if names.is_empty() {
        return Ok(Vec::new());
    }
    let moments = orbit_tables::moments(model, history)?;
    let line = |i: usize| -> Vec<Point> {
        let points = moments.iter().map(|moment| (moment.t / unit, moment.outputs.signals[i]));
        points.filter(|(t, value)| t.is_finite() && value.is_finite()).collect()
    };
    let labelled = names.iter().zip(units).enumerate();
    Ok(labelled.map(|(i, (name, unit))| (with_unit(&symbol(name), unit.as_deref()), line(i))).collect())
}

/// Returns the events of friction before the end of the trace, with their times divided by `unit`.
fn slips_within(slips: &[SlipPoint], trace: &[Sample], unit: f64) -> Vec<(f64, SlipPoint)> {
    let end = trace.last().map_or(f64::INFINITY, |last| last.t);
    slips.iter().filter(|slip| is_reached(slip.t, end)).map(|slip| (slip.t / unit, *slip)).collect()
}
