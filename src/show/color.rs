//! The colour type of figures, layers and reports.

/// Red, green and blue.
pub type Color = [u8; 3];

/// Returns a colour as six hexadecimal digits.
pub(crate) fn hex([r, g, b]: Color) -> String {
    format!("{r:02x}{g:02x}{b:02x}")
}
