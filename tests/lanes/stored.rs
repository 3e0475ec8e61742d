//! Stored records of the gear pair, computed before walls could be rigid or elastic.
//!
//! `stored/` has a table for each precision, whose first line names the driver. On this driver every bit must be the
//! same. Another driver sums in another order; there, status, period and word must be the same in cells where both
//! precisions agree. `STORE_RECORDS=1` writes the tables anew.

use std::fs;
use std::path::PathBuf;

use crate::common::gpu::{engine, open};
use rattlemap::gpu::{Precision, describe};
use rattlemap::map::plan::{Cell, Plan};
use rattlemap::map::scene::{Purpose, Scene};
use rattlemap::record::Record;

const SCENE: &str = "
axis = [
    { parameter = 'e', min = 0.02, max = 0.93, count = 8 },
    { parameter = 'omega', min = 1.1, max = 10.9, count = 8 },
]
[outputs]
quantities = ['class', 'lyapunov', 'impacts', 'mesh', 'symmetric', 'word', 'pattern']
";

fn table(precision: Precision) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join(format!("tests/lanes/stored/gear_pair_{}.csv", precision.name()))
}

/// Returns status, period and word, then all numbers as bits.
fn row(record: &Record) -> String {
    let word = record.spelling().map(|word| word.text()).unwrap_or_default();
    let numbers = [record.lyapunov, record.lyapunov_error, record.impacts_per_period, record.mesh_fraction];
    let bits: String = numbers
        .into_iter()
        .chain(record.strobe.iter().take(4))
        .map(|x| format!(",{:016x}", x.to_bits()))
        .collect();
    let Record { status, period, periods_run, symmetric, word_hash, pattern_hash, .. } = record;
    format!("{status},{period},{word},{periods_run},{symmetric},{word_hash:016x},{pattern_hash:016x}{bits}")
}

/// Returns status, period and word of a row.
fn class_of(row: &str) -> Vec<&str> {
    row.split(',').take(3).collect()
}

#[test]
fn the_gear_pair_has_its_stored_records() {
    let plan = Plan::new(&Scene::parse(SCENE, "stored", &[], Purpose::Map).unwrap());
    let cells: Vec<Cell> = (0..plan.run_count() as u32).map(|id| plan.cell(id)).collect();
    let stored = Precision::ALL.map(|precision| fs::read_to_string(table(precision)).unwrap_or_default());
    let rows = stored.each_ref().map(|text| text.lines().skip(1).collect::<Vec<_>>());
    for (k, precision) in Precision::ALL.into_iter().enumerate() {
        let driver = describe(open(precision).adapter());
        let records = pollster::block_on(engine(&plan, precision).run(&cells)).unwrap();
        let now: Vec<String> = records.iter().map(row).collect();
        if std::env::var_os("STORE_RECORDS").is_some() {
            fs::write(table(precision), format!("{driver}\n{}\n", now.join("\n"))).unwrap();
            continue;
        }
        assert_eq!(rows[k].len(), now.len(), "{precision:?}");
        let is_same = stored[k].lines().next() == Some(driver.as_str());
        let compared = if is_same { "every bit" } else { "status, period and word, on another driver" };
        println!("{precision:?} on {driver}: {compared}");
        for (i, cell) in cells.iter().enumerate() {
            let then = rows[k][i];
            if is_same {
                assert_eq!(now[i], then, "{precision:?}, cell {}", cell.id);
            } else if class_of(rows[0][i]) == class_of(rows[1][i]) {
                assert_eq!(class_of(&now[i]), class_of(then), "{precision:?}, cell {}", cell.id);
            }
        }
    }
}
