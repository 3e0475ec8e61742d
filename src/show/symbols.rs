//! Mathematical symbols of parameters, for figures and the report. Files use the names that users type.

use rattlemap_dynamics::model::Parameter;

#[rustfmt::skip]
const GREEK: [(&str, char); 25] = [
    ("alpha", '\u{3b1}'), ("beta", '\u{3b2}'), ("gamma", '\u{3b3}'), ("delta", '\u{3b4}'), ("epsilon", '\u{3b5}'),
    ("zeta", '\u{3b6}'), ("eta", '\u{3b7}'), ("theta", '\u{3b8}'), ("iota", '\u{3b9}'), ("kappa", '\u{3ba}'),
    ("lambda", '\u{3bb}'), ("mu", '\u{3bc}'), ("nu", '\u{3bd}'), ("xi", '\u{3be}'), ("pi", '\u{3c0}'),
    ("rho", '\u{3c1}'), ("sigma", '\u{3c3}'), ("tau", '\u{3c4}'), ("upsilon", '\u{3c5}'), ("phi", '\u{3c6}'),
    ("chi", '\u{3c7}'), ("psi", '\u{3c8}'), ("omega", '\u{3c9}'), ("Delta", '\u{394}'), ("Omega", '\u{3a9}'),
];

/// Returns the symbol of a name: `omega` becomes a Greek letter, the digits of `x1` or `omega_0` become subscripts.
pub fn symbol(name: &str) -> String {
    let stem = name.trim_end_matches(|sign: char| sign.is_ascii_digit());
    let digits = &name[stem.len()..];
    let letters = if digits.is_empty() { stem } else { stem.trim_end_matches('_') };
    let greek = GREEK.iter().find(|(name, _)| *name == letters);
    let below =
        |digit: char| digit.to_digit(10).and_then(|digit| char::from_u32(0x2080 + digit)).unwrap_or(digit);
    let mut symbol = greek.map_or_else(|| letters.to_owned(), |(_, letter)| letter.to_string());
    symbol.extend(digits.chars().map(below));
    symbol
}

/// Returns a title with the symbols of Greek names, and with the sign of multiplication for a single `x` between blanks.
pub(crate) fn in_title(title: &str) -> String {
    let is_greek = |word: &str| {
        GREEK.iter().any(|(name, letter)| symbol(word).starts_with(*letter) && word.starts_with(name))
    };
    let word = |word: &str| {
        if is_greek(word) { symbol(word) } else { word.replacen("x", "\u{d7}", usize::from(word == "x")) }
    };
    title.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

/// Returns the label of a parameter's axis.
pub fn axis_label(parameter: &Parameter) -> String {
    let symbol = symbol(&parameter.name);
    // A parameter without a description has its name as meaning.
    let label = match parameter.meaning == parameter.name {
        true => symbol,
        false => format!("{}, {symbol}", parameter.meaning),
    };
    with_unit(&label, parameter.unit.as_deref())
}

/// Adds the unit, if there is one, to a label: `excitation frequency, f [Hz]`.
pub(crate) fn with_unit(label: &str, unit: Option<&str>) -> String {
    unit.map_or(label.to_owned(), |unit| format!("{label} [{unit}]"))
}

/// Formats a number with the typographic minus.
pub(crate) fn number(value: f64) -> String {
    value.to_string().replace('-', "\u{2212}")
}

/// Formats an equation of a parameter's symbol and its value, with its unit.
pub(crate) fn equation(parameter: &Parameter, value: f64) -> String {
    let unit = parameter.unit.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
    format!("{} = {}{unit}", symbol(&parameter.name), number(value))
}

/// Returns the superscript of a digit or minus.
pub(crate) fn superscript(sign: char) -> char {
    match sign {
        '-' | '\u{2212}' => '\u{207b}',
        '1' => '\u{b9}',
        '2' => '\u{b2}',
        '3' => '\u{b3}',
        _ => sign.to_digit(10).and_then(|digit| char::from_u32(0x2070 + digit)).unwrap_or(sign),
    }
}

/// Returns a word in which a series of equal parts is a power: `(05)` with a raised 9, instead of nine times `05`.
pub(crate) fn with_powers(word: &str) -> String {
    // A hash has no parts.
    if word.starts_with('#') {
        return word.to_owned();
    }
    // With several gaps, the letter of its gap belongs to a symbol.
    let is_letter = |c: char| c.is_ascii_alphabetic();
    let mut symbols: Vec<String> = Vec::new();
    for c in word.chars() {
        match symbols.last_mut().filter(|symbol| symbol.chars().all(is_letter)) {
            Some(letter) => letter.push(c),
            None => symbols.push(c.to_string()),
        }
    }
    let (mut text, mut rest) = (String::new(), &symbols[..]);
    while !rest.is_empty() {
        let series = |length: usize| {
            let times = 1 + rest[length..].chunks(length).take_while(|part| *part == &rest[..length]).count();
            let exponent: String = times.to_string().chars().map(superscript).collect();
            let part = rest[..length].concat();
            let power = if part.len() == 1 { part + &exponent } else { format!("({part}){exponent}") };
            let whole: usize = rest[..times * length].iter().map(String::len).sum();
            (whole.saturating_sub(power.chars().count()), times * length, power)
        };
        match (1..=rest.len() / 2).map(series).max_by_key(|(saved, ..)| *saved) {
            Some((saved, length, power)) if saved >= LEAST_SAVED => {
                text += &power;
                rest = &rest[length..];
            }
            _ => {
                text += &rest[0];
                rest = &rest[1..];
            }
        }
    }
    text
}

/// Characters by which a power is at least shorter than its series.
const LEAST_SAVED: usize = 3;

/// Returns the digit or minus of a superscript.
pub(crate) fn lowered(sign: char) -> Option<char> {
    "\u{2212}0123456789".chars().find(|&plain| superscript(plain) == sign)
}

#[cfg(test)]
mod tests {
    use super::{axis_label, equation, in_title};
    use crate::model_file::FileModel;
    use crate::show::symbols::symbol;
    use rattlemap_dynamics::model::Model;

    #[test]
    fn labels_and_equations_have_units() {
        let text = FileModel::built_in("bilinear").unwrap().definition().text.clone();
        let with =
            text.replace("meaning = \"excitation frequency\"", "unit = \"rad/s\", meaning = \"frequency\"");
        let model = FileModel::parse(&with, "m.toml").unwrap();
        let [omega, zeta] = ["omega", "zeta"].map(|name| &model.parameters()[model.index(name).unwrap()]);
        assert_eq!(axis_label(omega), "frequency, \u{3c9} [rad/s]");
        assert_eq!(equation(omega, 1.5), "\u{3c9} = 1.5 rad/s");
        assert_eq!(
            (axis_label(zeta), equation(zeta, 0.1)),
            ("damping ratio, \u{3b6}".into(), "\u{3b6} = 0.1".into())
        );
    }

    #[test]
    fn titles_have_symbols() {
        let title = in_title("Beats: omega_0 x e at 64 x 64 cells, betas");
        assert_eq!(title, "Beats: \u{3c9}\u{2080} \u{d7} e at 64 \u{d7} 64 cells, betas");
    }

    #[test]
    #[rustfmt::skip]
    fn names_become_symbols() {
        for (name, expected) in [
            ("omega", "\u{3c9}"), ("Omega", "\u{3a9}"), ("lambda", "\u{3bb}"), ("e", "e"), ("mesh_speed", "mesh_speed"),
            ("x1", "x\u{2081}"), ("k12", "k\u{2081}\u{2082}"), ("omega_0", "\u{3c9}\u{2080}"), ("zeta2", "\u{3b6}\u{2082}"),
            ("7", "\u{2087}"),
        ] {
            assert_eq!(symbol(name), expected);
        }
    }
}
