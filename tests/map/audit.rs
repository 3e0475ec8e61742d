//! Audits of an adaptive map, compared with a map in which every cell is integrated.

use std::sync::LazyLock;

use rattlemap::map::engine::{Cpu, Engine};
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Purpose, Scene};
use rattlemap::map::schedule::{Audit, Deviation, Schedule};
use rattlemap::record::classify::classify;
use rattlemap::record::{Record, valid};
use rattlemap_dynamics::orbit::Class;

/// A window of the main map with bands of cycles with different numbers of impacts.
const SCENE: &str = "axis = [
    { parameter = 'e', min = 0.2, max = 0.5, count = 65 },
    { parameter = 'omega', min = 3.0, max = 8.0, count = 65 },
]
[outputs]
quantities = ['class', 'lyapunov', 'impacts', 'mesh']
";

fn plan(refine: &str) -> Plan {
    Plan::new(&Scene::parse(&format!("{SCENE}{refine}"), "test", &[], Purpose::Map).unwrap())
}

/// Records of the map in which every cell is integrated.
static WHOLE: LazyLock<Vec<Record>> = LazyLock::new(|| {
    let plan = plan("");
    crate::map::computed(&plan, &mut Engine::Cpu(Cpu::new(&plan)), plan.cell_count())
});

/// Computes the adaptive map with `audited` cells in its only audit.
fn adaptive(audited: usize) -> (Vec<Record>, Audit) {
    let whole = &*WHOLE;
    let plan = plan(&format!("[refine]\nminimum_grid = 8\nmax_error = 0.5\naudit = {audited}"));
    let mut schedule = Schedule::new(&plan);
    let mut records = vec![Record::default(); whole.len()];
    while !schedule.is_finished() {
        for cell in schedule.next(&plan, usize::MAX) {
            records[cell.id as usize] = whole[cell.id as usize].clone();
            schedule.take(cell.id, &records);
        }
    }
    let refined = schedule.finish(&mut records).unwrap();
    let [audit] = refined.audits[..] else { panic!("{refined:?}") };
    (records, audit)
}

/// An audit of all filled cells has the errors that follow from both maps. For comparison, an audit of a single cell
/// leaves nearly all cells filled.
#[test]
fn an_audit_of_all_filled_cells_agrees_with_both_maps() {
    let (_, audit) = adaptive(WHOLE.len());
    assert_eq!(audit.sampled, audit.filled);
    let (filled, single) = adaptive(1);
    assert_eq!((single.sampled, single.filled, single.wrong), (1, audit.filled, 0));
    type Quantity = (u32, fn(&Record) -> f64, Option<Deviation>);
    let quantities: [Quantity; 3] = [
        (valid::LYAPUNOV, |record| record.lyapunov, audit.errors.lyapunov),
        (valid::IMPACTS, |record| record.impacts_per_period, audit.errors.impacts),
        (valid::MESH, |record| record.mesh_fraction, audit.errors.mesh),
    ];
    for (bit, field, deviation) in quantities {
        let deviation = deviation.unwrap();
        let own =
            filled.iter().zip(&*WHOLE).filter(|(cell, own)| cell.valid & valid::FILLED & !own.valid != 0);
        let (with, without): (Vec<_>, Vec<_>) = own.partition(|(cell, _)| cell.valid & bit != 0);
        let mut differences: Vec<f64> =
            with.iter().map(|(cell, own)| (field(cell) - field(own)).abs()).collect();
        differences.sort_by(f64::total_cmp);
        // The single audited cell is missing.
        assert_eq!(differences.len() + without.len() + 1, audit.filled);
        assert!(deviation.compared - differences.len() <= 1, "{deviation:?}");
        assert!(deviation.empty - without.len() <= 1, "{deviation:?}");
        let off = differences.iter().filter(|&&difference| difference >= 1.0 - 1e-9).count();
        assert!(deviation.off_by_one - off <= 1, "{deviation:?}, {off}");
        for (share, quantile) in [(0.5, deviation.median), (0.95, deviation.p95), (1.0, deviation.worst)] {
            let place = (share * differences.len() as f64).ceil() as usize - 1;
            let around = differences[place - 1]..=differences[(place + 1).min(differences.len() - 1)];
            assert!(around.contains(&quantile), "{share}: {quantile}, {around:?}");
        }
    }
}

/// Filled impacts of cycles are whole numbers over the period, or empty between bands with different counts.
#[test]
fn filled_impacts_of_cycles_are_whole_numbers_or_empty() {
    let (records, audit) = adaptive(1);
    let (mut counted, mut empty) = (0, 0);
    for record in records.iter().filter(|record| record.valid & valid::FILLED != 0) {
        let Class::Periodic { period } = classify(record) else { continue };
        let count = record.impacts_per_period * f64::from(period);
        assert!((count - count.round()).abs() < 1e-9, "{record:?}");
        *if record.valid & valid::IMPACTS != 0 { &mut counted } else { &mut empty } += 1;
    }
    assert!(counted > audit.filled / 4 && empty > audit.filled / 20, "{counted} counted, {empty} empty");
}
