// The queue of lanes that are still running, compacted between dispatches: ended lanes cost
// nothing, and those that are left keep their order, for neighbours behave alike.
//
// Four passes: blocks of the queue are counted, the counts summed up, what is left of every block
// moved to its place in the queue's other half, and that half made the queue.

const BLOCK: u32 = 256u;

var<workgroup> block_counts: array<u32, BLOCK>;

fn queued(i: u32) -> u32 {
    return queue.lanes[queue.half * settings.lanes + i];
}

// Whether place `i` of the queue holds a lane that this variant has work for.
fn is_left(i: u32) -> bool {
    if i >= queue.count {
        return false;
    }
    tally = tallies[queued(i)].now;
    return running();
}

// Inclusive sums of a block's numbers.
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

// Each workgroup takes every `groups.x`-th block: there may be more of them than workgroups.
@compute @workgroup_size(BLOCK)
fn count_left(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) k: u32) {
    let blocks = (settings.lanes + BLOCK - 1u) / BLOCK;
    for (var b = group.x; b < blocks; b += groups.x) {
        sum_block(k, select(0u, 1u, is_left(b * BLOCK + k)));
        if k == BLOCK - 1u {
            starts_of_blocks[b] = block_counts[k];
        }
        workgroupBarrier();
    }
}

// One workgroup: where each block's lanes go, and how many there are.
@compute @workgroup_size(BLOCK)
fn sum_left(@builtin(local_invocation_index) k: u32) {
    let blocks = (settings.lanes + BLOCK - 1u) / BLOCK;
    let share = (blocks + BLOCK - 1u) / BLOCK;
    let begin_at = min(k * share, blocks);
    let end_at = min(begin_at + share, blocks);
    var own = 0u;
    for (var b = begin_at; b < end_at; b++) {
        own += starts_of_blocks[b];
    }
    sum_block(k, own);
    var start = block_counts[k] - own;
    for (var b = begin_at; b < end_at; b++) {
        let count = starts_of_blocks[b];
        starts_of_blocks[b] = start;
        start += count;
    }
    if k == BLOCK - 1u {
        queue.left = block_counts[k];
    }
}

@compute @workgroup_size(BLOCK)
fn move_left(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) k: u32) {
    let blocks = (settings.lanes + BLOCK - 1u) / BLOCK;
    for (var b = group.x; b < blocks; b += groups.x) {
        let i = b * BLOCK + k;
        let stays = is_left(i);
        let own = select(0u, 1u, stays);
        sum_block(k, own);
        if stays {
            let place = starts_of_blocks[b] + block_counts[k] - own;
            queue.lanes[(1u - queue.half) * settings.lanes + place] = queued(i);
        }
        workgroupBarrier();
    }
}

// The other half is the queue from here on.
@compute @workgroup_size(1)
fn turn_over() {
    queue.half = 1u - queue.half;
    queue.count = queue.left;
}
