// What a lane checks, counts and reads at phase 0.

// Completes a forcing period at phase 0.
fn begin_period() {
    tally.step = 0u;
    motion.theta = 0.0;
    restart_phase();
    tally.period += 1u;
    tally.passes_in_period = 0u;
    search.all_events += tally.events_in_period;
    if 2u * tally.period > settings.exponent_from {
        search.most_events = max(search.most_events, tally.events_in_period);
    }
    tally.events_in_period = 0u;
    if search.all_events > settings.most_events {
        tally.status = STATUS_CAP_EVENTS;
        return;
    }
    let itinerary = tally.itinerary;
    tally.itinerary = 0u;
    if EXPONENT && search.newton_steps == 0u {
        store_strobe(itinerary);
    }
    if tally.stage == STAGE_READING {
        tally.periods_to_read -= 1u;
        widen_scales(strobe_state());
        let read = tally.candidate - tally.periods_to_read;
        if EXPONENT {
            check_columns();
            compare_itineraries(itinerary, read);
        }
        let distance = octaves(distance_between(strobe_state(), measures.anchor));
        if tally.periods_to_read == 0u {
            search.return_distance = distance;
            tally.stage = STAGE_READ;
            return;
        }
        search.nearest = max(search.nearest, distance);
        if tally.candidate % read == 0u && distance > search.divisor_distance {
            search.divisor = read;
            search.divisor_distance = distance;
        }
        return;
    }
    accumulate_growth();
    if tally.period == settings.transient_periods {
        begin_counting();
    }
    if tally.period == early_periods() {
        measures.early_scale = measures.position_scale;
        measures.early_rate_scale = measures.rate_scale;
    }
    let decided = settings.max_period > 0u && recurs();
    // The budget includes the periods in which the cycle is read.
    let read_by = tally.period + tally.candidate;
    let is_last = read_by == settings.periods || read_by == last_period();
    // Strobes may contract by chance while tangents grow. Such motion has not settled.
    let is_due = is_last && search.streak >= STREAK && (search.is_settled == 1u || !grows(DOUBT));
    let early = settings.early_stop == 1u;
    if read_by <= last_period() && (is_due || (decided && (early || search.confirms_chaos == 1u))) {
        begin_reading();
    } else if early && is_non_impacting() {
        end_non_impacting();
    } else if tally.period >= settings.longest || (early && is_chaos()) || (early && tally.period >= settings.periods && is_quasi_periodic()) {
        tally.stage = STAGE_DONE;
    } else {
        confirm_chaos();
        if tally.period >= last_period() {
            tally.stage = STAGE_DONE;
        }
    }
}

// Gives a chaotic lane the periods that confirm chaos.
fn confirm_chaos() {
    if settings.longest > settings.decided_by && tally.period >= settings.decided_by && search.confirms_chaos == 0u {
        search.confirms_chaos = select(0u, 1u, is_chaotic(CHAOS_ERRORS));
    }
}

// Whether the reference continues this lane, which has ended: its class is undecided at the end of the budget.
fn is_handed_over() -> bool {
    return settings.hands_over == 1u && search.cycle == 0u && !is_chaos() && !is_quasi_periodic();
}

// Returns the period after which an undecided lane ends.
fn last_period() -> u32 {
    return select(settings.decided_by, settings.longest, search.confirms_chaos == 1u);
}

// Ends contact-free motion. It has period 1, and no cycle is read.
fn end_non_impacting() {
    begin_counting();
    search.cycle = 1u;
    measures.cycle_growth = contact_free_growth();
    tally.stage = STAGE_DONE;
}

// Resets the averages and counts.
fn begin_counting() {
    tally.impacts = 0u;
    tally.events = 0u;
    tally.grazes = 0u;
    tally.strobe_distance = FAR_FROM_STROBE;
    tally.mesh_right = 0u;
    tally.mesh_left = 0u;
    tally.mesh_whole = 0u;
    motion.mesh_part = 0.0;
    tally.word_length = 0u;
    tally.hash_low = 0u;
    tally.hash_high = 0u;
    tally.recent = 0u;
    if PATTERN {
        begin_pattern();
    }
    search.counting_start = tally.period;
}

// Starts to read one cycle of the period that was found.
fn begin_reading() {
    begin_counting();
    tally.stage = STAGE_READING;
    tally.periods_to_read = tally.candidate;
    search.has_read = 1u;
    // A cycle of even period cannot be its own mirror image, so it is not compared.
    search.mirror = 0u;
    search.divisor = 0u;
    search.divisor_distance = 0u;
    search.nearest = 0u;
    search.matching_cycles = TRAIL;
    measures.anchor = strobe_state();
    narrow_scales(measures.anchor);
    if EXPONENT {
        begin_columns();
        begin_cycle();
        motions[lane].stretch = array<Real, 3>(1.0, 1.0, 1.0);
        tallies[lane].column_scalings = 0u;
        tallies[lane].is_superstable = 0u;
        tallies[lane].has_overflowed = 0u;
    }
}

// Adds a part of a step, in free steps, to the time spent meshing.
fn count_meshing(part: Real) {
    motion.mesh_part += part;
    let whole = floor(motion.mesh_part);
    tally.mesh_whole += u32(whole);
    motion.mesh_part -= whole;
}
