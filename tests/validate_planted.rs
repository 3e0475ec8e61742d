//! Faults that fill a whole map, planted in records that are right otherwise: each of them is found, and none
//! is explained.

#[path = "common/computed.rs"]
mod computed;

use computed::computed;
use rattlemap::classify::classify;
use rattlemap::gpu::Precision;
use rattlemap::orbit::{Class, Status};
use rattlemap::plan::Plan;
use rattlemap::record::{Record, valid};
use rattlemap::scene::{Purpose, Scene};
use rattlemap::validate::{
    Explanation, Pick, Sample, StateSource, Stratum, Subject, Validation, replay, sample,
};

/// Restitution against frequency, `count` cells a side.
fn plan(count: usize, more: &str) -> Plan {
    planned("e", [0.0, 1.0], [1.0, 12.0], count, more)
}

fn planned(
    parameter: &str,
    [least, most]: [f64; 2],
    [slow, fast]: [f64; 2],
    count: usize,
    more: &str,
) -> Plan {
    let text = format!(
        "{more}\n[[axis]]\nparameter = '{parameter}'\nmin = {least}\nmax = {most}\ncount = {count}\n\
         [[axis]]\nparameter = 'omega'\nmin = {slow}\nmax = {fast}\ncount = {count}\n\
         [outputs]\nquantities = ['class', 'lyapunov', 'impacts', 'mesh', 'symmetric', 'word']\n"
    );
    Plan::new(&Scene::parse(&text, "planted", &[], Purpose::Map).unwrap())
}

const ELSEWHERE: &str = "[start]\npolicy = 'state'\nstate = [0.4, 1.0, -0.2, -3.0]";

/// Too short for many cells to be decided.
const SHORT: &str = "[integration]\ntransient_periods = 60\nobserved_periods = 32\nmax_period = 8";

/// Validates all of a map by the CPU engine, or by lanes.
fn validated(plan: &Plan, records: &[Record], is_lane: bool) -> Validation {
    let subject = Subject { plan, records, precision: Precision::F64, is_lane };
    let drawn = sample(plan, records, usize::MAX, 1);
    let source = if is_lane { StateSource::None("no device".to_owned()) } else { StateSource::Replay };
    replay(&subject, &drawn, source, &|_| {})
}

fn unexplained(found: &Validation) -> Vec<usize> {
    let without = found.mismatches.iter().filter(|mismatch| mismatch.explanation.is_none());
    without.map(|mismatch| mismatch.id as usize).collect()
}

/// Spoils every record that fits; where.
fn plant(records: &mut [Record], fits: fn(&Record) -> bool, spoil: fn(&mut Record)) -> Vec<usize> {
    let ids: Vec<usize> = (0..records.len()).filter(|&id| fits(&records[id])).collect();
    ids.iter().for_each(|&id| spoil(&mut records[id]));
    ids
}

fn chaotic(record: &Record) -> bool {
    classify(record) == Class::Chaotic
}

fn undecided(record: &Record) -> bool {
    classify(record) == Class::Undecided
}

fn settled(record: &Record) -> bool {
    record.period == 1 && record.status == Status::Ok.code() && record.impacts_per_period > 0.0
}

/// What is said of every cell of a kind, and is wrong.
struct Planted {
    what: &'static str,
    fits: fn(&Record) -> bool,
    spoil: fn(&mut Record),
}

const AVERAGES: [Planted; 5] = [
    Planted {
        what: "exponent within its own error",
        fits: chaotic,
        spoil: |record| {
            record.lyapunov_error = 0.6 * record.lyapunov;
            record.lyapunov *= 2.5;
        },
    },
    Planted { what: "too small an error", fits: chaotic, spoil: |record| record.lyapunov_error *= 0.1 },
    Planted { what: "impacts of chaos", fits: chaotic, spoil: |record| record.impacts_per_period *= 1.35 },
    Planted {
        what: "meshing of chaos",
        fits: |record| chaotic(record) && record.mesh_fraction == 0.0,
        spoil: |record| record.mesh_fraction = 0.095,
    },
    Planted {
        what: "averages of what is undecided",
        fits: undecided,
        spoil: |record| (record.lyapunov, record.impacts_per_period) = (-77.0, 55.0),
    },
];

const BITS: [Planted; 4] = [
    Planted { what: "status", fits: settled, spoil: |record| record.status = Status::NearGrazing.code() },
    Planted { what: "periods", fits: settled, spoil: |record| record.periods_run += 1 },
    Planted { what: "strobe", fits: chaotic, spoil: |record| record.strobe = [9.0, -99.0, 9.0, -99.0] },
    Planted { what: "a lost field", fits: settled, spoil: |record| record.valid &= !valid::SYMMETRIC },
];

/// Share of faults in averages that has to be found where lanes had few periods: the rest is as likely as what is right.
const FOUND_IN_SHORT: f64 = 0.6;

#[test]
fn averages_and_their_errors_are_measured_not_believed() {
    for (what, plan) in [("long", plan(14, "")), ("short", plan(12, SHORT))] {
        let right = computed(&plan);
        for is_lane in [false, true] {
            assert!(validated(&plan, &right, is_lane).mismatches.is_empty());
            for planted in &AVERAGES {
                let mut records = right.clone();
                let ids = plant(&mut records, planted.fits, planted.spoil);
                let found = unexplained(&validated(&plan, &records, is_lane));
                println!("{what}, lanes: {is_lane}: {}: {} of {}", planted.what, found.len(), ids.len());
                assert!(found.iter().all(|id| ids.contains(id)));
                // Over a few periods chaos scatters as much.
                let share = if is_lane && what == "short" { FOUND_IN_SHORT } else { 1.0 };
                let least = (share * ids.len() as f64) as usize;
                assert!(found.len() >= least, "{what}: {}", planted.what);
            }
        }
    }
}

#[test]
fn a_map_of_the_reference_is_the_same_to_the_bit() {
    let plan = plan(12, "");
    let right = computed(&plan);
    for planted in &BITS {
        let mut records = right.clone();
        let ids = plant(&mut records, planted.fits, planted.spoil);
        assert!(!ids.is_empty());
        // More than half of the map may be wrong.
        assert_eq!(unexplained(&validated(&plan, &records, false)), ids, "{}", planted.what);
    }
    let mut strobes = right.clone();
    let ids = plant(&mut strobes, |_| true, |record| record.strobe = [9.0, -99.0, 9.0, -99.0]);
    assert_eq!(unexplained(&validated(&plan, &strobes, false)), ids);
    let elsewhere = computed(&planned("e", [0.0, 1.0], [1.0, 12.0], 12, ELSEWHERE));
    let found = validated(&plan, &elsewhere, false);
    let explained = found.mismatches.len() - unexplained(&found).len();
    println!("wrong start: {} differ, {explained} of them explained", found.mismatches.len());
    assert!(found.mismatches.len() > 50 && explained * 5 < found.mismatches.len());
}

/// A force moved by its last bit stands for a processor that rounds differently.
#[test]
fn another_processor_is_no_fault() {
    let plan = plan(12, "");
    let other = planned("e", [0.0, 1.0], [1.0, 12.0], 12, "[parameters]\nF = 50.00000000000001");
    let records = computed(&other);
    let found = validated(&plan, &records, false);
    assert_eq!(unexplained(&found), [0usize; 0], "{:?}", found.mismatches);
    let mut wrong = records.clone();
    let ids = plant(&mut wrong, settled, |record| record.strobe[1] *= 1.0 + 1e-6);
    assert_eq!(unexplained(&validated(&plan, &wrong, false)), ids);
}

/// Where basins meet, a lane may end on either attractor; from another start it ends there everywhere.
#[test]
fn another_attractor_has_to_be_reached() {
    let (wrong, plan) = (computed(&plan(16, ELSEWHERE)), plan(16, ""));
    let found = validated(&plan, &wrong, true);
    let without = unexplained(&found).len();
    println!("wrong start: {} differ, {without} without an explanation", found.mismatches.len());
    assert!(found.mismatches.len() > 25 && 10 * without > 9 * found.mismatches.len());
}

#[test]
fn what_is_left_open_would_be_by_the_lanes_own_rule() {
    let plan = plan(12, "");
    let right = computed(&plan);
    let longest = |record: &mut Record| (record.status, record.periods_run) = (Status::Slow.code(), 528);
    let mut chaos = right.clone();
    let ids: Vec<usize> = (0..chaos.len()).filter(|&id| chaotic(&chaos[id])).collect();
    ids.iter().for_each(|&id| longest(&mut chaos[id]));
    let found = unexplained(&validated(&plan, &chaos, true));
    println!("chaos called undecided: {} of {}", found.len(), ids.len());
    assert_eq!(found, ids);
    // Its own strobe, moved off the cycle, is no evidence of a slow approach.
    let mut cycles = right.clone();
    let ids: Vec<usize> = (0..cycles.len()).filter(|&id| settled(&cycles[id])).collect();
    for &id in &ids {
        let record = &mut cycles[id];
        longest(record);
        record.period = 0;
        let off = [3e-3, 1e-2, 3e-3, 1e-2];
        record.strobe = std::array::from_fn(|i| record.strobe[i] + off[i]);
    }
    let found = unexplained(&validated(&plan, &cycles, true));
    println!("cycles called undecided: {} of {}", found.len(), ids.len());
    assert_eq!(found, ids);
    let mut longer = right.clone();
    let ids = plant(&mut longer, settled, |record| record.periods_run = 529);
    assert_eq!(unexplained(&validated(&plan, &longer, true)), ids);
}

/// Why the first cell of a plan has this record, in single precision and as one of so many; none if nothing tells.
fn why(plan: &Plan, record: Record, among: usize) -> Option<Explanation> {
    let mut records = vec![Record::default(); plan.cell_count()];
    records[0] = record;
    let subject = Subject { plan, records: &records, precision: Precision::F32, is_lane: true };
    let picks = vec![Pick { id: 0, stratum: Stratum::Uniform }];
    let sample = Sample { seed: 0, picks, strata: Vec::new(), among };
    let found = replay(&subject, &sample, StateSource::None(String::new()), &|_| {});
    found.mismatches.first().expect("a record that differs").explanation
}

/// Chaos as a lane has called it.
fn called([lyapunov, lyapunov_error]: [f64; 2], averages: [f64; 2], strobe: [f64; 4], ran: u32) -> Record {
    Record {
        lyapunov,
        lyapunov_error,
        impacts_per_period: averages[0],
        mesh_fraction: averages[1],
        strobe,
        periods_run: ran,
        valid: valid::PERIOD | valid::LYAPUNOV | valid::IMPACTS | valid::MESH | valid::STROBE,
        ..Record::default()
    }
}

const MORE_PERIODS: &str = "[integration]\nundecided_periods = 1584\n";

/// Over 117 periods of this cell's chaos the exponent is 1.32 with a standard deviation of 0.11, and in one of some
/// 100,000 stretches it is 0.69, on the reference and on lanes alike.
#[test]
fn what_is_rare_for_one_cell_is_not_among_many() {
    let plan = planned("e", [0.9902152641878669, 1.0], [3.7984344422700587, 20.0], 2, MORE_PERIODS);
    let strobe = [5.282638132572174, 13.860905665600836, 5.087088584899902, 12.87847142204324];
    let record = called([0.6941025743977469, 0.10835329592917606], [5.863247863247863, 0.0], strobe, 217);
    assert_eq!(why(&plan, record, 262_144), Some(Explanation::Chaos));
    let rare = Record { lyapunov: 0.66, ..record };
    assert_eq!(why(&plan, rare, 262_144), Some(Explanation::Chaos));
    assert_eq!(why(&plan, rare, 1), None);
    let rarer = Record { lyapunov: 0.2, lyapunov_error: 0.03, ..record };
    assert_eq!(why(&plan, rarer, 262_144), None);
}

/// Contact that lasts forgets where a motion began, but not its parameters: these decide how long it takes from a
/// chaos of larger exponent to one in three narrow bands.
#[test]
fn parameters_move_what_has_forgotten_its_start() {
    let plan = planned("e", [0.700587084148728, 1.0], [1.1506849315068493, 20.0], 2, MORE_PERIODS);
    let strobe = [1.2673653066158295, -0.13713733306166426, 0.767414927482605, 0.21200917358830157];
    let averages = [45.25, 0.28645193576812744];
    let record = called([0.07298831995966519, 0.011036492361667129], averages, strobe, 308);
    assert_eq!(why(&plan, record, 1), Some(Explanation::Chaos));
    for planted in [Record { lyapunov: 0.2, ..record }, Record { impacts_per_period: 44.5, ..record }] {
        assert_eq!(why(&plan, planted, 1), None, "{planted:?}");
    }
}
