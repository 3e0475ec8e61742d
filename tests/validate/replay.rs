//! `rattlemap validate`: what agrees, how differences are explained, and that planted errors are found.
//!
//! The lanes need an adapter; the tests fail without one: see `scripts/test.sh`.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::gpu::{map, open};
use crate::validate::fixtures::{
    EVERYTHING, cpu_identity, cpu_records, kind, kinds, read_records, sample_of, unexplained, validate_all,
    validate_first,
};
use assert_cmd::Command;
use rattlemap::gpu::Precision;
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Purpose, Scene};
use rattlemap::model_file::FileModel;
use rattlemap::record::classify::{classify, status};
use rattlemap::record::{Record, measures, valid};
use rattlemap::store::inventory;
use rattlemap::store::record_file::{Identity, RECORDS, RecordFile};
use rattlemap::validate::{
    Judge, Kind, Lanes, Sample, Stratum, Subject, Validation, independent, replay, sample,
};
use rattlemap_dynamics::model::{GearPair, REST};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::motion::Trajectory;
use rattlemap_dynamics::orbit::{Class, Status};
use rattlemap_dynamics::stability::{StrobeMap, multipliers};
use rattlemap_dynamics::word::Word;

/// Allows undecided cells as many periods as scenes/e_omega.toml.
const EXTENDED: &str = "integration.undecided_periods=1584";

fn scene_text(columns: usize, rows: usize) -> String {
    format!(
        "[[axis]]\nparameter = \"e\"\nmin = 0.0\nmax = 1.0\ncount = {columns}\n\n\
         [[axis]]\nparameter = \"omega\"\nmin = 1.0\nmax = 12.0\ncount = {rows}\n\n\
         [outputs]\nquantities = [\"class\", \"lyapunov\", \"impacts\", \"mesh\", \"symmetric\", \"word\", \"pattern\"]\n\
         files = [\"html\"]\n"
    )
}

fn scene(columns: usize, rows: usize) -> Scene {
    Scene::parse(&scene_text(columns, rows), "s", &[], Purpose::Map).unwrap()
}

/// Returns the plan of a map between these restitutions and frequencies.
fn plan_between([least, most]: [f64; 2], [slow, fast]: [f64; 2], count: usize, sets: &[&str]) -> Plan {
    let ranges = format!("axis.0.min={least:?} axis.0.max={most:?} axis.1.min={slow:?} axis.1.max={fast:?}");
    let sets: Vec<String> = ranges.split(' ').chain(sets.iter().copied()).map(str::to_owned).collect();
    Plan::new(&Scene::parse(&scene_text(count, count), "s", &sets, Purpose::Map).unwrap())
}

/// Returns a plan whose first cell is this one.
fn plan_at(e: f64, omega: f64, sets: &[&str]) -> Plan {
    plan_between([e, 1.0], [omega, 20.0], 2, sets)
}

fn settled(record: &Record) -> bool {
    record.period == 1
        && record.status == Status::Ok.code()
        && record.lyapunov.abs() > 0.15
        && record.impacts_per_period > 0.0
}

fn chaotic(record: &Record) -> bool {
    classify(record) == Class::Chaotic && record.lyapunov > 0.2
}

// ---- single records

/// Name of the wrong field, whether a record can be wrong in this way, and the function that makes it wrong.
type Planted = (&'static str, fn(&Record) -> bool, fn(&mut Record));

const PLANTED: [Planted; 20] = [
    ("period", settled, |record| record.period += 1),
    ("class", settled, |record| (record.period, record.lyapunov, record.lyapunov_error) = (0, 0.4, 0.01)),
    ("word", settled, |record| record.set_word(&Word::cyclic(b"1435"))),
    ("pattern", settled, |record| record.set_pattern(&Word::cyclic(b"1435"))),
    ("lyapunov", settled, |record| record.lyapunov *= 1.3),
    ("lyapunov", settled, |record| record.lyapunov = f64::NAN),
    ("impacts_per_period", settled, |record| record.impacts_per_period += 1.0),
    ("mesh_fraction", settled, |record| record.mesh_fraction = f64::NAN),
    ("symmetric", settled, |record| record.symmetric ^= 1),
    ("status", settled, |record| record.status = Status::NearGrazing.code()),
    ("status", settled, |record| record.status = Status::StrobeOnEvent.code()),
    ("class", settled, |record| record.status = Status::CapEvents.code()),
    ("status", settled, |record| record.status = Status::BelowResolution.code()),
    ("periods_run", settled, |record| record.periods_run = 529),
    ("lyapunov", chaotic, |record| record.lyapunov *= 5.0),
    ("impacts_per_period", chaotic, |record| record.impacts_per_period *= 3.0),
    ("mesh_fraction", chaotic, |record| record.mesh_fraction += 0.5),
    // A record's own status does not excuse its error.
    ("class", settled, |record| {
        (record.period, record.periods_run, record.status) = (0, 528, Status::Slow.code());
    }),
    ("class", chaotic, |record| (record.status, record.periods_run) = (Status::Slow.code(), 528)),
    ("class", settled, |record| {
        (record.period, record.lyapunov, record.lyapunov_error) = (0, 0.4, 0.01);
        (record.periods_run, record.strobe) = (400, Default::default());
    }),
];

/// Spoils one record in each way, except for those that `differ` anyway. Returns their cells and the wrong fields.
fn plant(records: &mut [Record], differ: &[u32]) -> Vec<(u32, &'static str)> {
    let mut wrong: Vec<(u32, &'static str)> = Vec::new();
    for (k, (field, fits, spoil)) in PLANTED.iter().enumerate() {
        let from = k * records.len() / PLANTED.len();
        let mut ids = (0..records.len()).map(|n| ((from + n) % records.len()) as u32);
        let is_free = |id: &u32| !differ.contains(id) && wrong.iter().all(|(other, _)| other != id);
        let id = ids.find(|id| is_free(id) && fits(&records[*id as usize])).unwrap();
        spoil(&mut records[id as usize]);
        wrong.push((id, *field));
    }
    wrong.sort_unstable();
    wrong
}

/// No device recomputes the records.
#[test]
fn wrong_records_are_found_whatever_the_engine() {
    let plan = Plan::new(&scene(12, 12));
    let mut records = cpu_records(&plan);
    let right = validate_all(&plan, &records, Precision::F64, true);
    assert!(unexplained(&right).is_empty() && right.mismatches.len() < 3, "{:?}", right.mismatches);
    let differ: Vec<u32> = right.mismatches.iter().map(|mismatch| mismatch.id).collect();
    let wrong = plant(&mut records, &differ);
    let ids: Vec<u32> = wrong.iter().map(|&(id, _)| id).collect();
    for precision in Precision::ALL {
        let found = validate_all(&plan, &records, precision, true);
        assert_eq!(unexplained(&found), ids, "{precision:?}: {wrong:?} {:?}", found.mismatches);
        for &(id, field) in &wrong {
            let mismatch = found.mismatches.iter().find(|mismatch| mismatch.id == id).unwrap();
            assert!(mismatch.differences.iter().any(|d| d.field.name() == field), "{field}: {mismatch:?}");
        }
        assert!(!found.faults().is_empty());
    }
}

/// Newton's method finds these cycles after 101 periods. The motion itself is still on its way after 528 periods.
#[test]
fn a_cycle_that_a_search_finds_early_is_reached_later() {
    let text = "model = 'two-masses'\n[[axis]]\nparameter = 'omega'\nvalues = [1.9247058823529413, 1.9686274509803923]\n\
                [[axis]]\nparameter = 'e'\nvalues = [0.5909803921568627, 0.6513725490196078]\n\
                [outputs]\nquantities = ['class', 'lyapunov', 'impacts', 'mesh', 'symmetric', 'word']\n";
    let plan = Plan::new(&Scene::parse(text, "test", &[], Purpose::Map).unwrap());
    let mut records = cpu_records(&plan);
    let is_slow = |record: &Record| record.period == 1 && status(record) == Status::Slow;
    assert!(records.iter().all(|record| is_slow(record) && record.periods_run < 200));
    let found = kinds(&validate_all(&plan, &records, Precision::F64, false));
    assert!(found.len() > 1 && found.iter().all(|kind| *kind == Kind::Budget), "{found:?}");
    records[0].impacts_per_period += 1.0;
    records[1].lyapunov *= 1.5;
    records[2].mesh_fraction += 2e-4;
    assert_eq!(unexplained(&validate_all(&plan, &records, Precision::F64, true)), [0, 1, 2]);
}

/// The averages of a lane are those near its cycle. They may be off by the distance from the cycle, and by no more.
#[test]
fn averages_near_a_cycle_may_be_off_by_the_distance() {
    let text = "model = 'gear-pair'\n[[axis]]\nparameter = 'e'\nvalues = [0.6, 0.61]\n[[axis]]\nparameter = 'omega'\n\
                values = [5.142857142857143, 5.15]\n[outputs]\nquantities = ['class', 'lyapunov', 'amplitude']\n";
    let plan = Plan::new(&Scene::parse(text, "test", &[], Purpose::Map).unwrap());
    let mean = measures::all()
        .find(|measure| measure.name(&measures::Subjects::of_states(&["x1", "v1", "x2", "v2"])) == "mean_gap")
        .unwrap()
        .place;
    let found = |distance: f64, off: f64| {
        let mut records = cpu_records(&plan);
        records[0].strobe[0] += distance;
        records[0].measures[mean] += off;
        let validation = validate_all(&plan, &records, Precision::F64, true);
        (unexplained(&validation), kinds(&validation).len())
    };
    assert_eq!(found(0.0, 0.0), (vec![], 0));
    assert_eq!(found(1e-5, 1e-5), (vec![], 1));
    assert_eq!(found(1e-5, 1e-3), (vec![0], 1));
    assert_eq!(found(0.0, 1e-5), (vec![0], 1));
}

/// Exchanges records of cells, and computes a map from another start.
#[test]
fn records_of_other_cells_and_of_another_start_are_found() {
    let plan = Plan::new(&scene(14, 14));
    let mut records = cpu_records(&plan);
    // A cell with few impacts gets the record of one with many, and vice versa.
    let mut settled: Vec<usize> = (0..records.len()).filter(|&id| settled(&records[id])).collect();
    settled.sort_by(|&a, &b| records[a].impacts_per_period.total_cmp(&records[b].impacts_per_period));
    let moved: Vec<usize> = (0..6).flat_map(|k| [settled[7 * k], settled[settled.len() - 1 - k]]).collect();
    for pair in moved.chunks_exact(2) {
        records.swap(pair[0], pair[1]);
    }
    let found = unexplained(&validate_all(&plan, &records, Precision::F32, true));
    assert!(moved.iter().all(|&id| found.contains(&(id as u32))), "{moved:?} {found:?}");
    let start = ["start.policy=state", "start.state=[0.4, 1.0, -0.2, -3.0]"];
    let elsewhere = cpu_records(&plan_between([0.0, 1.0], [1.0, 12.0], 14, &start));
    let found = validate_all(&plan, &elsewhere, Precision::F64, true);
    let without = unexplained(&found).len();
    assert!(found.mismatches.len() > 20 && 10 * without > 9 * found.mismatches.len());
}

/// Early stops once reported these cycles with status ok. An independent program in 80 bit shows what the start reaches.
#[test]
fn cycles_that_the_start_never_reaches_are_found() {
    // e, omega, the reported period and impacts, and the explanation in single precision.
    let reported = [
        // Period 2 with 8.5 impacts, and chaos. The reference reported period 1.
        (0.5949119373776908, 3.7984344422700587, 1, Some(8.0), Kind::Unexplained),
        (0.5610367892976589, 3.8959866220735786, 1, None, Kind::Unexplained),
        // Period 2; lanes reported 3. A symmetric cycle of 16 impacts; lanes reported an asymmetric one of 15: both are
        // stable, and starts that are equal in single precision reach either.
        (0.8, 5.745098039215686, 3, None, Kind::Unexplained),
        (0.3254901960784314, 3.2, 1, Some(15.0), Kind::Border),
    ];
    for (e, omega, period, impacts, single) in reported {
        let plan = plan_at(e, omega, &[EXTENDED]);
        let record = Record {
            period,
            impacts_per_period: impacts.unwrap_or(0.0),
            periods_run: 45,
            valid: valid::PERIOD | impacts.map_or(0, |_| valid::IMPACTS),
            ..Record::default()
        };
        for precision in Precision::ALL {
            let expected = if precision == Precision::F32 { single } else { Kind::Unexplained };
            let found = validate_first(&plan, &record, precision);
            assert_eq!(kinds(&found), [expected], "{precision:?}: {e} {omega}: {:?}", found.mismatches);
            assert_eq!(found.faults().is_empty(), expected == Kind::Border, "{precision:?}: {e} {omega}");
        }
    }
}

/// The motion is near the cycle at the end of the budget, because it passes it slowly, and leaves it later.
#[test]
fn a_motion_near_a_cycle_need_not_reach_it() {
    let plan = plan_at(0.4637964774951076, 1.7749510763209393, &[]);
    let (status, valid) = (Status::Slow.code(), valid::PERIOD);
    let record = Record { period: 1, status, periods_run: 528, valid, ..Record::default() };
    let found = validate_first(&plan, &record, Precision::F64);
    assert_eq!(found.mismatches.len(), 1, "{:?}", found.agreement);
}

/// Just after a period doubling the new cycle almost repeats the old one, but its word and pattern differ.
#[test]
fn a_cycle_after_period_doubling_has_its_own_word() {
    let plan = plan_at(0.8336594911937377, 3.045009784735812, &[EXTENDED]);
    let mut record = Record {
        period: 2,
        status: Status::Slow.code(),
        lyapunov: -0.0003997426808324721,
        impacts_per_period: 6.0,
        periods_run: 2082,
        valid: valid::PERIOD | valid::LYAPUNOV | valid::IMPACTS | valid::MESH | valid::SYMMETRIC,
        ..Record::default()
    };
    record.set_word(&Word::cyclic(b"223556223556"));
    record.set_pattern(&Word::cyclic(b"23562356"));
    assert_eq!(kind(&plan, &record, Precision::F32), Some(Kind::Budget));
}

/// The approach is slow and the strobe map is curved. Where the lane computes the multiplier, it differs from that of the
/// cycle by a tenth.
#[test]
fn a_multiplier_is_compared_at_the_state_where_it_was_computed() {
    let (e, omega, period, run) = (0.7240704500978473, 2.0978473581213306, 4, 64);
    let plan = plan_at(e, omega, &[]);
    let pair = GearPair { omega, ..GearPair::paper(e) };
    let flow = Flow::new(&pair.oscillator().unwrap());
    let mut trajectory = Trajectory::<0>::new(&flow, pair.law(), REST);
    (0..run - period).for_each(|_| trajectory.advance_period(&mut ()).unwrap());
    let derivative = StrobeMap::Periods(period).apply(&trajectory, trajectory.state()).unwrap().derivative();
    (0..period).for_each(|_| trajectory.advance_period(&mut ()).unwrap());
    let strobe = trajectory.state();
    let [re, im] = multipliers(&derivative).unwrap()[0];
    let record = Record {
        period,
        status: Status::Slow.code(),
        lyapunov: re.hypot(im).ln() / (f64::from(period) * flow.period),
        strobe: strobe.into(),
        periods_run: run,
        valid: valid::PERIOD | valid::LYAPUNOV | valid::STROBE,
        ..Record::default()
    };
    let kind_of = |record: &Record| kind(&plan, record, Precision::F32);
    assert_eq!(kind_of(&record), Some(Kind::Budget), "{record:?}");
    let steeper = Record { lyapunov: 4.0 * record.lyapunov, ..record.clone() };
    assert_eq!(kind_of(&steeper), Some(Kind::Unexplained), "the reference has another multiplier there");
    let elsewhere = Record { strobe: strobe.map(|x| 1.3 * x).into(), ..record.clone() };
    assert_eq!(kind_of(&elsewhere), Some(Kind::Unexplained), "there is no cycle near this state");
    let near = Record { status: Status::Ok.code(), strobe: strobe.map(|x| 1.01 * x).into(), ..record };
    assert_eq!(kind_of(&near), Some(Kind::Unexplained), "the motion has not settled");
}

// ---- a whole map

/// Makes averages of all chaotic cells wrong by less than a single cell would show.
#[test]
fn averages_of_chaotic_cells_are_compared_over_the_whole_class() {
    let plan = plan_between([0.62, 0.98], [3.4, 6.2], 9, &[]);
    let right = cpu_records(&plan);
    let failing = |spoil: fn(&mut Record)| -> Vec<&'static str> {
        let mut records = right.clone();
        records.iter_mut().filter(|record| classify(record) == Class::Chaotic).for_each(spoil);
        let found = validate_all(&plan, &records, Precision::F64, true);
        found.chaos.iter().filter(|test| test.fails()).map(|test| test.name).collect()
    };
    assert_eq!(failing(|_| {}), Vec::<&str>::new());
    type Spoil = fn(&mut Record);
    let wrong: [(&str, Spoil); 4] = [
        ("lyapunov", |record| {
            record.lyapunov_error = 0.6 * record.lyapunov;
            record.lyapunov *= 2.5;
        }),
        ("lyapunov_error", |record| record.lyapunov_error *= 0.1),
        ("impacts_per_period", |record| record.impacts_per_period *= 1.35),
        ("mesh_fraction", |record| record.mesh_fraction += 0.095),
    ];
    for (name, spoil) in wrong {
        assert!(failing(spoil).contains(&name), "{name}: {:?}", failing(spoil));
    }
}

/// Computes a map by lanes and validates it with the same device.
fn validate_lanes(plan: &Plan, precision: Precision, rewrite: Option<fn(String) -> String>) -> Validation {
    let mut gpu = open(precision);
    rewrite.into_iter().for_each(|rewrite| gpu.rewrite_shaders(rewrite));
    let records = map(plan, &mut gpu);
    let subject = Subject { plan, records: &records, precision, is_lane: true };
    let mut selection = sample(plan, &records, usize::MAX, 1);
    selection.states = (0..records.len() as u32).collect();
    let mut double = (precision == Precision::F32 && rewrite.is_none()).then(|| open(Precision::F64));
    let lanes = Lanes::run(&subject, &selection, Some(&mut *gpu), double.as_deref_mut(), &|_| ());
    replay(&subject, &selection, &pollster::block_on(lanes).unwrap(), &|_| {})
}

#[test]
fn a_correct_map_of_lanes_passes() {
    check_correct_map(Precision::F32);
}

#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn a_correct_map_of_lanes_in_double_precision_passes() {
    check_correct_map(Precision::F64);
}

fn check_correct_map(precision: Precision) {
    let plan = Plan::new(&scene(20, 20));
    let (found, cells) = (validate_lanes(&plan, precision, None), plan.cell_count());
    assert_eq!(found.faults(), Vec::<String>::new(), "{:?}", found.mismatches);
    assert!(found.mismatches.len() * 20 < cells, "many differ");
    let states = found.states.unwrap();
    // Most states can be compared, and not all are exact: a bound that no error comes near would find nothing.
    assert!(states.compared * 10 > 9 * cells && states.off.is_empty() && states.distances[1] > 0.0);
    assert_eq!(found.again, [cells, cells]);
}

/// The processor measures machines, also when their lanes are computed again.
#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn a_map_of_a_machine_with_quantities_passes() {
    let scene = "model = 'viscoelastic-ball'\n[[axis]]\nparameter = 'A'\nvalues = [1.1, 1.2, 1.3]\n[[axis]]\nparameter = 'B'\n\
                 values = [0.3, 0.4]\n[outputs]\nquantities = ['class', 'symmetric', 'amplitude', 'impact_energy', 'multiplier']\n";
    let plan = Plan::new(&Scene::parse(scene, "ball.toml", &[], Purpose::Map).unwrap());
    let found = validate_lanes(&plan, Precision::F32, None);
    assert_eq!(found.faults(), Vec::<String>::new(), "{:?}", found.mismatches);
    assert_eq!(found.again, [plan.cell_count(); 2]);
}

#[test]
fn a_lane_that_misses_one_impact_in_ten_thousand_is_found() {
    check_missed_impacts(Precision::F32);
}

#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn a_lane_in_double_precision_that_misses_one_impact_in_ten_thousand_is_found() {
    check_missed_impacts(Precision::F64);
}

/// The shader skips the contact law at one contact in ten thousand. Lanes reach the same attractors, and most records
/// are right.
fn check_missed_impacts(precision: Precision) {
    let rewrite = |source: String| {
        let law = "    motion.q = after;\n    if pressed && leaving";
        let miss = "    if ((bitcast<u32>(f32(closing)) * 2654435761u) >> 8u) % 10000u == 0u {\n\
                    \x20       motion.q[1] = -motion.q[1];\n        return jump;\n    }\n";
        assert!(source.contains(law));
        source.replace(law, &format!("{miss}{law}"))
    };
    let plan = plan_between([0.1, 0.9], [1.0, 8.0], 96, &["integration.transient_periods=60"]);
    let mut gpu = open(precision);
    gpu.rewrite_shaders(rewrite);
    let ids: Vec<u32> = (0..plan.cell_count() as u32).collect();
    let records = vec![Record::default(); ids.len()];
    let subject = Subject { plan: &plan, records: &records, precision, is_lane: true };
    let selection = Sample { states: ids, ..sample_of(Vec::new()) };
    let lanes = pollster::block_on(Lanes::run(&subject, &selection, Some(&mut gpu), None, &|_| ())).unwrap();
    let states = replay(&subject, &selection, &lanes, &|_| {}).states.unwrap();
    assert!(states.rate().is_too_many(), "{states:?}");
}

/// With early stops the cells stay within their allowance of work. The judge has no early stops and exceeds it.
#[test]
fn a_judge_that_exceeds_its_work_reports_a_short_budget() {
    let light =
        ["parameters.m1=2e-5", "integration.transient_periods=200", "integration.observed_periods=12"];
    let plan = plan_between([0.1, 0.4], [0.4, 0.5], 2, &[&light[..], &["integration.max_period=4"]].concat());
    let records = cpu_records(&plan);
    let found = validate_all(&plan, &records, Precision::F64, false);
    let kinds = kinds(&found);
    assert!(!kinds.is_empty() && kinds.iter().all(|kind| *kind == Kind::Budget), "{:?}", found.mismatches);
    // A wrong record has no such excuse: this engine does not reproduce it.
    let mut wrong = records;
    wrong.iter_mut().for_each(|record| record.impacts_per_period += 1.0);
    assert_eq!(unexplained(&validate_all(&plan, &wrong, Precision::F64, false)).len(), wrong.len());
}

#[test]
fn cells_that_fail_in_their_first_period_are_validated() {
    let plan = plan_between([0.1, 0.4], [1.0, 2.0], 2, &["F=1e300"]);
    let records = cpu_records(&plan);
    assert!(
        records.iter().all(|record| record.periods_run == 0 && status(record).is_failure()),
        "{records:?}"
    );
    let found = validate_all(&plan, &records, Precision::F64, false);
    assert_eq!(found.faults(), Vec::<String>::new(), "{:?}", found.mismatches);
}

/// The map's engine decides the cell after more than the 528 periods that the judging lanes run.
#[test]
fn an_undecided_judge_does_not_contradict_a_record() {
    let (e, omega) = (0.6217008797653959, 2.247311827956989);
    let plan = plan_between([e, e + 1e-6], [omega, omega + 1e-6], 2, &[EXTENDED]);
    let records = cpu_records(&plan);
    assert!(matches!(classify(&records[0]), Class::Periodic { .. }), "{:?}", records[0]);
    let subject = Subject { plan: &plan, records: &records, precision: Precision::F64, is_lane: false };
    let mut double = open(Precision::F64);
    let selection = sample_of(vec![0]);
    let lanes =
        pollster::block_on(Lanes::run(&subject, &selection, None, Some(&mut *double), &|_| ())).unwrap();
    let found = replay(&subject, &selection, &lanes, &|_| {});
    assert_eq!((found.judge, kinds(&found)), (Judge::Lanes, vec![Kind::Budget]), "{:?}", found.mismatches);
}

/// The shader's condition for meshing after an impact.
const MESHES: &str = "leaving <= mesh_speed(side) &&";

/// Plane in which a meshing speed that is wrong by 1 % ends one series of impacts in a hundred one impact earlier.
fn plane_of_chatter(sets: &[&str]) -> Plan {
    plan_between([0.2, 0.6], [1.0, 2.5], 20, sets)
}

fn finds_a_wrong_threshold_in_lanes(precision: Precision) {
    let rewrite = |source: String| {
        assert!(source.contains(MESHES));
        source.replace(MESHES, "leaving <= Real(1.01) * mesh_speed(side) &&")
    };
    let found = validate_lanes(&plane_of_chatter(&[]), precision, Some(rewrite));
    assert!(!found.faults().is_empty(), "{precision:?}: {:?}", found.mismatches);
}

#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn a_threshold_that_is_off_by_a_hundredth_is_found() {
    finds_a_wrong_threshold_in_lanes(Precision::F32);
}

#[test]
#[ignore = "takes 40 s; scripts/test.sh --all"]
fn a_threshold_that_is_off_by_a_hundredth_is_found_in_f64_and_on_the_reference() {
    finds_a_wrong_threshold_in_lanes(Precision::F64);
    let other = cpu_records(&plane_of_chatter(&["mesh_speed=0.0101"]));
    let found = validate_all(&plane_of_chatter(&[]), &other, Precision::F64, false);
    assert!(!found.faults().is_empty(), "{:?}", found.mismatches);
}

/// The multiplier is -0.9972. A lane is still far from the cycle when it has read twice its period and an exponent of that place.
#[test]
fn a_slow_lane_may_have_twice_the_period_and_another_exponent() {
    let model = FileModel::parse(include_str!("data/loose_gear.toml"), "loose_gear.toml").unwrap();
    let scene = Scene::builder(model)
        .cells(["rpm", "a"], &[[2138.4615384615386, 55.53846153846154]])
        .quantities(&EVERYTHING)
        .build();
    let plan = Plan::new(&scene.unwrap());
    assert_eq!(cpu_records(&plan)[0].period, 24);
    let lane = &map(&plan, &mut open(Precision::F64))[0];
    assert_eq!((lane.period, status(lane)), (48, Status::Slow), "{lane:?}");
    assert_eq!(kind(&plan, lane, Precision::F64), Some(Kind::Budget));
}

/// An ODE library that shares no code with the reference judges a map of the reference.
#[test]
fn a_map_of_the_reference_is_judged_by_an_independent_program() {
    let plan = plan_between([0.05, 0.95], [1.2, 11.0], 7, &["integration.transient_periods=150"]);
    let records = cpu_records(&plan);
    let found = validate_all(&plan, &records, Precision::F64, false);
    assert_eq!((found.judge, found.faults()), (Judge::Independent, Vec::new()), "{:?}", found.mismatches);
    let judged = (0..49).filter_map(|id| independent::record(&plan, id, &records)).collect::<Vec<_>>();
    let claims = |class: fn(&Record) -> bool| judged.iter().filter(|record| class(record)).count();
    assert!(claims(|r| r.period > 0) > 30 && claims(|r| r.period == 0) > 2, "{judged:?}");
}

#[test]
fn samples_have_their_strata_and_repeat() {
    let plan = Plan::new(&scene(40, 40));
    // Three stripes of period 1, 2 and 1. One column has status `slow`.
    let record = |id: usize| {
        let i = id % 40;
        let status = if i == 5 { Status::Slow } else { Status::Ok };
        let period = if (10..25).contains(&i) { 2 } else { 1 };
        Record { status: status.code(), period, valid: valid::PERIOD, ..Record::default() }
    };
    let records: Vec<Record> = (0..1600).map(record).collect();
    let selection = sample(&plan, &records, 400, 7);
    assert_eq!(selection, sample(&plan, &records, 400, 7));
    assert_ne!(selection.draws, sample(&plan, &records, 400, 8).draws);
    let counts: Vec<_> =
        selection.draws.iter().map(|draw| (draw.stratum, draw.runs, draw.ids.len())).collect();
    // There are fewer cells with a status than wanted, so the uniform stratum gets the rest.
    let expected = [(Stratum::Uniform, 1600, 260), (Stratum::Border, 160, 100), (Stratum::Status, 40, 40)];
    assert_eq!(counts, expected);
    assert!(selection.draws[1].ids.iter().all(|id| [9, 10, 24, 25].contains(&(id % 40))));
    assert!(
        selection.draws.iter().all(|draw| draw.ids.is_sorted_by(|a, b| a < b)),
        "a cell was selected twice"
    );
    assert_eq!(sample(&plan, &records, 5000, 7).ids().len(), 1600);
}

#[test]
fn kinds_have_distinct_names() {
    let names: std::collections::HashSet<_> = Kind::ALL.iter().map(|kind| kind.name()).collect();
    assert_eq!(names.len(), Kind::ALL.len());
}

// ---- the command

fn rattlemap(folder: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    let mut command = Command::cargo_bin("rattlemap").unwrap();
    command.current_dir(folder).args(arguments).assert()
}

/// Returns a folder with a finished map `o` of 16 x 16 cells, and the map's folder.
fn finished() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), scene_text(16, 16)).unwrap();
    rattlemap(folder.path(), &["map", "s.toml", "--engine", "cpu", "--out", "o", "--quiet"]).success();
    let out = folder.path().join("o");
    (folder, out)
}

fn said(assert: &assert_cmd::assert::Assert) -> String {
    String::from_utf8_lossy(&assert.get_output().stderr).into_owned()
}

fn json(out: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(out.join("validation.json")).unwrap()).unwrap()
}

#[test]
fn a_map_is_validated_and_its_report_says_so() {
    let (folder, out) = finished();
    let run = |arguments: &[&str]| rattlemap(folder.path(), &[&["validate", "o"], arguments].concat());
    let text = said(&run(&["--samples", "60", "--seed", "3"]).success().stdout(""));
    for part in [
        " of 256 random cells: 0 differ (below ",
        " cells next to another class or period: ",
        "without early stops, and ",
        "ran again on the same kind of processor, ",
        "are the same to the bit",
        "o: validation.json, report.html",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert!(!text.contains("not on the map's own device"), "{text}");
    let verdict = text.lines().last().unwrap();
    assert!(
        verdict.starts_with("The map stands: 0 of ") && verdict.contains(" random cells are wrong (below "),
        "{verdict}"
    );
    let found = json(&out);
    assert_eq!((&found["verdict"], &found["requested"]), (&verdict.into(), &60.into()));
    assert_eq!((&found["again_on"], &found["same_device"]), (&found["processor"], &true.into()));
    // The second judge is graphics hardware, if there is any, otherwise the ODE solver.
    let judge = found["judge"].as_str().unwrap();
    assert_eq!(found["lanes_f64_on"].is_string(), judge == "lanes_f64", "{judge}");
    assert!(["lanes_f64", "dop853"].contains(&judge), "{judge}");
    assert_eq!((&found["seed"], &found["cells"]), (&3.into(), &256.into()));
    assert_eq!((&found["faults"], &found["identical"]), (&serde_json::json!([]), &found["samples"]));
    let uniform = &found["strata"][0];
    assert_eq!((&uniform["name"], &uniform["kinds"]["unexplained"]["count"]), (&"uniform".into(), &0.into()));
    let sampled: u64 =
        found["strata"].as_array().unwrap().iter().map(|s| s["sampled"].as_u64().unwrap()).sum();
    assert_eq!(sampled, 60);
    // States of lanes are compared where there are lanes.
    let off = &found["states"]["off"]["count"];
    assert!(if judge == "lanes_f64" { *off == 0 } else { off.is_null() }, "{off}");
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("\"validation\":{\"format\":2,\"command\":\"validate\""), "no section");
    // An equal seed gives equal bytes.
    let first = fs::read(out.join("validation.json")).unwrap();
    run(&["--samples", "60", "--seed", "3", "--quiet"]).success().stderr("");
    assert!(fs::read(out.join("validation.json")).unwrap() == first);
    run(&["--samples", "60", "--seed", "4", "--quiet"]).success();
    assert!(fs::read(out.join("validation.json")).unwrap() != first);
    // Writing the map again keeps the validation; computing it again removes it.
    let map = |last: &str| rattlemap(folder.path(), &["map", "s.toml", "--out", "o", last]).success();
    let files = ["validation.json", "report.html"].map(|name| (name, fs::read(out.join(name)).unwrap()));
    map("--resume");
    assert!(files.iter().all(|(name, bytes)| fs::read(out.join(name)).unwrap() == *bytes));
    assert!(said(&map("--force")).contains("o: removed files of an earlier run: validation.json\n"));
    assert!(fs::read_to_string(out.join("report.html")).unwrap().contains("\"validation\":null"));
}

#[test]
fn planted_records_fail_the_validation_by_name() {
    let (folder, out) = finished();
    let scene = scene(16, 16);
    let plan = Plan::new(&scene);
    let (path, identity) = (out.join(RECORDS), cpu_identity(&scene));
    let mut records = vec![Record::default(); plan.cell_count()];
    let stored = read_records(&path, &identity);
    assert_eq!(stored.len(), 256);
    stored.into_iter().for_each(|(id, record)| records[id as usize] = record);
    let wrong = plant(&mut records, &[]);
    let spoilt: Vec<(u32, Record)> = (0..).zip(records).collect();
    RecordFile::create(&path, &identity).unwrap().append(&spoilt).unwrap();

    let run = rattlemap(folder.path(), &["validate", "o", "--samples", "256", "--quiet"]).code(1).stdout("");
    let text = said(&run);
    assert!(
        text.contains("do not trust this map: ")
            && text.contains(&format!("; {} of all 256 cells are wrong;", PLANTED.len())),
        "{text}"
    );
    // The message names the first cells.
    for &(id, _) in &wrong[..8] {
        let [i, j] = plan.indices(id);
        assert!(text.contains(&format!("({i}, {j})")), "{text}");
    }
    assert!(text.contains("o/validation.json"), "{text}");
    let mismatches = json(&out)["mismatches"].clone();
    let mismatches = mismatches.as_array().unwrap().iter().filter(|m| m["kind"] == "unexplained");
    let ids: Vec<u64> = mismatches.clone().map(|mismatch| mismatch["id"].as_u64().unwrap()).collect();
    assert!(wrong.iter().map(|&(id, _)| u64::from(id)).eq(ids), "{wrong:?}");
    let mut commands = mismatches.map(|mismatch| mismatch["replay"].as_str().unwrap());
    let arguments: Vec<&str> = commands.next().unwrap().split(' ').skip(1).chain(["--json"]).collect();
    rattlemap(folder.path(), &arguments).success();
}

/// The folder of a basin map whose records are changed as if its engine had returned them.
#[test]
fn the_same_program_must_reproduce_records_of_the_reference_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("o");
    let text =
        ["x1", "v1"].map(|name| format!("[[axis]]\nstart = '{name}'\nmin = -0.4\nmax = 0.4\ncount = 3\n"));
    let text = format!("{}[parameters]\ne = 0.6\nomega = 5.6\n", text.concat());
    fs::write(folder.path().join("s.toml"), &text).unwrap();
    rattlemap(folder.path(), &["map", "s.toml", "--engine", "cpu", "--out", "o", "--quiet"]).success();
    let identity = cpu_identity(&Scene::parse(&text, "s", &[], Purpose::Map).unwrap());
    let right = read_records(&out.join(RECORDS), &identity);
    let manifest = fs::read_to_string(out.join("manifest.json")).unwrap();
    let forge = |change: fn(usize, &mut Record), sources: &str| {
        let mut records = right.clone();
        records.iter_mut().enumerate().for_each(|(nth, (_, record))| change(nth, record));
        let identity = identity.clone().built_from(sources, Identity::own_target());
        RecordFile::create(&out.join(RECORDS), &identity).unwrap().append(&records).unwrap();
        let text = manifest.replace(Identity::own_sources(), sources);
        let mut forged: serde_json::Value = serde_json::from_str(&text).unwrap();
        let files = forged["files"].as_array_mut().unwrap();
        files.retain(|file| file["name"] == "cells.csv");
        files.push(serde_json::to_value(inventory::entry(&out, RECORDS).unwrap()).unwrap());
        fs::write(out.join("manifest.json"), inventory::sealed(forged).unwrap()).unwrap();
        rattlemap(folder.path(), &["validate", "o"])
    };
    let one_bit = |nth: usize, record: &mut Record| {
        if nth == 7 {
            record.strobe[0] = f64::from_bits(record.strobe[0].to_bits() ^ 1);
        }
    };
    let statuses = |_: usize, record: &mut Record| record.status = Status::Slow.code();
    for (change, count) in [(one_bit as fn(usize, &mut Record), 1), (statuses, 9)] {
        let text = said(&forge(change, Identity::own_sources()).code(1));
        let fault = format!(
            "do not trust this map: {count} of 9 cells differ from what the same program computes again"
        );
        assert!(text.contains(&fault), "{text}");
    }
    // Another build may round differently in every cell.
    let every_bit = |_: usize, record: &mut Record| {
        record.strobe[0] = f64::from_bits(record.strobe[0].to_bits() ^ 1);
    };
    let text = said(&forge(every_bit, "other sources").success());
    assert!(
        text.contains(": 0 of 9 records are the same to the bit. Another build of the program"),
        "{text}"
    );
}

/// All cells of an adaptive map may be filled. Then there is no cell to recompute.
#[test]
fn a_validation_without_a_recomputed_cell_fails() {
    let plan = Plan::new(&scene(3, 3));
    let filled = vec![Record { valid: valid::FILLED, ..Record::default() }; 9];
    let selection = sample(&plan, &filled, 400, 1);
    let subject = Subject { plan: &plan, records: &filled, precision: Precision::F64, is_lane: true };
    let found = replay(&subject, &selection, &Lanes::default(), &|_| {});
    assert_eq!((found.replayed, found.filled), (0, 9));
    assert_eq!(found.faults(), ["none of 9 cells was compared"]);
}

/// Another device than the map's may round differently, so the result names it.
#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn the_result_names_a_device_other_than_the_maps() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("o");
    fs::write(folder.path().join("s.toml"), scene_text(4, 3)).unwrap();
    let map = ["map", "s.toml", "--out", "o", "--engine", "gpu", "--quiet"];
    rattlemap(folder.path(), &map).success();
    let validated = || said(&rattlemap(folder.path(), &["validate", "o"]).success());
    let text = validated();
    assert!(text.contains("Lanes ran again on the map's own device, "), "{text}");
    let manifest = fs::read_to_string(out.join("manifest.json")).unwrap();
    let original: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    let found = json(&out);
    assert_eq!((&found["same_device"], &found["again_on"]), (&true.into(), &original["device"]));
    // The map as if another device had computed it.
    let device = original["device"].as_str().unwrap();
    let scene = scene(4, 3);
    let identity = |device| Identity::new("gpu", "f32", device, scene.identity());
    let records = read_records(&out.join(RECORDS), &identity(device));
    RecordFile::create(&out.join(RECORDS), &identity("Faraway card")).unwrap().append(&records).unwrap();
    let mut faraway: serde_json::Value =
        serde_json::from_str(&manifest.replace(device, "Faraway card")).unwrap();
    let changed = [RECORDS, "report.html", "validation.json"];
    let files = faraway["files"].as_array_mut().unwrap();
    files.retain(|file| !changed.contains(&file["name"].as_str().unwrap()));
    let entries = changed.map(|name| inventory::entry(&out, name).unwrap());
    files.extend(entries.map(|entry| serde_json::to_value(entry).unwrap()));
    fs::write(out.join("manifest.json"), inventory::sealed(faraway).unwrap()).unwrap();
    let text = validated();
    assert!(
        text.contains(&format!("Lanes ran again on {device}, not on the map's own device, Faraway card (no")),
        "{text}"
    );
    assert!(text.contains("called Faraway card"), "{text}");
    let found = json(&out);
    assert_eq!((&found["device"], &found["same_device"]), (&"Faraway card".into(), &false.into()));
    assert_eq!(found["again_on"], device);
}

#[test]
fn a_folder_without_a_finished_map_is_refused() {
    let (folder, out) = finished();
    let ends = |code: i32, arguments: &[&str], parts: &[&str]| {
        let run = rattlemap(folder.path(), &[&["validate"], arguments].concat()).code(code).stdout("");
        parts.iter().for_each(|part| assert!(said(&run).contains(part), "{part}: {}", said(&run)));
    };
    let refused = |arguments: &[&str], parts: &[&str]| ends(2, arguments, parts);
    refused(&["nowhere"], &["nowhere: there is no such folder"]);
    refused(&["."], &["there is no manifest.json", "not the folder of a map"]);
    refused(&["o", "--samples", "0"], &["--samples"]);
    let manifest = fs::read_to_string(out.join("manifest.json")).unwrap();
    let with = |from: &str, to: &str| {
        assert!(manifest.contains(from), "{from}");
        fs::write(out.join("manifest.json"), manifest.replace(from, to)).unwrap();
    };
    let version = format!("\"crate_version\": \"{}\"", env!("CARGO_PKG_VERSION"));
    with(&version, "\"crate_version\": \"0.0.1\"");
    refused(&["o"], &["made by rattlemap 0.0.1", "--force"]);
    with("\"command\": \"map\"", "\"command\": \"bifurcation\"");
    refused(&["o"], &["not the manifest of a map, but of `bifurcation`"]);
    with("max = 12.0", "max = 11.0");
    refused(
        &["o"],
        &["records.bin does not belong to the manifest.json", "`axis.1.max` was 12.0, now 11.0", "--force"],
    );
    with("\"precision\": \"f64\"", "\"precision\": \"f16\"");
    refused(&["o"], &["f16"]);
    with("{", "");
    refused(&["o"], &["not the manifest of a map"]);
    fs::remove_file(out.join("manifest.json")).unwrap();
    refused(&["o"], &["the run is unfinished", "--resume"]);
    fs::write(out.join("manifest.json"), &manifest).unwrap();
    let records = fs::read(out.join(RECORDS)).unwrap();
    fs::write(out.join(RECORDS), &records[..records.len() - 1]).unwrap();
    ends(1, &["o"], &["records.bin is damaged: it has", "of 256 cells", "--resume"]);
    let mut bad = records.clone();
    bad[20] ^= 0x10;
    fs::write(out.join(RECORDS), bad).unwrap();
    ends(1, &["o"], &["its header does not match its checksum", "--force"]);
    fs::remove_file(out.join(RECORDS)).unwrap();
    refused(&["o"], &["there is no records.bin"]);
}
