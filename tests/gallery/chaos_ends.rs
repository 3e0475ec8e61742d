//! Chaos of one degree of freedom that ends when the mass comes to rest on a wall.

use rattlemap::model_file::FileModel;
use rattlemap_dynamics::model::{Form, Model, REST};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Budget, Measurement, Settings, Status, measure};

fn budget(early_stop: bool) -> Budget {
    Budget {
        settings: Settings { transient_periods: 400, ..Settings::default() },
        early_stop,
        undecided_periods: 0,
        confirm_chaos: 0,
        exponent: true,
        shows_exponent: true,
        quantities: false,
    }
}

/// Computes a ball in a tilted tube with and without early stops.
fn both(f: f64, a: f64) -> [Measurement; 2] {
    let mut tube = FileModel::parse(include_str!("data/tilted_tube.toml"), "tilted_tube.toml").unwrap();
    [("f", f), ("a", a)].iter().for_each(|&(name, value)| tube.set(name, value).unwrap());
    let flow = Flow::new(Form::from(&tube.oscillator().unwrap()));
    [true, false].map(|early_stop| measure(&flow, tube.law(), REST, &budget(early_stop)))
}

/// The motion is chaotic for more than 198 periods. Then a series of impacts closes, and a superstable cycle follows. The cells are those of
/// a map in which this happens: rounding decides how long the chaos of a cell lasts.
#[test]
fn a_tube_is_not_called_chaotic_before_its_ball_rests() {
    for (f, a) in [
        (11.338983050847459, 18.170212765957448),
        (12.152542372881356, 29.48936170212766),
        (12.966101694915254, 31.914893617021278),
        (13.372881355932204, 33.53191489361702),
        (15.0, 34.340425531914896),
        (14.389830508474576, 39.191489361702125),
    ] {
        let [early, whole] = both(f, a);
        let of = |measured: &Measurement| (measured.period, measured.multiplier.map(|[modulus, _]| modulus));
        assert!(whole.period.is_some_and(|period| period < 12), "f = {f}, a = {a}: {whole:?}");
        assert_eq!((of(&early), of(&early).1), (of(&whole), Some(0.0)), "f = {f}, a = {a}");
        assert!((200..528).contains(&early.periods_run), "f = {f}, a = {a}: {}", early.periods_run);
    }
}

/// The ball rests again and again, more than `max_period` apart. Such a motion needs no further periods.
#[test]
fn a_superstable_cycle_longer_than_max_period_ends_the_cell() {
    let measured = both(3.8135593220338984, 10.085106382978724);
    assert!(measured.iter().all(|one| one.period.is_none() && one.status == Status::Slow), "{measured:?}");
    assert_eq!(measured[1].periods_run, 528);
    assert!(measured[0].periods_run < 400, "{}", measured[0].periods_run);
}
