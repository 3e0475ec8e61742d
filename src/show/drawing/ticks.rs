//! Ticks of an axis: which values are marked, and their labels.

use crate::show::drawing::axis::{Axis, Scale};
use crate::show::symbols::{number, superscript};

/// A mark on an axis.
#[derive(Clone, Debug)]
pub(crate) struct Tick {
    /// Position on the axis' scale.
    pub(crate) at: f64,
    /// Label; empty for a minor tick.
    pub(crate) label: String,
}

/// Returns the ticks of an axis of `length` pixels, with labels at least `spacing` pixels apart where possible.
pub(crate) fn ticks(axis: &Axis, length: f64, spacing: f64) -> Vec<Tick> {
    match axis.scale {
        Scale::Linear => linear(axis, length / spacing),
        Scale::Logarithmic => logarithmic(axis, length, spacing),
        Scale::Listed => listed(axis, length, spacing),
    }
}

/// Returns every n-th listed value, beginning with the first.
fn listed(axis: &Axis, length: f64, spacing: f64) -> Vec<Tick> {
    let room = length / (axis.high - axis.low);
    let step = (spacing / room).ceil().max(1.0) as usize;
    let each = axis.listed.iter().enumerate().step_by(step);
    each.map(|(i, value)| Tick { at: i as f64, label: number(*value) }).collect()
}

/// Returns at most `most` round values.
fn linear(axis: &Axis, most: f64) -> Vec<Tick> {
    let rough = (axis.high - axis.low) / most.max(1.0);
    let decade = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|s| *s >= rough * (1.0 - 1e-9));
    let step = step.unwrap_or(10.0 * decade);
    let first = (axis.low / step - 1e-9).ceil();
    let count = (axis.high / step + 1e-9).floor() - first;
    let decimals = (-step.log10() - 1e-9).ceil().clamp(0.0, 12.0) as usize;
    let largest = axis.low.abs().max(axis.high.abs());
    let is_scientific = largest >= 1e6 || step < 1e-5;
    let label = |at| if is_scientific { scientific(at, step) } else { decimal(at, decimals) };
    (0..=count.clamp(-1.0, 100.0) as i64)
        .map(|i| (first + i as f64) * step)
        .map(|at| Tick { at, label: label(at) })
        .collect()
}

/// Formats a decimal with the typographic minus.
fn decimal(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    text.trim_start_matches(if zero { "-" } else { "" }).replace('-', "\u{2212}")
}

/// Formats a number like `4\u{b7}10\u{207b}\u{2077}`, with the digits that distinguish values one `step` apart.
fn scientific(value: f64, step: f64) -> String {
    // A value far smaller than the step is a rounding error of zero.
    if value.abs() < 1e-3 * step {
        return "0".to_owned();
    }
    let power = |value: f64| (value.abs().log10() + 1e-9).floor();
    let digits = (power(value) - power(step)).clamp(0.0, 12.0) as usize;
    let written = format!("{value:.digits$e}");
    let (part, power) = written.split_once('e').unwrap_or((&written, "0"));
    let raised: String = power.chars().map(superscript).collect();
    format!("{part}\u{b7}10{raised}").replace('-', "\u{2212}")
}

/// Least distance of minor ticks in pixels.
const MINOR_SPACING: f64 = 4.0;
/// Labels within these powers of ten are plain numbers.
const PLAIN: (f64, f64) = (-3.0, 4.0);

/// Returns powers of ten with minor ticks between them, and where there is room also 2 and 5 times these powers. An axis
/// that is too short for two such labels has round values instead.
fn logarithmic(axis: &Axis, length: f64, spacing: f64) -> Vec<Tick> {
    let Axis { low, high, .. } = *axis;
    let decade = length / (high - low);
    let named: &[u32] = if decade * 2f64.log10() >= spacing { &[1, 2, 5] } else { &[1] };
    // Number of decades from one label to the next.
    let step = (spacing / decade).ceil().max(1.0) as i32;
    // An axis extends a little beyond its values, so only whole decades count.
    let is_plain = (low - 1e-9).ceil() >= PLAIN.0 && (high + 1e-9).floor() <= PLAIN.1;
    let is_named = move |part: u32, power: i32| named.contains(&part) && power.rem_euclid(step) == 0;
    let is_marked = move |part: u32| match part {
        1 => true,
        // The narrowest interval is from 9 to 10.
        _ => step == 1 && decade * (10f64 / 9.0).log10() >= MINOR_SPACING,
    };
    let tick = |power: i32, part: u32| Tick {
        at: f64::from(power) + f64::from(part).log10(),
        label: if is_named(part, power) { power_label(part, power, is_plain) } else { String::new() },
    };
    // Limits the number of ticks of an extremely long axis.
    let powers = (low.floor().max(-400.0) as i32)..=(high.ceil().min(400.0) as i32);
    let ticks: Vec<Tick> = powers
        .flat_map(|power| {
            (1..10)
                .filter(move |&part| is_marked(part) || is_named(part, power))
                .map(move |part| (power, part))
        })
        .map(|(power, part)| tick(power, part))
        .filter(|tick| (low - 1e-9..=high + 1e-9).contains(&tick.at))
        .collect();
    if ticks.iter().filter(|tick| !tick.label.is_empty()).count() >= 2 {
        ticks
    } else {
        round(axis, length, spacing)
    }
}

/// Returns round values on a logarithmic axis of about a decade or less.
fn round(axis: &Axis, length: f64, spacing: f64) -> Vec<Tick> {
    let [low, high] = [axis.low, axis.high].map(|power| 10f64.powf(power));
    let values = Axis { scale: Scale::Linear, ..Axis::exact("", low, high) };
    let pixels = length / (axis.high - axis.low);
    let mut most = length / spacing;
    loop {
        let ticks: Vec<Tick> = linear(&values, most)
            .into_iter()
            .filter(|tick| tick.at > 0.0)
            .map(|tick| Tick { at: tick.at.log10(), ..tick })
            .collect();
        let closest =
            ticks.windows(2).map(|pair| (pair[1].at - pair[0].at) * pixels).fold(f64::MAX, f64::min);
        if closest >= 0.75 * spacing || most < 2.0 {
            return ticks;
        }
        most *= 0.7;
    }
}

/// Formats `part` times a power of ten, as a plain number or with a superscript.
fn power_label(part: u32, power: i32, is_plain: bool) -> String {
    if is_plain {
        let decimals = (-power).max(0) as usize;
        return format!("{:.decimals$}", f64::from(part) * 10f64.powi(power));
    }
    let raised: String = power.to_string().chars().map(superscript).collect();
    if part == 1 { format!("10{raised}") } else { format!("{part}\u{b7}10{raised}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, most: f64) -> Vec<String> {
        ticks(axis, most, 1.0).into_iter().map(|tick| tick.label).collect()
    }

    #[test]
    fn ticks_are_round_and_have_a_typographic_minus() {
        let labels = |low, high, most| labels(&Axis::exact("", low, high), most);
        assert_eq!(labels(-1.02, 1.02, 5.0), ["\u{2212}1.0", "\u{2212}0.5", "0.0", "0.5", "1.0"]);
        assert_eq!(labels(0.0, 0.031, 4.0), ["0.00", "0.01", "0.02", "0.03"]);
        assert_eq!(labels(0.0, 1.0, 10.0).len(), 11);
        assert_eq!(labels(0.0, 128.0, 10.0), ["0", "20", "40", "60", "80", "100", "120"]);
    }

    #[test]
    fn very_small_and_very_large_values_are_short() {
        let labels = |low, high, most| labels(&Axis::exact("", low, high), most);
        let small = [
            "\u{2212}4\u{b7}10\u{207b}\u{2077}",
            "\u{2212}2\u{b7}10\u{207b}\u{2077}",
            "0",
            "2\u{b7}10\u{207b}\u{2077}",
        ];
        assert_eq!(labels(-4.1e-7, 2.2e-7, 4.0), small);
        assert_eq!(
            labels(0.9e-6, 1.3e-6, 3.0),
            ["1.0\u{b7}10\u{207b}\u{2076}", "1.2\u{b7}10\u{207b}\u{2076}"]
        );
        assert_eq!(labels(0.0, 2.1e6, 2.0), ["0", "2\u{b7}10\u{2076}"]);
    }

    fn log_axis(low: f64, high: f64) -> Axis {
        Axis::logarithmic("", [low, high], 0.0)
    }

    /// Returns the labels of a logarithmic axis and the number of its minor ticks.
    fn log_labels(low: f64, high: f64, length: f64, spacing: f64) -> (Vec<String>, usize) {
        let ticks = ticks(&log_axis(low, high), length, spacing);
        let minor = ticks.iter().filter(|tick| tick.label.is_empty()).count();
        (ticks.into_iter().map(|tick| tick.label).filter(|label| !label.is_empty()).collect(), minor)
    }

    #[test]
    fn logarithmic_axes_mark_decades_with_minor_ticks_and_label_2_and_5_where_there_is_room() {
        let plain = |labels: &[&str]| labels.iter().map(|&label| label.to_owned()).collect::<Vec<_>>();
        // 200 pixels to a decade: no room for 2 and 5, each 60 or more from the next.
        assert_eq!(log_labels(10.0, 1000.0, 400.0, 90.0), (plain(&["10", "100", "1000"]), 16));
        assert_eq!(
            log_labels(10.0, 1000.0, 1000.0, 90.0),
            (plain(&["10", "20", "50", "100", "200", "500", "1000"]), 12)
        );
        assert_eq!(log_labels(0.001, 1.0, 300.0, 90.0).0, ["0.001", "0.01", "0.1", "1"]);
        let far = log_labels(1e-7, 1e5, 400.0, 90.0);
        assert_eq!(
            (far.0, far.1),
            (plain(&["10\u{207b}\u{2076}", "10\u{207b}\u{b3}", "10\u{2070}", "10\u{b3}"]), 9)
        );
        assert_eq!(
            log_labels(1e5, 1e6, 400.0, 90.0).0,
            ["10\u{2075}", "2\u{b7}10\u{2075}", "5\u{b7}10\u{2075}", "10\u{2076}"]
        );
    }

    #[test]
    fn short_logarithmic_axes_have_round_values_with_enough_room() {
        assert_eq!(log_labels(900.0, 1100.0, 500.0, 90.0).0, ["900", "950", "1000", "1050", "1100"]);
        for (low, high) in [(150.0, 450.0), (2.0, 9.0), (1.1, 1.9), (7e7, 7.1e7), (3e-9, 4e-9)] {
            let axis = log_axis(low, high);
            let ticks = ticks(&axis, 600.0, 90.0);
            assert!(ticks.len() >= 2, "{low} {high}: {ticks:?}");
            let pixels = 600.0 / (axis.high - axis.low);
            let labelled: Vec<f64> = ticks.iter().filter(|t| !t.label.is_empty()).map(|t| t.at).collect();
            assert!(labelled.len() >= 2, "{low} {high}: {ticks:?}");
            assert!(
                labelled.windows(2).all(|pair| (pair[1] - pair[0]) * pixels > 60.0),
                "{low} {high}: {ticks:?}"
            );
            assert!(labelled.iter().all(|at| (axis.low - 1e-6..=axis.high + 1e-6).contains(at)), "{ticks:?}");
        }
    }

    #[test]
    fn listed_values_have_unrounded_labels_and_are_skipped_where_there_is_no_room() {
        let axis = Axis::listed("", [0.1, 0.25, 1.0, 40.0, 1e5].into_iter());
        assert_eq!(labels(&axis, 500.0), ["0.1", "0.25", "1", "40", "100000"]);
        let few: Vec<(f64, String)> =
            ticks(&axis, 250.0, 90.0).into_iter().map(|tick| (tick.at, tick.label)).collect();
        assert_eq!(few, [(0.0, "0.1".to_owned()), (2.0, "1".to_owned()), (4.0, "100000".to_owned())]);
    }

    #[test]
    fn the_number_of_ticks_of_extreme_axes_is_limited() {
        for (low, high) in [(1e300, -1e300), (-1e300, 1e300), (1e-12, 1.1e-12), (0.0, 0.0)] {
            assert!(ticks(&Axis::exact("", low, high), 8.0, 1.0).len() <= 101, "{low} {high}");
            let logarithmic = Axis { scale: Scale::Logarithmic, ..Axis::exact("", low, high) };
            assert!(ticks(&logarithmic, 800.0, 100.0).len() <= 901, "{low} {high}");
        }
    }
}
