//! Grids of colours: maps and colour bars.

use plotters::prelude::*;

use super::{Canvas, Rect};
use crate::output::DrawError;

impl Canvas<'_> {
    /// Fills a rectangle with a grid of colours, `[column, row]` counted from its lower left
    /// corner; each canvas pixel shows the cell that its centre lies in.
    pub fn raster(
        &self,
        rect: Rect,
        [columns, rows]: [usize; 2],
        color: impl Fn([usize; 2]) -> [u8; 3],
    ) -> Result<(), DrawError> {
        let (left, top, width, height) = Canvas::fine_rect(rect);
        if width * height == 0 {
            return Ok(());
        }
        let mut pixels = Vec::with_capacity(3 * width * height);
        let across: Vec<usize> = (0..width).map(|x| (2 * x + 1) * columns / (2 * width)).collect();
        let mut shown = None;
        for y in 0..height {
            let row = rows - 1 - (2 * y + 1) * rows / (2 * height);
            if shown == Some(row) {
                // The same cells as one line above.
                pixels.extend_from_within(pixels.len() - 3 * width..);
                continue;
            }
            across.iter().for_each(|&column| pixels.extend(color([column, row])));
            shown = Some(row);
        }
        let size = (width as u32, height as u32);
        match BitMapElement::with_owned_buffer((left, top), size, pixels) {
            Some(element) => self.area.draw(&element),
            None => unreachable!("the buffer has three bytes per pixel"),
        }
    }
}
