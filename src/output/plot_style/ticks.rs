//! Which values an axis marks, and how they are written.

use super::axes::{Axis, Scale};

/// Logarithmic axes shorter than this many decades name all their ticks, not powers of ten alone.
const SHORT: f64 = 2.5;

/// A marked place of an axis.
#[derive(Clone, Debug)]
pub(super) struct Tick {
    /// On the axis, in its own scale.
    pub(super) at: f64,
    /// What is written there; empty for a grid line alone.
    pub(super) label: String,
}

/// The ticks of an axis `length` pixels long, one to `apart` pixels at most where there is a choice.
pub(super) fn ticks(axis: &Axis, length: f64, apart: f64) -> Vec<Tick> {
    match axis.scale {
        Scale::Linear => linear(axis, length / apart),
        Scale::Logarithmic => logarithmic(axis),
    }
}

/// At most `most` round values.
fn linear(axis: &Axis, most: f64) -> Vec<Tick> {
    let rough = (axis.high - axis.low) / most.max(1.0);
    let decade = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|s| *s >= rough * (1.0 - 1e-9));
    let step = step.unwrap_or(10.0 * decade);
    let first = (axis.low / step - 1e-9).ceil();
    let count = (axis.high / step + 1e-9).floor() - first;
    let decimals = (-step.log10() - 1e-9).ceil().clamp(0.0, 12.0) as usize;
    let largest = axis.low.abs().max(axis.high.abs());
    (0..=count.clamp(-1.0, 100.0) as i64)
        .map(|i| (first + i as f64) * step)
        .map(|at| Tick { at, label: decimal(at, decimals, largest >= 1e6 || step < 1e-5) })
        .collect()
}

/// With the typographic minus.
fn decimal(value: f64, decimals: usize, scientific: bool) -> String {
    let text = if scientific { format!("{value:.3e}") } else { format!("{value:.decimals$}") };
    let zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    text.trim_start_matches(if zero { "-" } else { "" }).replace('-', "\u{2212}")
}

/// Powers of ten; on a short axis also twice and five times as much.
fn logarithmic(axis: &Axis) -> Vec<Tick> {
    let Axis { low, high, .. } = *axis;
    let parts: &[u32] = if high - low < SHORT { &[1, 2, 5] } else { &[1] };
    (low.floor() as i32..=high.ceil() as i32)
        .flat_map(|decade| parts.iter().map(move |&part| (decade, part)))
        .map(|(decade, part)| Tick {
            at: f64::from(decade) + f64::from(part).log10(),
            label: spoken(part, decade),
        })
        .filter(|tick| (low..=high).contains(&tick.at))
        .collect()
}

/// `part` times a power of ten as people say it.
fn spoken(part: u32, decade: i32) -> String {
    let whole = |from: i32| part * 10u32.pow((decade - from) as u32);
    match decade {
        -2..=-1 => format!("{:.*}", -decade as usize, f64::from(part) * 10f64.powi(decade)),
        0..=2 => whole(0).to_string(),
        3..=5 => format!("{} 000", whole(3)),
        6..=8 => format!("{} million", whole(6)),
        9..=11 => format!("{} billion", whole(9)),
        _ => format!("{part}e{decade}").replace('-', "\u{2212}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, most: f64) -> Vec<String> {
        ticks(axis, most, 1.0).into_iter().map(|tick| tick.label).collect()
    }

    #[test]
    fn ticks_are_round_and_written_with_a_true_minus() {
        let labels = |low, high, most| labels(&Axis::exact("", low, high), most);
        assert_eq!(labels(-1.02, 1.02, 5.0), ["\u{2212}1.0", "\u{2212}0.5", "0.0", "0.5", "1.0"]);
        assert_eq!(labels(0.0, 0.031, 4.0), ["0.00", "0.01", "0.02", "0.03"]);
        assert_eq!(labels(0.0, 1.0, 10.0).len(), 11);
        assert_eq!(labels(0.0, 128.0, 10.0), ["0", "20", "40", "60", "80", "100", "120"]);
    }

    #[test]
    fn logarithmic_ticks_are_powers_of_ten_and_on_short_axes_their_parts() {
        let labels = |low: f64, high: f64| {
            labels(&Axis { scale: Scale::Logarithmic, ..Axis::exact("", low, high) }, 10.0)
        };
        assert_eq!(labels(2.9, 7.1), ["1 000", "10 000", "100 000", "1 million", "10 million"]);
        assert_eq!(labels(4.8, 6.5), ["100 000", "200 000", "500 000", "1 million", "2 million"]);
        assert_eq!(labels(-3.0, 0.0), ["1e\u{2212}3", "0.01", "0.1", "1"]);
        assert_eq!(labels(-1.0, 0.0), ["0.1", "0.2", "0.5", "1"]);
        assert_eq!(labels(11.0, 14.0), ["100 billion", "1e12", "1e13", "1e14"]);
    }

    #[test]
    fn extreme_axes_do_not_fill_with_ticks() {
        for (low, high) in [(1e300, -1e300), (-1e300, 1e300), (1e-12, 1.1e-12), (0.0, 0.0)] {
            assert!(ticks(&Axis::exact("", low, high), 8.0, 1.0).len() <= 101, "{low} {high}");
        }
    }
}
