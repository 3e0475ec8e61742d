//! Axes: ranges, ticks, and the frame that maps data to pixels.

use anyhow::Result;

use super::{Align, Canvas, DARK, GRID, MEDIUM, Point, Rect, SMALL};

/// Share of its span by which an axis reaches beyond its data.
const PADDING: f64 = 0.06;
/// Tick marks' length.
const TICK: f64 = 7.0;

/// One axis: what it shows and from where to where.
#[derive(Clone, Debug)]
pub(in crate::output) struct Axis {
    pub(in crate::output) label: String,
    pub(in crate::output) low: f64,
    pub(in crate::output) high: f64,
}

impl Axis {
    /// An axis from `low` to `high`; widened if that is empty or not finite.
    pub(in crate::output) fn exact(label: &str, low: f64, high: f64) -> Axis {
        let (low, high) = if low.is_finite() && high.is_finite() { (low, high) } else { (0.0, 0.0) };
        let least = 1e-9 * low.abs().max(high.abs()).max(1e-6);
        let (low, high) = if high - low > least { (low, high) } else { (low - 0.5, low + 0.5) };
        Axis { label: label.to_owned(), low, high }
    }

    /// An axis that holds all finite `values` with some room.
    ///
    /// It spans at least `least_span`, lest motion that has died down fills a panel with
    /// its rounding errors.
    pub(in crate::output) fn around(label: &str, values: impl Iterator<Item = f64>, least_span: f64) -> Axis {
        let (low, high) =
            values.filter(|v| v.is_finite()).fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
        if low > high {
            return Axis::exact(label, -least_span / 2.0, least_span / 2.0);
        }
        let room = PADDING * (high - low) + (least_span - (high - low)).max(0.0) / 2.0;
        Axis::exact(label, low - room, high + room)
    }

    /// At most `most` round values on the axis, and how to write them.
    fn ticks(&self, most: f64) -> Vec<(f64, String)> {
        let rough = (self.high - self.low) / most.max(1.0);
        let decade = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|s| *s >= rough * (1.0 - 1e-9));
        let step = step.unwrap_or(10.0 * decade);
        let first = (self.low / step - 1e-9).ceil();
        let count = (self.high / step + 1e-9).floor() - first;
        let decimals = (-step.log10() - 1e-9).ceil().clamp(0.0, 12.0) as usize;
        let largest = self.low.abs().max(self.high.abs());
        (0..=count.clamp(-1.0, 100.0) as i64)
            .map(|i| (first + i as f64) * step)
            .map(|value| (value, label(value, decimals, largest >= 1e6 || step < 1e-5)))
            .collect()
    }
}

/// A tick label, with the typographic minus.
fn label(value: f64, decimals: usize, scientific: bool) -> String {
    let text = if scientific { format!("{value:.3e}") } else { format!("{value:.decimals$}") };
    let zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    text.trim_start_matches(if zero { "-" } else { "" }).replace('-', "\u{2212}")
}

/// A panel: its place on the canvas and what its edges mean.
#[derive(Clone, Debug)]
pub(in crate::output) struct Frame {
    pub(in crate::output) rect: Rect,
    pub(in crate::output) x: Axis,
    pub(in crate::output) y: Axis,
}

impl Frame {
    /// The pixel at which a data point lies.
    pub(in crate::output) fn at(&self, x: f64, y: f64) -> Point {
        let Rect { left, top, right, bottom } = self.rect;
        (
            left + (x - self.x.low) / (self.x.high - self.x.low) * (right - left),
            bottom - (y - self.y.low) / (self.y.high - self.y.low) * (bottom - top),
        )
    }

    /// The pixels between two values of x over the panel's whole height.
    pub(in crate::output) fn column(&self, from: f64, to: f64) -> Rect {
        let [from, to] = [from, to].map(|x| self.at(x, 0.0).0.clamp(self.rect.left, self.rect.right));
        Rect { left: from, right: to, ..self.rect }
    }

    /// Draws the grid; comes before the data.
    pub(in crate::output) fn draw_grid(&self, canvas: &Canvas<'_>) -> Result<()> {
        let Rect { left, top, right, bottom } = self.rect;
        for (value, _) in self.x_ticks() {
            let x = self.at(value, 0.0).0;
            canvas.stroke(&[(x, top), (x, bottom)], 1.0, GRID)?;
        }
        for (value, _) in self.y_ticks() {
            let y = self.at(0.0, value).1;
            canvas.stroke(&[(left, y), (right, y)], 1.0, GRID)?;
        }
        Ok(())
    }

    /// Draws border, ticks and labels; comes after the data. `x_labels` is false for a
    /// panel that shares the x axis of the one below.
    pub(in crate::output) fn draw_axes(&self, canvas: &Canvas<'_>, x_labels: bool) -> Result<()> {
        let Rect { left, top, right, bottom } = self.rect;
        let border = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        canvas.stroke(&border, 1.5, DARK)?;
        for (value, text) in self.x_ticks() {
            let x = self.at(value, 0.0).0;
            canvas.stroke(&[(x, bottom), (x, bottom + TICK)], 1.5, DARK)?;
            if x_labels {
                canvas.text(&text, (x, bottom + TICK + 17.0), SMALL, Align::Center, DARK)?;
            }
        }
        let mut widest = 0f64;
        for (value, text) in self.y_ticks() {
            let y = self.at(0.0, value).1;
            canvas.stroke(&[(left - TICK, y), (left, y)], 1.5, DARK)?;
            canvas.text(&text, (left - TICK - 6.0, y), SMALL, Align::Right, DARK)?;
            widest = widest.max(canvas.text_width(&text, SMALL)?);
        }
        let y_label = (left - TICK - 6.0 - widest - 26.0, (top + bottom) / 2.0);
        canvas.text(&self.y.label, y_label, MEDIUM, Align::Upwards, DARK)?;
        if x_labels {
            let x_label = ((left + right) / 2.0, bottom + TICK + 54.0);
            canvas.text(&self.x.label, x_label, MEDIUM, Align::Center, DARK)?;
        }
        Ok(())
    }

    /// Draws ticks and labels of the y axis on the right: the scale of a colour bar.
    pub(in crate::output) fn draw_scale(&self, canvas: &Canvas<'_>) -> Result<()> {
        let right = self.rect.right;
        for (value, text) in self.y.ticks((self.rect.bottom - self.rect.top) / 45.0) {
            let y = self.at(0.0, value).1;
            canvas.stroke(&[(right, y), (right + TICK, y)], 1.5, DARK)?;
            canvas.text(&text, (right + TICK + 7.0, y), SMALL, Align::Left, DARK)?;
        }
        Ok(())
    }

    fn x_ticks(&self) -> Vec<(f64, String)> {
        self.x.ticks((self.rect.right - self.rect.left) / 90.0)
    }

    fn y_ticks(&self) -> Vec<(f64, String)> {
        self.y.ticks((self.rect.bottom - self.rect.top) / 60.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64, most: f64) -> Vec<String> {
        Axis::exact("", low, high).ticks(most).into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn ticks_are_round_and_written_with_a_true_minus() {
        assert_eq!(labels(-1.02, 1.02, 5.0), ["\u{2212}1.0", "\u{2212}0.5", "0.0", "0.5", "1.0"]);
        assert_eq!(labels(0.0, 0.031, 4.0), ["0.00", "0.01", "0.02", "0.03"]);
        assert_eq!(labels(0.0, 1.0, 10.0).len(), 11);
        assert_eq!(labels(0.0, 128.0, 10.0), ["0", "20", "40", "60", "80", "100", "120"]);
    }

    #[test]
    fn empty_constant_and_extreme_data_give_a_usable_axis() {
        let cases: [&[f64]; 5] = [&[], &[0.0, 0.0], &[f64::NAN], &[1e300, -1e300], &[1e-12, 1.1e-12]];
        for values in cases {
            let axis = Axis::around("", values.iter().copied(), 0.01);
            assert!(axis.high > axis.low, "{values:?}");
            assert!(axis.ticks(8.0).len() <= 101, "{values:?}");
        }
    }
}
