//! The results of gear pairs must not change by a bit.
//!
//! `data/gear_pair_bits.csv` was computed on x86-64 Linux with `avx2` and `fma`, the settings of
//! `.cargo/config.toml`. There every bit must agree. On other targets rounding differs, and only period and word must
//! agree. `STORE_RECORDS=1` writes the table again.

use crate::common::{BUDGET, REST, flow_of};
use rattlemap_dynamics::model::GearPair;
use rattlemap_dynamics::orbit::{Budget, Measurement, Settings, measure};
use rayon::prelude::*;

/// Whether this is the target on which the table was computed.
const IS_SAME: bool =
    cfg!(all(target_arch = "x86_64", target_os = "linux", target_feature = "avx2", target_feature = "fma"));

/// Returns 64 cells over restitution and frequency, half of them with infinite chatter.
fn cells() -> Vec<GearPair> {
    let cell = |n: u32| {
        let (i, j) = (f64::from(n % 8), f64::from(n / 8));
        let mesh_speed = if n.is_multiple_of(2) { 0.01 } else { 0.0 };
        GearPair { omega: 1.1 + 1.4 * j, mesh_speed, ..GearPair::paper(0.02 + 0.13 * i) }
    };
    (0..64).map(cell).collect()
}

fn measured(pair: &GearPair) -> Measurement {
    let settings = Settings { transient_periods: 200, ..Settings::default() };
    let budget = Budget { settings, undecided_periods: 328, ..BUDGET };
    measure(&flow_of(pair), pair.law(), REST, &budget)
}

/// Returns a line of the table: period (0 for none), word, and the bits of exponent and strobe state.
fn row(measured: &Measurement) -> String {
    let [lyapunov, _] = measured.lyapunov.unwrap_or([f64::NAN; 2]);
    let bits = [lyapunov]
        .into_iter()
        .chain(measured.strobe[..4].iter().copied())
        .map(|x| format!("{:016x}", x.to_bits()));
    let word = measured.word.as_ref().map(ToString::to_string).unwrap_or_default();
    let first = [measured.period.unwrap_or(0).to_string(), word];
    first.into_iter().chain(bits).collect::<Vec<_>>().join(",")
}

#[test]
fn results_of_gear_pairs_agree_with_the_table_to_the_bit() {
    let table = include_str!("../data/gear_pair_bits.csv");
    let rows: Vec<String> = cells().par_iter().map(|pair| row(&measured(pair))).collect();
    if std::env::var_os("STORE_RECORDS").is_some() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/gear_pair_bits.csv");
        return std::fs::write(path, rows.join("\n") + "\n").unwrap();
    }
    assert_eq!(table.lines().count(), rows.len());
    for ((now, then), pair) in rows.iter().zip(table.lines()).zip(cells()) {
        if IS_SAME {
            assert_eq!(now, then, "{pair:?}");
        } else {
            let period_and_word = |row: &str| row.split(',').take(2).map(str::to_owned).collect::<Vec<_>>();
            assert_eq!(period_and_word(now), period_and_word(then), "{pair:?}");
        }
    }
}
