//! Lanes that read a cycle in vain: each is a real lane that goes that way, and ends as the reference says.
//!
//! How often a lane went astray is no part of a record. A rewritten shader hands it out in place of the periods run.

use rattlemap::flow::Flow;
use rattlemap::gpu::{AdapterChoice, Gpu, Lane, LaneSettings, Precision};
use rattlemap::model::{GearPair, State};
use rattlemap::orbit::{Class, Settings, analyse};
use rattlemap::record::Record;
use rattlemap::reference::Trajectory;
use rattlemap::stability::{StrobeMap, refine};

const REST: State = [0.0; 4];

/// The shader with a counter of the lane's in place of its periods.
fn telling(source: String, counter: &str) -> String {
    let plain = "finding.periods_run = tally.period;";
    assert_eq!(source.matches(plain).count(), 1);
    source.replace(plain, &format!("finding.periods_run = {counter};"))
}

/// One lane's record, and what the shader tells in place of its periods.
fn run(precision: Precision, rewrite: fn(String) -> String, pair: &GearPair, start: State) -> (Record, u32) {
    let mut gpu = pollster::block_on(Gpu::open(precision, &AdapterChoice::default())).unwrap();
    gpu.rewrite_shaders(rewrite);
    let settings = LaneSettings { undecided_periods: 1584, ..LaneSettings::default() };
    let lanes = [Lane { flow: 0, law: 0, start }];
    let flows = [pair.oscillator().unwrap()];
    let records = pollster::block_on(gpu.run(&flows, &[pair.law()], &lanes, &settings)).unwrap();
    (records[0], records[0].periods_run)
}

/// A lane from rest that goes that way at least once, and ends on the reference's cycle.
fn check(rewrite: fn(String) -> String, [e, omega]: [f64; 2]) {
    let pair = GearPair { omega, ..GearPair::paper(e) };
    let orbit = analyse(&pair, REST, &Settings::default());
    let Class::Periodic { period } = orbit.class else {
        panic!("e = {e}, omega = {omega}: {:?}", orbit.class)
    };
    let (record, times) = run(Precision::F32, rewrite, &pair, REST);
    println!("e = {e}, omega = {omega}: {times}");
    assert!(times > 0, "e = {e}, omega = {omega}: the lane does not go that way");
    assert_eq!(record.period, period, "e = {e}, omega = {omega}");
    let lyapunov = record.lyapunov;
    assert!(
        (lyapunov - orbit.lyapunov).abs() < 1e-3,
        "e = {e}, omega = {omega}: {lyapunov} {}",
        orbit.lyapunov
    );
}

/// Asked from afar, Newton's method finds no cycle that the motion moves about in the way that its matrix says:
/// the lane goes back and asks again from near by.
#[test]
fn a_cycle_from_afar_that_was_none_is_asked_for_again() {
    for cell in [[0.370, 2.3], [0.047, 3.25], [0.89, 9.835]] {
        check(|source| telling(source, "tallies[lane].strayed"), cell);
    }
}

/// From near by, too, it may lead nowhere: beside a graze, or where rounding is amplified.
#[test]
fn a_lane_that_newton_throws_off_waits_for_the_cycle() {
    for cell in [[0.6929133858267716, 1.6929133858267718], [0.6692913385826772, 4.897637795275591]] {
        check(|source| telling(source, "tally.vain"), cell);
    }
}

/// The cycle that was read repels: recurrence is looked for from scratch.
#[test]
fn a_lane_that_read_a_cycle_that_repels_searches_on() {
    for cell in [[0.6456692913385826, 2.9921259842519685], [0.41732283464566927, 4.031496062992126]] {
        check(|source| telling(source, "tally.tries"), cell);
    }
}

/// The symmetric cycle past the pitchfork, by continuation from before it.
fn symmetric_cycle(e: f64) -> State {
    let mut state = analyse(&GearPair::paper(0.5), REST, &Settings::default()).strobe;
    let steps = 50;
    for n in 0..=steps {
        let pair = GearPair::paper(0.5 + (e - 0.5) * f64::from(n) / f64::from(steps));
        let flow = Flow::new(&pair.oscillator().unwrap());
        let seed = Trajectory::new(&flow, pair.law(), state);
        state = refine(&seed, StrobeMap::MirroredHalves(1)).expect("the branch goes on").state;
    }
    state
}

/// A lane that starts on a cycle which repels rests there, as far as rounding lets it: it is kicked off, and goes
/// to one of the twins that attract. In f32: what is as far off as rounding of f64 leaves so late that its way to
/// the twins may be called chaos.
#[test]
fn a_lane_on_a_cycle_that_repels_is_kicked_off() {
    let pair = GearPair::paper(0.57);
    let start = symmetric_cycle(0.57);
    let moved = [start[0], start[1] + 1e-4, start[2], start[3]];
    let orbit = analyse(&pair, moved, &Settings::default());
    assert_eq!((orbit.class, orbit.symmetric), (Class::Periodic { period: 1 }, Some(false)));
    let (record, times) = run(Precision::F32, |source| telling(source, "tally.tries"), &pair, start);
    assert!(times > 0, "the lane was not at rest there");
    assert_eq!((record.period, record.symmetric), (1, 0));
    assert!((record.lyapunov - orbit.lyapunov).abs() < 1e-3, "{}", record.lyapunov);
}
