//! Elements that all figures share: canvas, axes, legends, labels, and the file formats PNG, SVG and PDF.
//!
//! Positions and sizes are in pixels of the finished picture. A [`Canvas`] stores the drawn items; [`write_figure`]
//! encodes them.

pub mod axis;
mod canvas;
mod fitting;
pub mod frame;
pub mod labels;
pub mod legend;
mod pdf;
mod png;
mod shapes;
mod style;
mod svg;
mod ticks;
mod typeface;

use std::io::Write;

pub use crate::show::color::Color;
pub use canvas::{Bitmap, Canvas};
pub use shapes::{Align, Marker, Point, Rect, Shape};
pub use style::{BELOW, DARK, FAINT, GEAR_1, GEAR_2, GRID, LARGE, MEDIUM, MESHING, SMALL, WHITE, wall_color};

use crate::map::scene::Format;
use crate::show::error::WriteError;

/// Draws a picture of `size` pixels on white and writes it as SVG, PDF or, for all other formats, PNG.
///
/// # Errors
/// [`WriteError`] if the picture cannot be encoded or written.
pub fn write_figure(
    mut out: impl Write,
    format: Format,
    (width, height): (u32, u32),
    draw: impl FnOnce(&Canvas),
) -> Result<(), WriteError> {
    let canvas = Canvas::empty((width.into(), height.into()));
    draw(&canvas);
    match format {
        Format::Svg => svg::write(&mut out, &canvas),
        Format::Pdf => Ok(out.write_all(&pdf::encoded(&canvas)?)?),
        _ => Ok(out.write_all(&png::encoded(&canvas)?)?),
    }
}
