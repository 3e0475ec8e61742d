//! Cycles of the main plane that earlier lanes did not find.
//!
//! The lanes need an adapter; without one the tests fail (see `scripts/test.sh`).

use crate::common::gpu::{open, run, run_from_rest};
use crate::common::pairs::AsPair;
use crate::common::{REST, paper as pair};
use crate::lanes::kinds;
use rattlemap::gpu::{LaneSettings, Precision};
use rattlemap::record::Record;
use rattlemap::record::classify::classify;
use rattlemap_dynamics::model::state;
use rattlemap_dynamics::orbit::{Class, Status};

/// The points lie within a thousandth of the motion, so that shorter lags recur, and Newton's method leaves the
/// motion's branch. Lanes once repeated the same search for ever.
#[test]
fn a_cycle_of_close_points_is_found_although_newton_leaves_its_branch() {
    let pairs = [pair(5.0 / 9.0, 17.0 / 9.0), pair(238.0 / 511.0, 1.0 + 11.0 * 44.0 / 511.0)];
    for (precision, pairs) in [(Precision::F64, &pairs[..]), (Precision::F32, &pairs[..1])] {
        for record in run_from_rest(&mut open(precision), pairs, &LaneSettings::default()) {
            assert_eq!(classify(&record), Class::Periodic { period: 7 }, "{precision:?}: {record:?}");
        }
    }
}

/// Motion that approaches its cycle for thousands of periods recurs, and the cycle is read again and again. With a
/// new tangent vector after each reading, the exponent was 0.17 by 25 standard errors, and the motion was called
/// chaotic.
#[test]
#[ignore = "compiles shaders of its own; scripts/test.sh --all"]
fn the_exponent_does_not_depend_on_cycles_that_are_read() {
    let slow = [pair(441.0 / 511.0, 1.0 + 11.0 * 155.0 / 511.0)];
    for precision in Precision::ALL {
        let with =
            |early_stop| LaneSettings { early_stop, undecided_periods: 1584, ..LaneSettings::default() };
        let mut gpu = open(precision);
        let [on_the_way, undisturbed] =
            [true, false].map(|early_stop| run_from_rest(&mut gpu, &slow, &with(early_stop)).swap_remove(0));
        assert_eq!(classify(&on_the_way), Class::Undecided, "{precision:?}: {on_the_way:?}");
        // Both decrease with time: after 2,112 periods and after 528.
        for (record, least) in [(on_the_way, -0.0007), (undisturbed, -0.0011)] {
            assert!((least..-0.0005).contains(&record.lyapunov), "{precision:?}: {record:?}");
            assert!(record.lyapunov_error < 1e-4, "{precision:?}: {record:?}");
        }
    }
}

/// A cycle of period 3 with a multiplier of -0.9985, at the end of long chaos that comes close to other cycles of
/// period 3. Motion that approaches it from alternating sides recurs best after six periods. Lanes once reported
/// period 6: they had rejected period 3 after reading another cycle, which is unstable.
#[test]
fn a_cycle_that_is_approached_from_both_sides_is_not_doubled() {
    let cell = pair(0.948, 5.64);
    let starts = [
        [-0.053144306447458156, 2.713737059448592, -0.24326969921312358, -2.0849732837656756],
        [-0.49640028439788964, 4.566288023660416, -0.7606548398185529, 6.393597386904993],
        [0.7334643848582618, -6.355003281405908, 0.7944278876389996, 2.7450908084078485],
        [0.2591010529126554, -7.413808352146448, 0.5947944251521922, 7.04170930985307],
    ];
    let settings = LaneSettings { periods: 1456, transient_periods: 1200, ..LaneSettings::default() };
    for precision in Precision::ALL {
        for record in run(&mut open(precision), &starts.map(|start| (cell, state(&start))), &settings) {
            let class = classify(&record);
            // Chaos amplifies rounding: not every lane reaches the cycle in time.
            let is_known = matches!(class, Class::Periodic { period: 3 } | Class::Chaotic | Class::Undecided);
            assert!(is_known, "{precision:?}: {record:?}");
        }
    }
}

/// The points of a cycle of period 15 lie closer together than the resolution of single precision.
#[test]
fn a_cycle_below_the_resolution_has_that_status() {
    let cell = [pair(0.4637964774951076, 1.7749510763209393)];
    let settings = LaneSettings { undecided_periods: 1584, ..LaneSettings::default() };
    for (precision, status) in [(Precision::F32, Status::BelowResolution), (Precision::F64, Status::Ok)] {
        let record = &run_from_rest(&mut open(precision), &cell, &settings)[0];
        assert_eq!(classify(record), Class::Periodic { period: 15 }, "{precision:?}: {record:?}");
        assert_eq!(record.status, status.code(), "{precision:?}: {record:?}");
    }
}

/// Powers of two are exact: another unit of length changes no bit. The series of the flow is truncated by a norm that
/// adds rates to displacements, so that another unit of time may round differently.
#[test]
fn classes_do_not_depend_on_the_units_of_length_and_time() {
    let pairs = (0..24 * 24).map(|n| pair(f64::from(n % 24) / 23.0, 1.0 + 11.0 * f64::from(n / 24) / 23.0));
    let plane: Vec<_> = pairs.map(|pair| (pair.pair(), pair.law(), REST)).collect();
    // Whether lanes follow chatter depends on speeds, too.
    let settings = LaneSettings::default();
    for precision in Precision::ALL {
        let expected = kinds::run(precision, &plane, &settings).unwrap();
        for (length, time) in [(-20, 0), (20, 0), (0, -10), (0, 10), (-10, 10)] {
            let (far, long) = (f64::from(length).exp2(), f64::from(time).exp2());
            let cells: Vec<_> = plane.iter().map(|cell| kinds::in_units(cell, length, time)).collect();
            let records = kinds::run(precision, &cells, &settings).unwrap();
            let differ = expected.iter().zip(records).filter(|(expected, record)| {
                let mut record = record.clone();
                for i in 0..4 {
                    record.strobe[i] /= if i % 2 == 0 { far } else { far / long };
                }
                (record.lyapunov, record.lyapunov_error) =
                    (record.lyapunov * long, record.lyapunov_error * long);
                let says = |record: &Record| (classify(record), record.period, record.status);
                if time == 0 { record != **expected } else { says(&record) != says(expected) }
            });
            assert_eq!(differ.count(), 0, "{precision:?}, length 2^{length}, time 2^{time}");
        }
    }
}

/// Newton's method leads to a stable cycle that the motion does not approach: a fold of the strobe map or another
/// basin lies between them. An independent program computed the motion's own cycle with 80 bits.
#[test]
fn a_stable_cycle_that_is_not_approached_is_not_reported() {
    let settings = LaneSettings { undecided_periods: 1584, ..LaneSettings::default() };
    let named = [
        (0.8, 5.745098039215686, 2, 2.5),
        (0.3254901960784314, 3.2, 1, 16.0),
        // Beyond a threshold of meshing lies a cycle of period 1, near which the motion stays for twenty periods.
        (0.5949119373776908, 3.7984344422700587, 2, 8.5),
        (0.5177257525083612, 3.6040133779264214, 3, 50.0 / 3.0),
        (0.03522504892367906, 6.9628180039138945, 1, 3.0),
        // The approach is slow and curved, so that Newton's method fails until the lane makes no more searches.
        (0.5590551181102362, 5.417322834645669, 1, 2.0),
    ];
    for (e, omega, period, impacts) in named {
        let cells = [(0.0, 0.0), (1e-6, 0.0), (0.0, 1e-6), (1e-6, 1e-6)].map(|(d, w)| pair(e + d, omega + w));
        for precision in Precision::ALL {
            for record in run_from_rest(&mut open(precision), &cells, &settings) {
                assert_eq!(
                    classify(&record),
                    Class::Periodic { period },
                    "{precision:?}, {e} {omega}: {record:?}"
                );
                let off = (record.impacts_per_period - impacts).abs();
                assert!(off < 1e-9, "{precision:?}, {e} {omega}: {record:?}");
            }
        }
    }
}
