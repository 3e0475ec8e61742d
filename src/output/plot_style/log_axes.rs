//! A panel with logarithmic axes.

use anyhow::Result;

use super::axes::{Axis, Frame};
use super::{Align, Canvas, DARK, GRID, MEDIUM, Point, Rect, SMALL};

const TICK: f64 = 7.0;

/// A panel whose axes run over whole decades.
#[derive(Clone, Debug)]
pub(in crate::output) struct LogFrame {
    /// In decimal logarithms.
    frame: Frame,
}

impl LogFrame {
    /// A panel that holds all positive `values`, each axis at least a decade long.
    pub(in crate::output) fn around(
        rect: Rect,
        labels: [&str; 2],
        x: impl Iterator<Item = f64>,
        y: impl Iterator<Item = f64>,
    ) -> LogFrame {
        LogFrame { frame: Frame { rect, x: decades(labels[0], x), y: decades(labels[1], y) } }
    }

    /// The pixel of a data point; what lies beyond an axis is put on its end.
    pub(in crate::output) fn at(&self, x: f64, y: f64) -> Point {
        let on = |axis: &Axis, value: f64| value.log10().clamp(axis.low, axis.high);
        self.frame.at(on(&self.frame.x, x), on(&self.frame.y, y))
    }

    /// The panel's place.
    pub(in crate::output) fn rect(&self) -> Rect {
        self.frame.rect
    }

    /// Draws the grid; comes before the data.
    pub(in crate::output) fn draw_grid(&self, canvas: &Canvas<'_>) -> Result<()> {
        let Rect { left, top, right, bottom } = self.frame.rect;
        for decade in whole(&self.frame.x) {
            let x = self.frame.at(decade, 0.0).0;
            canvas.stroke(&[(x, top), (x, bottom)], 1.0, GRID)?;
        }
        for decade in whole(&self.frame.y) {
            let y = self.frame.at(0.0, decade).1;
            canvas.stroke(&[(left, y), (right, y)], 1.0, GRID)?;
        }
        Ok(())
    }

    /// Draws border, ticks and labels; comes after the data.
    pub(in crate::output) fn draw_axes(&self, canvas: &Canvas<'_>) -> Result<()> {
        let Rect { left, top, right, bottom } = self.frame.rect;
        let border = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        canvas.stroke(&border, 1.5, DARK)?;
        for decade in whole(&self.frame.x) {
            let x = self.frame.at(decade, 0.0).0;
            canvas.stroke(&[(x, bottom), (x, bottom + TICK)], 1.5, DARK)?;
            canvas.text(&label(decade), (x, bottom + TICK + 17.0), SMALL, Align::Center, DARK)?;
        }
        let mut widest = 0f64;
        for decade in whole(&self.frame.y) {
            let y = self.frame.at(0.0, decade).1;
            let text = label(decade);
            canvas.stroke(&[(left - TICK, y), (left, y)], 1.5, DARK)?;
            canvas.text(&text, (left - TICK - 6.0, y), SMALL, Align::Right, DARK)?;
            widest = widest.max(canvas.text_width(&text, SMALL)?);
        }
        let y_label = (left - TICK - 6.0 - widest - 26.0, (top + bottom) / 2.0);
        canvas.text(&self.frame.y.label, y_label, MEDIUM, Align::Upwards, DARK)?;
        let x_label = ((left + right) / 2.0, bottom + TICK + 54.0);
        canvas.text(&self.frame.x.label, x_label, MEDIUM, Align::Center, DARK)
    }
}

fn decades(label: &str, values: impl Iterator<Item = f64>) -> Axis {
    let logs = values.filter(|v| *v > 0.0 && v.is_finite()).map(f64::log10);
    let (low, high) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    if low > high {
        return Axis::exact(label, -1.0, 1.0);
    }
    Axis::exact(label, low.floor(), high.ceil().max(low.floor() + 1.0))
}

fn whole(axis: &Axis) -> impl Iterator<Item = f64> + use<> {
    (axis.low.ceil() as i32..=axis.high.floor() as i32).map(f64::from)
}

/// A power of ten: plain near one, else with an exponent.
fn label(decade: f64) -> String {
    match decade as i32 {
        n @ 0..=4 => format!("{}", 10i32.pow(n as u32)),
        n @ -2..=-1 => format!("{:.*}", -n as usize, 10f64.powi(n)),
        n => format!("1e{n}").replace('-', "\u{2212}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_run_over_whole_decades() {
        let axis = decades("", [3e-7, 0.2, 0.0, f64::INFINITY, f64::NAN].into_iter());
        assert_eq!((axis.low, axis.high), (-7.0, 0.0));
        let flat = decades("", [10.0].into_iter());
        assert_eq!((flat.low, flat.high), (1.0, 2.0));
        assert!(decades("", std::iter::empty()).low < 0.0);
        assert_eq!([-7.0, -2.0, 0.0, 3.0].map(label), ["1e\u{2212}7", "0.01", "1", "1000"]);
    }
}
