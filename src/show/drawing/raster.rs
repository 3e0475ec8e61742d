//! Grids of colours: maps, colour bars, clouds of points.

use crate::show::drawing::canvas::Item;
use crate::show::drawing::{Canvas, RGBColor, Rect};
use crate::show::error::DrawError;

/// Pixels, the uppermost row first.
#[derive(Clone, Debug)]
pub struct Bitmap {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Three bytes per pixel.
    pub rgb: Vec<u8>,
    /// How much each pixel covers, from 0 to 255; everything where there is none.
    pub alpha: Option<Vec<u8>>,
    /// Whether they blend into each other where they are scaled.
    pub is_smooth: bool,
}

impl Canvas<'_> {
    /// Fills a rectangle with a grid of colours, `[column, row]` counted from its lower left corner.
    pub fn raster(
        &self,
        rect: Rect,
        [columns, rows]: [usize; 2],
        color: impl Fn([usize; 2]) -> [u8; 3],
    ) -> Result<(), DrawError> {
        let cells = (0..rows).rev().flat_map(|row| (0..columns).map(move |column| [column, row]));
        let mut rgb = Vec::with_capacity(3 * columns * rows);
        cells.for_each(|cell| rgb.extend(color(cell)));
        self.image(rect, Bitmap { size: [columns, rows], rgb, alpha: None, is_smooth: false })
    }

    /// Draws pixels into a rectangle.
    pub fn image(&self, rect: Rect, bitmap: Bitmap) -> Result<(), DrawError> {
        if rect.right > rect.left && rect.bottom > rect.top && !bitmap.rgb.is_empty() {
            self.add(Item::Image { rect, bitmap });
        }
        Ok(())
    }
}

impl Bitmap {
    /// Clear pixels.
    pub fn clear(size: [usize; 2]) -> Bitmap {
        let count = size[0] * size[1];
        Bitmap { size, rgb: vec![0xff; 3 * count], alpha: Some(vec![0; count]), is_smooth: true }
    }

    /// Gives a pixel, counted row by row, its colour.
    pub fn set(&mut self, pixel: usize, RGBColor(r, g, b): RGBColor, opacity: f64) {
        self.rgb[3 * pixel..3 * pixel + 3].copy_from_slice(&[r, g, b]);
        if let Some(alpha) = &mut self.alpha {
            alpha[pixel] = (opacity * 255.0).round() as u8;
        }
    }
}
