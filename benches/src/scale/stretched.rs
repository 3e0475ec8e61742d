//! A small map, stretched.

use rattlemap::map::Map;
use rattlemap::record::Record;

/// Numbers differ from those of the small map by this much of themselves.
const CHANGE: f64 = 1e-3;

/// Records of a map of `counts` cells, made of those of a small one.
#[derive(Clone, Debug)]
pub struct Stretched<'m> {
    small: &'m Map,
    counts: [usize; 2],
}

impl<'m> Stretched<'m> {
    /// One start per cell.
    pub fn new(small: &'m Map, counts: [usize; 2]) -> Stretched<'m> {
        Stretched { small, counts }
    }

    /// The record of a cell.
    pub fn record(&self, id: u32) -> Record {
        let [columns, rows] = self.small.counts();
        let (i, j) = (id as usize % self.counts[0], id as usize / self.counts[0]);
        let (i, j) = (i * columns / self.counts[0], j * rows / self.counts[1]);
        let mut record = self.small.records()[j * columns + i];
        let mut random = u64::from(id);
        // Those of a lane in single precision.
        let mut change =
            |value: &mut f64| *value *= 1.0 + f64::from((CHANGE * (unit(&mut random) - 0.5)) as f32);
        change(&mut record.lyapunov);
        change(&mut record.lyapunov_error);
        change(&mut record.mesh_fraction);
        if record.period == 0 {
            change(&mut record.impacts_per_period);
        }
        for x in &mut record.strobe {
            change(x);
            *x = f64::from(*x as f32);
        }
        record
    }
}

/// A number from 0 to 1 (SplitMix64).
fn unit(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut x = *state;
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 11) as f64 * 2f64.powi(-53)
}
