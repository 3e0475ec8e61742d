//! Half the meshing speed: what a validation says of it is what two maps say.

use crate::computed::computed;
use crate::judged::validated;
use rattlemap::gpu::Precision;
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Purpose, Scene};
use rattlemap::record::classify::classify;
use rattlemap::record::{Record, Spelling};
use rattlemap_dynamics::orbit::Class;

/// Impacts pile up into meshing almost everywhere.
fn plan(mesh_speed: f64) -> Plan {
    let text = "[[axis]]\nparameter = 'e'\nmin = 0.05\nmax = 0.4\ncount = 8\n\
                [[axis]]\nparameter = 'omega'\nmin = 1.2\nmax = 6.2\ncount = 9\n\
                [outputs]\nquantities = ['class', 'lyapunov', 'mesh', 'word', 'pattern']\n";
    let sets = [format!("mesh_speed={mesh_speed:?}")];
    Plan::new(&Scene::parse(text, "s", &sets, Purpose::Map).unwrap())
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
fn it_changes_words_and_hardly_patterns() {
    let [whole, half] = [0.01, 0.005].map(plan);
    let [before, after] = [&whole, &half].map(computed);
    let found = validated(&whole, &before, Precision::F64, true).half_mesh.unwrap();
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
    assert!(
        words > among[1] / 3 && patterns < among[1] / 10,
        "{words} words, {patterns} patterns of {among:?}"
    );
    // At a speed of none there is no half.
    let never = plan(0.0);
    assert_eq!(validated(&never, &computed(&never), Precision::F64, true).half_mesh, None);
}
