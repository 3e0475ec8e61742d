//! How sure are averages over motion that is on no cycle?

use crate::stability::standard_error;

/// What averages over a stretch of such motion are uncertain by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatter {
    /// Forcing periods that the exponent was averaged over.
    pub exponent_periods: u32,
    /// Forcing periods that impacts and meshing were averaged over.
    pub periods: u32,
    /// Standard errors of impacts per period and of the mesh fraction over these; infinite where there
    /// were too few periods to tell.
    pub errors: [f64; 2],
}

impl Scatter {
    /// That of averages over the last `periods` of a motion, from all of it that its exponent was averaged over.
    /// `counts` holds impacts and meshing time at every strobe of that.
    pub(crate) fn of(counts: &[[f64; 2]], periods: u32, forcing_period: f64) -> Scatter {
        let exponent_periods = counts.len().saturating_sub(1) as u32;
        // A longer stretch sees slower swings.
        let share = (f64::from(exponent_periods) / f64::from(periods.max(1))).max(1.0).sqrt();
        let error = |i: usize| {
            let each: Vec<f64> = counts.windows(2).map(|pair| pair[1][i] - pair[0][i]).collect();
            share * standard_error(&each)
        };
        Scatter { exponent_periods, periods, errors: [error(0), error(1) / forcing_period] }
    }
}
