//! The cells whose chaos ends in a validation must be those of a map that continues its chaotic cells.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use crate::validate::fixtures::cpu_records;
use rattlemap::gpu::Precision;
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Purpose, Scene};
use rattlemap::record::classify::classify;
use rattlemap::validate::{Rate, Subject, draw_chaos, follow_chaos};
use rattlemap_dynamics::orbit::Class;

const SCENE: &str = include_str!("../../scenes/gallery/impact_oscillator.toml");
const PERIODS: u32 = 1000;

fn plan(further: u32) -> Plan {
    let sets = ["axis.0.count=28", "axis.1.count=28", &format!("integration.confirm_chaos={further}")];
    Plan::new(&Scene::parse(SCENE, "s", &sets.map(str::to_owned), Purpose::Map).unwrap())
}

#[test]
fn the_followed_cells_end_as_in_a_map_with_further_periods() {
    let (whole, longer) = (plan(0), plan(PERIODS));
    let [records, continued] = [&whole, &longer].map(cpu_records);
    let subject = Subject { plan: &whole, records: &records, precision: Precision::F64, is_lane: false };
    let chaotic = records.iter().filter(|record| classify(record) == Class::Chaotic).count();
    // A fifth of the sample is followed, drawn at random; here all.
    let (few, runs) = draw_chaos(&records, 20, 1);
    assert_eq!((few.len(), runs), (4, chaotic));
    assert_ne!(few, draw_chaos(&records, 20, 2).0, "another seed draws other cells");
    let (ids, _) = draw_chaos(&records, 5 * records.len(), 1);
    assert_eq!(ids.len(), chaotic);
    let (done, halt) = (AtomicUsize::new(0), AtomicBool::new(false));
    let report = || _ = done.fetch_add(1, Ordering::Relaxed);
    let found = follow_chaos(&subject, (&ids, runs), PERIODS, &report, &halt);
    assert_eq!(done.into_inner(), chaotic);
    let ended: Vec<(u32, Class, u32)> =
        found.ended.iter().map(|end| (end.id, end.class, end.periods_run)).collect();
    let of = |&id: &u32| {
        let record = &continued[id as usize];
        (id, classify(record), record.periods_run)
    };
    let expected: Vec<(u32, Class, u32)> =
        ids.iter().map(of).filter(|(_, class, _)| *class != Class::Chaotic).collect();
    assert_eq!(ended, expected);
    assert_eq!(found.rate, Rate::new(expected.len(), chaotic));
    let periodic = ended.iter().filter(|(_, class, _)| matches!(class, Class::Periodic { .. })).count();
    assert!(periodic > 3 && ended.len() < chaotic / 2, "{ended:?} of {chaotic}");
    assert_eq!(found.ended[0].indices, whole.indices(found.ended[0].id));
}
