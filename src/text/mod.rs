//! Texts that users write: TOML whose values know their places (`document`), tables with known fields (`section`), errors that
//! name file, line, field, value and remedy ([`error`]), formulas ([`expression`]), text for terminals ([`printable`]), and
//! text for shells ([`shell`]). Pure.

pub(crate) mod document;
pub mod error;
pub mod expression;
pub mod printable;
pub(crate) mod section;
pub mod shell;
