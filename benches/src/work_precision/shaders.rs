//! Forms of the lane's shader for measurements, made from its text.

/// The lane as it is; records carry the last two events in fields that are not asked for.
pub(super) fn lane(source: String) -> String {
    with_event_times(&source)
}

/// The lane with classical Runge-Kutta in place of the exact propagator, in one loop as papers
/// write it: step, check, act.
pub(super) fn runge_kutta(source: String) -> String {
    replace(&runge_kutta_phased(source), "let verdict = scan_steps();", "let verdict = SCAN_CAREFUL;")
}

/// The same with the lane's two phases: scan until something may happen, then act.
pub(super) fn runge_kutta_phased(source: String) -> String {
    const BASELINE: &str = include_str!("../../shaders/runge_kutta.wgsl");
    let start = source.find("fn fly_to_stop_phase()").expect("the shader flies to marks");
    let (before, after) = source.split_at(start);
    let (_, after) = after.split_at(after.find("\n}\n").expect("a function ends") + 3);
    with_event_times(&format!("{before}{BASELINE}{after}"))
}

/// Notes step and fraction of each event. Steps go to the count of impacts, one more than
/// they are so that nothing is zero, the latest in the lower half; fractions to the exponent
/// and its error. What is overwritten is growth within a block and time spent meshing, neither of which is asked for.
fn with_event_times(source: &str) -> String {
    let silent = replace(source, "    tally.impacts += 1u;\n", "");
    let noted = replace(
        &silent,
        "fn count_event(side: u32) {\n",
        "fn count_event(side: u32) {\n    motion.mesh_part = motion.block_growth;\n    \
         motion.block_growth = motion.theta;\n    \
         tally.impacts = (tally.impacts << 16u) | (tally.step + 1u);\n",
    );
    replace(
        &noted,
        "        finding.valid |= VALID_IMPACTS;\n",
        "        finding.valid |= VALID_IMPACTS | VALID_LYAPUNOV;\n        \
         reading.growth = motion.block_growth;\n        reading.growth_error = motion.mesh_part;\n",
    )
}

fn replace(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "the shader has no {from}");
    text.replace(from, to)
}
