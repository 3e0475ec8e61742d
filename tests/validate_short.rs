//! Explanations of what lanes say of cells with few periods, where neither chaos nor rest is sure: they
//! hold for what lanes did there, and for nothing that is made up.
//!
//! The lanes need an adapter; none is a failure: see `scripts/test.sh`.

mod short_cells;

use rattlemap::classify::classify;
use rattlemap::engine::{Cpu, Engine};
use rattlemap::flow::Flow;
use rattlemap::gpu::Precision;
use rattlemap::model::GearPair;
use rattlemap::orbit::{Class, Settings, Status, analyse};
use rattlemap::plan::Plan;
use rattlemap::record::{Record, valid};
use rattlemap::reference::Trajectory;
use rattlemap::scene::{Purpose, Scene};
use rattlemap::schedule::Schedule;
use rattlemap::stability::{StrobeMap, refine};
use rattlemap::validate::Explanation;
use short_cells::{Cell, cell, cells, explanation, lane};

/// Changes a record.
type Spoil = fn(&mut Record);

#[track_caller]
fn stays_unexplained(plan: &Plan, record: Record, precision: Precision, planted: &[(&str, Spoil)]) {
    for (what, spoil) in planted {
        let mut wrong = record;
        spoil(&mut wrong);
        assert_eq!(explanation(plan, wrong, precision), Ok(None), "{what}: {wrong:?}");
    }
}

/// Impacts amplify what support damping then forgets: over 32 periods tangents grow by e^15, and the
/// reference's standard error, of shorter blocks in other units, is too large to call that chaos.
#[test]
fn weak_chaos_is_the_references_own_in_the_lanes_blocks() {
    for cell in cells("weak", 3) {
        let plan = cell.plan();
        let record = lane(&plan, Precision::F64);
        assert_eq!(classify(&record), Class::Chaotic, "{record:?}");
        assert_eq!(explanation(&plan, record, Precision::F64), Ok(Some(Explanation::UndecidedInBudget)));
        let planted: [(&str, Spoil); 5] = [
            ("twice the exponent", |record| record.lyapunov *= 2.0),
            ("half of it, surely", |record| {
                (record.lyapunov, record.lyapunov_error) = (0.4 * record.lyapunov, 1e-3)
            }),
            ("impacts", |record| record.impacts_per_period = 3.0 * record.impacts_per_period + 1.0),
            ("meshing", |record| record.mesh_fraction += 0.3),
            ("a cycle", |record| record.period = 3),
        ];
        stays_unexplained(&plan, record, Precision::F64, &planted);
    }
}

/// Tangents of these grow in proportion to time, or not at all.
#[test]
fn neutral_motion_is_no_chaos_in_anybodys_blocks() {
    // The paper's pair, undamped and never in contact: a torus; the same unforced; and a swing of one gear
    // beside a free one.
    let torus = [2.0, 1.0, 0.0, 0.0, 30.0, 20.0, 1.0, 1000.0, 1.0, 5.6, 5.0, 0.8, 0.01];
    let unforced = [2.0, 1.0, 0.0, 0.0, 30.0, 20.0, 1.0, 1000.0, 0.0, 5.6, 5.0, 0.8, 0.01];
    let free = [2.0, 1.0, 0.0, 0.0, 0.0, 20.0, 1.0, 1000.0, 1.0, 5.6, 50.0, 0.8, 0.01];
    for (parameters, start) in
        [(torus, [0.1, 0.0, 0.2, 0.0]), (unforced, [0.3, 0.0, 0.0, 0.5]), (free, [0.0, 0.0, 0.1, 0.0])]
    {
        let plan = Cell(parameters, start).plan();
        let record = lane(&plan, Precision::F64);
        assert_eq!(classify(&record), Class::Undecided, "{record:?}");
        let chaos: Spoil = |record| {
            record.status = Status::Ok.code();
            (record.lyapunov, record.lyapunov_error) = (0.4, 0.01);
        };
        let weak: Spoil = |record| {
            record.status = Status::Ok.code();
            (record.lyapunov, record.lyapunov_error) = (0.02, 0.002);
        };
        let cap: Spoil = |record| record.status = Status::CapEvents.code();
        let cycle: Spoil = |record| {
            (record.status, record.period) = (Status::Ok.code(), 1);
            (record.lyapunov, record.lyapunov_error) = (-0.3, 0.0);
        };
        let planted = [("chaos", chaos), ("weak chaos", weak), ("too many events", cap), ("a cycle", cycle)];
        stays_unexplained(&plan, record, Precision::F64, &planted);
    }
}

/// A gear without a support spring that comes to rest on a wall: its cycle neither attracts nor repels in
/// the end. Lanes in f64 see that contact ends; those in f32 rest before, and read the first one then.
#[test]
fn a_gear_at_rest_is_left_open_or_read_before_it_rests() {
    let resting = cells("resting", 2);
    for cell in &resting {
        let record = lane(&cell.plan(), Precision::F64);
        assert_eq!(classify(&record), Class::Undecided, "{record:?}");
    }
    let plan = resting[0].plan();
    let record = lane(&plan, Precision::F32);
    let why = explanation(&plan, record, Precision::F32);
    if classify(&record) == Class::Undecided {
        assert_eq!(why, Err(()), "{record:?}");
    } else {
        assert_eq!(classify(&record), Class::Periodic { period: 1 }, "{record:?}");
        assert_eq!(why, Ok(Some(Explanation::Unsettled)));
        let planted: [(&str, Spoil); 6] = [
            ("period", |record| record.period = 2),
            ("exponent", |record| record.lyapunov *= 1.3),
            ("meshing", |record| record.mesh_fraction -= 0.2),
            ("impacts", |record| record.impacts_per_period += 2.0),
            ("another place", |record| record.strobe = record.strobe.map(|x| 0.5 * x)),
            ("chaos", |record| {
                (record.period, record.status) = (0, Status::Ok.code());
                (record.lyapunov, record.lyapunov_error) = (0.4, 0.01);
            }),
        ];
        stays_unexplained(&plan, record, Precision::F32, &planted);
    }
}

/// Unforced, of two gears without supports, one at rest on the other.
#[test]
fn too_many_events_are_rounding_or_chaos_or_a_fault() {
    let plan = cell("at_rest").plan();
    let record = lane(&plan, Precision::F32);
    let why = explanation(&plan, record, Precision::F32);
    if record.status == Status::CapEvents.code() {
        assert_eq!(why, Ok(Some(Explanation::BelowResolution)));
    } else {
        assert_eq!((classify(&record), why), (Class::Undecided, Err(())), "{record:?}");
    }
    // In f64 the same motion is far above rounding after one period; where the teeth still move it is a
    // fault, and so it is elsewhere.
    let early: Spoil = |record| {
        (record.status, record.period, record.periods_run) = (Status::CapEvents.code(), 0, 0);
        record.strobe = [0.0, -0.19, 0.0, -0.15];
    };
    stays_unexplained(&plan, record, Precision::F64, &[("too early", early)]);
    // Elastic impacts on a wall that the load presses to: six thousand in a period, and slower ones, of which
    // there are more, if the strobe cuts a flight that is shallower than the gap rounds by.
    let plan = cell("elastic").plan();
    let cut: Spoil = |record| {
        (record.status, record.period, record.periods_run) = (Status::CapEvents.code(), 0, 8);
        record.valid = valid::STROBE;
    };
    let mut record = lane(&plan, Precision::F32);
    cut(&mut record);
    assert_eq!(explanation(&plan, record, Precision::F32), Ok(Some(Explanation::EngineCap)));
    // The gap of a lane in f64 tells where it is.
    stays_unexplained(&plan, lane(&plan, Precision::F64), Precision::F64, &[("cut", cut)]);
    // One at rest, whose teeth meet once or twice in a period: a lane once met ten thousand times there.
    let stuck: Spoil = |record| {
        (record.status, record.period, record.periods_run) = (Status::CapEvents.code(), 0, 59);
        record.strobe =
            [1.7857179045677185e-5, -0.01238123487995892, -0.014012660831212997, -0.01238123487995892];
    };
    let plan = cell("balanced").plan();
    stays_unexplained(&plan, lane(&plan, Precision::F32), Precision::F32, &[("stuck", stuck)]);
    // The paper's chaos has some ten events in a period.
    let pair = [2.0, 1.0, 0.6, 0.6, 30.0, 20.0, 1.0, 1000.0, 50.0, 5.6, 0.5, 0.65, 0.01];
    let plan = Cell(pair, [0.0; 4]).plan();
    for precision in Precision::ALL {
        let cap: Spoil = |record| (record.status, record.period) = (Status::CapEvents.code(), 0);
        stays_unexplained(&plan, lane(&plan, precision), precision, &[("chaos", cap)]);
    }
}

/// A gap of 1e-4 beside displacements of 4: single precision rounds at every step what decides how long the
/// teeth mesh.
#[test]
fn rounding_at_every_step_moves_averages_so_far_and_no_farther() {
    let plan = cell("fine").plan();
    let record = lane(&plan, Precision::F32);
    assert!(matches!(explanation(&plan, record, Precision::F32), Err(()) | Ok(Some(_))), "{record:?}");
    let planted: [(&str, Spoil); 4] = [
        ("meshing", |record| record.mesh_fraction -= 0.01),
        ("exponent", |record| record.lyapunov *= 1.3),
        ("impacts", |record| record.impacts_per_period += 2.0),
        ("period", |record| record.period = 2),
    ];
    stays_unexplained(&plan, record, Precision::F32, &planted);
}

/// The same, over so many steps that the turning of cos and sin drifts.
#[test]
fn a_phase_that_drifts_moves_averages_so_far_and_no_farther() {
    for cell in cells("drifting", 2) {
        let plan = cell.plan();
        let record = lane(&plan, Precision::F32);
        let why = explanation(&plan, record, Precision::F32);
        let is_rounding = |why| matches!(why, Explanation::BelowResolution | Explanation::Border);
        assert!(why.is_err() || why.is_ok_and(|why| why.is_some_and(is_rounding)), "{why:?}: {record:?}");
        let planted: [(&str, Spoil); 4] = [
            ("meshing", |record| record.mesh_fraction += 5e-4),
            ("exponent", |record| record.lyapunov *= 0.3),
            ("impacts", |record| record.impacts_per_period += 2.0),
            ("period", |record| record.period = 2),
        ];
        stays_unexplained(&plan, record, Precision::F32, &planted);
        // In double precision nothing drifts so far.
        let less: Spoil = |record| record.mesh_fraction -= 6e-5;
        stays_unexplained(&plan, lane(&plan, Precision::F64), Precision::F64, &[("meshing", less)]);
    }
}

/// One whose strobes alternate by a hundred-thousandth in single precision, which calls it period 2.
#[test]
fn a_multiple_of_a_period_is_rounding_or_a_fault() {
    let plan = cell("alternating").plan();
    let record = lane(&plan, Precision::F32);
    let why = explanation(&plan, record, Precision::F32);
    assert!(matches!(why, Err(()) | Ok(Some(Explanation::BelowResolution))), "{why:?}: {record:?}");
    let planted: [(&str, Spoil); 4] = [
        ("another period", |record| record.period = 3),
        ("exponent", |record| record.lyapunov *= 0.5),
        ("impacts", |record| record.impacts_per_period += 1.0),
        ("meshing", |record| record.mesh_fraction -= 1e-3),
    ];
    stays_unexplained(&plan, record, Precision::F32, &planted);
    let record = lane(&plan, Precision::F64);
    assert_eq!(classify(&record), Class::Periodic { period: 1 }, "{record:?}");
    let twice: Spoil = |record| record.period = 2;
    stays_unexplained(&plan, record, Precision::F64, &[("period", twice)]);
}

/// Meshing that ends where next to nothing presses, and chatter of a thousand impacts: there rounding on the
/// way to every event decides.
#[test]
fn rounding_at_events_moves_averages_so_far_and_no_farther() {
    let mut decided = 0;
    for cell in cells("turned", 2) {
        let plan = cell.plan();
        let record = lane(&plan, Precision::F32);
        let why = explanation(&plan, record, Precision::F32);
        if classify(&record) == Class::Undecided {
            assert_eq!(why, Ok(Some(Explanation::UndecidedInBudget)), "{record:?}");
            continue;
        }
        decided += 1;
        assert!(matches!(why, Err(()) | Ok(Some(Explanation::BelowResolution))), "{why:?}: {record:?}");
        let planted: [(&str, Spoil); 4] = [
            ("meshing", |record| record.mesh_fraction += 0.01),
            ("exponent", |record| record.lyapunov = 2.0),
            ("impacts", |record| record.impacts_per_period += 2.0),
            ("period", |record| record.period = 2),
        ];
        stays_unexplained(&plan, record, Precision::F32, &planted);
    }
    assert!(decided > 0);
}

/// What is amplified for 30 periods are a lane's own numbers, the share of an impulse above all, the same at every
/// impact; and elastic impacts on a wall, of which they make two more or less.
#[test]
fn numbers_that_are_rounded_once_for_all_make_chaos_or_meshing() {
    let [amplified, elastic] = cells("kicked", 2).try_into().ok().unwrap();
    let plan = amplified.plan();
    let record = lane(&plan, Precision::F32);
    let why = explanation(&plan, record, Precision::F32);
    let is_rounding = |why| matches!(why, Explanation::BelowResolution | Explanation::Chaos);
    assert!(why.is_err() || why.is_ok_and(|why| why.is_some_and(is_rounding)), "{why:?}: {record:?}");
    let planted: [(&str, Spoil); 3] = [
        ("twice the exponent", |record| {
            record.status = Status::Ok.code();
            (record.lyapunov, record.lyapunov_error) = (0.5, 0.02);
        }),
        ("impacts", |record| {
            record.status = Status::Ok.code();
            (record.lyapunov, record.lyapunov_error, record.impacts_per_period) = (0.2, 0.03, 8.0);
        }),
        ("a cycle", |record| (record.period, record.status) = (3, Status::Ok.code())),
    ];
    stays_unexplained(&plan, record, Precision::F32, &planted);
    // In double precision nothing of the kind is in reach.
    let chaos: Spoil = |record| {
        record.status = Status::Ok.code();
        (record.lyapunov, record.lyapunov_error, record.impacts_per_period) = (0.2, 0.03, 4.0);
    };
    stays_unexplained(&plan, lane(&plan, Precision::F64), Precision::F64, &[("chaos", chaos)]);

    let plan = elastic.plan();
    let record = lane(&plan, Precision::F32);
    let why = explanation(&plan, record, Precision::F32);
    assert!(matches!(why, Err(()) | Ok(Some(Explanation::BelowResolution))), "{why:?}: {record:?}");
    let planted: [(&str, Spoil); 3] = [
        ("meshing", |record| record.mesh_fraction -= 0.01),
        ("impacts", |record| record.impacts_per_period += 20.0),
        ("period", |record| record.period = 2),
    ];
    stays_unexplained(&plan, record, Precision::F32, &planted);
}

/// Beside an unsymmetric cycle a symmetric one, whose averages rounding moves further than bars are wide.
#[test]
fn another_cycle_may_be_read_where_every_step_rounds() {
    let plan = cell("beside").plan();
    let record = lane(&plan, Precision::F32);
    let why = explanation(&plan, record, Precision::F32);
    assert!(why.is_err() || why.is_ok_and(|why| why.is_some()), "{why:?}: {record:?}");
    // A lane that leaves it open claims nothing but averages on the way: then only a claim is planted.
    let claim: Spoil = |record| {
        (record.status, record.period) = (Status::Ok.code(), 3);
        (record.lyapunov, record.lyapunov_error) = (-1.5, 0.0);
    };
    if classify(&record) == Class::Undecided {
        stays_unexplained(&plan, record, Precision::F32, &[("a cycle", claim)]);
        return;
    }
    let planted: [(&str, Spoil); 5] = [
        ("meshing", |record| record.mesh_fraction += 0.1),
        ("exponent", |record| record.lyapunov = 1.5),
        ("impacts", |record| record.impacts_per_period += 2.0),
        ("symmetry", |record| record.symmetric = 1 - record.symmetric),
        ("another place", |record| record.strobe = record.strobe.map(|x| 1.2 * x)),
    ];
    stays_unexplained(&plan, record, Precision::F32, &planted);
}

/// Strobes in the dip at the start of meshing, where a state does not tell that the teeth mesh. The lane is there
/// before the reference is, or says nothing.
#[test]
fn a_cycle_whose_strobe_is_in_a_dip_is_read_there() {
    let plan = cell("dip").plan();
    let record = Record {
        lyapunov: -0.01974552229067482,
        impacts_per_period: 3.6,
        mesh_fraction: 0.24196472764015198,
        strobe: [0.03876093868166208, -0.014957416229296442, 0.011348499916493893, -0.011862732010606336],
        period: 5,
        periods_run: 45,
        status: Status::Ok.code(),
        valid: valid::PERIOD | valid::LYAPUNOV | valid::IMPACTS | valid::MESH | valid::STROBE,
        ..Record::default()
    };
    assert_eq!(explanation(&plan, record, Precision::F32), Ok(Some(Explanation::Unsettled)));
    let planted: [(&str, Spoil); 5] = [
        ("meshing", |record| record.mesh_fraction += 0.01),
        ("exponent", |record| record.lyapunov *= 3.0),
        ("impacts", |record| record.impacts_per_period += 0.4),
        ("period", |record| record.period = 10),
        ("another place", |record| record.strobe = record.strobe.map(|x| 1.2 * x)),
    ];
    stays_unexplained(&plan, record, Precision::F32, &planted);
}

/// The reference calls a motion chaos that ends on a cycle in time; a lane that is there by its last period
/// may be left open on it, and nowhere else.
#[test]
fn a_lane_is_left_open_on_the_cycle_where_chaos_ends() {
    for (e, omega) in [(0.6088, 3.4487), (0.8789, 5.6876)] {
        let text = format!(
            "[[axis]]\nparameter = 'e'\nmin = {e}\nmax = 1.0\ncount = 2\n\
             [[axis]]\nparameter = 'omega'\nmin = {omega}\nmax = 20.0\ncount = 2\n\
             [outputs]\nquantities = ['class', 'lyapunov', 'impacts', 'mesh', 'symmetric', 'word']\n"
        );
        let plan = Plan::new(&Scene::parse(&text, "cell", &[], Purpose::Map).unwrap());
        let batch = Schedule::new(&plan).batch(&plan, 0, 1);
        let chaos = pollster::block_on(Engine::Cpu(Cpu::new(&plan)).run(&batch)).unwrap()[0];
        assert_eq!(classify(&chaos), Class::Chaotic, "{chaos:?}");
        let pair = GearPair { omega, ..GearPair::paper(e) };
        let ends = analyse(&pair, [0.0; 4], &Settings { transient_periods: 4000, ..Settings::default() });
        let Class::Periodic { period } = ends.class else { panic!("{ends:?}") };
        let open = |strobe| Record {
            strobe,
            status: Status::Slow.code(),
            periods_run: 528,
            valid: valid::STROBE | valid::PERIOD,
            ..Record::default()
        };
        let why = |record| explanation(&plan, record, Precision::F32);
        let near = open(ends.strobe.map(|x| x * (1.0 + 1e-4)));
        assert_eq!(why(near), Ok(Some(Explanation::UndecidedInBudget)), "{:?}", ends.class);
        // A cycle of the same period that repels, which chaos passes.
        let flow = Flow::new(&pair.oscillator().unwrap());
        let mut passing: Trajectory<'_> = Trajectory::new(&flow, pair.law(), chaos.strobe);
        let repelling = (0..200).find_map(|_| {
            passing.advance_period(&mut ()).unwrap();
            refine(&passing, StrobeMap::Periods(period)).filter(|cycle| cycle.spectral_radius() > 1.5)
        });
        let beside = repelling.expect("a cycle that repels").state.map(|x| x * (1.0 + 2e-4));
        for strobe in [chaos.strobe, beside, ends.strobe.map(|x| 1.5 * x), [0.0; 4]] {
            assert_eq!(why(open(strobe)), Ok(None), "{strobe:?}");
        }
    }
}
