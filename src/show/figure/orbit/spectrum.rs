//! The spectra of gap and velocity, one below the other.

use std::io::Write;

use crate::map::scene::Format;
use crate::model_file::gap_names;
use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::Frame;
use crate::show::drawing::legend::draw_head;
use crate::show::drawing::{Canvas, DARK, GEAR_2, Marker, Rect, write_figure};
use crate::show::error::WriteError;
use crate::show::figure::orbit::heading;
use crate::show::figure::orbit::plot::{FREE_LINE, ORBIT_LEFT, ORBIT_WIDTH};
use crate::show::orbit_spectrum::Spectrum;
use crate::show::symbols::with_unit;
use crate::show::wall_labels::WallLabels;
use rattlemap_dynamics::model::Model;
use rattlemap_dynamics::orbit::Orbit;

/// Lines below this share of the largest one are not drawn: they are rounding errors or aliases.
const SMALLEST_SHARE: f64 = 1e-5;

/// Spectra of more lines have thinner strokes and smaller dots.
const THICK_LINES: usize = 200;

/// Name of the figure's file without its extension.
pub const NAME: &str = "spectrum";

/// Draws a spectrum and writes it.
pub fn write(
    out: impl Write,
    format: Format,
    model: &dyn Model,
    orbit: &Orbit,
    spectrum: &Spectrum,
) -> Result<(), WriteError> {
    let subtitle = format!("{}  \u{b7}  {}", heading::character(model, orbit), spectrum.method());
    write_figure(out, format, (ORBIT_WIDTH, 1050), |canvas| {
        let top = draw_head(canvas, &heading::parameters(model), &subtitle, &[]) + 14.0;
        let whole = canvas.panel(ORBIT_LEFT, top);
        let middle = (top + whole.bottom) / 2.0;
        let labels = WallLabels::of(model);
        let quantity = if gap_names(model).contains(&labels.gap()) { "the gap" } else { labels.gap() };
        let units = model.units();
        let of_gap = with_unit(&format!("amplitude of {quantity}"), units.gap.as_deref());
        let of_velocity = with_unit("amplitude of its velocity", units.gap_velocity().as_deref());
        let panels =
            [(of_gap.as_str(), top, middle - 15.0), (of_velocity.as_str(), middle + 15.0, whole.bottom)];
        for (which, (label, top, bottom)) in panels.into_iter().enumerate() {
            draw(canvas, Rect { top, bottom, ..whole }, spectrum, which, label);
        }
    })
}

/// Draws the lines of the gap, or with `which` 1 those of its velocity.
fn draw(canvas: &Canvas, rect: Rect, spectrum: &Spectrum, which: usize, label: &str) {
    let lines = || spectrum.lines.iter().map(|line| (line.frequency, line.amplitudes[which]));
    let largest = lines().map(|(_, size)| size).fold(0.0, f64::max);
    let is_visible = |size: f64| size > SMALLEST_SHARE * largest;
    let end = spectrum.lines.last().map_or(1.0, |line| line.frequency);
    let frame = Frame {
        rect,
        x: Axis::exact("frequency in multiples of the forcing frequency", 0.0, end),
        y: Axis::decades(label, lines().map(|(_, size)| size).filter(|&size| is_visible(size))),
    };
    frame.draw_grid(canvas);
    if spectrum.cycle.is_none() {
        let path: Vec<_> = lines().map(|(frequency, size)| frame.at(frequency, size)).collect();
        canvas.stroke(&path, 1.4, DARK);
    } else {
        let [width, radius] = if spectrum.lines.len() <= THICK_LINES { [FREE_LINE, 5.0] } else { [1.0, 2.5] };
        for (frequency, size) in lines().filter(|&(_, size)| is_visible(size)) {
            let at = frame.at(frequency, size);
            canvas.stroke(&[(at.0, rect.bottom), at], width, DARK);
            // Subharmonics have another colour than multiples of the forcing frequency.
            let color = if frequency.fract() == 0.0 { DARK } else { GEAR_2 };
            canvas.marker(at, Marker::dot(color, radius));
        }
    }
    frame.draw_axes(canvas, which == 1);
}
