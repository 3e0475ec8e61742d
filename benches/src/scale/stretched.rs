//! Records of a large map, derived from those of a small one.

use rattlemap::job::run::Map;
use rattlemap::record::Record;

/// Largest relative change of numbers of the small map. Only the first digit remains.
const CHANGE: f64 = 0.1;

/// One cell in this many gets the record of another cell of the small map.
const STRAY: f64 = 16.0;
/// Largest distance of that cell, in cells of the small map.
const AWAY: f64 = 3.0;

/// Records of a map of `counts` cells along its axes.
#[derive(Clone, Debug)]
pub struct Stretched<'m> {
    small: &'m Map,
    counts: [usize; 2],
}

impl<'m> Stretched<'m> {
    /// Stretches a map with one start per cell.
    pub fn new(small: &'m Map, counts: [usize; 2]) -> Stretched<'m> {
        Stretched { small, counts }
    }

    /// Returns the record of a cell.
    pub fn record(&self, id: u32) -> Record {
        let small = self.small.counts();
        let mut random = u64::from(id);
        let is_stray = STRAY * unit(&mut random) < 1.0;
        let at = [id as usize % self.counts[0], id as usize / self.counts[0]];
        let [i, j] = [0, 1].map(|axis| {
            let away = if is_stray { AWAY * (2.0 * unit(&mut random) - 1.0) } else { 0.0 };
            let place = (at[axis] * small[axis]) as f64 / self.counts[axis] as f64 + away;
            (place.max(0.0) as usize).min(small[axis] - 1)
        });
        let mut record = self.small.records().record(j * small[0] + i);
        let mut changed = |value: f64| value * (1.0 + CHANGE * (unit(&mut random) - 0.5));
        record.lyapunov = changed(record.lyapunov);
        record.lyapunov_error = changed(record.lyapunov_error);
        record.mesh_fraction = changed(record.mesh_fraction);
        if record.period == 0 {
            record.impacts_per_period = changed(record.impacts_per_period);
        }
        // Most lanes have single precision.
        record.strobe = record.strobe.map(|x| f64::from(changed(x) as f32));
        record
    }
}

/// Returns a random number from 0 to 1 (SplitMix64).
fn unit(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut x = *state;
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 11) as f64 * 2f64.powi(-53)
}
