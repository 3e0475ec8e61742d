//! A variant of the shader whose lanes end at their first contact and return the velocities before and after.

use super::lanes::Start;
use rattlemap::gpu::Constants;
use rattlemap::record::Record;

/// The statement of the shader that applies the contact law.
const CONTACT: &str = "        jump = contact(side, settling);\n";

/// Returns both rates before and after in place of the state. One run returns both, because drivers round differently in
/// two variants of a shader.
const REPLACEMENT: &str = "        let before = motion.q;
        jump = contact(side, settling);
        motion.q = array<Real, 4>(before[1], motion.q[1], before[3], motion.q[3]);
        tally.stage = STAGE_DONE;
        iterations = settings.iterations;
        return;
";

/// Returns the variant of the shader.
pub(super) fn first_contact(source: String) -> String {
    assert!(source.contains(CONTACT), "the shader has no such statement: {CONTACT}");
    source.replace(CONTACT, REPLACEMENT)
}

/// Returns the shader unchanged.
pub(super) fn whole(source: String) -> String {
    source
}

/// Rates at the first contact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact {
    /// Rate of the gap before and after.
    pub(super) w: [f64; 2],
    /// Velocity of gear 2 before and after.
    pub(super) v2: [f64; 2],
}

/// Returns the contact in a lane's record; `None` if the lane reached no wall. `steps`: the steps per period that were
/// requested.
pub(super) fn contact((pair, _): &Start, record: &Record, steps: Option<u32>) -> Option<Contact> {
    if record.periods_run > 0 {
        return None;
    }
    let constants = Constants::new(&pair.oscillator().ok()?, steps)?;
    let constants = constants.pair()?;
    // The shader wrote the rates where a state in lane units has (z, z', x2, x2').
    let [w, w_after, v, v_after] = constants.to_lane(record.strobe());
    let [w, v] = [w, v].map(|rate| rate / constants.flow.h);
    let [w_after, v_after] = [w_after, v_after].map(|rate| rate / constants.flow.h);
    Some(Contact { w: [w, w_after], v2: [v, v_after] })
}
