//! What people write: TOML in which every value knows its place (`document`), tables of known fields (`section`),
//! errors that name file, line, field, value and remedy ([`error`]), formulas ([`expression`]), and what of a text a
//! terminal may see ([`printable`]) and a shell takes as it is ([`shell`]). Pure.

pub(crate) mod document;
pub mod error;
pub mod expression;
pub mod printable;
pub(crate) mod section;
pub mod shell;
#[cfg(feature = "figures")]
pub(crate) mod size;
