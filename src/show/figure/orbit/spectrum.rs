//! The spectra of each gap and its velocity, one below the other.

use crate::map::scene::FigureStyle;
use crate::model_file::{gap_names, several_gaps};
use crate::show::drawing::axis::Axis;
use crate::show::drawing::frame::{Frame, column, stacked};
use crate::show::drawing::legend::draw_head;
use crate::show::drawing::{Canvas, DARK, GEAR_2, Marker};
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

/// Default height with one gap.
const HEIGHT: f64 = 1050.0;

/// Name of the figure's file without its extension.
pub const NAME: &str = "spectrum";

/// Draws a spectrum.
pub fn draw(style: &FigureStyle, model: &dyn Model, orbit: &Orbit, spectrum: &Spectrum) -> Canvas {
    let subtitle = format!("{}  \u{b7}  {}", heading::character(model, orbit), spectrum.method());
    let canvas = Canvas::new(style, ORBIT_WIDTH);
    let top = draw_head(&canvas, &heading::parameters(model), &subtitle, &[]) + 14.0;
    let units = model.units();
    let label = |(gap, which): (usize, usize)| {
        let labels = WallLabels::of(model, gap);
        let has_symbol = several_gaps(model).is_some() || !gap_names(model).contains(&labels.gap());
        let quantity = if has_symbol { labels.gap() } else { "the gap" };
        match which {
            0 => with_unit(&format!("amplitude of {quantity}"), units.gap.as_deref()),
            _ => {
                let quantity =
                    several_gaps(model).map_or("its velocity".to_owned(), |names| format!("{}'", names[gap]));
                with_unit(&format!("amplitude of {quantity}"), units.gap_velocity().as_deref())
            }
        }
    };
    let count = spectrum.lines.first().map_or(1, |line| line.amplitudes.len());
    let shown: Vec<(usize, usize)> = (0..count).flat_map(|gap| [(gap, 0), (gap, 1)]).collect();
    let end = spectrum.lines.last().map_or(1.0, |line| line.frequency);
    let x = Axis::exact("frequency in multiples of the forcing frequency", 0.0, end);
    let y = |&quantity: &(usize, usize)| {
        Axis::decades(&label(quantity), visible(spectrum, quantity).map(|(_, size)| size))
    };
    let edges = stacked(&canvas, top, HEIGHT * count as f64, &vec![1.0; shown.len()]);
    let panels = edges.into_iter().zip(shown.iter().map(y)).collect();
    let frames = column(&canvas, panels, &x, ORBIT_LEFT, 0.0);
    for (i, (frame, &quantity)) in frames.iter().zip(&shown).enumerate() {
        draw_panel(&canvas, frame, spectrum, quantity, i + 1 == shown.len());
    }
    canvas
}

/// Returns frequencies and amplitudes of a gap, or with `which` 1 of its velocity.
fn lines(spectrum: &Spectrum, (gap, which): (usize, usize)) -> impl Iterator<Item = (f64, f64)> {
    spectrum.lines.iter().map(move |line| (line.frequency, line.amplitudes[gap][which]))
}

/// Returns those that are drawn.
fn visible(spectrum: &Spectrum, quantity: (usize, usize)) -> impl Iterator<Item = (f64, f64)> {
    let largest = lines(spectrum, quantity).map(|(_, size)| size).fold(0.0, f64::max);
    lines(spectrum, quantity).filter(move |&(_, size)| size > SMALLEST_SHARE * largest)
}

/// Draws a panel. The last one has the labels of the axis of frequencies.
fn draw_panel(canvas: &Canvas, frame: &Frame, spectrum: &Spectrum, quantity: (usize, usize), is_last: bool) {
    frame.draw_grid(canvas);
    if spectrum.cycle.is_none() {
        let path: Vec<_> =
            lines(spectrum, quantity).map(|(frequency, size)| frame.at(frequency, size)).collect();
        canvas.stroke(&path, 1.4, DARK);
    } else {
        let [width, radius] = if spectrum.lines.len() <= THICK_LINES { [FREE_LINE, 5.0] } else { [1.0, 2.5] };
        for (frequency, size) in visible(spectrum, quantity) {
            let at = frame.at(frequency, size);
            canvas.stroke(&[(at.0, frame.rect.bottom), at], width, DARK);
            // Subharmonics have another colour than multiples of the forcing frequency.
            let color = if frequency.fract() == 0.0 { DARK } else { GEAR_2 };
            canvas.marker(at, Marker::dot(color, radius));
        }
    }
    frame.draw_axes(canvas, is_last);
}
