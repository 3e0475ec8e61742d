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
use serde::Serialize;

use super::cells::{EngineName, flow_of, paper};
use super::lanes::{Lanes, Start};
use super::{Size, Verdict, readout};
use rattlemap::gpu::{GpuError, LaneSettings};
use rattlemap::map::random::Random;
use rattlemap::record::Record;
use rattlemap::record::distance::farther;
use rattlemap_dynamics::model::{GearPair, Side, state};
use rattlemap_dynamics::motion::{GapEvent, Trajectory};

/// Allowed error of the gap in unit roundoffs: about a dozen steps precede the contact, and each rounds eight times.
pub const ROUNDINGS: f64 = 96.0;

/// One distance on one engine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The engine.
    pub engine: EngineName,
    /// Distance of the amplitude behind the wall, in units of half the backlash; negative if the swing misses the wall.
    pub distance: f64,
    /// Number of cells.
    pub cells: usize,
    /// Number of cells with a contact.
    pub contacts: usize,
    /// Largest error of the contact speed, in units of `omega b`.
    pub speed_error: f64,
    /// Change of the contact speed if the gap has an error of [`ROUNDINGS`] unit roundoffs.
    pub law: f64,
}

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

/// Computes every distance on every engine.
///
/// # Errors
/// A [`GpuError`].
pub fn measure(size: Size, seed: u64, lanes: &mut Lanes) -> Result<Vec<Row>, GpuError> {
    let (per_decade, cells) = size.pick((1, 4), (2, 32), (4, 256));
    let mut random = Random::new(seed);
    let exponents = (0..=14 * per_decade).map(|k| -f64::from(k) / f64::from(per_decade));
    let distances: Vec<f64> =
        exponents.map(|exponent| 0.03 * 10f64.powf(exponent)).flat_map(|d| [d, -d]).collect();
    // The same swings at every distance.
    let seeds: Vec<u64> = (0..cells).map(|_| random.bits()).collect();
    let starts: Vec<Start> = distances
        .iter()
        .flat_map(|&distance| seeds.iter().map(move |&seed| swing(distance, &mut Random::new(seed))))
        .collect();
    let speeds: Vec<Option<f64>> = starts.par_iter().map(on_reference).collect();
    let mut rows = tabulate(EngineName::Reference, &distances, &starts, &speeds);
    lanes.rewrite(readout::first_contact);
    for precision in lanes.precisions() {
        let records = lanes.run(precision, &starts, &LaneSettings::only(1))?;
        let speeds = starts.iter().zip(&records).map(|(start, record)| contact_speed(start, record, None));
        let speeds: Vec<Option<f64>> = speeds.collect();
        rows.extend(tabulate(precision.into(), &distances, &starts, &speeds));
    }
    lanes.rewrite(readout::whole);
    Ok(rows)
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

fn tabulate(engine: EngineName, distances: &[f64], starts: &[Start], speeds: &[Option<f64>]) -> Vec<Row> {
    let cells = starts.len() / distances.len();
    let row = |(i, &distance): (usize, &f64)| {
        let of_distance = i * cells..(i + 1) * cells;
        let errors = of_distance.filter_map(|k| {
            let (pair, _) = &starts[k];
            speeds[k].map(|w| (w / (pair.omega * pair.b) - speed(distance)).abs())
        });
        let errors: Vec<f64> = errors.collect();
        Row {
            engine,
            distance,
            cells,
            contacts: errors.len(),
            speed_error: errors.iter().copied().fold(0.0, farther),
            law: law(distance, ROUNDINGS * engine.unit_roundoff()),
        }
    };
    distances.iter().enumerate().map(row).collect()
}

/// Requires that errors obey the square-root law, and that beyond rounding no contact is missed and none is reported for a
/// swing that misses the wall.
pub fn judge(rows: &[Row]) -> Verdict {
    let resolved = |row: &Row| row.distance.abs() > ROUNDINGS * row.engine.unit_roundoff();
    let missed: usize = rows
        .iter()
        .filter(|row| resolved(row) && row.distance > 0.0)
        .map(|row| row.cells - row.contacts)
        .sum();
    let invented: usize =
        rows.iter().filter(|row| resolved(row) && row.distance < 0.0).map(|row| row.contacts).sum();
    let with_contact = rows.iter().filter(|row| row.contacts > 0);
    let worst = with_contact.map(|row| row.speed_error / row.law).fold(0.0, farther);
    let cells: usize = rows.iter().map(|row| row.cells).sum();
    Verdict {
        holds: missed == 0 && invented == 0 && worst <= 1.0,
        sentence: format!(
            "{cells} swings up to a wall: {missed} contacts missed, {invented} invented beyond rounding; errors of \
             the contact speed at most {worst:.2} of the square-root law for {ROUNDINGS} roundings"
        ),
    }
}
