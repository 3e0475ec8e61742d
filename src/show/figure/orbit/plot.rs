//! The parts that figures of an orbit share: axes, lines, markers, legend entries. Lengths are in pixels.

use crate::show::color::Color;
use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::Frame;
use crate::show::drawing::legend::{Entry, Key};
use crate::show::drawing::{Canvas, DARK, FAINT, MESHING, Marker, Point, Shape, wall_color};
use crate::show::figure::orbit::heading;
use crate::show::figure::orbit::motion::Motion;
use crate::show::names;
use crate::show::symbols::{symbol, with_unit};
use crate::show::wall_labels::WallLabels;
use rattlemap_dynamics::model::{Contact, Model, ModelError, Oscillator, Side, State, Units};
use rattlemap_dynamics::orbit::{Class, EventKind, History, Orbit, Sample};

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
    pub(crate) walls: WallLabels,
    pub(crate) motion: Motion,
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
        let motion = Motion::new(&orbit.events, trace, orbit.forcing_period);
        let plot = OrbitPlot::of(model, motion, heading::character(model, orbit))?;
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
        let motion = Motion::new(&history.events, &history.samples, 1.0);
        let plot = OrbitPlot::of(model, motion, heading::from_start(model, start))?;
        Ok(OrbitPlot { time: with_unit("time, t", plot.units.time.as_deref()), ..plot })
    }

    fn of(model: &'a dyn Model, motion: Motion, subtitle: String) -> Result<OrbitPlot<'a>, ModelError> {
        Ok(OrbitPlot {
            names: model.state_names().into_iter().map(symbol).collect(),
            units: model.units(),
            bodies: model.bodies(),
            oscillator: model.oscillator()?,
            walls: WallLabels::of(model),
            motion,
            time: "time in forcing periods, t / T".to_owned(),
            cycle: None,
            title: heading::parameters(model),
            subtitle,
        })
    }

    /// Draws the motion in its colours, free and meshing.
    pub(crate) fn draw_lines(
        &self,
        canvas: &Canvas,
        frame: &Frame,
        (free, meshing): (Color, Color),
        at: impl Fn(f64, &State) -> Point,
    ) {
        // Many turns in one panel need a thinner line.
        let thin = if self.motion.pieces.len() > 100 { 0.6 } else { 1.0 };
        for piece in &self.motion.pieces {
            let (color, width) = match piece.meshing {
                Some(_) if free != meshing => (meshing, MESHING_LINE),
                _ => (free, FREE_LINE),
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
            canvas.dashes(from, to, 1.3, FAINT);
        }
    }

    /// Draws markers of the events, meshing above impacts. With `both`, impacts have markers before and after.
    pub(crate) fn draw_markers(
        &self,
        canvas: &Canvas,
        frame: &Frame,
        both: bool,
        at: impl Fn(f64, &State) -> Point,
    ) {
        for kind in self.motion.kinds() {
            for (t, event) in self.motion.events.iter().filter(|(_, event)| event.kind == kind) {
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
    }

    /// Returns the marker of an event. Markers are smaller if there are many events.
    fn marker(&self, kind: EventKind, color: Color) -> Marker {
        let radius = match self.motion.events.len() {
            0..=40 => 7.0,
            41..=150 => 5.0,
            _ => 3.5,
        };
        Marker { shape: Shape::of(kind), ..Marker::dot(color, radius) }
    }

    /// Returns the legend: the motion, the events, and the walls. With `both`, impacts have states before and after.
    pub(crate) fn legend(&self, motion: Vec<Entry>, both: bool) -> Vec<Entry> {
        let mut entries = motion;
        for kind in self.motion.kinds() {
            let marker = Marker { radius: 7.0, ..self.marker(kind, DARK) };
            entries.push(match kind {
                EventKind::Impact if both => Entry::new(Key::MarkerPair(marker), "impact: before, after"),
                EventKind::Impact => Entry::new(Key::Marker(marker), "impact"),
                EventKind::MeshStart => {
                    Entry::new(Key::Marker(marker), &format!("{} starts", self.contact_name()))
                }
                EventKind::MeshEnd => {
                    Entry::new(Key::Marker(marker), &format!("{} ends", self.contact_name()))
                }
            });
        }
        if both && self.motion.events.iter().any(|(_, event)| event.before != event.after) {
            entries.push(Entry::new(Key::Dashes { color: FAINT }, "velocity jump"));
        }
        for side in self.motion.walls() {
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
        let has_impacts = |side: &Side| self.contact(*side) == Some(Contact::Impact);
        if Side::BOTH.iter().any(has_impacts) { "meshing" } else { "contact" }
    }

    /// Returns the positions of the walls of a side and the widths of their lines, the first wall first.
    pub(crate) fn wall_lines(&self, side: Side) -> impl Iterator<Item = (f64, f64)> {
        let outer = self.oscillator.outer_walls[side.index()].iter().map(|wall| (wall.at, 1.0));
        std::iter::once((self.oscillator.walls[side.index()], 2.0)).chain(outer)
    }

    /// Returns the contact law of a wall; none without a wall.
    pub(crate) fn contact(&self, side: Side) -> Option<Contact> {
        let i = side.index();
        self.oscillator.walls[i].is_finite().then(|| self.oscillator.contacts[i])
    }

    /// Returns the displacements of a motion that counts as decayed: a tenth of half the backlash. With a single wall, which may
    /// be far away, it is a thousandth of the length scale.
    pub(crate) fn decayed(&self) -> f64 {
        let share = if self.oscillator.walls.iter().all(|wall| wall.is_finite()) { 0.1 } else { 1e-3 };
        share * self.oscillator.length_scale()
    }

    /// Returns the axis of time.
    pub(crate) fn time_axis(&self) -> Axis {
        let mut times = self.motion.points().map(|(t, _)| t);
        let first = times.next().unwrap_or(0.0);
        let last = times.fold(first, f64::max);
        let end = if last > first { last } else { first + 1.0 };
        Axis::exact(&self.time, first, end)
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
