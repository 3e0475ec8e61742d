//! Elements that all figures share: canvas, axes, legends, labels, and the file formats PNG, SVG and PDF.
//!
//! Positions and sizes are in units of 0.36 points at the default type size: small type has [`SMALL`] units at any type
//! size, so a larger type makes a page of the same width fewer units wide. In a figure of default width and type size, a
//! unit is a pixel. A [`Canvas`] stores the drawn items; [`write_figure`] encodes them.

pub mod axis;
mod canvas;
mod fitting;
pub mod frame;
pub mod labels;
pub mod legend;
#[cfg(any(test, target_arch = "wasm32"))]
mod metrics;
mod pdf;
mod png;
mod shapes;
mod style;
mod svg;
pub(crate) mod ticks;
mod typeface;

use std::io::Write;

pub use crate::show::color::Color;
pub use canvas::{Bitmap, Canvas};
pub use shapes::{Align, Marker, Point, Rect, Shape};
pub use style::{BODIES, DARK, FAINT, GEAR_2, GRID, LARGE, MEDIUM, MESHING, SMALL, WHITE, wall_color};

use crate::map::scene::Format;
use crate::show::error::WriteError;

/// Returns a picture as SVG.
pub fn svg(canvas: &Canvas) -> String {
    let mut image = Vec::new();
    // Writing to memory cannot fail.
    let _ = svg::write(&mut image, canvas);
    String::from_utf8_lossy(&image).into_owned()
}

/// Writes a picture as SVG, PDF or, for all other formats, PNG.
///
/// # Errors
/// [`WriteError`] if the picture cannot be encoded or written.
pub fn write_figure(mut out: impl Write, format: Format, canvas: &Canvas) -> Result<(), WriteError> {
    match format {
        Format::Svg => svg::write(&mut out, canvas),
        Format::Pdf => Ok(out.write_all(&pdf::encoded(canvas)?)?),
        _ => Ok(out.write_all(&png::encoded(canvas)?)?),
    }
}
