//! Lanes that end at their first contact: a form of the shader that shows what it did there.

use super::lanes::Start;
use rattlemap::gpu::Constants;
use rattlemap::record::Record;

/// Where the shader acts on a contact.
const CONTACT: &str = "        jump = contact(side, settling);\n";

/// In place of gap, rate, x and rate: both rates before and after. Before and after belong to
/// one computation: in two forms of a shader drivers round differently.
const SHOWN: &str = "        let before = motion.q;
        jump = contact(side, settling);
        motion.q = array<Real, 4>(before[1], motion.q[1], before[3], motion.q[3]);
        tally.stage = STAGE_DONE;
        return;
";

/// Ends at the first contact.
pub(super) fn first_contact(source: String) -> String {
    assert!(source.contains(CONTACT), "the shader acts on contacts elsewhere");
    source.replace(CONTACT, SHOWN)
}

/// The shader as it is.
pub(super) fn whole(source: String) -> String {
    source
}

/// A first contact: rates of the gap and velocities of gear 2.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact {
    /// Rate of the gap before and after.
    pub(super) w: [f64; 2],
    /// Velocity of gear 2 before and after.
    pub(super) v2: [f64; 2],
}

/// What a lane showed; none if it met no wall. `steps` as they were asked for.
pub(super) fn contact((pair, _): &Start, record: &Record, steps: Option<u32>) -> Option<Contact> {
    if record.periods_run > 0 {
        return None;
    }
    let constants = Constants::new(&pair.oscillator().ok()?, steps)?;
    // As if it were a state in lane units: (z, z', x2, x2').
    let [w, w_after, v, v_after] = constants.to_lane(record.strobe);
    let [w, v] = [w, v].map(|rate| rate / constants.flow.h);
    let [w_after, v_after] = [w_after, v_after].map(|rate| rate / constants.flow.h);
    Some(Contact { w: [w, w_after], v2: [v, v_after] })
}
