// Lists of lanes, made anew every few periods and before cycles are judged. Each kernel has a list of the lanes that it continues, and a
// further list has the lanes that have ended. LIST_OBSERVE overlaps the three lists in front of it: it has all their lanes. Lanes of a list
// are sorted by their key, so that neighbours do similar work. Lanes with equal keys keep the order of the active list, in which neighbours
// have similar parameters.
//
// This is a counting sort in three passes: count the lanes of each block of the active list by key, sum the counts, and write each lane to
// its place.

// Number of keys of a list.
const KEYS_OF_LIST: u32 = KEYS / LISTS;

// Words of a set of lanes of a block, one bit for each lane.
const WORDS: u32 = BLOCK / 32u;

// The lanes of a block that have each key.
var<workgroup> members: array<atomic<u32>, KEYS * WORDS>;
var<workgroup> sums: array<u32, BLOCK>;

// Returns the lane at a place of the active list.
fn active_lane(i: u32) -> u32 {
    return queue.lanes[i];
}

// Returns the lane at a place of a list.
fn listed_lane(list: u32, i: u32) -> u32 {
    return queue.lanes[settings.slots + queue.begins[list] + i];
}

// Lanes in a warp of a card.
const WARP: u32 = 32u;

// Returns how many invocations each lane of a list gets. A few lanes get a warp each, because lanes of a warp that do different work take
// turns.
fn spread(list: u32) -> u32 {
    return select(1u, WARP, queue.counts[list] <= settings.few_lanes && list != LIST_ENDED);
}

// Returns the place of an invocation's lane in a list; the length of the list if the invocation has no lane.
fn place_in_list(list: u32, id: vec3<u32>) -> u32 {
    let i = id.y * settings.row + id.x;
    let count = queue.counts[list];
    return select(count, min(i / spread(list), count), i % spread(list) == 0u);
}

// Returns the list to which the lane belongs. The kernel without the exponent's tangent vector moves a lane until it needs the vector, or
// reads a cycle with the columns of its monodromy matrix. The choice must not depend on where a dispatch ends, because kernels round
// differently.
fn list_of_lane() -> u32 {
    if tally.status != STATUS_OK || tally.stage == STAGE_DONE {
        return LIST_ENDED;
    }
    if tally.stage == STAGE_READ {
        return LIST_JUDGE;
    }
    if tally.stage == STAGE_MEASURING {
        return LIST_MEASURE;
    }
    if EXPONENT && tally.stage == STAGE_READING {
        return LIST_READING;
    }
    let grows = tally.carries_growth == 1u || tally.period >= settings.growth_from;
    return select(LIST_PLAIN, LIST_GROWTH, EXPONENT && grows);
}

// Returns the key of a lane of the active list: its list, and the size of its number of events per period. Lanes without early stops keep
// their order: in a map in which no lane ends, neighbours are more alike (benches/warps).
fn key_of(i: u32) -> u32 {
    let slot = active_lane(i);
    tally.status = tallies[slot].now.status;
    tally.stage = tallies[slot].now.stage;
    tally.period = tallies[slot].now.period;
    tally.carries_growth = tallies[slot].now.carries_growth;
    let list = list_of_lane();
    var key = list * KEYS_OF_LIST;
    if settings.early_stop == 1u && list < LIST_MEASURE {
        let events = tallies[slot].search.all_events / max(tally.period, 1u);
        key += min(firstLeadingBit(max(events, 2u)) - 1u, KEYS_OF_LIST - 1u);
    }
    return key;
}

// Sorts the lanes of a block into `members`. Returns the key of lane `k` of the block; KEYS if there is no such lane.
fn sort_block(b: u32, k: u32) -> u32 {
    for (var word = k; word < KEYS * WORDS; word += BLOCK) {
        atomicStore(&members[word], 0u);
    }
    workgroupBarrier();
    let i = b * BLOCK + k;
    var key = KEYS;
    if i < settings.active_lanes {
        key = key_of(i);
        atomicOr(&members[key * WORDS + k / 32u], 1u << (k % 32u));
    }
    workgroupBarrier();
    return key;
}

// Returns how many of the first `k` lanes of the block have a key.
fn members_before(key: u32, k: u32) -> u32 {
    var count = 0u;
    for (var word = 0u; word < WORDS; word++) {
        let first = 32u * word;
        let lanes = atomicLoad(&members[key * WORDS + word]);
        let mask = select(0xffffffffu, (1u << (k % 32u)) - 1u, k < first + 32u);
        count += select(0u, countOneBits(lanes & mask), k > first);
    }
    return count;
}

fn blocks_of_list() -> u32 {
    return (settings.active_lanes + BLOCK - 1u) / BLOCK;
}

// There may be more blocks than workgroups, so each workgroup takes every `groups.x`-th block.
@compute @workgroup_size(BLOCK)
fn count_lanes(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) k: u32) {
    let blocks = blocks_of_list();
    for (var b = group.x; b < blocks; b += groups.x) {
        let key = sort_block(b, k);
        if k < KEYS {
            block_starts[k * blocks + b] = members_before(k, BLOCK);
        }
        workgroupBarrier();
    }
}

// One workgroup replaces the count of each key and block by the place of its first lane, and computes where each list begins, its length
// and the workgroups of a dispatch over it.
@compute @workgroup_size(BLOCK)
fn sum_lanes(@builtin(local_invocation_index) k: u32) {
    let blocks = blocks_of_list();
    let share = (KEYS * blocks + BLOCK - 1u) / BLOCK;
    let begin_at = min(k * share, KEYS * blocks);
    let end_at = min(begin_at + share, KEYS * blocks);
    var own = 0u;
    for (var b = begin_at; b < end_at; b++) {
        own += block_starts[b];
    }
    sums[k] = own;
    workgroupBarrier();
    for (var reach = 1u; reach < BLOCK; reach *= 2u) {
        var before = 0u;
        if k >= reach {
            before = sums[k - reach];
        }
        workgroupBarrier();
        sums[k] += before;
        workgroupBarrier();
    }
    var start = sums[k] - own;
    for (var b = begin_at; b < end_at; b++) {
        let count = block_starts[b];
        block_starts[b] = start;
        start += count;
    }
    storageBarrier();
    if k < LISTS {
        // No key belongs to LIST_OBSERVE.
        let begins = select(block_starts[k * KEYS_OF_LIST * blocks], 0u, k == LIST_OBSERVE);
        var ends = settings.active_lanes;
        if k + 1u < LISTS {
            ends = block_starts[(k + 1u) * KEYS_OF_LIST * blocks];
        }
        queue.begins[k] = begins;
        queue.counts[k] = ends - begins;
        let groups = ((ends - begins) * spread(k) + WORKGROUP - 1u) / WORKGROUP;
        let in_row = settings.row / WORKGROUP;
        workgroups[k] = array<u32, 3>(min(groups, in_row), (groups + in_row - 1u) / in_row, 1u);
    }
    if k == 0u {
        queue.beat += 1u;
    }
}

@compute @workgroup_size(BLOCK)
fn place_lanes(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) k: u32) {
    let blocks = blocks_of_list();
    for (var b = group.x; b < blocks; b += groups.x) {
        let key = sort_block(b, k);
        if key < KEYS {
            let place = block_starts[key * blocks + b] + members_before(key, k);
            queue.lanes[settings.slots + place] = active_lane(b * BLOCK + k);
        }
        workgroupBarrier();
    }
}
