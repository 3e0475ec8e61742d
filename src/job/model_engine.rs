//! Says which engine computes an oscillator, why, and what its motion costs.

use rattlemap_dynamics::model::Oscillator;

/// Names the engine of an oscillator in one line. Times are those of a processor core, from `benches/README.md`.
pub fn described(oscillator: &Oscillator) -> String {
    match oscillator.needs_machine() {
        None => "pair, for up to two coordinates and one gap: about 0.3 us for a forcing period and 0.15 us for an event"
            .to_owned(),
        Some(reason) => {
            format!("machine, because of {reason}: 0.6 to 1.7 us for an event, by coordinates")
        }
    }
}
