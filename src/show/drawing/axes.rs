//! Axes: ranges, scales, and the frame that maps data to pixels.

use crate::show::drawing::ticks::{Tick, ticks};
use crate::show::drawing::{Align, Canvas, DARK, GRID, MEDIUM, Point, Rect, SMALL};
use crate::show::error::DrawError;

/// Share of its span by which an axis reaches beyond its data.
const PADDING: f64 = 0.06;
/// Values that differ by no more than this share of themselves are one, and the share of it that its axis spans.
const CONSTANT: f64 = 1e-9;
const ABOUT_CONSTANT: f64 = 0.2;
/// Tick marks' length.
const TICK: f64 = 7.0;
/// The length of those without a label.
const MINOR: f64 = 4.0;
/// The smallest type of an axis' name, and what is left free beyond its ends.
const SMALLEST: f64 = 16.0;
const MARGIN: f64 = 12.0;
/// The smallest type of labels of ticks, the room that the widest may take, and where the middle of the axis' name
/// beside them may lie at least: farther left it would be cut off.
const SMALLEST_TICKS: f64 = 12.0;
const TICK_ROOM: f64 = 97.0;
const NAME_MIDDLE: f64 = 14.0;
/// From the widest label to the middle of the axis' name.
const NAME_AWAY: f64 = 26.0;
/// Pixels between ticks at least: labels beside each other need more room than stacked ones.
const APART: (f64, f64) = (90.0, 60.0);
const APART_ON_BAR: f64 = 45.0;

/// How values lie on an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// In proportion.
    Linear,
    /// By decimal logarithms.
    Logarithmic,
    /// In the order of a list, each as far from the next: at 0, 1, 2 ...
    Listed,
}

/// One axis: what it shows and from where to where.
#[derive(Clone, Debug)]
pub struct Axis {
    /// What stands beside it.
    pub label: String,
    /// Ends in the scale: decimal logarithms on a logarithmic axis.
    pub low: f64,
    /// See `low`.
    pub high: f64,
    /// How values lie on it.
    pub scale: Scale,
    /// The values of a list, ascending; none on other axes.
    pub listed: Vec<f64>,
}

impl Axis {
    /// An axis from `low` to `high`; widened if that is empty or not finite.
    pub fn exact(label: &str, low: f64, high: f64) -> Axis {
        let (low, high) = if low.is_finite() && high.is_finite() { (low, high) } else { (0.0, 0.0) };
        let least = 1e-9 * low.abs().max(high.abs()).max(1e-6);
        let (low, high) = if high - low > least { (low, high) } else { (low - 0.5, low + 0.5) };
        Axis { label: label.to_owned(), low, high, scale: Scale::Linear, listed: Vec::new() }
    }

    /// An axis of ascending values that have as much room as each other, half of it on either side.
    pub fn listed(label: &str, values: impl Iterator<Item = f64>) -> Axis {
        let listed: Vec<f64> = values.collect();
        let high = listed.len() as f64 - 0.5;
        Axis { listed, scale: Scale::Listed, ..Axis::exact(label, -0.5, high) }
    }

    /// A logarithmic axis from the value `low` to the value `high`, both positive; widened as [`Axis::exact`] where
    /// they are not.
    pub fn logarithmic(label: &str, low: f64, high: f64) -> Axis {
        Axis { scale: Scale::Logarithmic, ..Axis::exact(label, low.log10(), high.log10()) }
    }

    /// An axis that holds all finite `values` with some room.
    ///
    /// It spans at least `least_span`, lest motion that has died down fills a panel with
    /// its rounding errors. What is constant has round numbers beside it, in place of its last digits.
    pub fn around(label: &str, values: impl Iterator<Item = f64>, least_span: f64) -> Axis {
        let Some((low, high)) = ends(values) else {
            return Axis::exact(label, -least_span / 2.0, least_span / 2.0);
        };
        let size = low.abs().max(high.abs());
        let is_constant = high - low <= CONSTANT * size;
        let least_span = if is_constant { least_span.max(ABOUT_CONSTANT * size) } else { least_span };
        let room = PADDING * (high - low) + (least_span - (high - low)).max(0.0) / 2.0;
        Axis::exact(label, low - room, high + room)
    }

    /// A logarithmic axis that holds all positive `values` with some room and spans at least
    /// `least_decades`.
    pub fn around_logarithms(label: &str, values: impl Iterator<Item = f64>, least_decades: f64) -> Axis {
        let axis = Axis::around(label, values.filter(|v| *v > 0.0).map(f64::log10), least_decades);
        Axis { scale: Scale::Logarithmic, ..axis }
    }

    /// A logarithmic axis that holds all positive `values`, of whole decades, one at least.
    pub fn decades(label: &str, values: impl Iterator<Item = f64>) -> Axis {
        let logarithms = values.filter(|v| *v > 0.0).map(f64::log10);
        let (low, high) = ends(logarithms).unwrap_or((-1.0, 1.0));
        let axis = Axis::exact(label, low.floor(), high.ceil().max(low.floor() + 1.0));
        Axis { scale: Scale::Logarithmic, ..axis }
    }

    /// Where a value lies in the scale; on a logarithmic axis what is beyond an end lies on it, in a list what is
    /// between two values on the upper one.
    fn place(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => value,
            Scale::Logarithmic => value.log10().clamp(self.low, self.high),
            Scale::Listed => self.listed.partition_point(|listed| *listed < value) as f64,
        }
    }
}

/// The name of an axis, in smaller type if it is too long.
fn draw_name(canvas: &Canvas<'_>, name: &str, at: Point, room: f64, align: Align) -> Result<(), DrawError> {
    let size = (MEDIUM * room / canvas.text_width(name, MEDIUM)?.max(1.0)).clamp(SMALLEST, MEDIUM);
    canvas.text(&canvas.fitted(name, size, room + 1.0)?, at, size, align, DARK)
}

/// Of the mark beside a label, which a minor tick does not have.
fn mark_length(label: &str) -> f64 {
    if label.is_empty() { MINOR } else { TICK }
}

/// The smallest and the largest finite value, if there is one.
fn ends(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let finite = values.filter(|v| v.is_finite());
    let (low, high) = finite.fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
    (low <= high).then_some((low, high))
}

/// A panel: its place on the canvas and what its edges mean.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Its place.
    pub rect: Rect,
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
}

impl Frame {
    /// The pixel at which a data point lies.
    pub fn at(&self, x: f64, y: f64) -> Point {
        (self.x_pixel(self.x.place(x)), self.y_pixel(self.y.place(y)))
    }

    fn x_pixel(&self, place: f64) -> f64 {
        let Rect { left, right, .. } = self.rect;
        left + (place - self.x.low) / (self.x.high - self.x.low) * (right - left)
    }

    fn y_pixel(&self, place: f64) -> f64 {
        let Rect { top, bottom, .. } = self.rect;
        bottom - (place - self.y.low) / (self.y.high - self.y.low) * (bottom - top)
    }

    /// The pixels between two values of x over the panel's whole height.
    pub fn column(&self, from: f64, to: f64) -> Rect {
        let [from, to] = [from, to].map(|x| self.at(x, 0.0).0.clamp(self.rect.left, self.rect.right));
        Rect { left: from, right: to, ..self.rect }
    }

    /// Draws the grid; comes before the data.
    pub fn draw_grid(&self, canvas: &Canvas<'_>) -> Result<(), DrawError> {
        let Rect { left, top, right, bottom } = self.rect;
        let is_major = |tick: &Tick| !tick.label.is_empty();
        for tick in self.x_ticks().into_iter().filter(is_major) {
            let x = self.x_pixel(tick.at);
            canvas.stroke(&[(x, top), (x, bottom)], 1.0, GRID)?;
        }
        for tick in self.y_ticks(APART.1).into_iter().filter(is_major) {
            let y = self.y_pixel(tick.at);
            canvas.stroke(&[(left, y), (right, y)], 1.0, GRID)?;
        }
        Ok(())
    }

    /// Draws border, ticks and labels; comes after the data. `x_labels` is false for a
    /// panel that shares the x axis of the one below.
    pub fn draw_axes(&self, canvas: &Canvas<'_>, x_labels: bool) -> Result<(), DrawError> {
        let Rect { left, top, bottom, .. } = self.rect;
        canvas.outline(self.rect, 1.5)?;
        self.draw_x_axis(canvas, x_labels)?;
        let (ticks, from) = (self.y_ticks(APART.1), left - TICK - 6.0);
        let widths = ticks.iter().map(|tick| canvas.text_width(&tick.label, SMALL));
        let widest = widths.collect::<Result<Vec<_>, _>>()?.into_iter().fold(0.0, f64::max);
        let room = (from - NAME_AWAY - NAME_MIDDLE).min(TICK_ROOM);
        let size = (SMALL * room / widest.max(1.0)).clamp(SMALLEST_TICKS, SMALL);
        for Tick { at, label } in ticks {
            let y = self.y_pixel(at);
            canvas.stroke(&[(left - mark_length(&label), y), (left, y)], 1.5, DARK)?;
            canvas.text(&label, (from, y), size, Align::Right, DARK)?;
        }
        let name = (from - widest * size / SMALL - NAME_AWAY).max(NAME_MIDDLE);
        let y_label = (name, (top + bottom) / 2.0);
        let room = 2.0 * y_label.1.min(canvas.size().1 - y_label.1) - 2.0 * MARGIN;
        draw_name(canvas, &self.y.label, y_label, room, Align::Upwards)
    }

    /// Draws the lower edge with its ticks, and labels if they are wanted.
    pub fn draw_x_axis(&self, canvas: &Canvas<'_>, labels: bool) -> Result<(), DrawError> {
        let Rect { left, right, bottom, .. } = self.rect;
        canvas.stroke(&[(left, bottom), (right, bottom)], 1.5, DARK)?;
        for Tick { at, label } in self.x_ticks() {
            let x = self.x_pixel(at);
            canvas.stroke(&[(x, bottom), (x, bottom + mark_length(&label))], 1.5, DARK)?;
            if labels {
                canvas.text(&label, (x, bottom + TICK + 17.0), SMALL, Align::Center, DARK)?;
            }
        }
        if labels {
            let middle = ((left + right) / 2.0, bottom + TICK + 54.0);
            let room = 2.0 * middle.0.min(canvas.size().0 - middle.0) - 2.0 * MARGIN;
            draw_name(canvas, &self.x.label, middle, room, Align::Center)?;
        }
        Ok(())
    }

    /// Draws ticks and labels of the y axis on the right: the scale of a colour bar.
    pub fn draw_scale(&self, canvas: &Canvas<'_>) -> Result<(), DrawError> {
        let right = self.rect.right;
        for Tick { at, label } in self.y_ticks(APART_ON_BAR) {
            let y = self.y_pixel(at);
            canvas.stroke(&[(right, y), (right + mark_length(&label), y)], 1.5, DARK)?;
            canvas.text(&label, (right + TICK + 7.0, y), SMALL, Align::Left, DARK)?;
        }
        Ok(())
    }

    fn x_ticks(&self) -> Vec<Tick> {
        ticks(&self.x, self.rect.right - self.rect.left, APART.0)
    }

    fn y_ticks(&self, apart: f64) -> Vec<Tick> {
        ticks(&self.y, self.rect.bottom - self.rect.top, apart)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_constant_and_extreme_data_give_a_usable_axis() {
        let cases: [&[f64]; 5] = [&[], &[0.0, 0.0], &[f64::NAN], &[1e300, -1e300], &[1e-12, 1.1e-12]];
        for values in cases {
            let axis = Axis::around("", values.iter().copied(), 0.01);
            assert!(axis.high > axis.low, "{values:?}");
            let axis = Axis::around_logarithms("", values.iter().copied(), 0.8);
            assert!(axis.high - axis.low > 0.79, "{values:?}");
        }
    }

    #[test]
    fn a_constant_has_round_numbers_beside_it() {
        for value in [0.2, -3.0, 1e-7, 4e8] {
            let axis = Axis::around("", [value, value * (1.0 + 1e-15)].into_iter(), 1e-6 * value.abs());
            let span = axis.high - axis.low;
            assert!((0.19..0.21).contains(&(span / value.abs())), "{value}: {span}");
        }
        let varied = Axis::around("", [1.0, 1.000_1].into_iter(), 1e-6);
        assert!(varied.high - varied.low < 2e-4, "{varied:?}");
    }

    #[test]
    fn logarithmic_axes_run_over_whole_decades() {
        let axis = Axis::decades("", [3e-7, 0.2, 0.0, f64::INFINITY, f64::NAN].into_iter());
        assert_eq!((axis.low, axis.high), (-7.0, 0.0));
        let flat = Axis::decades("", [10.0].into_iter());
        assert_eq!((flat.low, flat.high), (1.0, 2.0));
        assert!(Axis::decades("", std::iter::empty()).low < 0.0);
        let rect = Rect { left: 0.0, top: 0.0, right: 70.0, bottom: 10.0 };
        let frame = Frame { rect, x: axis, y: flat };
        assert_eq!(frame.at(1e-6, 1e9), (10.0, 0.0), "what is beyond an end lies on it");
        assert_eq!(frame.at(0.0, 10.0), (0.0, 10.0));
    }
}
