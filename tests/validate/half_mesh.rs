//! The rates that a validation reports at half the meshing speed must equal those that two maps give.

use crate::validate::fixtures::{cpu_records, validate_all};
use rattlemap::gpu::Precision;
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Quantity, Scene};
use rattlemap::record::classify::classify;
use rattlemap::record::{Record, Spelling};
use rattlemap_dynamics::model::GearPair;
use rattlemap_dynamics::orbit::Class;

/// Returns the plan of a map in which chatter ends in meshing almost everywhere.
fn plan(mesh_speed: f64) -> Plan {
    use Quantity::{Class, Lyapunov, Mesh, Pattern, Word};
    let scene = Scene::builder(GearPair { mesh_speed, ..GearPair::paper(0.5) })
        .axis("e", 0.05..=0.4, 8)
        .axis("omega", 1.2..=6.2, 9)
        .quantities(&[Class, Lyapunov, Mesh, Word, Pattern]);
    Plan::new(&scene.build().unwrap())
}

fn is_same(ours: Option<Spelling>, theirs: Option<Spelling>) -> bool {
    match (&ours, &theirs) {
        (Some(Spelling::Whole(ours)), Some(Spelling::Whole(theirs))) => {
            ours == theirs || ours.mirrored() == *theirs
        }
        _ => ours == theirs,
    }
}

#[test]
fn half_the_meshing_speed_changes_words_and_few_patterns() {
    let [whole, half] = [0.01, 0.005].map(plan);
    let [before, after] = [&whole, &half].map(cpu_records);
    let found = validate_all(&whole, &before, Precision::F64, true).half_mesh.unwrap();
    let meshing = || before.iter().zip(&after).filter(|(record, _)| record.mesh_fraction > 0.0);
    let is_cycle = |record: &Record| matches!(classify(record), Class::Periodic { .. });
    let cycles = || meshing().filter(|(before, after)| is_cycle(before) && is_cycle(after));
    let changed = |of: fn(&Record) -> Option<Spelling>| {
        cycles().filter(|(before, after)| !is_same(of(before), of(after))).count()
    };
    let rates = [found.classes, found.periods, found.words, found.patterns];
    let among = [meshing().count(), cycles().count(), cycles().count(), cycles().count()];
    assert_eq!(rates.map(|rate| rate.among), among);
    let [words, patterns] = [changed(Record::spelling), changed(Record::pattern)];
    let periods = cycles().filter(|(before, after)| before.period != after.period).count();
    assert_eq!(rates.map(|rate| rate.count)[1..], [periods, words, patterns]);
    let few = words > among[1] / 3 && patterns < among[1] / 10;
    assert!(few, "{words} words and {patterns} patterns of {among:?} change");
    // A meshing speed of zero has no half.
    let never = plan(0.0);
    assert_eq!(validate_all(&never, &cpu_records(&never), Precision::F64, true).half_mesh, None);
}
