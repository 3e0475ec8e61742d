//! Models as files: the gear pair's is the gear pair, and no text makes reading panic.

use proptest::prelude::*;
use rattlemap::model_file::FileModel;
use rattlemap_dynamics::model::{GearPair, Model};

/// A number of any size, and zero of both signs.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => (-3.0..3.0_f64).prop_map(|x| 10_f64.powf(x)),
        1 => Just(0.0),
        1 => Just(1e300),
    ]
}

fn pair() -> impl Strategy<Value = GearPair> {
    let fields = proptest::array::uniform11(number());
    (fields, 0.0..=1.0_f64, -50.0..50.0_f64).prop_map(
        |([m1, m2, r1, r2, k1, k2, r, k, omega, b, mesh_speed], e, force)| GearPair {
            m1,
            m2,
            r1,
            r2,
            k1,
            k2,
            r,
            k,
            force,
            omega,
            b,
            e,
            mesh_speed,
        },
    )
}

#[test]
fn the_gear_pair_of_the_file_is_that_of_the_library() {
    let file = FileModel::built_in("gear-pair").unwrap();
    let paper = GearPair::paper(0.605);
    assert_eq!(file.parameters(), GearPair::PARAMETERS);
    assert_eq!((file.name(), file.title(), file.source()), (paper.name(), paper.title(), paper.source()));
    assert_eq!((file.state_names(), file.bodies()), (paper.state_names(), paper.bodies()));
    assert_eq!(file.frequency(), paper.frequency());
    let has_value = |index| file.value(index) == paper.value(index);
    assert!((0..file.parameters().len()).all(has_value), "the values before any is set are `orbit`'s");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// To the bit: the debug text of a number tells also the sign of a zero.
    #[test]
    fn both_gear_pairs_make_the_same_oscillator_and_law(pair in pair()) {
        let mut file = FileModel::built_in("gear-pair").unwrap();
        (0..file.parameters().len()).for_each(|index| file.assign(index, pair.value(index)));
        prop_assert_eq!(format!("{:?}", Model::oscillator(&file)), format!("{:?}", pair.oscillator()));
        prop_assert_eq!(format!("{:?}", file.law()), format!("{:?}", pair.law()));
    }
}
