// Puts a lane at its start, before its first dispatch.

@compute @workgroup_size(WORKGROUP)
fn begin(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = settings.first_new + id.y * settings.row + id.x;
    if i >= settings.active_lanes {
        return;
    }
    lane = active_lane(i);
    cell = cells[lane];
    tally.status = cell.refused;
    tally.strobe_distance = FAR_FROM_STROBE;
    restart_phase();
    begin_motion();
    // The trail needs no initial value, because `strobe_count` says that it is empty.
    motions[lane].now = motion;
    motions[lane].measures = measures;
    clear_columns();
    motions[lane].vector = initial_tangent();
    tallies[lane].now = tally;
    tallies[lane].search = search;
    tallies[lane].is_measured = 0u;
    begin_pattern();
}
