//! Texts that users write: TOML whose values know their places (`document`), tables with known fields (`section`),
//! errors that name file, line, field, value and remedy ([`error`]), formulas ([`expression`]), text for terminals
//! ([`printable`]), and text for shells ([`shell`]). Pure.

pub(crate) mod document;
pub mod error;
pub mod expression;
pub mod printable;
pub(crate) mod section;
pub mod shell;
#[cfg(feature = "files")]
pub(crate) mod size;

/// Splits a table of test cases: one case per line, fields separated by `|`, with `\n` for a line break within a field.
#[cfg(test)]
pub(crate) fn test_cases<const N: usize>(table: &str) -> Vec<[String; N]> {
    let field = |field: &str| field.trim().replace("\\n", "\n");
    let case = |line: &str| {
        let fields: Vec<String> = line.split('|').map(field).collect();
        fields.try_into().unwrap_or_else(|fields| panic!("{N} fields: {fields:?}"))
    };
    table.lines().filter(|line| !line.trim().is_empty()).map(case).collect()
}
