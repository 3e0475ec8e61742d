//! Cells of the random space that lanes once got wrong, or claimed more of than they knew.
//!
//! The lanes need an adapter; none is a failure: see `scripts/test.sh`.

mod short_cells;

use rattlemap::classify::classify;
use rattlemap::flow::Flow;
use rattlemap::gpu::Precision;
use rattlemap::orbit::{Class, Measured, measure};
use rattlemap::plan::Plan;
use rattlemap::record::valid;
use short_cells::{Cell, explanation, lane};

/// The first cell of a plan on the reference.
fn reference(plan: &Plan) -> Measured {
    let cell = plan.cell(0);
    measure(&Flow::new(&plan.oscillator(cell.flow)), plan.law(cell.law), plan.start(0, &[]), plan.budget())
}

/// Deep dips, whose pressing ceases a thousandth of a step before they are over.
const DIPPING: [Cell; 2] = [
    Cell(
        [
            0.7933379981454828,
            65.32358605169345,
            0.0058446031311233425,
            8.41818246692525,
            1.0385853366942233,
            15.639209862905885,
            3.4458857895196546,
            75995.7175398333,
            -20.603691377561766,
            2.0245583841580386,
            1.1391720124841538,
            0.6174666009966507,
            6.919667262866591,
        ],
        [0.0; 4],
    ),
    Cell(
        [
            8.584240828771728,
            22.131303736341113,
            0.0032816049931715043,
            34.12255501239598,
            37.01619702838403,
            19.289667272832098,
            2.8712736425790544,
            12624.157296189429,
            -12.738824641276093,
            0.8519788481479289,
            0.251330155705628,
            0.464004769960334,
            4.510756265268243,
        ],
        [0.0; 4],
    ),
];

#[test]
fn a_dip_that_ends_just_before_the_wall_is_no_meshing() {
    for cell in &DIPPING {
        let plan = cell.plan();
        let record = lane(&plan, Precision::F32);
        assert_eq!(explanation(&plan, record, Precision::F32), Err(()), "{record:?}");
    }
}

/// Monodromy matrices with entries a hundred times their largest eigenvalue.
const SHEARED: [Cell; 2] = [
    Cell(
        [
            36.667601431907386,
            0.7538255760196768,
            3.260600694648454,
            0.003442287479783542,
            0.0,
            887.8182389275798,
            0.3239548797192779,
            9.064264039557413,
            -3.8943467240003433,
            0.9210421342641381,
            0.0032357484889002307,
            0.0,
            0.06089290745510626,
        ],
        [0.0024816522286768856, -0.006911815014291799, -0.0007540962602233453, -0.00965815801317456],
    ),
    Cell(
        [
            0.41907306973749464,
            0.019261983810586296,
            2.672583305903358,
            0.0,
            19.042314104367485,
            15.9224675038915,
            0.07211640813374005,
            63152.55353592994,
            0.09359910950710122,
            6.983088321903559,
            0.0012835670375468274,
            0.23769056685781176,
            42.326877845605125,
        ],
        [0.0; 4],
    ),
];

#[test]
fn multipliers_are_not_lost_in_squares_of_a_larger_matrix() {
    for cell in &SHEARED {
        let plan = cell.plan();
        let truth = reference(&plan).lyapunov.unwrap()[0];
        let record = lane(&plan, Precision::F32);
        let apart = (record.lyapunov - truth).abs() * std::f64::consts::TAU / plan.gear_pair(0).omega;
        assert_eq!(classify(&record), Class::Periodic { period: 1 }, "{record:?}");
        assert!(apart < 0.01, "{apart}: {record:?}");
    }
}

/// A spiral that comes close to where it was five periods ago; meshing that ends once a gear without a
/// support has crept off the wall; impacts that end in the same way.
const UNSURE: [(Cell, u32); 3] = [
    (
        Cell(
            [
                37.024195035488816,
                38.1028932982827,
                0.698873339286074,
                0.002578082642103011,
                0.3245063454547759,
                0.12393397145026035,
                68.99249805174765,
                2.9303982956358214,
                2803.771647297635,
                0.4066623927099049,
                0.006607592582895798,
                0.0,
                34.544551010222555,
            ],
            [-0.008537456075364191, 0.0007125044726708383, -0.005018533403050226, 0.006367306471156367],
        ),
        5,
    ),
    (
        Cell(
            [
                0.3901774267366317,
                6.440799373792104,
                0.06102089005804837,
                0.0025299894319994547,
                754.0634609419327,
                0.0,
                201.65373793563984,
                22.975709138168416,
                0.0033164168277366158,
                1.2405025832852334,
                0.008490049136481713,
                0.9999970683424871,
                0.1481367074472687,
            ],
            [-0.010458328413780891, -0.006824113646020814, -0.006151140515315889, 0.002211715078009901],
        ),
        1,
    ),
    (
        Cell(
            [
                0.2779059381401813,
                0.3917014237382963,
                9.221379548309493,
                15.181214242324499,
                0.0,
                0.9085678691281855,
                0.780813537996256,
                3.891711163958565,
                0.6267825651573636,
                1.5672254691951648,
                2.0347084979551746,
                0.0,
                0.0,
            ],
            [-2.61581625487684, -3.589324757733575, -0.5811077569216654, 7.2331056863536105],
        ),
        1,
    ),
];

#[test]
fn what_is_not_sure_is_not_claimed() {
    for (cell, period) in &UNSURE {
        let record = lane(&cell.plan(), Precision::F64);
        assert_ne!(classify(&record), Class::Periodic { period: *period }, "{record:?}");
    }
}

/// A slow spiral to a symmetric cycle, and one to a cycle that is not quite.
const HALFWAY: Cell = Cell(
    [
        13.427254292268229,
        1.720027309427946,
        1.5304009508278298,
        0.8778026964534849,
        0.2203899419094789,
        0.19827034208487335,
        0.0017705946473482693,
        1.5470899111690108,
        -79.836722621679,
        2.5286732358857815,
        0.0012153635674109703,
        1.0,
        15.556723372357391,
    ],
    [0.0; 4],
);
const ALMOST: Cell = Cell(
    [
        1.105323080343295,
        0.14435925576289962,
        0.0,
        0.003728364978314536,
        3618.036582990766,
        207.2892035690218,
        0.004680065301488307,
        0.0,
        -51.134603119379236,
        0.4497815290789088,
        0.0001507944388064379,
        0.4333113984283059,
        2.441102084151279e-6,
    ],
    [7.398952622979273e-5, 0.00017942929119499443, 7.195470823267726e-6, 0.00019227446135563112],
);

#[test]
fn symmetry_is_told_where_the_cycle_is_near_enough() {
    for (cell, wrong) in [(&HALFWAY, 0), (&ALMOST, 1)] {
        let record = lane(&cell.plan(), Precision::F64);
        let claims = record.period > 0 && record.valid & valid::SYMMETRIC != 0;
        assert!(!claims || record.symmetric != wrong, "{record:?}");
    }
}

/// Neutral motions with 900 elastic impacts in a period.
const SHAKEN: [Cell; 2] = [
    Cell(
        [
            0.014806838961719533,
            12.887417520344677,
            0.0,
            0.003769204799889489,
            0.0,
            2163.2693532672592,
            1.9389762752150224,
            757217.9052665302,
            -513.7765281934426,
            54.83276125781735,
            0.00045995867644497697,
            1.0,
            2.0882599040439884,
        ],
        [0.0009381166798074674, -0.05267286852264624, 0.00016555125497948523, 0.03762167538437371],
    ),
    Cell(
        [
            0.5131879279898032,
            0.05592389529967653,
            0.0,
            0.0,
            2291.559433090498,
            0.27922513778109426,
            0.0,
            0.0,
            -0.0,
            0.636432526283484,
            0.00010578012131122987,
            1.0,
            0.0,
        ],
        [0.00029543170084165096, 0.00013238370206592785, 8.445672719382331e-5, -7.744693911460235e-6],
    ),
];

#[test]
fn rounding_at_many_impacts_is_no_chaos() {
    for cell in &SHAKEN {
        let record = lane(&cell.plan(), Precision::F32);
        assert_eq!(classify(&record), Class::Undecided, "{record:?}");
    }
}

/// A symmetric cycle of 656 impacts, whose half-period map amplifies rounding a thousandfold.
const MIRRORED: Cell = Cell(
    [
        0.058942655762370594,
        0.15775831106248125,
        20.102215754017102,
        0.039451258307740565,
        0.0,
        100.27410194344479,
        0.05634213980065689,
        650.747505379099,
        5924.190380180608,
        49.42095178134529,
        0.03610021410388172,
        0.9999996564542655,
        0.0,
    ],
    [0.04177816629598643, -2.5199368247796246, 0.03001884095355131, -5.673224672987838],
);

#[test]
fn the_reference_finds_a_cycle_its_own_mirror_image_where_that_is_hard_to_see() {
    assert_eq!(reference(&MIRRORED.plan()).symmetric, Some(true));
}
