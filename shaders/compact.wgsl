// Compaction lists the lanes that a variant has work for, or those that have ended. Lanes that are not listed cost nothing. The list keeps
// the order of the active list, in which neighbouring lanes behave alike.
//
// Three passes: count the selected lanes of each block of the active list, sum the counts, and copy each block's
// lanes to their place.

var<workgroup> block_counts: array<u32, BLOCK>;

// Returns the lane at a place of the active list.
fn active_lane(i: u32) -> u32 {
    return queue.lanes[i];
}

// Returns the lane at a place of the list of selected lanes.
fn selected_lane(i: u32) -> u32 {
    return queue.lanes[settings.slots + i];
}

// Whether place `i` of the active list holds a lane that is selected.
fn is_selected(i: u32) -> bool {
    if i >= settings.active_lanes {
        return false;
    }
    tally = tallies[active_lane(i)].now;
    if settings.ended == 1u {
        return is_over();
    }
    return has_work();
}

// Computes the inclusive sums of a block's numbers.
fn sum_block(k: u32, own: u32) {
    block_counts[k] = own;
    workgroupBarrier();
    for (var reach = 1u; reach < BLOCK; reach *= 2u) {
        var before = 0u;
        if k >= reach {
            before = block_counts[k - reach];
        }
        workgroupBarrier();
        block_counts[k] += before;
        workgroupBarrier();
    }
}

// There may be more blocks than workgroups, so each workgroup takes every `groups.x`-th block.
@compute @workgroup_size(BLOCK)
fn count_selected(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) k: u32) {
    let blocks = (settings.active_lanes + BLOCK - 1u) / BLOCK;
    for (var b = group.x; b < blocks; b += groups.x) {
        sum_block(k, select(0u, 1u, is_selected(b * BLOCK + k)));
        if k == BLOCK - 1u {
            block_starts[b] = block_counts[k];
        }
        workgroupBarrier();
    }
}

// One workgroup computes the place of each block's lanes, the total, and the workgroups of a dispatch over these lanes.
@compute @workgroup_size(BLOCK)
fn sum_selected(@builtin(local_invocation_index) k: u32) {
    let blocks = (settings.active_lanes + BLOCK - 1u) / BLOCK;
    let share = (blocks + BLOCK - 1u) / BLOCK;
    let begin_at = min(k * share, blocks);
    let end_at = min(begin_at + share, blocks);
    var own = 0u;
    for (var b = begin_at; b < end_at; b++) {
        own += block_starts[b];
    }
    sum_block(k, own);
    var start = block_counts[k] - own;
    for (var b = begin_at; b < end_at; b++) {
        let count = block_starts[b];
        block_starts[b] = start;
        start += count;
    }
    if k == BLOCK - 1u {
        queue.count = block_counts[k];
        queue.beat += 1u;
        let groups = (queue.count + WORKGROUP - 1u) / WORKGROUP;
        let in_row = settings.row / WORKGROUP;
        workgroups = array<u32, 3>(min(groups, in_row), (groups + in_row - 1u) / in_row, 1u);
    }
}

@compute @workgroup_size(BLOCK)
fn move_selected(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) k: u32) {
    let blocks = (settings.active_lanes + BLOCK - 1u) / BLOCK;
    for (var b = group.x; b < blocks; b += groups.x) {
        let i = b * BLOCK + k;
        let stays = is_selected(i);
        let own = select(0u, 1u, stays);
        sum_block(k, own);
        if stays {
            let place = block_starts[b] + block_counts[k] - own;
            queue.lanes[settings.slots + place] = active_lane(i);
        }
        workgroupBarrier();
    }
}
