//! The approach to grazing: how an error in the gap changes the contact speed.
//!
//! Gear 1 swings in its steady state `x1 = A cos(omega t - phi)`, and gear 2 rests until they meet. If the amplitude exceeds
//! the wall's distance by `d b`, so that `A = b (1 + d)`, the first contact has the speed
//!
//! ```text
//! w = omega b s(d),   s(d) = sqrt(d (2 + d)),
//! ```
//!
//! so an error `eps` in the gap changes `s(d)` to `s(d + eps)`. The error of the speed grows like `eps / sqrt(2 d)` and
//! reaches `sqrt(2 eps)` at grazing itself. This is the conditioning of the problem; no method of the same precision does
//! better. If `d` is negative, there is no contact.

use rayon::prelude::*;

use super::cells::{EngineName, flow_of, paper};
use super::lanes::{Lanes, Start};
use super::{Checks, SEED, readout};
use rattlemap::gpu::LaneSettings;
use rattlemap::map::random::Random;
use rattlemap::record::Record;
use rattlemap::record::distance::farther;
use rattlemap_dynamics::model::{GearPair, Side, state};
use rattlemap_dynamics::motion::{GapEvent, Trajectory};

/// Allowed error of the gap in unit roundoffs: about a dozen steps precede the contact, and each rounds eight times.
const ROUNDINGS: f64 = 96.0;

/// Half decades of distances from grazing, and swings at each distance.
const HALF_DECADES: u32 = 28;
const SWINGS: usize = 32;

/// Returns a swing with amplitude `b (1 + distance)`.
pub(super) fn swing(distance: f64, random: &mut Random) -> Start {
    let mut number = |low: f64, high: f64| low + (high - low) * random.unit();
    let base = GearPair { r1: number(4.0, 8.0), ..paper(number(0.0, 1.0), number(2.0, 6.0)) };
    let GearPair { m1, r1, k1, omega, b, .. } = base;
    // F / A as a complex number. Its phase keeps the start away from both walls.
    let [re, im] = [k1 - m1 * omega * omega, r1 * omega];
    let [size, amplitude] = [re.hypot(im), b * (1.0 + distance)];
    let pair = GearPair { force: amplitude * size, ..base };
    (pair, state(&[amplitude * re / size, amplitude * omega * im / size]))
}

/// Returns the contact speed in units of `omega b`.
fn speed(distance: f64) -> f64 {
    let distance = distance.max(0.0);
    (distance * (2.0 + distance)).sqrt()
}

/// Returns the largest change of the contact speed for an error `eps` of the gap.
fn law(distance: f64, eps: f64) -> f64 {
    (speed(distance + eps) - speed(distance)).max(speed(distance) - speed(distance - eps))
}

/// Compares every distance on every engine: errors obey the square-root law, and beyond rounding no contact is missed and none
/// is reported for a swing that misses the wall.
pub(super) fn check(lanes: &mut Lanes) -> Checks {
    let mut checks = Checks::default();
    let mut random = Random::new(SEED);
    let distances = (0..=HALF_DECADES).map(|k| 0.03 * 10f64.powf(-0.5 * f64::from(k)));
    let distances: Vec<f64> = distances.flat_map(|d| [d, -d]).collect();
    // The same swings at every distance.
    let seeds: Vec<u64> = (0..SWINGS).map(|_| random.bits()).collect();
    let starts: Vec<Start> = distances
        .iter()
        .flat_map(|&distance| seeds.iter().map(move |&seed| swing(distance, &mut Random::new(seed))))
        .collect();
    let speeds: Vec<Option<f64>> = starts.par_iter().map(on_reference).collect();
    compare(EngineName::Reference, &distances, &starts, &speeds, &mut checks);
    lanes.rewrite(readout::first_contact);
    for precision in lanes.precisions() {
        let records = lanes.run(precision, &starts, &LaneSettings::only(1));
        let speeds = starts.iter().zip(&records).map(|(start, record)| contact_speed(start, record, None));
        compare(precision.into(), &distances, &starts, &speeds.collect::<Vec<_>>(), &mut checks);
    }
    lanes.rewrite(readout::whole);
    checks
}

/// Returns the speed of the reference's first contact, which must be with the right wall.
fn on_reference((pair, start): &Start) -> Option<f64> {
    let flow = flow_of(pair);
    let mut trajectory = Trajectory::new(&flow, pair.law(), *start);
    let mut events: Vec<GapEvent> = Vec::new();
    trajectory.advance_period(&mut events).ok()?;
    events.first().filter(|event| event.side == Side::Right).map(|event| event.before[1])
}

/// Returns the speed of a lane's first contact. The lane ends there.
pub(super) fn contact_speed(start: &Start, record: &Record, steps: Option<u32>) -> Option<f64> {
    readout::contact(start, record, steps).map(|contact| contact.w[0]).filter(|&w| w > 0.0)
}

fn compare(
    engine: EngineName,
    distances: &[f64],
    starts: &[Start],
    speeds: &[Option<f64>],
    checks: &mut Checks,
) {
    let eps = ROUNDINGS * engine.unit_roundoff();
    let swings = starts.chunks(SWINGS).zip(speeds.chunks(SWINGS));
    for (&distance, (starts, speeds)) in distances.iter().zip(swings) {
        let what = |what: &str| format!("{engine:?}, {what} at the distance {distance:e}");
        let found = speeds.iter().flatten().count();
        if distance.abs() > eps {
            let expected = if distance > 0.0 { SWINGS } else { 0 };
            checks.require(found == expected, what("contacts missed or invented"));
        }
        let contacts = starts.iter().zip(speeds).filter_map(|((pair, _), w)| Some((pair, (*w)?)));
        let errors = contacts.map(|(pair, w)| (w / (pair.omega * pair.b) - speed(distance)).abs());
        checks.add(errors.fold(0.0, farther), law(distance, eps), what("error of the speed"));
    }
}
