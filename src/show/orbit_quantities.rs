//! Measured quantities of an orbit, as JSON and as text.

use serde_json::{Map, Value};

use crate::map::scene::Quantity;
use crate::show::names;
use crate::show::numbers::Number;
use crate::show::symbols::with_unit;
use rattlemap_dynamics::model::{Model, Side};
use rattlemap_dynamics::number::significant;
use rattlemap_dynamics::orbit::Orbit;

/// Returns all measured quantities by name, and the approach speeds at each wall. A quantity that the motion does not have is
/// null.
pub(crate) fn object(model: &dyn Model, orbit: &Orbit) -> Value {
    // Impacts and meshing have numbers of each gap if there are several.
    let quantities = [&[Quantity::Impacts, Quantity::Mesh][..], &Quantity::measured()].concat();
    let numbers = Number::of(model, &quantities);
    let mut object: Map<String, Value> =
        numbers.iter().map(|number| (number.name.clone(), number.of_orbit(orbit).into())).collect();
    for side in Side::BOTH {
        let [mean, largest] = approaches(orbit, side).map_or([None; 2], |speeds| speeds.map(Some));
        for (name, value) in [("impact_speed", mean), ("impact_speed_max", largest)] {
            object.insert(format!("{name}_{}", names::side(side)), value.into());
        }
    }
    object.into()
}

/// Returns the mean and the largest approach speed at a wall, if there are impacts.
fn approaches(orbit: &Orbit, side: Side) -> Option<[f64; 2]> {
    let speeds = orbit.quantities.as_ref()?.approaches[side.index()];
    (speeds.count > 0).then_some([speeds.mean, speeds.largest])
}

/// Lines of a summary: their quantities, each with the word before its numbers.
const LINES: [(&str, &[(Quantity, &str)]); 10] = [
    ("impact speed", &[(Quantity::ImpactSpeed, "mean"), (Quantity::ImpactSpeedMax, "largest")]),
    ("contact force", &[(Quantity::ContactForceMax, "largest"), (Quantity::ContactForceRms, "rms")]),
    ("cycle", &[(Quantity::CycleTime, "time")]),
    (
        "per unit time",
        &[
            (Quantity::ImpactRate, "impacts"),
            (Quantity::ImpactEnergy, "energy of impacts"),
            (Quantity::Dissipated, "energy of dampers"),
            (Quantity::ReleaseEnergy, "energy released by walls"),
        ],
    ),
    (
        "friction",
        &[(Quantity::FrictionEnergy, "energy per unit time"), (Quantity::StickFraction, "sticking fraction")],
    ),
    ("amplitude", &[(Quantity::Amplitude, "")]),
    ("root mean square", &[(Quantity::Rms, "")]),
    ("first harmonic", &[(Quantity::Harmonic, "")]),
    ("impacts of each gap", &[(Quantity::Impacts, "")]),
    ("meshing of each gap", &[(Quantity::Mesh, "")]),
];

/// Returns labels and values of the lines of a summary with the quantities that the motion has.
pub(crate) fn facts(model: &dyn Model, orbit: &Orbit) -> Vec<(String, String)> {
    let list = |&(label, quantities): &(&str, &[(Quantity, &str)])| {
        let of = |&(quantity, word): &(Quantity, &str)| -> Vec<String> {
            let text = |number: &Number| {
                let value = with_unit(&significant(number.of_orbit(orbit)?), number.unit.as_deref());
                Some([word, &number.subject, &value].join(" ").trim().to_owned())
            };
            Number::of(model, &[quantity]).iter().filter_map(text).collect()
        };
        let texts: Vec<String> = quantities.iter().flat_map(of).collect();
        (!texts.is_empty()).then(|| (label.to_owned(), texts.join(", ").replace("  ", " ")))
    };
    let mut facts: Vec<(String, String)> = LINES.iter().filter_map(list).collect();
    let of_side = |side: Side| {
        let unit = model.units().gap_velocity();
        let [mean, largest] =
            approaches(orbit, side)?.map(|speed| with_unit(&significant(speed), unit.as_deref()));
        Some(format!("; {} mean {mean}, largest {largest}", names::side(side)))
    };
    let sides: String = Side::BOTH.into_iter().filter_map(of_side).collect();
    if let (Some(first), false) = (facts.first_mut(), sides.is_empty()) {
        first.1.push_str(&sides);
    }
    facts
}
