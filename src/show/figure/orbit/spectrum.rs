//! The spectrum of gap and velocity, one below the other.

use std::path::Path;

use crate::map::scene::Format;
use crate::show::drawing::axes::{Axis, Frame};
use crate::show::drawing::legend::draw_head;
use crate::show::drawing::{Canvas, DARK, GEAR_2, Marker, Rect, Shape, save_figure};
use crate::show::error::{DrawError, FigureError};
use crate::show::figure::orbit::{LEFT, LINE, WIDTH, heading};
use crate::show::orbit_spectrum::Spectrum;
use crate::show::wall_words::WallWords;
use crate::store::error::OutputError;
use rattlemap_dynamics::model::Model;
use rattlemap_dynamics::orbit::Orbit;

/// Lines below this share of the largest are rounding or folded back, and are not shown.
const FLOOR: f64 = 1e-5;

/// Lines that can be told apart as such.
const APART: usize = 200;

/// Every file that [`write_each`] may make.
pub(crate) const NAMES: [&str; 3] = ["spectrum.png", "spectrum.svg", "spectrum.pdf"];

/// Draws a spectrum in each of the `formats` of figures; `place` gets the name of each and what saves it at a path.
///
/// # Errors
/// As `place`.
pub(crate) fn write_each(
    model: &dyn Model,
    orbit: &Orbit,
    spectrum: &Spectrum,
    formats: &[Format],
    mut place: impl FnMut(&'static str, &dyn Fn(&Path) -> Result<(), FigureError>) -> Result<(), OutputError>,
) -> Result<(), OutputError> {
    let is_asked = |name: &&str| formats.iter().any(|format| *name == format!("spectrum.{}", format.name()));
    NAMES
        .into_iter()
        .filter(is_asked)
        .try_for_each(|name| place(name, &|path| save(path, model, orbit, spectrum)))
}

fn save(path: &Path, model: &dyn Model, orbit: &Orbit, spectrum: &Spectrum) -> Result<(), FigureError> {
    let subtitle = format!("{}  \u{b7}  {}", heading::character(model, orbit), spectrum.method());
    save_figure(path, (WIDTH, 1050), |canvas| {
        let top = draw_head(canvas, &heading::parameters(model), &subtitle, &[])? + 14.0;
        let whole = canvas.panel(LEFT, top);
        let middle = (top + whole.bottom) / 2.0;
        let words = WallWords::of(model);
        // A gap that is a displacement has its name.
        let quantity = if words.gap() == "z" { "the gap" } else { words.gap() };
        let of_gap = format!("amplitude of {quantity}");
        let panels = [
            (of_gap.as_str(), top, middle - 15.0),
            ("amplitude of its velocity", middle + 15.0, whole.bottom),
        ];
        for (which, (label, top, bottom)) in panels.into_iter().enumerate() {
            draw(canvas, Rect { top, bottom, ..whole }, spectrum, which, label)?;
        }
        Ok(())
    })
}

/// The gap's lines, or with `which` 1 those of its velocity.
fn draw(
    canvas: &Canvas<'_>,
    rect: Rect,
    spectrum: &Spectrum,
    which: usize,
    label: &str,
) -> Result<(), DrawError> {
    let lines = || spectrum.lines.iter().map(|line| (line.frequency, line.amplitudes[which]));
    let largest = lines().map(|(_, size)| size).fold(0.0, f64::max);
    let is_shown = |size: f64| size > FLOOR * largest;
    let end = spectrum.lines.last().map_or(1.0, |line| line.frequency);
    let frame = Frame {
        rect,
        x: Axis::exact("frequency in multiples of the forcing frequency", 0.0, end),
        y: Axis::decades(label, lines().map(|(_, size)| size).filter(|&size| is_shown(size))),
    };
    frame.draw_grid(canvas)?;
    if spectrum.cycle.is_none() {
        let path: Vec<_> = lines().map(|(frequency, size)| frame.at(frequency, size)).collect();
        canvas.stroke(&path, 1.4, DARK)?;
    } else {
        let few = spectrum.lines.len() <= APART;
        for (frequency, size) in lines().filter(|&(_, size)| is_shown(size)) {
            let at = frame.at(frequency, size);
            canvas.stroke(&[(at.0, rect.bottom), at], if few { LINE } else { 1.0 }, DARK)?;
            // What is no multiple of the forcing is what the cycle adds.
            let color = if frequency.fract() == 0.0 { DARK } else { GEAR_2 };
            let radius = if few { 5.0 } else { 2.5 };
            canvas.marker(at, Marker { shape: Shape::Circle, color, radius, hollow: false })?;
        }
    }
    frame.draw_axes(canvas, which == 1)
}
