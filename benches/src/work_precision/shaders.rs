//! Variants of the lane's shader for measurements, derived from its text.

/// Returns the shader with classical Runge-Kutta in place of the exact propagator, in one loop as in papers: step, check for
/// events, apply the contact law.
pub(super) fn runge_kutta(source: String) -> String {
    replace(&runge_kutta_phased(source), "let verdict = scan_steps();", "let verdict = SCAN_CAREFUL;")
}

/// Returns the shader with classical Runge-Kutta in the two phases of lanes: steps until an event may happen, then the event.
pub(super) fn runge_kutta_phased(source: String) -> String {
    const BASELINE: &str = include_str!("../../shaders/runge_kutta.wgsl");
    let start = source.find("fn fly_to_stop_phase()").expect("the shader has this function");
    let (before, after) = source.split_at(start);
    let (_, after) = after.split_at(after.find("\n}\n").expect("a function ends") + 3);
    with_event_times(format!("{before}{BASELINE}{after}"))
}

/// Returns the lane's shader with the times of events in the records: the step and the fraction of a step of the last two events. The steps plus one replace the count of impacts, the
/// latest in its lower half; zero means no event. The fractions replace the exponent and its error. This overwrites growth
/// within a block and the time of meshing, which are not requested.
pub(super) fn with_event_times(source: String) -> String {
    let without_impacts = replace(&source, "    tally.impacts += 1u;\n", "");
    let with_events = replace(
        &without_impacts,
        "fn count_event(side: u32) {\n",
        "fn count_event(side: u32) {\n    motion.mesh_part = motion.block_growth;\n    \
         motion.block_growth = motion.theta;\n    \
         tally.impacts = (tally.impacts << 16u) | (tally.step + 1u);\n",
    );
    replace(
        &with_events,
        "        finding.valid |= VALID_IMPACTS;\n",
        "        finding.valid |= VALID_IMPACTS | VALID_LYAPUNOV;\n        \
         reading.growth = motion.block_growth;\n        reading.growth_error = motion.mesh_part;\n",
    )
}

fn replace(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "the shader has no {from}");
    text.replace(from, to)
}
