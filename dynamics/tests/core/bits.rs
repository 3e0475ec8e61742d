//! The gear pair's records to the bit, as they were before oscillators had full mass matrices, rigid and
//! elastic walls.
//!
//! `data/gear_pair_bits.csv` was made on x86-64 Linux with `avx2` and `fma`, as `.cargo/config.toml` asks for:
//! there every bit must agree. Elsewhere rounding differs, and only what a cell is must be the same.

use crate::common::REST;
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::GearPair;
use rattlemap_dynamics::orbit::{Budget, Measurement, Settings, measure};
use rayon::prelude::*;

/// Whether this is a target that the table was made on.
const IS_SAME: bool =
    cfg!(all(target_arch = "x86_64", target_os = "linux", target_feature = "avx2", target_feature = "fma"));

/// 64 cells over restitution and frequency, in every other column with infinite chatter.
fn cells() -> Vec<GearPair> {
    let cell = |n: u32| {
        let (i, j) = (f64::from(n % 8), f64::from(n / 8));
        let mesh_speed = if n.is_multiple_of(2) { 0.01 } else { 0.0 };
        GearPair { omega: 1.1 + 1.4 * j, mesh_speed, ..GearPair::paper(0.02 + 0.13 * i) }
    };
    (0..64).map(cell).collect()
}

fn measured(pair: &GearPair) -> Measurement {
    let budget = Budget {
        settings: Settings { transient_periods: 200, ..Settings::default() },
        early_stop: true,
        undecided_periods: 328,
        exponent: true,
        shows_exponent: true,
    };
    measure(&Flow::new(&pair.oscillator().expect("valid")), pair.law(), REST, &budget)
}

/// Period (0: none), word, then the bits of exponent and strobe state.
fn row(measured: &Measurement) -> String {
    let [lyapunov, _] = measured.lyapunov.unwrap_or([f64::NAN; 2]);
    let bits = [lyapunov].into_iter().chain(measured.strobe).map(|x| format!("{:016x}", x.to_bits()));
    let word = measured.word.as_ref().map(ToString::to_string).unwrap_or_default();
    let first = [measured.period.unwrap_or(0).to_string(), word];
    first.into_iter().chain(bits).collect::<Vec<_>>().join(",")
}

#[test]
fn the_gear_pair_keeps_its_bits() {
    let table = include_str!("../data/gear_pair_bits.csv");
    let rows: Vec<String> = cells().par_iter().map(|pair| row(&measured(pair))).collect();
    assert_eq!(table.lines().count(), rows.len());
    for ((now, then), pair) in rows.iter().zip(table.lines()).zip(cells()) {
        if IS_SAME {
            assert_eq!(now, then, "{pair:?}");
        } else {
            let what = |row: &str| row.split(',').take(2).map(str::to_owned).collect::<Vec<_>>();
            assert_eq!(what(now), what(then), "{pair:?}");
        }
    }
}
