//! Names in output files. They are part of the contract with scripts.

use crate::map::scene::Format;
pub use crate::model_file::side;
use rattlemap_dynamics::model::Side;
use rattlemap_dynamics::orbit::Class;

/// Returns the name of a figure's file.
pub fn figure(what: &str, format: Format) -> String {
    format!("{what}.{}", format.name())
}

/// Returns the names of a figure's files in all formats.
pub fn figures(what: &str) -> [(Format, String); 3] {
    Format::FIGURES.map(|format| (format, figure(what, format)))
}

/// Returns the forcing periods per cycle of a periodic motion.
pub fn period(class: Class) -> Option<u32> {
    match class {
        Class::Periodic { period } => Some(period),
        _ => None,
    }
}

/// Returns 1 for the right wall, -1 for the left wall.
pub fn side_code(side: Side) -> i8 {
    match side {
        Side::Right => 1,
        Side::Left => -1,
    }
}

/// Whether tables tell a number.
pub(crate) fn is_told(x: f64) -> bool {
    x.is_finite() || x == f64::NEG_INFINITY
}

/// Formats a number for a table: the shortest decimal that reads back as the same number. Absent and not finite numbers are
/// empty, except minus infinity, the exponent of a superstable cycle.
pub(crate) fn float(x: impl Into<Option<f64>>) -> String {
    x.into().filter(|x| is_told(*x)).map_or(String::new(), |x| format!("{x:?}"))
}

/// Formats an optional value for a table. An absent value is empty.
pub(crate) fn optional(value: Option<impl ToString>) -> String {
    value.map_or(String::new(), |value| value.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_not_finite_are_empty_in_tables_except_the_exponent_of_a_superstable_cycle() {
        assert_eq!(
            [0.1 + 0.2, -0.0, f64::NAN, f64::INFINITY].map(float),
            ["0.30000000000000004", "-0.0", "", ""]
        );
        assert_eq!([Some(1.0), Some(f64::NEG_INFINITY), None].map(float), ["1.0", "-inf", ""]);
    }
}
