//! Explanations of lanes that leave open what the reference decides or tells apart: whatever they claim has to be
//! some motion's own.
//!
//! The lanes need an adapter; none is a failure: see `scripts/test.sh`.

#[path = "short_cells/planted.rs"]
mod planted;
mod short_cells;

use planted::Said;
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
use rattlemap::stability::{StrobeMap, refine};
use rattlemap::validate::Explanation;
use short_cells::{Cell, cell, cells, explanation, lane};

/// What a lane left open that has averaged impacts and meshing.
fn open([impacts_per_period, mesh_fraction]: [f64; 2], strobe: [f64; 4], periods_run: u32) -> Record {
    Record {
        impacts_per_period,
        mesh_fraction,
        strobe,
        status: Status::Slow.code(),
        periods_run,
        valid: valid::STROBE | valid::PERIOD | valid::IMPACTS | valid::MESH,
        ..Record::default()
    }
}

fn with_exponent(record: Record, [lyapunov, lyapunov_error]: [f64; 2]) -> Record {
    Record { lyapunov, lyapunov_error, valid: record.valid | valid::LYAPUNOV, ..record }
}

/// For cells that are undecided by the end of the budget.
const MORE_PERIODS: &str = "[integration]\nundecided_periods = 1584\n";

/// The main plane with its first cell there.
fn plan_at(e: f64, omega: f64, integration: &str) -> Plan {
    let text = format!(
        "[[axis]]\nparameter = 'e'\nmin = {e}\nmax = 1.0\ncount = 2\n\
         [[axis]]\nparameter = 'omega'\nmin = {omega}\nmax = 20.0\ncount = 2\n\
         {integration}[outputs]\nquantities = ['class', 'lyapunov', 'impacts', 'mesh', 'symmetric', 'word']\n"
    );
    Plan::new(&Scene::parse(&text, "cell", &[], Purpose::Map).unwrap())
}

/// Beside an unsymmetric cycle a symmetric one: rounding keeps a lane off either, and moves its averages.
#[test]
fn what_is_left_open_has_the_averages_of_its_motion() {
    let plan = cell("beside").plan();
    let strobe = [0.02114208840430365, -3.151288327627767e-5, 0.021121863275766373, 0.005357128477331726];
    let record = open([38.375, 0.43264836072921753], strobe, 64);
    Said(&plan, Precision::F32, record).is_explained_by(Explanation::Border).but_not_with(&[
        ("more meshing", |record| record.mesh_fraction += 0.1),
        ("less meshing", |record| record.mesh_fraction -= 0.1),
        ("none", |record| record.mesh_fraction = 0.0),
        ("more impacts", |record| record.impacts_per_period += 2.0),
        ("fewer impacts", |record| record.impacts_per_period -= 2.0),
        ("impacts that are not whole", |record| record.impacts_per_period += 0.01),
    ]);
}

/// Chatter of a thousand impacts over three periods, which scatters: whole impacts may be those of any one period.
#[test]
fn what_scatters_has_averages_within_its_scatter() {
    let plan = cells("turned", 2)[1].plan();
    let strobe = [3.2311919986095745, -8.109986223597144, 3.2310774326324463, -8.167506568329685];
    let record = open([482.0, 0.21997125446796417], strobe, 64);
    Said(&plan, Precision::F32, record).is_explained_by(Explanation::UndecidedInBudget).but_not_with(&[
        ("meshing", |record| record.mesh_fraction += 0.5),
        ("impacts that are not whole", |record| record.impacts_per_period += 0.01),
    ]);
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
        Said(&plan, Precision::F64, record).but_not_with(&[
            ("chaos", |record| {
                record.status = Status::Ok.code();
                (record.lyapunov, record.lyapunov_error) = (0.4, 0.01);
            }),
            ("weak chaos", |record| {
                record.status = Status::Ok.code();
                (record.lyapunov, record.lyapunov_error) = (0.02, 0.002);
            }),
            ("too many events", |record| record.status = Status::CapEvents.code()),
            ("a cycle", |record| {
                (record.status, record.period) = (Status::Ok.code(), 1);
                (record.lyapunov, record.lyapunov_error) = (-0.3, 0.0);
            }),
        ]);
    }
}

/// Lanes that may stop early count from where exponents begin, 100 periods after the start, not from the end of the
/// transient: this one is left open by a slow cycle after 2,112 periods, and has averaged 1,917.
#[test]
fn lanes_that_may_stop_early_count_before_the_transient_is_over() {
    let plan = plan_at(0.7480314960629921, 1.0, MORE_PERIODS);
    let strobe = [1.2445701956748962, -0.08700716515500079, 0.7460595965385437, 0.2017984370626537];
    let record = open([101_761.0 / 1917.0, 0.29894429445266724], strobe, 2112);
    Said(&plan, Precision::F32, record).is_explained_by(Explanation::BelowResolution).but_not_with(&[
        ("meshing", |record| record.mesh_fraction += 1e-3),
        ("impacts", |record| record.impacts_per_period += 0.5),
        ("counted too long", |record| record.impacts_per_period = 106_861.0 / 2013.0),
    ]);
}

/// Bands of chaos a hundred-thousandth of the motion wide, with 68 or 70 impacts a period: rounding holds a lane in a
/// pattern of four periods, and in 573 of them it has met 69 on average, but for one impact. No stretch of the
/// reference as long has so few.
#[test]
fn what_is_not_resolved_has_the_averages_of_any_period() {
    let plan = plan_at(0.8062622309197651, 1.1076320939334638, MORE_PERIODS);
    let strobe = [1.2475126087665558, 0.4332843715321194, 0.7775796055793762, -0.8528200569797216];
    let record = with_exponent(
        open([68.99825479930192, 0.05525544658303261], strobe, 2112),
        [0.04426941373598075, 0.0002834432499675276],
    );
    Said(&plan, Precision::F32, record).is_explained_by(Explanation::UndecidedInBudget).but_not_with(&[
        ("more impacts", |record| record.impacts_per_period += 2.0),
        ("fewer impacts", |record| record.impacts_per_period -= 2.0),
        ("meshing", |record| record.mesh_fraction += 1e-2),
        ("exponent", |record| record.lyapunov = 0.06),
    ]);
    // Double precision resolves them.
    assert_eq!(explanation(&plan, record, Precision::F64), Ok(None));
}

/// A cycle of seven points, two of them 2.5e-5 of the motion apart: single precision rests on six.
#[test]
fn a_point_that_is_not_resolved_may_be_left_out() {
    let plan = plan_at(0.5185909980430529, 3.647749510763209, MORE_PERIODS);
    let strobe = [4.349817514419556, 7.34684832088109, 4.049044132232666, 6.912274701279334];
    let averages = open([101.0 / 6.0, 0.06931833177804947], strobe, 237);
    let record = Record {
        period: 6,
        status: Status::Ok.code(),
        word_hash: 0x642c_8fc3_3ceb_dd00,
        word_length: 125,
        valid: averages.valid | valid::LYAPUNOV | valid::SYMMETRIC | valid::WORD,
        lyapunov: -0.20000232699814274,
        ..averages
    };
    Said(&plan, Precision::F32, record).is_explained_by(Explanation::BelowResolution).but_not_with(&[
        ("another period", |record| record.period = 5),
        ("impacts", |record| record.impacts_per_period += 1.0 / 6.0),
        ("exponent", |record| record.lyapunov *= 1.5),
        ("meshing", |record| record.mesh_fraction += 1e-3),
        ("word", |record| record.word_length = 127),
    ]);
    assert_eq!(explanation(&plan, record, Precision::F64), Ok(None));
}

/// From rest the reference comes to a cycle of 16 impacts, and a lane to a motion beside it of 14 and now and then 15:
/// chaos too weak to be told in 2,112 periods.
#[test]
fn weak_chaos_beside_a_cycle_may_be_left_open() {
    let plan = plan_at(0.5440313111545988, 3.8199608610567513, MORE_PERIODS);
    let strobe = [5.325708985328674, 15.185622256063587, 5.027534008026123, 16.502757142735994];
    let record = with_exponent(
        open([14.016483516483516, 0.0], strobe, 2112),
        [0.053449972824758, 0.019188195534138718],
    );
    Said(&plan, Precision::F32, record).is_explained_by(Explanation::UndecidedInBudget).but_not_with(&[
        ("impacts", |record| record.impacts_per_period += 1.0),
        ("meshing", |record| record.mesh_fraction += 1e-3),
        ("another exponent", |record| record.lyapunov = -0.1),
        ("a cycle", |record| {
            (record.period, record.status, record.lyapunov_error) = (1, Status::Ok.code(), 0.0);
        }),
    ]);
}

/// The reference calls a motion chaos that ends on a cycle in time; a lane that is there by its last period
/// may be left open on it, and nowhere else.
#[test]
fn a_lane_is_left_open_on_the_cycle_where_chaos_ends() {
    // The first one attracts from close by only.
    let settling = Some(Explanation::UndecidedInBudget);
    for (e, omega, settles_from_there) in [(0.6088, 3.4487, None), (0.8789, 5.6876, settling)] {
        let plan = plan_at(e, omega, "");
        let cells = plan.cells(0..1);
        let chaos = pollster::block_on(Engine::Cpu(Cpu::new(&plan)).run(&cells)).unwrap()[0];
        assert_eq!(classify(&chaos), Class::Chaotic, "{chaos:?}");
        let pair = GearPair { omega, ..GearPair::paper(e) };
        let ends = analyse(&pair, [0.0; 4], &Settings { transient_periods: 4000, ..Settings::default() });
        let Class::Periodic { period } = ends.class else { panic!("{ends:?}") };
        let averages = [ends.impacts_per_period, ends.mesh_fraction];
        let open = |strobe| open(averages, strobe, 528);
        let why = |record| explanation(&plan, record, Precision::F32);
        // The cycle amplifies rounding by some hundreds.
        let near = open(ends.strobe.map(|x| x * (1.0 + 1e-4)));
        assert_eq!(why(near), Ok(Some(Explanation::BelowResolution)), "{:?}", ends.class);
        let farther = open(ends.strobe.map(|x| x * (1.0 + 1e-3)));
        assert_eq!(why(farther), Ok(settles_from_there), "{:?}", ends.class);
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
        Said(&plan, Precision::F32, near).but_not_with(&[
            ("meshing", |record| record.mesh_fraction += 0.5),
            ("impacts", |record| record.impacts_per_period += 20.0),
            ("impacts that are not whole", |record| record.impacts_per_period += 1e-4),
        ]);
    }
}

/// Weak chaos about a cycle of two periods that repels by 1.2 % a period: in single precision rounding holds a lane on the
/// cycle, and what it averages is the cycle's own.
#[test]
fn rounding_may_hold_a_lane_on_a_cycle_amid_chaos() {
    let text = format!(
        "[parameters]\nomega = 3.1\n\
         [[axis]]\nparameter = 'mesh_speed'\nmin = 0.08818897637795277\nmax = 0.2\ncount = 2\n\
         [[axis]]\nparameter = 'e'\nmin = 0.2677165354330709\nmax = 1.0\ncount = 2\n{MORE_PERIODS}\
         [outputs]\nquantities = ['class', 'lyapunov', 'impacts', 'mesh', 'symmetric', 'word']\n"
    );
    let plan = Plan::new(&Scene::parse(&text, "cell", &[], Purpose::Map).unwrap());
    let strobe = [2.5345593690872192, 1.491196159724417, 2.034390449523926, 1.3883452982364286];
    let record = with_exponent(
        open([8.0, 0.31821197271347046], strobe, 2112),
        [0.006005663555867948, 1.0816699281962777e-5],
    );
    Said(&plan, Precision::F32, record).is_explained_by(Explanation::BelowResolution).but_not_with(&[
        ("more growth", |record| record.lyapunov *= 3.0),
        ("off the cycle", |record| record.strobe[1] += 1e-2),
    ]);
}
