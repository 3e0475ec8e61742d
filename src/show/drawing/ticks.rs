//! Ticks of an axis: which values are marked, and their labels.

use crate::map::scene::Scale;
use crate::show::drawing::axis::Axis;
use crate::show::symbols::{number, superscript};

/// A mark on an axis.
#[derive(Clone, Debug)]
pub(crate) struct Tick {
    /// Position on the axis' scale.
    pub(crate) at: f64,
    /// Label; empty for a minor tick.
    pub(crate) label: String,
}

/// The ticks of an axis. Their labels are multiples of ten to the `power`.
#[derive(Clone, Debug)]
pub(crate) struct Ticks {
    pub(crate) list: Vec<Tick>,
    pub(crate) power: i32,
}

impl Ticks {
    /// Returns the name of the axis, if it has one, with the common factor of its labels.
    pub(crate) fn name(&self, axis: &Axis) -> String {
        if axis.label.is_empty() { String::new() } else { axis.label.clone() + &self.factor() }
    }

    /// Returns what the common factor adds to the name of the axis; nothing if it is 1.
    pub(crate) fn factor(&self) -> String {
        if self.power == 0 { String::new() } else { format!(", in {}", power_label(self.power)) }
    }
}

/// Returns the ticks of an axis of `length` units, with labels at least `spacing` units apart where possible.
pub(crate) fn ticks(axis: &Axis, length: f64, spacing: f64) -> Ticks {
    let plain = |list| Ticks { list, power: 0 };
    match axis.scale {
        Scale::Linear => linear(axis, length / spacing),
        Scale::Log => logarithmic(axis, length, spacing),
        Scale::Values => plain(listed(axis, length, spacing)),
    }
}

/// Returns every n-th listed value, beginning with the first.
fn listed(axis: &Axis, length: f64, spacing: f64) -> Vec<Tick> {
    let room = length / (axis.high - axis.low);
    let step = (spacing / room).ceil().max(1.0) as usize;
    let each = axis.listed.iter().enumerate().step_by(step);
    each.map(|(i, value)| Tick { at: i as f64, label: number(*value) }).collect()
}

/// Returns at most `most` round values. Labels of very large and very small values have a common factor.
fn linear(axis: &Axis, most: f64) -> Ticks {
    let rough = (axis.high - axis.low) / most.max(1.0);
    let decade = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|s| *s >= rough * (1.0 - 1e-9));
    let step = step.unwrap_or(10.0 * decade);
    let first = (axis.low / step - 1e-9).ceil();
    let count = (axis.high / step + 1e-9).floor() - first;
    let largest = axis.low.abs().max(axis.high.abs());
    let power = match largest >= 1e6 || (step < 1e-5 && largest < 1e-2) {
        true => (largest.log10() + 1e-9).floor() as i32,
        false => 0,
    };
    // Division by 10 gives the nearest number to 0.6; multiplication by 0.1 does not.
    let divided = |at: f64| if power < 0 { at * 10f64.powi(-power) } else { at / 10f64.powi(power) };
    let decimals = (-divided(step).log10() - 1e-9).ceil().clamp(0.0, 12.0) as usize;
    let list = (0..=count.clamp(-1.0, 100.0) as i64)
        .map(|i| (first + i as f64) * step)
        .map(|at| Tick { at, label: decimal(divided(at), decimals) })
        .collect();
    Ticks { list, power }
}

/// Formats a decimal with the typographic minus.
fn decimal(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    text.trim_start_matches(if zero { "-" } else { "" }).replace('-', "\u{2212}")
}

/// Least distance of minor ticks in pixels.
const MINOR_SPACING: f64 = 4.0;
/// Labels within these powers of ten are plain numbers.
const PLAIN: (f64, f64) = (-3.0, 4.0);

/// Returns powers of ten with minor ticks between them, and plain numbers where there is room also 2 and 5 times these
/// powers. An axis that is too short for two such labels has round values instead.
fn logarithmic(axis: &Axis, length: f64, spacing: f64) -> Ticks {
    let Axis { low, high, .. } = *axis;
    let decade = length / (high - low);
    // Number of decades from one label to the next.
    let step = (spacing / decade).ceil().max(1.0) as i32;
    // An axis extends a little beyond its values, so only whole decades count.
    let is_plain = (low - 1e-9).ceil() >= PLAIN.0 && (high + 1e-9).floor() <= PLAIN.1;
    let named: &[u32] = if is_plain && decade * 2f64.log10() >= spacing { &[1, 2, 5] } else { &[1] };
    let is_named = move |part: u32, power: i32| named.contains(&part) && power.rem_euclid(step) == 0;
    let is_marked = move |part: u32| match part {
        1 => true,
        // The narrowest interval is from 9 to 10.
        _ => step == 1 && decade * (10f64 / 9.0).log10() >= MINOR_SPACING,
    };
    let tick = |power: i32, part: u32| Tick {
        at: f64::from(power) + f64::from(part).log10(),
        label: match is_named(part, power) {
            true if is_plain => plain_label(part, power),
            true => power_label(power),
            false => String::new(),
        },
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
        Ticks { list: ticks, power: 0 }
    } else {
        round(axis, length, spacing)
    }
}

/// Returns round values on a logarithmic axis of about a decade or less.
fn round(axis: &Axis, length: f64, spacing: f64) -> Ticks {
    let [low, high] = [axis.low, axis.high].map(|power| 10f64.powf(power));
    let values = Axis { scale: Scale::Linear, ..Axis::exact("", low, high) };
    let pixels = length / (axis.high - axis.low);
    let mut most = length / spacing;
    loop {
        let Ticks { list, power } = linear(&values, most);
        let positive = list.into_iter().filter(|tick| tick.at > 0.0);
        let list: Vec<Tick> = positive.map(|tick| Tick { at: tick.at.log10(), ..tick }).collect();
        let closest = list.windows(2).map(|pair| (pair[1].at - pair[0].at) * pixels).fold(f64::MAX, f64::min);
        if closest >= 0.75 * spacing || most < 2.0 {
            return Ticks { list, power };
        }
        most *= 0.7;
    }
}

/// Formats `part` times a power of ten as a plain number.
fn plain_label(part: u32, power: i32) -> String {
    let decimals = (-power).max(0) as usize;
    format!("{:.decimals$}", f64::from(part) * 10f64.powi(power))
}

/// Formats a power of ten.
fn power_label(power: i32) -> String {
    let raised: String = power.to_string().chars().map(superscript).collect();
    format!("10{raised}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, most: f64) -> Vec<String> {
        ticks(axis, most, 1.0).list.into_iter().map(|tick| tick.label).collect()
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
    fn very_small_and_very_large_values_have_a_common_factor_in_the_name_of_the_axis() {
        for (low, high, most, expected, name) in [
            (-4.1e-7, 2.2e-7, 4.0, vec!["\u{2212}4", "\u{2212}2", "0", "2"], "x, in 10\u{207b}\u{2077}"),
            (0.9e-6, 1.3e-6, 3.0, vec!["1.0", "1.2"], "x, in 10\u{207b}\u{2076}"),
            (0.0, 2.1e6, 2.0, vec!["0", "2"], "x, in 10\u{2076}"),
            (0.5, 0.500_001_3, 2.0, vec!["0.500000", "0.500001"], "x"),
            (0.0, 2.1e5, 3.0, vec!["0", "100000", "200000"], "x"),
            (0.0, 2.1e-4, 3.0, vec!["0.0000", "0.0001", "0.0002"], "x"),
        ] {
            let axis = Axis::exact("x", low, high);
            assert_eq!(labels(&axis, most), expected);
            assert_eq!(ticks(&axis, most, 1.0).name(&axis), name);
        }
    }

    fn log_axis(low: f64, high: f64) -> Axis {
        Axis::logarithmic("", [low, high], 0.0)
    }

    /// Returns the labels of a logarithmic axis and the number of its minor ticks.
    fn log_labels(low: f64, high: f64, length: f64, spacing: f64) -> (Vec<String>, usize) {
        let ticks = ticks(&log_axis(low, high), length, spacing).list;
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
        assert_eq!(log_labels(1e5, 1e6, 400.0, 90.0).0, ["10\u{2075}", "10\u{2076}"]);
    }

    #[test]
    fn short_logarithmic_axes_have_round_values_with_enough_room() {
        assert_eq!(log_labels(900.0, 1100.0, 500.0, 90.0).0, ["900", "950", "1000", "1050", "1100"]);
        for (low, high) in [(150.0, 450.0), (2.0, 9.0), (1.1, 1.9), (7e7, 7.1e7), (3e-9, 4e-9)] {
            let axis = log_axis(low, high);
            let ticks = ticks(&axis, 600.0, 90.0).list;
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
            ticks(&axis, 250.0, 90.0).list.into_iter().map(|tick| (tick.at, tick.label)).collect();
        assert_eq!(few, [(0.0, "0.1".to_owned()), (2.0, "1".to_owned()), (4.0, "100000".to_owned())]);
    }

    #[test]
    fn the_number_of_ticks_of_extreme_axes_is_limited() {
        for (low, high) in [(1e300, -1e300), (-1e300, 1e300), (1e-12, 1.1e-12), (0.0, 0.0)] {
            assert!(ticks(&Axis::exact("", low, high), 8.0, 1.0).list.len() <= 101, "{low} {high}");
            let logarithmic = Axis { scale: Scale::Log, ..Axis::exact("", low, high) };
            assert!(ticks(&logarithmic, 800.0, 100.0).list.len() <= 901, "{low} {high}");
        }
    }
}
