//! Maps of machines, judged by the ODE solver.

use crate::validate::fixtures::{cpu_records, unexplained, validate_all};
use rattlemap::gpu::Precision;
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Purpose, Scene};
use rattlemap::record::Record;
use rattlemap::record::classify::classify;
use rattlemap::validate::{Judge, differences, independent};
use rattlemap_dynamics::orbit::Class;

/// Two gears between the walls of two gaps, on a shaft that feels them: cycles, and chaos.
fn gears(e: &str) -> Plan {
    let axis = |name: &str, min: &str, max: &str, count: usize| {
        format!("[[axis]]\nparameter = '{name}'\nmin = {min}\nmax = {max}\ncount = {count}\n")
    };
    let text = format!("model = 'two-loose-gears'\nparameters = {{ e = {e} }}\n")
        + &axis("omega", "120.0", "360.0", 5)
        + &axis("A", "1e-4", "7e-4", 3)
        + "[integration]\ntransient_periods = 150\nobserved_periods = 64\nmax_period = 16\n";
    Plan::new(&Scene::parse(&text, "gears.toml", &[], Purpose::Map).unwrap())
}

#[test]
fn a_map_of_a_machine_is_judged_and_a_falsified_record_is_found() {
    let plan = gears("0.6");
    let mut records = cpu_records(&plan);
    let found = validate_all(&plan, &records, Precision::F64, false);
    assert_eq!((found.judge, found.faults()), (Judge::Independent, Vec::new()), "{:?}", found.mismatches);
    let of = |id: u32, records: &Vec<Record>| independent::record(&plan, id, records);
    let judged: Vec<(u32, Record)> =
        (0..records.len() as u32).filter_map(|id| Some((id, of(id, &records)?))).collect();
    assert!(judged.len() > 7, "{} of {} cells are judged", judged.len(), records.len());
    let differs = |record: &Record, judge: &Record| {
        !differences(record, judge, Precision::F64, plan.oscillator(0).period(), plan.budget()).is_empty()
    };
    // The judge finds a reference that computes with a restitution which is off by a hundredth. Gears that come to rest on their flanks
    // once per period forget it.
    let others = cpu_records(&gears("0.594"));
    let cycles = judged.iter().filter(|(id, judge)| {
        judge.period > 0
            && classify(&records[*id as usize]) == Class::Periodic { period: judge.period }
            && judge.impacts_per_period > 0.0
    });
    let cycles: Vec<_> = cycles.collect();
    let wrong = cycles.iter().filter(|(id, judge)| differs(&others[*id as usize], judge)).count();
    assert!(cycles.len() >= 4 && 4 * wrong > cycles.len(), "{wrong} of {}", cycles.len());
    // A record of another cell.
    let (id, other) = (cycles[0].0, cycles[1].0);
    records[id as usize] = others[other as usize].clone();
    let found = validate_all(&plan, &records, Precision::F64, false);
    assert_eq!(unexplained(&found), [id]);
}
