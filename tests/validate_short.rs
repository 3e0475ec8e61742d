//! Explanations of what lanes say of cells with few periods, where neither chaos nor rest is sure: they
//! hold for what lanes did there, and for nothing that is made up.
//!
//! The lanes need an adapter; none is a failure: see `scripts/test.sh`.

mod short_cells;

use rattlemap::classify::classify;
use rattlemap::gpu::Precision;
use rattlemap::orbit::{Class, Status};
use rattlemap::plan::Plan;
use rattlemap::record::Record;
use rattlemap::validate::Explanation;
use short_cells::{Cell, explanation, lane};

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
const WEAK: [Cell; 3] = [
    Cell(
        [
            2.7820010318277637,
            0.030102994271735864,
            0.1574594413174311,
            0.002454983918033779,
            352.0695024389885,
            0.0,
            0.0,
            7.478246460719106,
            0.006022946398931511,
            40.51849689995893,
            1.8289597078412225,
            0.7555638295998724,
            0.011133987047050486,
        ],
        [2.0796273140321695, 136.0836614413116, 0.7232607542945363, 155.2553321249037],
    ),
    Cell(
        [
            0.47218235289610705,
            5.929569630240548,
            0.0,
            0.005166777597752234,
            30.314219733250646,
            38.67455540623106,
            0.017728272214944274,
            414.415006595205,
            0.0,
            11.788165104939573,
            0.13524496751386317,
            0.5296799004908582,
            0.0025044719991055117,
        ],
        [-0.22663449345375544, -2.51299174023783, -0.004126413802277747, -5.847651888559649],
    ),
    Cell(
        [
            2.2315633362958316,
            5.523424592805293,
            0.14082215321585992,
            1.443591251987449,
            0.0,
            0.2600712488441795,
            0.16890690016762633,
            8831.531980430529,
            4.057471840297504,
            63.51663539426005,
            0.5997669989197834,
            0.5044657566236439,
            0.0,
        ],
        [-0.3631264959319609, -119.58713952258677, -0.12104373916016596, -41.36238802357405],
    ),
];

#[test]
fn weak_chaos_is_the_references_own_in_the_lanes_blocks() {
    for cell in &WEAK {
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
const RESTING: [Cell; 2] = [
    Cell(
        [
            2.3641330101373184,
            23.01263187023638,
            1.4120615997896726,
            2.391688422861378,
            3542.1009806503735,
            0.0,
            90.61176159407259,
            24.077846648817392,
            -0.011832825773863504,
            12.348916100190214,
            32.47897579239632,
            0.3384332769841446,
            0.0,
        ],
        [44.12833800871946, -441.8080781659228, 23.58059582918715, 207.46696275501725],
    ),
    Cell(
        [
            67.46164874375515,
            15.846297110154149,
            0.0,
            57.37205273519314,
            0.0,
            60.54947476305295,
            885.2635632740071,
            29.999602357691266,
            -3.568546718510178,
            1.9261604333094877,
            18.305388627090643,
            0.42475742061780286,
            2.1145147382247353e-6,
        ],
        [22.558221869588365, 67.007003803532, 18.161880624392573, 18.834313938429034],
    ),
];

#[test]
fn a_gear_at_rest_is_left_open_or_read_before_it_rests() {
    for cell in &RESTING {
        let record = lane(&cell.plan(), Precision::F64);
        assert_eq!(classify(&record), Class::Undecided, "{record:?}");
    }
    let plan = RESTING[0].plan();
    let record = lane(&plan, Precision::F32);
    if classify(&record) != Class::Undecided {
        assert_eq!(classify(&record), Class::Periodic { period: 1 }, "{record:?}");
        assert_eq!(explanation(&plan, record, Precision::F32), Ok(Some(Explanation::Unsettled)));
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
const AT_REST: Cell = Cell(
    [
        0.5102353948934131,
        0.07522568516203158,
        12.8334865183009,
        0.0,
        0.0,
        0.0,
        0.5068186445404628,
        3.0961106225228696,
        0.0,
        1.5022414016538406,
        0.033399143472322014,
        0.4480834828434169,
        5.087107778073495,
    ],
    [0.016491485196524255, -0.1929169114823801, 0.017593504066693424, -0.15279480638507534],
);

#[test]
fn too_many_events_are_rounding_or_chaos_or_a_fault() {
    let plan = AT_REST.plan();
    let record = lane(&plan, Precision::F32);
    if record.status == Status::CapEvents.code() {
        assert_eq!(explanation(&plan, record, Precision::F32), Ok(Some(Explanation::BelowResolution)));
    }
    // In f64 the same motion is far above rounding after one period; where the teeth still move it is a
    // fault, and so it is elsewhere.
    let early: Spoil = |record| {
        (record.status, record.period, record.periods_run) = (Status::CapEvents.code(), 0, 0);
        record.strobe = [0.0, -0.19, 0.0, -0.15];
    };
    stays_unexplained(&plan, record, Precision::F64, &[("too early", early)]);
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
const FINE: Cell = Cell(
    [
        7.3225828037764265,
        0.44976892029581345,
        0.013588791311945155,
        0.0027533987249903384,
        1272.2144586995096,
        0.0,
        0.9618557418524423,
        2.0732291498903006,
        -5577.284246846522,
        0.20778645434020987,
        0.00013194514365232675,
        0.17328028453507582,
        0.0,
    ],
    [0.0; 4],
);

#[test]
fn rounding_at_every_step_moves_averages_so_far_and_no_farther() {
    let plan = FINE.plan();
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
const DRIFTING: [Cell; 2] = [
    Cell(
        [
            0.08823531625324646,
            0.12941349877452898,
            0.464288828952097,
            0.0,
            675.5378853817336,
            0.0,
            0.31562895088481074,
            5612.198359022663,
            8027.684263746821,
            1.6568954539515373,
            0.006695239363000086,
            0.24090160207268607,
            0.0010698161672906808,
        ],
        [0.0; 4],
    ),
    Cell(
        [
            0.2047675157021311,
            0.0635173497611614,
            0.2997898683527236,
            0.0,
            5311.903590523875,
            3.5541769698826697,
            0.40893421641857497,
            490.7530689598123,
            -4937.6036611205745,
            1.3344483289535414,
            0.00794227976231415,
            0.32344024881232336,
            0.04616037941123117,
        ],
        [0.0; 4],
    ),
];

#[test]
fn a_phase_that_drifts_moves_averages_so_far_and_no_farther() {
    for cell in &DRIFTING {
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
const ALTERNATING: Cell = Cell(
    [
        0.5056531814412567,
        0.562462919954447,
        0.0,
        0.00341805887958341,
        1166.1764952212475,
        330.4672072109734,
        0.2755939805167101,
        2.834887861553148,
        -446.71728329162977,
        0.5087343515952822,
        0.00025696758033011316,
        0.0,
        7.015472375038137e-5,
    ],
    [-4.629693576984496e-5, -0.0005572948104036579, -3.3559287565770934e-5, -0.000274661662267506],
);

#[test]
fn a_multiple_of_a_period_is_rounding_or_a_fault() {
    let plan = ALTERNATING.plan();
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
