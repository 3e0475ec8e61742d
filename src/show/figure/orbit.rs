//! One orbit drawn like Figs 6 to 9 of the paper: phase planes, time history, gap.

mod gap;
mod heading;
mod motion;
pub(crate) mod spectrum;
mod symbols;

use std::path::{Path, PathBuf};

use crate::map::scene::Format;
use crate::show::drawing::axes::{Axis, Frame};
use crate::show::drawing::legend::{Entry, Key, draw_head};
use crate::show::drawing::{
    Align, Canvas, DARK, FAINT, GEAR_1, GEAR_2, MEDIUM, MESHING, Marker, RGBColor, Rect, SMALL, Shape,
    save_figure, wall_color,
};
use crate::show::error::{DrawError, FigureError};
use crate::show::figure::orbit::motion::Motion;
use crate::show::symbols::symbol;
use crate::show::wall_words::{WallWords, name};
use crate::store::error::OutputError;
use rattlemap_dynamics::model::{Contact, Model, Oscillator, Side, State};
use rattlemap_dynamics::orbit::{Class, EventKind, Orbit, Sample};

/// Every file that [`write`] may make.
pub(crate) const NAMES: [&str; 9] = [
    "phase_plane.png",
    "phase_plane.svg",
    "phase_plane.pdf",
    "time_history.png",
    "time_history.svg",
    "time_history.pdf",
    "gap.png",
    "gap.svg",
    "gap.pdf",
];
const WIDTH: u32 = 1600;
const LEFT: f64 = 130.0;
/// Between the two phase planes: room for the labels of the right one.
const BETWEEN: f64 = 150.0;
const LINE: f64 = 2.2;
const MESHING_LINE: f64 = 4.0;
/// Opacity of the bands that show when the teeth mesh.
const BAND: f64 = 0.16;
const TIME_LABEL: &str = "time in forcing periods, t / T";

/// Draws an orbit as `phase_plane`, `time_history` and `gap` in `dir`, each in every one of the `formats` of figures.
///
/// `trace` holds samples in order of time, from phase 0 on, over at least one forcing
/// period; the events of `orbit` are merged into it so that corners and velocity jumps
/// are exact. No events, no trace and states that are not finite are all accepted.
/// Returns the files written.
///
/// # Errors
/// [`OutputError`] for a file that cannot be written, by name, or a model without motion.
pub fn write(
    dir: &Path,
    model: &dyn Model,
    orbit: &Orbit,
    trace: &[Sample],
    formats: &[Format],
) -> Result<Vec<PathBuf>, OutputError> {
    let mut files = Vec::new();
    write_each(model, orbit, trace, formats, |name, save| {
        files.push(dir.join(name));
        Ok(save(&dir.join(name))?)
    })?;
    Ok(files)
}

/// Draws the figures; `place` gets the name of each and what saves it at a path.
pub(crate) fn write_each(
    model: &dyn Model,
    orbit: &Orbit,
    trace: &[Sample],
    formats: &[Format],
    mut place: impl FnMut(&'static str, &dyn Fn(&Path) -> Result<(), FigureError>) -> Result<(), OutputError>,
) -> Result<(), OutputError> {
    let scene = Scene {
        names: model.state_names().into_iter().map(symbol).collect(),
        bodies: model.bodies(),
        oscillator: model.oscillator()?,
        walls: WallWords::of(model),
        motion: Motion::new(orbit, trace),
        cycle: matches!(orbit.class, Class::Periodic { .. }).then_some(f64::from(orbit.cycle_periods)),
        title: heading::parameters(model),
        subtitle: heading::character(model, orbit),
    };
    let mut place_each = |figure: &str, height, draw: &dyn Fn(&Canvas<'_>) -> Result<(), DrawError>| {
        let is_asked =
            |name: &&str| formats.iter().any(|format| *name == format!("{figure}.{}", format.name()));
        NAMES
            .into_iter()
            .filter(is_asked)
            .try_for_each(|name| place(name, &|path| save_figure(path, (WIDTH, height), draw)))
    };
    place_each("phase_plane", 980, &|canvas| scene.draw_phase_planes(canvas))?;
    place_each("time_history", 1150, &|canvas| scene.draw_time_history(canvas))?;
    place_each("gap", 1050, &|canvas| scene.draw_gap(canvas))
}

/// One orbit on its way onto paper.
struct Scene<'a> {
    /// Of the state's components.
    names: Vec<String>,
    bodies: Vec<&'a str>,
    oscillator: Oscillator,
    walls: WallWords,
    motion: Motion,
    /// Forcing periods after which it comes round; none if it does not.
    cycle: Option<f64>,
    title: String,
    subtitle: String,
}

impl Scene<'_> {
    fn draw_phase_planes(&self, canvas: &Canvas<'_>) -> Result<(), DrawError> {
        let mut legend = vec![Entry::new(Key::Line { color: DARK, width: LINE }, "free motion")];
        legend.extend(self.meshing_entry());
        legend.extend(self.event_entries(true));
        let top = draw_head(canvas, &self.title, &self.subtitle, &legend)? + 14.0;
        let whole = canvas.panel(LEFT, top);
        let count = self.bodies.len() as f64;
        let width = (whole.right - whole.left - (count - 1.0) * BETWEEN) / count;
        for (i, body) in self.bodies.iter().enumerate() {
            let left = LEFT + i as f64 * (width + BETWEEN);
            let (x, v) = (2 * i, 2 * i + 1);
            let rect = Rect { left, right: left + width, ..whole };
            let displacement = match symbol(body) == self.names[x] {
                true => format!("displacement, {}", self.names[x]),
                false => format!("displacement of {body}, {}", self.names[x]),
            };
            let frame = Frame {
                rect,
                x: self.state_axis(&displacement, &[x], 1.0),
                y: self.state_axis(&format!("velocity, {}", self.names[v]), &[v], self.oscillator.omega),
            };
            frame.draw_grid(canvas)?;
            self.draw_upright_walls(canvas, &frame, i)?;
            let at = |_: f64, state: &State| (state[x], state[v]);
            self.draw_jumps(canvas, &frame, at)?;
            self.draw_lines(canvas, &frame, (DARK, MESHING), at)?;
            self.draw_markers(canvas, &frame, true, at)?;
            frame.draw_axes(canvas, true)?;
        }
        Ok(())
    }

    fn draw_time_history(&self, canvas: &Canvas<'_>) -> Result<(), DrawError> {
        let colored = || self.bodies.iter().zip([GEAR_1, GEAR_2]).enumerate();
        let line = |(_, (body, color)): (usize, (&&str, RGBColor))| {
            Entry::new(Key::Line { color, width: LINE }, body)
        };
        let mut legend: Vec<Entry> = colored().map(line).collect();
        for side in
            Side::BOTH.into_iter().filter(|s| self.motion.pieces.iter().any(|p| p.meshing == Some(*s)))
        {
            let band = Key::Patch { color: wall_color(side), opacity: BAND };
            legend.push(Entry::new(band, &format!("{}, {} wall", self.lasting(), name(side))));
        }
        legend.extend(self.event_entries(true));
        let top = draw_head(canvas, &self.title, &self.subtitle, &legend)? + 14.0;
        let whole = canvas.panel(LEFT, top);
        let middle = (top + whole.bottom) / 2.0;
        let panels = [
            (0, "displacement, x", 1.0, top, middle - 15.0),
            (1, "velocity, v", self.oscillator.omega, middle + 15.0, whole.bottom),
        ];
        for (quantity, label, scale, top, bottom) in panels {
            let components: Vec<usize> = (quantity..self.names.len()).step_by(2).collect();
            let frame = Frame {
                rect: Rect { top, bottom, ..whole },
                x: self.time_axis(),
                y: self.state_axis(label, &components, scale),
            };
            self.draw_bands(canvas, &frame)?;
            frame.draw_grid(canvas)?;
            for (i, (_, color)) in colored() {
                let index = quantity + 2 * i;
                let at = |t: f64, state: &State| (t, state[index]);
                self.draw_jumps(canvas, &frame, at)?;
                self.draw_lines(canvas, &frame, (color, color), at)?;
                self.draw_markers(canvas, &frame, quantity == 1, at)?;
            }
            frame.draw_axes(canvas, quantity == 1)?;
        }
        Ok(())
    }

    fn draw_bands(&self, canvas: &Canvas<'_>, frame: &Frame) -> Result<(), DrawError> {
        for piece in &self.motion.pieces {
            if let Some(side) = piece.meshing {
                let (from, to) = piece.span();
                canvas.fill(frame.column(from, to), wall_color(side), BAND)?;
            }
        }
        Ok(())
    }

    /// Draws the motion in its colours, free and meshing.
    fn draw_lines(
        &self,
        canvas: &Canvas<'_>,
        frame: &Frame,
        (free, meshing): (RGBColor, RGBColor),
        at: impl Fn(f64, &State) -> (f64, f64),
    ) -> Result<(), DrawError> {
        // Many turns in one panel need a thinner line.
        let thin = if self.motion.pieces.len() > 100 { 0.6 } else { 1.0 };
        for piece in &self.motion.pieces {
            let (color, width) = match piece.meshing {
                Some(_) if free != meshing => (meshing, MESHING_LINE),
                _ => (free, LINE),
            };
            let path = piece.points.iter().map(|(t, state)| at(*t, state)).map(|(x, y)| frame.at(x, y));
            let path: Vec<_> = path.collect();
            canvas.stroke(&path, width * thin, color)?;
            // A gear at rest is a point, and too small to be seen as such.
            if path.iter().all(|p| (p.0 - path[0].0).hypot(p.1 - path[0].1) < 3.0)
                && self.motion.pieces.len() == 1
            {
                canvas.marker(path[0], Marker { shape: Shape::Circle, color, radius: 6.0, hollow: false })?;
            }
        }
        Ok(())
    }

    fn draw_jumps(
        &self,
        canvas: &Canvas<'_>,
        frame: &Frame,
        at: impl Fn(f64, &State) -> (f64, f64),
    ) -> Result<(), DrawError> {
        for (t, event) in &self.motion.events {
            let [from, to] = [at(*t, &event.before), at(*t, &event.after)].map(|(x, y)| frame.at(x, y));
            canvas.dashes(from, to, 1.3, FAINT)?;
        }
        Ok(())
    }

    /// Marks the events, meshing above impacts; with `both`, impacts before and after.
    fn draw_markers(
        &self,
        canvas: &Canvas<'_>,
        frame: &Frame,
        both: bool,
        at: impl Fn(f64, &State) -> (f64, f64),
    ) -> Result<(), DrawError> {
        for kind in self.motion.kinds() {
            for (t, event) in self.motion.events.iter().filter(|(_, event)| event.kind == kind) {
                let marker = self.marker(kind, wall_color(event.side));
                let [before, after] =
                    [at(*t, &event.before), at(*t, &event.after)].map(|(x, y)| frame.at(x, y));
                let twice = both && kind == EventKind::Impact;
                if twice {
                    canvas.marker(before, marker)?;
                }
                canvas.marker(after, Marker { hollow: twice, ..marker })?;
            }
        }
        Ok(())
    }

    /// Smaller where there are many.
    fn marker(&self, kind: EventKind, color: RGBColor) -> Marker {
        let radius = match self.motion.events.len() {
            0..=40 => 7.0,
            41..=150 => 5.0,
            _ => 3.5,
        };
        Marker { shape: Shape::of(kind), color, radius, hollow: false }
    }

    fn meshing_entry(&self) -> Option<Entry> {
        let key = Key::Line { color: MESHING, width: MESHING_LINE };
        self.motion.meshes().then(|| Entry::new(key, self.lasting()))
    }

    /// Legend of the events that occur; with `both`, of states before and after.
    fn event_entries(&self, both: bool) -> Vec<Entry> {
        let mut entries = Vec::new();
        for kind in self.motion.kinds() {
            let marker = Marker { radius: 7.0, ..self.marker(kind, DARK) };
            entries.push(match kind {
                EventKind::Impact if both => Entry::new(Key::MarkerPair(marker), "impact: before, after"),
                EventKind::Impact => Entry::new(Key::Marker(marker), "impact"),
                EventKind::MeshStart => {
                    Entry::new(Key::Marker(marker), &format!("{} starts", self.lasting()))
                }
                EventKind::MeshEnd => Entry::new(Key::Marker(marker), &format!("{} ends", self.lasting())),
            });
        }
        if both && self.motion.events.iter().any(|(_, event)| event.before != event.after) {
            entries.push(Entry::new(Key::Dashes { color: FAINT }, "velocity jump"));
        }
        for side in self.motion.walls() {
            let patch = Key::Patch { color: wall_color(side), opacity: 1.0 };
            entries.push(Entry::new(patch, &format!("{} wall", name(side))));
        }
        entries
    }

    /// What lasting contact is called: teeth mesh behind a wall that hits back, anything else touches.
    fn lasting(&self) -> &'static str {
        let hits = |side: &Side| self.contact(*side) == Some(Contact::Impact);
        if Side::BOTH.iter().any(hits) { "meshing" } else { "contact" }
    }

    /// What a wall is; none where there is no wall.
    fn contact(&self, side: Side) -> Option<Contact> {
        let i = side.index();
        self.oscillator.walls[i].is_finite().then(|| self.oscillator.contacts[i])
    }

    /// The walls that the motion touches, in the plane of a displacement that they stop alone.
    fn draw_upright_walls(
        &self,
        canvas: &Canvas<'_>,
        frame: &Frame,
        displacement: usize,
    ) -> Result<(), DrawError> {
        let Rect { left, top, right, bottom } = frame.rect;
        let gap = self.oscillator.gap;
        if gap[1 - displacement] != 0.0 {
            return Ok(());
        }
        for side in self.motion.walls() {
            let x = frame.at(self.oscillator.walls[side.index()] / gap[displacement], 0.0).0;
            if (left..=right).contains(&x) {
                canvas.stroke(&[(x, top), (x, bottom)], 2.0, wall_color(side))?;
            }
        }
        Ok(())
    }

    /// The displacements of motion that has died down: a tenth of the half backlash. What stands for that with a single
    /// wall, which may be far, is less certain, and a smaller share of it is taken.
    fn died_down(&self) -> f64 {
        let share = if self.oscillator.walls.iter().all(|wall| wall.is_finite()) { 0.1 } else { 1e-3 };
        share * self.oscillator.length_scale()
    }

    fn time_axis(&self) -> Axis {
        let (first, last) = self.motion.points().fold((0f64, 0f64), |(a, b), (t, _)| (a.min(t), b.max(t)));
        Axis::exact(TIME_LABEL, first, if last > first { last } else { first + 1.0 })
    }

    /// An axis for components of the state; `scale` is theirs relative to a displacement.
    fn state_axis(&self, label: &str, components: &[usize], scale: f64) -> Axis {
        let values = self.motion.points().flat_map(|(_, state)| components.iter().map(|i| state[*i]));
        Axis::around(label, values, self.died_down() * scale)
    }
}
