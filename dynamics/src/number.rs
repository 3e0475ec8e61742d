//! Numbers in messages and summaries for people. Files have all digits.

/// Largest number of significant digits.
const DIGITS: i32 = 6;

/// Smallest power of ten of a number without an exponent.
const SMALLEST: i32 = -4;

/// Formats a number with at most six significant digits: `0.000473`, `12.5`, `2e8`.
pub fn significant(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        // 0 has no sign.
        return (x + 0.0).to_string();
    }
    let rounded = format!("{x:.*e}", DIGITS as usize - 1);
    let (mantissa, exponent) = rounded.split_once('e').unwrap_or((&rounded, "0"));
    let exponent: i32 = exponent.parse().unwrap_or_default();
    match (SMALLEST..DIGITS).contains(&exponent) {
        true => short(&format!("{x:.*}", (DIGITS - 1 - exponent) as usize)).to_owned(),
        false => format!("{}e{exponent}", short(mantissa)),
    }
}

/// Removes zeros at the end of a decimal fraction.
fn short(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

#[cfg(test)]
mod tests {
    use super::significant;

    #[test]
    fn numbers_of_any_size_have_six_significant_digits() {
        for (x, expected) in [
            (0.000_471_234_56, "0.000471235"),
            (-0.000_047_123_45, "-4.71235e-5"),
            (0.1 + 0.2, "0.3"),
            (999_999.5, "1e6"),
            (200_000_000.0, "2e8"),
            (123_456.0, "123456"),
            (-12.5, "-12.5"),
            (-0.0, "0"),
            (5e-324, "4.94066e-324"),
            (f64::NAN, "NaN"),
            (f64::NEG_INFINITY, "-inf"),
        ] {
            assert_eq!(significant(x), expected);
        }
    }
}
