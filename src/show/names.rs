//! The names that outputs use: part of the contract with scripts.

use crate::map::scene::Format;
use crate::show::cells::Source;
use rattlemap_dynamics::model::Side;
use rattlemap_dynamics::orbit::{Class, EventKind, Status};

/// Every class name, in the order in which they are counted.
pub(crate) const CLASSES: [&str; 4] = Class::NAMES;

/// The name of a figure's file.
pub(crate) fn figure(what: &str, format: Format) -> String {
    format!("{what}.{}", format.name())
}

/// A figure's files, by format.
pub(crate) fn figures(what: &str) -> [(Format, String); 3] {
    Format::FIGURES.map(|format| (format, figure(what, format)))
}

pub(crate) fn class(class: Class) -> &'static str {
    class.name()
}

/// The number that stands for a class in tables: its place in [`CLASSES`].
pub(crate) fn class_code(class: Class) -> i8 {
    class.index() as i8
}

/// Forcing periods per cycle, where the motion is periodic.
pub(crate) fn period(class: Class) -> Option<u32> {
    match class {
        Class::Periodic { period } => Some(period),
        _ => None,
    }
}

pub(crate) fn status(status: Status) -> &'static str {
    status.name()
}

pub(crate) fn kind(kind: EventKind) -> &'static str {
    match kind {
        EventKind::Impact => "impact",
        EventKind::MeshStart => "mesh_start",
        EventKind::MeshEnd => "mesh_end",
    }
}

/// `1` right, `-1` left.
pub(crate) fn side(side: Side) -> i8 {
    match side {
        Side::Right => 1,
        Side::Left => -1,
    }
}

pub(crate) fn source(source: Source) -> &'static str {
    match source {
        Source::Integrated => "integrated",
        Source::Filled => "filled",
    }
}

/// A number in a table: the shortest decimal that reads back as the same; empty where there is none or it is not finite.
pub(crate) fn float(x: impl Into<Option<f64>>) -> String {
    x.into().filter(|x| x.is_finite()).map_or(String::new(), |x| format!("{x:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_have_finite_numbers_or_nothing() {
        assert_eq!(
            [0.1 + 0.2, -0.0, f64::NAN, f64::INFINITY].map(float),
            ["0.30000000000000004", "-0.0", "", ""]
        );
        assert_eq!([Some(1.0), Some(f64::NEG_INFINITY), None].map(float), ["1.0", "", ""]);
    }
}
