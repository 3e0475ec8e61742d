//! Title and subtitle of an orbit's figures.

use crate::show::caption;
use crate::show::orbit_summary::has_mirror_images;
use crate::show::symbols::{number, superscript, symbol};
use rattlemap_dynamics::model::{Model, State};
use rattlemap_dynamics::orbit::{Class, Orbit};

/// Largest number of symbols of a word in a heading.
const WORD_SYMBOLS: usize = 32;

/// Returns the title: the model and its parameters.
pub(crate) fn parameters(model: &dyn Model) -> String {
    format!("{}: {}", model.title(), caption::parameters(model, |_| false))
}

/// Returns the subtitle: class, word and Lyapunov exponent, and the symmetry if the model is symmetric.
pub(crate) fn character(model: &dyn Model, orbit: &Orbit) -> String {
    let class = match (orbit.class, orbit.symmetric.filter(|_| has_mirror_images(model))) {
        (Class::Periodic { period }, Some(true)) => format!("period {period}, symmetric"),
        (Class::Periodic { period }, Some(false)) => format!("period {period}, not symmetric"),
        (Class::Periodic { period }, None) => format!("period {period}"),
        (Class::Chaotic, _) => "chaotic".to_owned(),
        (Class::Undecided, _) => "undecided".to_owned(),
        (Class::Failed, _) => "failed".to_owned(),
        (Class::QuasiPeriodic, _) => "quasi-periodic".to_owned(),
    };
    let mut parts = vec![class, flights(orbit)];
    if orbit.lyapunov.is_finite() {
        let error = orbit.lyapunov_error.map_or(String::new(), |error| format!(" \u{b1} {error:.4}"));
        parts.push(format!("\u{3bb} = {:.4}{error}", orbit.lyapunov).replace('-', "\u{2212}"));
    }
    parts.join("  \u{b7}  ")
}

/// Returns the subtitle of a motion from the start: its first state.
pub(crate) fn from_start(model: &dyn Model, start: &State) -> String {
    let components = model.state_names().into_iter().zip(start);
    let values: Vec<String> =
        components.map(|(name, value)| format!("{} = {}", symbol(name), number(*value))).collect();
    format!("motion from {}", values.join(", "))
}

fn flights(orbit: &Orbit) -> String {
    let word = shortened(&orbit.word.time_order());
    match orbit.word.len() {
        0 if orbit.strobe_meshing.is_some() => "always in contact".to_owned(),
        0 => "no contact".to_owned(),
        n if n > WORD_SYMBOLS => format!("word {word} ({n} symbols)"),
        _ => format!("word {word}"),
    }
}

/// Writes runs of a symbol in a long word as powers, and cuts the word if that is still too long.
fn shortened(word: &str) -> String {
    if word.len() <= WORD_SYMBOLS {
        return word.to_owned();
    }
    let mut text = String::new();
    for run in word.as_bytes().chunk_by(|a, b| a == b) {
        let mut power = char::from(run[0]).to_string();
        if run.len() > 1 {
            power.extend(run.len().to_string().chars().map(superscript));
        }
        if text.chars().count() + power.chars().count() > WORD_SYMBOLS {
            return text + "\u{2026}";
        }
        text += &power;
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_words_have_powers_and_are_cut() {
        assert_eq!(shortened("13554622"), "13554622");
        assert_eq!(shortened(&format!("1{}36", "2".repeat(130))), "12\u{b9}\u{b3}\u{2070}36");
        let long = shortened(&"36".repeat(40));
        assert_eq!((long.chars().count(), long.ends_with('\u{2026}')), (33, true));
    }
}
