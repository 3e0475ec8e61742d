//! The colour type of figures, layers and reports.

/// Red, green and blue.
pub type Color = [u8; 3];
