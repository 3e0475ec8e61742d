//! Errors in descriptions of oscillators.

use thiserror::Error;

use crate::number::significant;

/// An error in an oscillator or a contact law.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum OscillatorError {
    /// A number that is out of its range.
    #[error("{quantity} = {}: it must be {requirement}", significant(*.value))]
    OutOfRange {
        /// The quantity.
        quantity: String,
        /// The rejected value.
        value: f64,
        /// The range in words.
        requirement: &'static str,
    },
    /// Walls that leave no room between them.
    #[error("walls at {} and {}: the right one must lie above the left one", significant(.walls[0]), significant(.walls[1]))]
    Walls {
        /// Positions of the right and the left wall.
        walls: [f64; 2],
    },
}

pub(super) fn finite(quantity: impl Fn() -> String, value: f64) -> Result<(), OscillatorError> {
    require(value.is_finite(), quantity, value, "a finite number")
}

pub(super) fn positive(quantity: impl Fn() -> String, value: f64) -> Result<(), OscillatorError> {
    require(value.is_finite() && value > 0.0, quantity, value, "finite and greater than 0")
}

pub(super) fn require(
    is_allowed: bool,
    quantity: impl Fn() -> String,
    value: f64,
    requirement: &'static str,
) -> Result<(), OscillatorError> {
    match is_allowed {
        true => Ok(()),
        false => Err(OscillatorError::OutOfRange { quantity: quantity(), value, requirement }),
    }
}
