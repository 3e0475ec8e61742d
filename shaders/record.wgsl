// Turns a lane's last state into its results.

@compute @workgroup_size(WORKGROUP)
fn conclude(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = place_in_list(LIST_ENDED, id);
    if i == queue.counts[LIST_ENDED] {
        return;
    }
    load_lane(listed_lane(LIST_ENDED, i));
    load_strobe_state();
    if tallies[lane].is_measured == 1u {
        motion = motions[lane].ended;
        tally = tallies[lane].ended;
    }
    conclude_motion();
    var reading: Reading;
    var finding: Finding;
    finding.slot = lane;
    finding.status = last_status();
    finding.periods_run = tally.period;
    if cell.refused == 0u {
        reading.strobe = strobe_state();
        finding.valid = VALID_STROBE;
    }
    if tally.status == STATUS_OK {
        finding.valid |= VALID_IMPACTS;
        finding.impacts = tally.impacts;
        finding.counted = max(tally.period - search.counting_start, 1u);
        if MESH {
            finding.valid |= VALID_MESH;
            reading.mesh_fraction = mesh_fraction(finding.counted);
        }
        if settings.max_period > 0u {
            finding.valid |= VALID_PERIOD;
            finding.period = search.cycle;
        }
        if is_near_strobe() {
            finding.valid |= VALID_NEAR_STROBE;
        }
        if is_handed_over() {
            finding.valid |= VALID_OPEN;
        }
        // Motion without contact, which is not read as a cycle, has forgotten the tie.
        if is_tied() && (search.cycle == 0u || search.has_read == 1u) {
            finding.valid |= VALID_TIED;
        }
        if search.cycle > 0u {
            read_cycle(&reading, &finding);
        } else if EXPONENT && search.blocks > 1u {
            finding.valid |= VALID_LYAPUNOV;
            let growth = mean_growth();
            reading.growth = growth.x;
            reading.growth_error = growth.y;
            if is_quasi_periodic() {
                finding.valid |= VALID_QUASI_PERIODIC;
            }
        }
    }
    readings[i] = reading;
    findings[i] = finding;
}

fn last_status() -> u32 {
    if tally.status != STATUS_OK || tally.stage != STAGE_DONE {
        return tally.status;
    }
    if search.cycle == 0u {
        if is_quasi_periodic() {
            return STATUS_OK;
        }
        let is_open = settings.max_period > 0u && EXPONENT && search.blocks > 1u;
        let open = select(STATUS_SLOW, STATUS_NEUTRAL, search.is_neutral == 1u);
        return select(STATUS_OK, open, is_open && (escapes(CHAOS_ERRORS) || !outgrows(CHAOS_ERRORS)));
    }
    if search.has_read == 0u {
        return select(STATUS_OK, STATUS_NEUTRAL, measures.cycle_growth >= 0.0);
    }
    if tally.grazes > 0u {
        return STATUS_NEAR_GRAZING;
    }
    if strobe_distance() < ON_STROBE {
        return STATUS_STROBE_ON_EVENT;
    }
    if search.is_neutral == 1u {
        return STATUS_NEUTRAL;
    }
    if is_slow() {
        return STATUS_SLOW;
    }
    return select(STATUS_OK, STATUS_BELOW_RESOLUTION, hides_period());
}

fn strobe_distance() -> Real {
    return Real(bitcast<f32>(tally.strobe_distance));
}

// Whether an event near phase 0 makes the comparison of strobe states uncertain although the status does not say so. Such an event may lie
// before and after the strobe in turn. A cycle then seems twice as long, or is not found.
fn is_near_strobe() -> bool {
    if search.cycle > 1u {
        return strobe_distance() < NEAR_STROBE;
    }
    let status = last_status();
    let is_undecided = search.cycle == 0u && (status == STATUS_SLOW || status == STATUS_NEUTRAL);
    return is_undecided && strobe_distance() < ON_STROBE;
}

fn read_cycle(reading: ptr<function, Reading>, finding: ptr<function, Finding>) {
    // Contact-free motion is symmetric, and is not read as a cycle. If the approach is slow or rounding is amplified, only a clearly broken
    // symmetry is known. On a symmetric cycle every impact has a mirror image.
    if SYMMETRY && cell.mirror == 1u {
        let has_conjugate = tally.impacts % 2u == 0u;
        let is_symmetric = search.has_read == 0u || (is_surely_symmetric() && has_conjugate);
        if is_symmetric || !has_conjugate || is_surely_unsymmetric() {
            (*finding).valid |= VALID_SYMMETRIC;
            (*finding).symmetric = select(0u, 1u, is_symmetric);
        }
    }
    if EXPONENT {
        (*finding).valid |= VALID_LYAPUNOV;
        (*reading).growth = LN_2 * measures.cycle_growth / Real(search.cycle);
    }
    if PATTERN {
        read_pattern(finding);
    }
    if !WORD {
        return;
    }
    (*finding).valid |= VALID_WORD;
    for (var n = 0u; n < 7u; n++) {
        spell(finding, SPELLED_WORD + n, select(0u, tallies[lane].word[n], n * SYMBOLS_PER_NUMBER < tally.word_length));
    }
    spell(finding, SPELLED_WORD_LENGTH, tally.word_length);
    if tally.word_length > WORD_SYMBOLS {
        close_hash();
        spell(finding, SPELLED_WORD_HASH, tally.hash_low);
        spell(finding, SPELLED_WORD_HASH + 1u, tally.hash_high);
    }
}

// Stores a number of the word or the pattern. The place is an argument, because variants without words have a shorter array, which a
// constant place would exceed.
fn spell(finding: ptr<function, Finding>, place: u32, number: u32) {
    (*finding).spelling[place] = number;
}

fn read_pattern(finding: ptr<function, Finding>) {
    let whole = tallies[lane].pattern_length;
    var length = whole;
    var recent = tallies[lane].pattern_recent;
    var hash = vec2<u32>(tallies[lane].pattern_hash[0], tallies[lane].pattern_hash[1]);
    let first = tallies[lane].pattern[0];
    // The cycle's last run and its first one have the same symbol, so they are one run.
    if length > 1u && (recent & LATEST_SYMBOL) == (first & LATEST_SYMBOL) {
        if length > HASH_WINDOW - 1u {
            hash -= hash_window(recent);
        }
        recent = recent >> SYMBOL_BITS;
        length -= 1u;
    }
    (*finding).valid |= VALID_PATTERN;
    for (var n = 0u; n < 7u; n++) {
        spell(finding, SPELLED_PATTERN + n, select(0u, tallies[lane].pattern[n], n * SYMBOLS_PER_NUMBER < whole));
    }
    spell(finding, SPELLED_PATTERN_LENGTH, length);
    if length > WORD_SYMBOLS {
        for (var n = 0u; n < HASH_WINDOW - 1u; n++) {
            recent = append_symbol(recent, (first >> (SYMBOL_BITS * n)) & LATEST_SYMBOL);
            hash += hash_window(recent);
        }
        spell(finding, SPELLED_PATTERN_HASH, hash.x);
        spell(finding, SPELLED_PATTERN_HASH + 1u, hash.y);
    }
}

// Adds the hash windows that span the end of the word. All other windows have been added before.
fn close_hash() {
    for (var n = 0u; n < HASH_WINDOW - 1u; n++) {
        push_symbol((tallies[lane].word[0] >> (SYMBOL_BITS * n)) & LATEST_SYMBOL);
        add_hash_window();
    }
}

// Copies what was measured to the place of each result.
@compute @workgroup_size(WORKGROUP)
fn gather(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = place_in_list(LIST_ENDED, id);
    if i == queue.counts[LIST_ENDED] {
        return;
    }
    let slot = listed_lane(LIST_ENDED, i);
    var result: Measured;
    if tallies[slot].is_measured == 1u && tallies[slot].now.status == STATUS_OK {
        result.totals = motions[slot].totals;
        result.highs = motions[slot].highs;
        result.lows = motions[slot].lows;
    }
    measured[i].totals = result.totals;
    measured[i].highs = result.highs;
    measured[i].lows = result.lows;
    measured[i].has_read = Real(tallies[slot].search.has_read);
    for (var k = 0u; k < MATRIX; k++) {
        measured[i].tangents[k] = motions[slot].tangents[k];
    }
}
