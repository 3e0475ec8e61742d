// The motion of a machine from event to event, by the rules of the reference (dynamics/src/machine/motion.rs).

// Order of the root of the distance when a gap leaves a rigid wall. Its acceleration is zero, and the next derivative is not.
const RELEASE_ORDER: u32 = 3u;
// Stands for an order that will be computed at the end of the event.
const UNKNOWN_ORDER: u32 = 7u;
// Largest number of decisions on gaps and elements at rest after one event.
const MOST_DECISIONS: u32 = 16u;

// Kinds of events.
const ENDS_NOTHING: u32 = 0u;
const ENDS_AT_WALL: u32 = 1u; // the gap reaches the next wall in a direction
const ENDS_ONSET: u32 = 2u; // the gap of a contact onset comes to its wall
const ENDS_PRESSING: u32 = 3u; // the gap of a contact onset is not pressed to its wall any more
const LEAVES: u32 = 4u; // the gap comes back from behind its wall
const ENDS_FORCE: u32 = 5u; // a wall that only pushes would begin to pull
const BEGINS_FORCE: u32 = 6u; // a wall that only pushes begins to push
const ENDS_PUSH: u32 = 7u; // a rigid wall would have to pull
const ENDS_SLIDING: u32 = 8u; // a sliding rate vanishes
const BEGINS_SLIDING: u32 = 9u; // a holding force reaches its limit for sliding in a direction
const BEGINS_STAGE: u32 = 10u; // the stage of the forces changes
const ENDS_SERIES: u32 = 11u; // the limit of a series of impacts

// A possible event. `index`: its gap or its element with friction. `side`: a side, or the mode of friction that follows. `line`: a function
// that is positive before the event and zero at the event. `order`: the order of this function's root at the start of the step; 0 without a
// root.
struct Watch {
    kind: u32,
    index: u32,
    side: u32,
    line: Line,
    order: u32,
}

const WATCHES_PER_GAP: u32 = 3u;
const WATCHES: u32 = WATCHES_PER_GAP * GAPS + 2u * ELEMENTS;
const NO_WALL: u32 = 0xffffffffu;

fn rate_of_gap(gap: u32) -> Real {
    return motion.q[2u * gap + 1u];
}

fn is_kept(domain: u32, gap: u32) -> bool {
    return is_still(domain, gap) && rate_of_gap(gap) == 0.0;
}

// Side and number of the next wall in a direction from the gap. The number is NO_WALL if no wall lies there.
fn wall_ahead(gap: u32, direction: u32) -> vec2<u32> {
    let mode = gap_modes[gap];
    if mode >= ONSET {
        return vec2<u32>(direction, NO_WALL);
    }
    let passed = select(BEYOND - mode, mode - BEYOND, mode >= BEYOND);
    if passed == 0u || (mode > BEYOND) == (direction == SIDE_RIGHT) {
        return vec2<u32>(direction, select(NO_WALL, passed, passed < wall_count(gap, direction)));
    }
    return vec2<u32>(1u - direction, passed - 1u);
}

// Side and number of the wall that a gap in a contact onset reaches if it moves away from the wall of its contact.
fn wall_behind(gap: u32, side: u32) -> vec2<u32> {
    let count = wall_count(gap, side);
    if count > 1u {
        return vec2<u32>(side, count - 2u);
    }
    return vec2<u32>(1u - side, select(NO_WALL, 0u, wall_count(gap, 1u - side) > 0u));
}

// Order of the root of the gap's distance from the wall in a direction; 0 if the gap is not on that wall.
fn order_from_wall(gap: u32, direction: u32) -> u32 {
    return select(0u, wall_order[gap], wall_side[gap] == direction);
}

// Side on which the gap is behind a last wall that only pushes; SIDE_NONE otherwise.
fn pushing_side(gap: u32) -> u32 {
    let mode = gap_modes[gap];
    if mode >= ONSET || mode == BEYOND {
        return SIDE_NONE;
    }
    let side = contact_of(mode);
    let is_last = mode == beyond_walls(side, wall_count(gap, side));
    return select(SIDE_NONE, side, is_last && last_kind(gap, side) == LAST_PUSHING);
}

fn no_watch() -> Watch {
    return Watch(ENDS_NOTHING, 0u, 0u, row_line(0u, 0.0), 0u);
}

// Returns the watch with a number.
fn watch(number_of_watch: u32, domain: u32) -> Watch {
    var found = no_watch();
    if number_of_watch >= WATCHES_PER_GAP * GAPS {
        let i = (number_of_watch - WATCHES_PER_GAP * GAPS) / 2u;
        let is_first = (number_of_watch - WATCHES_PER_GAP * GAPS) % 2u == 0u;
        found.index = i;
        if i >= shape.elements || (held_gap < GAPS && ((rubs >> i) & 1u) == 1u) {
            return found;
        }
        if slips[i] != STICKS {
            if is_first {
                found.kind = ENDS_SLIDING;
                found.line = rate_line(i, sign_of_slip(slips[i]));
                found.order = from_rate[i];
            }
        } else if has_hold(domain, i) {
            found.kind = BEGINS_SLIDING;
            found.side = select(BACKWARD, FORWARD, is_first);
            found.line = row_line(hold_row(domain, i), -sign_of_slip(found.side));
            found.line.constant = element_force(i);
        }
        return found;
    }
    let gap = number_of_watch / WATCHES_PER_GAP;
    let nth = number_of_watch % WATCHES_PER_GAP;
    let mode = gap_modes[gap];
    let side = contact_of(mode);
    found.index = gap;
    found.side = side;
    if gap == held_gap {
        if nth == 0u {
            found.kind = ENDS_PRESSING;
            found.line = row_line(acceleration_row(domain, gap), sign_of(leaving_side));
        }
        return found;
    }
    if is_stuck(mode) {
        if nth == 0u && has_push(domain, gap) {
            found.kind = ENDS_PUSH;
            found.line = push_line(domain, gap);
        }
        return found;
    }
    if is_kept(domain, gap) {
        return found;
    }
    // The wall that the gap may reach, and the direction to it.
    var wall = vec2<u32>(side, NO_WALL);
    var direction = nth;
    if mode < ONSET {
        if nth < 2u {
            wall = wall_ahead(gap, nth);
        } else if pushing_side(gap) != SIDE_NONE {
            found.kind = ENDS_FORCE;
        }
    } else if mode < PRESSED {
        if nth == 0u {
            found.kind = ENDS_ONSET;
            direction = side;
            wall.y = wall_count(gap, side) - 1u;
        } else if nth == 1u {
            found.kind = ENDS_PRESSING;
            found.line = row_line(acceleration_row(domain, gap), sign_of(side));
            found.order = from_force[gap];
        } else {
            direction = 1u - side;
            wall = wall_behind(gap, side);
        }
    } else if nth == 0u {
        found.kind = LEAVES;
        direction = 1u - side;
        wall.y = wall_count(gap, side) - 1u;
    } else if nth == 1u && mode >= OPEN {
        found.kind = BEGINS_FORCE;
    }
    if wall.y != NO_WALL {
        found.line = distance_line(gap, wall_at(gap, wall.x, wall.y), direction);
        found.order = order_from_wall(gap, direction);
        if found.kind == ENDS_NOTHING {
            found.kind = ENDS_AT_WALL;
            found.side = direction;
        }
    } else if found.kind == ENDS_FORCE || found.kind == BEGINS_FORCE {
        found.line = force_line(gap, side, select(Real(-1.0), Real(1.0), found.kind == ENDS_FORCE));
        found.order = from_force[gap];
    }
    return found;
}

// Steps of the grid until the stage changes or the lane must stop.
fn steps_to_stop() -> Real {
    var stop = Real(next_stop_phase() - tally.step);
    if tally.next_change < shape.changes && change_step() >= tally.step {
        stop = min(stop, Real(change_step() - tally.step) + change_theta());
    }
    return max(stop - motion.theta, Real(0.0));
}

fn change_step() -> u32 {
    return u32(table[shape.schedule + 3u * tally.next_change]);
}

fn change_theta() -> Real {
    return table[shape.schedule + 3u * tally.next_change + 1u];
}

// Takes one step to the first event, or as far as the series or the grid allow. Returns whether the step ends at a stop phase.
fn step() -> bool {
    load_phase();
    let domain = present_domain();
    let to_stop = steps_to_stop();
    var time_of_rest: Real = 0.0;
    if leaving_gap < GAPS {
        time_of_rest = begin_rest(domain, to_stop);
        leaving_gap = GAPS;
        if time_of_rest == 0.0 {
            // The dispatch may end here.
            return false;
        }
    }
    tally.passes_in_period += 1u;
    if COLUMNS && (slid & NEW_COLUMNS) != 0u {
        slid ^= NEW_COLUMNS;
        for (var n = 0u; n < VECTORS; n++) {
            set_tangent(n, constrained(tangent(n)));
        }
    }
    let remaining = min(to_stop, 1.0 - motion.theta) * flow.h;
    let h = select(min(unit_of(domain), remaining), time_of_rest, time_of_rest > 0.0);
    load_sizes(motion.q);
    expand(domain, h);
    var first = no_watch();
    var share: Real = 1.0;
    for (var n = 0u; n < WATCHES; n++) {
        let candidate = watch(n, domain);
        if candidate.kind == ENDS_NOTHING {
            continue;
        }
        iterations += TERMS * select(1u, 1u + WIDTH / 4u, candidate.line.scale != 0.0);
        for (var k = 0u; k <= shape.terms; k++) {
            powers[k] = value_of(candidate.line, k);
        }
        var order = candidate.order;
        let size = value_and_size(candidate.line, 0u, product_and_size(candidate.line.row, 0u)).y;
        if candidate.kind == BEGINS_SLIDING && abs(powers[0]) <= ROUNDING * size && powers[1] > 0.0 {
            // The force has just touched its limit.
            order = 1u;
        }
        let fall = first_fall(order, size);
        // Among gaps that reach their walls together, the first one in the model has its event first.
        let may_tie = candidate.kind == ENDS_AT_WALL && first.kind == ENDS_AT_WALL && candidate.index != first.index && first.order == 0u;
        if fall < share - select(Real(0.0), time_of_tie() / h, may_tie) || (fall <= 1.0 && first.kind == ENDS_NOTHING) {
            share = fall;
            first = candidate;
        } else if fall == NO_ROOT && touches {
            if held_gap < GAPS {
                first = candidate;
            } else {
                note_touch(candidate);
            }
        }
    }
    if held_gap < GAPS {
        if first.kind != ENDS_NOTHING {
            continue_series();
            return false;
        }
        first = Watch(ENDS_SERIES, held_gap, leaving_side, row_line(0u, 0.0), 0u);
    }
    if share > 0.0 {
        advance(domain, share, share * h);
    }
    if first.kind == ENDS_NOTHING && h >= remaining && is_change_next() {
        motion.theta = change_theta();
        first.kind = BEGINS_STAGE;
    }
    if first.kind != ENDS_NOTHING {
        cross(first, domain);
        if tally.events_in_period > settings.events_per_period {
            tally.status = STATUS_CAP_EVENTS;
        }
        return false;
    }
    if h < remaining {
        return false;
    }
    motion.theta = 0.0;
    let stop = next_stop_phase();
    tally.step += 1u;
    return tally.step >= stop;
}

// Whether the next stop is a change of the stage.
fn is_change_next() -> bool {
    return tally.next_change < shape.changes && change_step() == tally.step;
}

// Handles a function that touches zero within rounding. At an elastic wall without a preload the linearisation is valid with and without
// contact, so such a touch is no graze.
fn note_touch(touched: Watch) {
    if touched.kind == BEGINS_SLIDING {
        return;
    }
    if touched.kind == ENDS_AT_WALL && gap_modes[touched.index] < ONSET {
        let wall = wall_ahead(touched.index, touched.side);
        let is_elastic = wall.y < passable(touched.index, wall.x);
        if is_elastic && spring(touched.index, wall.x, wall.y)[2] == 0.0 {
            return;
        }
    }
    tally.grazes += 1u;
}

// Moves state, tangents and phase over a part of a step.
fn advance(domain: u32, share: Real, time: Real) {
    motion.q = state_after(share);
    if VECTORS > 0u {
        for (var i = 0u; i < VECTORS; i++) {
            var u = tangent(i);
            if held_gap < GAPS {
                u = stopped_tangent(i, domain);
            }
            load_vector(u);
            expand(domain, time);
            set_tangent(i, state_after(1.0));
        }
        if held_gap == GAPS {
            check_range();
        }
    }
    let part = time / flow.h;
    motion.theta += part;
    if held_gap < GAPS && motion.theta >= 1.0 {
        motion.theta -= 1.0;
        tally.step += 1u;
    }
    // Only a step without an event reaches the end of the grid step.
    motion.theta = min(motion.theta, 1.0 - 2.0 * ULP);
    var is_in_contact = false;
    for (var gap = 0u; gap < GAPS; gap++) {
        is_in_contact = is_in_contact || contact_of(contact_mode(gap, gap_modes[gap])) != SIDE_NONE;
        if !is_kept(domain, gap) {
            wall_side[gap] = SIDE_NONE;
        }
        from_force[gap] = 0u;
    }
    for (var i = 0u; i < ELEMENTS; i++) {
        from_rate[i] = 0u;
    }
    if MESH && is_in_contact {
        count_meshing(part);
    }
}

// Mode that says which contact a gap in this mode has.
fn contact_mode(gap: u32, mode: u32) -> u32 {
    if mode >= OPEN && mode < STUCK {
        return before_last(gap, contact_of(mode));
    }
    return mode;
}

// Counts an event at a wall.
fn count_event(gap: u32, side: u32) {
    note(FIRST_AT_WALL + side + 2u * (gap_modes[gap] + 32u * gap));
}

// Counts a change of friction; adds its symbol unless `symbol` is NO_SYMBOL.
fn count_slip(symbol: u32) {
    note(512u + symbol);
}

const NO_SYMBOL: u32 = 64u;
const STICKING_ENDS: u32 = 7u;
const SLIDING_REVERSES: u32 = 0u;

// Codes of the events of one instant. They are counted together in one call, because drivers copy a function to each call. Codes below 512
// have no symbol.
const FIRST_AT_WALL: u32 = 1024u;
const MOST_NOTES: u32 = 16u;
var<private> notes: array<u32, MOST_NOTES>;
var<private> note_count: u32;

fn note(code: u32) {
    if note_count < MOST_NOTES {
        notes[note_count] = code;
        note_count += 1u;
    }
}

// Returns the symbol of the flight that ends with an event at a wall. The gap's next flight begins there.
fn symbol_at_wall(gap: u32, side: u32, mode: u32) -> u32 {
    let origin = origins[gap];
    origins[gap] = side;
    let at = contact_of(contact_mode(gap, mode));
    var symbol = select(4u, 1u, at == SIDE_RIGHT);
    if at == SIDE_NONE {
        let is_right = side == SIDE_RIGHT;
        symbol = select(select(6u, 5u, !is_right), select(3u, 2u, is_right), origin == SIDE_RIGHT);
    }
    symbol += select(0u, 8u * (gap + 1u), GAPS > 1u);
    return select(symbol, NO_SYMBOL, at == SIDE_NONE && origin == SIDE_NONE);
}

fn count_notes() {
    for (var n = 0u; n < note_count; n++) {
        var code = notes[n];
        var symbol = select(NO_SYMBOL, code - 512u, code >= 512u);
        if code >= FIRST_AT_WALL {
            code -= FIRST_AT_WALL;
            symbol = symbol_at_wall(code / 64u, code % 2u, (code / 2u) % 32u);
            code += 1u;
        }
        if symbol != NO_SYMBOL {
            add_symbol(symbol);
        }
        keep_strobe_distance();
        tally.itinerary = mix_bits(tally.itinerary + code);
        tally.events += 1u;
        tally.events_in_period += 1u;
    }
    note_count = 0u;
}

// An impact. `kick`: change of each rate per unit of change of the gap's rate. `kick_gap`: the gap. `kick_factor`: minus the derivative of
// the change of the gap's rate with respect to this rate.
var<private> kick: array<Real, COORDINATES>;
var<private> kick_gap: u32;
var<private> kick_factor: Real;

// Applies the derivative of the impact's jump to a vector.
fn jump(u: State) -> State {
    var v = u;
    let change = kick_factor * v[2u * kick_gap + 1u];
    for (var i = 0u; i < shape.coordinates; i++) {
        v[2u * i + 1u] -= kick[i] * change;
    }
    return v;
}

// Time derivative of the state before an event. It stays in memory: an array in registers is slow to compile if it lives for long.
var<private> comes: State;

// Processes the event that ends the present modes, and applies its saltation to the tangents.
fn cross(event: Watch, domain: u32) {
    load_phase();
    let is_at_wall = event.kind == ENDS_AT_WALL || event.kind == ENDS_ONSET || event.kind == LEAVES;
    if is_at_wall {
        motion.q[event.line.entry] = -event.line.constant / event.line.factor;
    }
    var rate: Real = 0.0;
    if VECTORS > 0u {
        load_point(motion.q);
        differentiate(domain, 0u, 1.0);
        for (var i = 0u; i < shape.dim; i++) {
            comes[i] = series[WIDTH + i];
        }
        rate = select(value_of(event.line, 1u), Real(-1.0), event.kind == ENDS_SERIES);
    }
    kick_factor = 0.0;
    act(event, domain);
    let next = present_domain();
    complete_orders(next);
    count_notes();
    if VECTORS > 0u && event.kind != BEGINS_STAGE {
        saltate(event, next, select(Real(0.0), NO_SPEED * flow.speed, is_at_wall), rate);
    }
    let has_left = event.kind == ENDS_AT_WALL && kick_factor != 0.0 && gap_modes[event.index] == before_last(event.index, event.side);
    if has_left && resting_gaps() == held_gaps {
        leaving_gap = event.index;
        leaving_side = event.side;
    }
}

// Applies `S u = R u + (f+ - R f-) (n . u) / (n . f-)` to every tangent vector, and projects it to the constraints.
fn saltate(event: Watch, domain: u32, least: Real, rate: Real) {
    load_point(motion.q);
    differentiate(domain, 0u, 1.0);
    var change = jump(comes);
    let inverse = select(1.0 / rate, Real(0.0), abs(rate) <= least);
    let is_passed = event.kind == ENDS_AT_WALL || event.kind == LEAVES;
    if abs(rate) <= least && (kick_factor != 0.0 || !is_passed) {
        tally.grazes += 1u;
    }
    for (var i = 0u; i < shape.dim; i++) {
        leaves[i] = series[WIDTH + i];
        change[i] = (leaves[i] - change[i]) * inverse;
    }
    for (var n = 0u; n < VECTORS; n++) {
        let u = tangent(n);
        load_vector(u);
        let along = select(value_of(event.line, 0u), late[n], event.kind == ENDS_SERIES);
        var v = jump(u);
        for (var i = 0u; i < shape.dim; i++) {
            v[i] += change[i] * along;
        }
        set_tangent(n, constrained(v));
    }
    check_range();
}

fn act(event: Watch, domain: u32) {
    let i = event.index;
    var exempt_gap = GAPS;
    var exempt_element = ELEMENTS;
    var reached = SIDE_NONE;
    var stopped = ELEMENTS;
    has_outcome = false;
    held_gap = GAPS;
    switch event.kind {
        case ENDS_AT_WALL: {
            if gap_modes[i] >= ONSET {
                end_contact(i, contact_of(gap_modes[i]));
            }
            reached = event.side;
        }
        case ENDS_ONSET: {
            gap_modes[i] = PRESSED + event.side;
            leave(i, 1u - event.side);
        }
        case ENDS_PRESSING: {
            end_contact(i, event.side);
            wall_side[i] = SIDE_NONE;
        }
        case LEAVES: {
            if gap_modes[i] < OPEN {
                end_contact(i, event.side);
                leave(i, event.side);
            } else {
                gap_modes[i] = before_last(i, event.side);
                if sign_of(event.side) * rate_of_gap(i) < 0.0 {
                    leave(i, event.side);
                } else {
                    reached = event.side;
                }
            }
        }
        case ENDS_FORCE: {
            end_contact(i, event.side);
            gap_modes[i] = OPEN + event.side;
            from_force[i] = 1u;
        }
        case BEGINS_FORCE: {
            begin_force(i, event.side);
        }
        case ENDS_PUSH: {
            end_contact(i, event.side);
            wall_side[i] = event.side;
            wall_order[i] = RELEASE_ORDER;
            exempt_gap = i;
        }
        case ENDS_SLIDING: {
            stopped = i;
        }
        case BEGINS_SLIDING: {
            begin_sliding(i, event.side, domain);
            exempt_element = i;
        }
        case ENDS_SERIES: {
            end_series(i, event.side);
            has_outcome = true;
        }
        default: {
            // Modes that depend on forces are decided again in the stage that begins.
            stage = u32(table[shape.schedule + 3u * tally.next_change + 2u]);
            tally.next_change += 1u;
        }
    }
    if reached != SIDE_NONE {
        reach(i, reached);
    }
    if has_outcome {
        gap_modes[i] = tried_gaps[i];
        if is_stuck(gap_modes[i]) {
            wall_side[i] = SIDE_NONE;
        } else {
            let side = select(event.side, reached, reached != SIDE_NONE);
            leave(i, select(side, 1u - side, gap_modes[i] >= PRESSED));
        }
    }
    if event.kind != ENDS_ONSET {
        settle(exempt_gap, exempt_element, stopped);
    }
}

// Begins contact with a wall that only pushes.
fn begin_force(gap: u32, side: u32) {
    count_event(gap, side);
    gap_modes[gap] = beyond_walls(side, wall_count(gap, side));
    from_force[gap] = 1u;
}

// Ends a lasting contact with the last wall of a side.
fn end_contact(gap: u32, side: u32) {
    count_event(gap, side);
    gap_modes[gap] = before_last(gap, side);
}

// Records that a gap lies on the wall in a direction and does not pass it.
fn leave(gap: u32, direction: u32) {
    wall_side[gap] = direction;
    wall_order[gap] = 1u;
}

// Computes the orders of all roots at the present state.
fn complete_orders(domain: u32) {
    for (var n = 0u; n < GAPS + ELEMENTS; n++) {
        let is_gap = n < GAPS;
        let gap = min(n, GAPS - 1u);
        let element = select(n - GAPS, 0u, is_gap);
        var line = distance_line(gap, 0.0, SIDE_RIGHT);
        if is_gap {
            if wall_side[gap] == SIDE_NONE {
                continue;
            }
            if rate_of_gap(gap) != 0.0 {
                wall_order[gap] = 1u;
            }
            if rate_of_gap(gap) != 0.0 || wall_order[gap] >= RELEASE_ORDER {
                continue;
            }
        } else {
            if from_rate[element] != UNKNOWN_ORDER {
                continue;
            }
            line = rate_line(element, 1.0);
        }
        let order = lead(line, domain, motion.q, select(1u, 2u, is_gap)).order;
        if is_gap {
            wall_order[gap] = order;
        } else {
            from_rate[element] = order;
        }
    }
}

// Processes a gap that reaches a wall in a direction.
fn reach(gap: u32, direction: u32) {
    let wall = wall_ahead(gap, direction);
    if wall.y == NO_WALL {
        return;
    }
    motion.q[2u * gap] = wall_at(gap, wall.x, wall.y);
    let domain = present_domain();
    let closing = sign_of(direction) * rate_of_gap(gap);
    let is_elastic = wall.y < passable(gap, wall.x);
    let is_tiny = closing < NO_SPEED * flow.speed;
    let is_pushing = wall.x == direction && is_elastic && wall.y + 1u == wall_count(gap, wall.x) && last_kind(gap, wall.x) == LAST_PUSHING;
    // Acceleration towards the wall, and force of a wall that only pushes. They are computed only if they are used.
    var heads: Real = 1.0;
    var pushes: Real = 1.0;
    for (var n = 0u; n < 2u; n++) {
        var line = distance_line(gap, 0.0, 1u - direction);
        if n == 1u {
            line = force_line(gap, wall.x, 1.0);
        }
        if select(is_tiny && closing >= 0.0, is_pushing, n == 1u) {
            let value = lead(line, domain, motion.q, select(2u, 0u, n == 1u)).value;
            heads = select(value, heads, n == 1u);
            pushes = value;
        }
    }
    if closing < 0.0 || (closing == 0.0 && !(heads > 0.0)) {
        leave(gap, direction);
        return;
    }
    if is_tiny && closing > 0.0 && !is_elastic && !(heads > 0.0) {
        // Ends alternating impacts of two gaps: both leave their walls from rest.
        motion.q[2u * gap + 1u] = 0.0;
        tally.grazes += 1u;
        note(0u);
        leave(gap, direction);
        return;
    }
    let next = select(gap_modes[gap] - 1u, gap_modes[gap] + 1u, direction == SIDE_RIGHT);
    if wall.x != direction {
        count_event(gap, wall.x);
        gap_modes[gap] = next;
        leave(gap, wall.x);
    } else if is_elastic {
        if is_pushing && !(pushes > 0.0) {
            gap_modes[gap] = OPEN + wall.x;
        } else {
            count_event(gap, wall.x);
            gap_modes[gap] = next;
            if closing < GRAZING_SPEED * flow.speed && spring(gap, wall.x, wall.y)[2] != 0.0 {
                tally.grazes += 1u;
            }
        }
        leave(gap, 1u - wall.x);
        if is_pushing {
            from_force[gap] = UNKNOWN_ORDER;
        }
    } else {
        impact(gap, wall.x);
    }
}

// Returns the restitution at an approach speed, and its derivative with respect to the speed.
fn restitution(gap: u32, side: u32, speed: Real) -> array<Real, 2> {
    let law = laws[cell.law_index][2u * gap + side];
    var value = law[0];
    var slope: Real = 0.0;
    if law[1] != 0.0 {
        let ratio = power(speed, law[2]);
        value += law[1] * ratio;
        slope = law[1] * law[2] * ratio / max(speed, 1e-30);
    }
    let is_inside = value >= 0.0 && value <= 1.0;
    return array<Real, 2>(clamp(value, Real(0.0), Real(1.0)), select(Real(0.0), slope, is_inside));
}

// Returns `x^p` for a positive number, to the precision of its type. WGSL has no powers for f64.
fn power(x: Real, p: Real) -> Real {
    let octaves = p * octaves_of(clamp(x, Real(1e-30), Real(1e30)));
    let whole = clamp(round(octaves), Real(-120.0), Real(120.0));
    let y = (octaves - whole) * LN_2;
    var sum: Real = 1.0;
    for (var k = shape.terms; k > 0u; k--) {
        sum = 1.0 + sum * y / Real(k);
    }
    return sum * Real(ldexp(1.0, i32(whole)));
}

// Returns the leaving speed below which the flights of a series of impacts are not followed, at the loaded point.
fn lowest_speed(domain: u32, gap: u32) -> Real {
    return sqrt(2.0 * LOWEST_FLIGHT * flow.length * abs(product_and_size(acceleration_row(domain, gap), 0u).x));
}

// Processes an impact, after which the gap leaves the wall, or a lasting contact begins.
fn impact(gap: u32, side: u32) {
    load_mobilities();
    let approach = sign_of(side) * rate_of_gap(gap);
    let law = restitution(gap, side, approach);
    let e = law[0];
    let leaving = e * approach;
    let is_rigid = last_kind(gap, side) == LAST_RIGID;
    let mesh_speed = laws[cell.law_index][2u * gap + side][3];
    var kept = 0u;
    var lasts = false;
    var next = motion.q;
    var pressing: Real = 0.0;
    for (var trial = 0u; trial <= GAPS; trial++) {
        let let_go = joint_impact(gap, side, kept);
        // First the impact as if the gap leaves its wall. If the gap is then slow, contact may last.
        lasts = false;
        var is_slow = false;
        var chosen_gaps = gap_modes;
        var chosen_slips = slips;
        for (var stops = 0u; stops < 2u; stops++) {
            if stops == 1u && !(is_slow && is_rigid) {
                break;
            }
            var q = motion.q;
            let change = select((1.0 + e) * approach, approach, stops == 1u);
            for (var i = 0u; i < shape.coordinates; i++) {
                q[2u * i + 1u] -= sign_of(side) * kick[i] * change;
            }
            q[2u * gap + 1u] = select(-sign_of(side) * leaving, Real(0.0), stops == 1u);
            tried_gaps = gap_modes;
            for (var other = 0u; other < GAPS; other++) {
                if ((let_go >> other) & 1u) == 1u {
                    tried_gaps[other] = before_last(other, (gap_modes[other] + 1u) % 2u);
                }
            }
            if stops == 1u {
                tried_gaps[gap] = STUCK + side;
            }
            let fits = slide_after_jump(q, change != 0.0, gap, select(SIDE_NONE, side, stops == 1u));
            if stops == 1u {
                lasts = fits && is_stuck(tried_gaps[gap]);
                if lasts {
                    next = q;
                    chosen_gaps = tried_gaps;
                    chosen_slips = tried_slips;
                }
                break;
            }
            next = q;
            chosen_gaps = tried_gaps;
            chosen_slips = tried_slips;
            // Contact lasts only if the gap is pressed to the wall both without and with contact.
            for (var with_contact = 0u; with_contact < 2u; with_contact++) {
                let domain = domain_of(tried_gaps, tried_slips);
                let value = lead(distance_line(gap, 0.0, 1u - side), domain, q, 2u).value;
                if with_contact == 1u {
                    if value > 0.0 {
                        lasts = true;
                        chosen_gaps = tried_gaps;
                    }
                    break;
                }
                pressing = value;
                is_slow = leaving <= max(mesh_speed, lowest_speed(domain, gap));
                if !is_slow || is_rigid || !(pressing > 0.0) {
                    break;
                }
                tried_gaps[gap] = select(PRESSED, ONSET, leaving > 0.0) + side;
            }
        }
        tried_gaps = chosen_gaps;
        tried_slips = chosen_slips;
        // Gaps whose flight would be too low stay at rest. Otherwise the impacts of two gaps might alternate for ever.
        var low = 0u;
        let domain = domain_of(tried_gaps, tried_slips);
        for (var other = 0u; other < GAPS; other++) {
            if low == 0u && ((let_go >> other) & 1u) == 1u {
                let at = (gap_modes[other] + 1u) % 2u;
                let presses = lead(distance_line(other, 0.0, 1u - at), domain, next, 2u).value > 0.0;
                if presses && -sign_of(at) * next[2u * other + 1u] <= lowest_speed(domain, other) {
                    low = 1u << other;
                }
            }
        }
        kept |= low;
        if low == 0u {
            break;
        }
    }
    held_gaps = select(UNSURE, held_gaps, kept == 0u);
    if is_tied_with_another(gap) {
        tally.ties = 1u;
    }
    if !lasts && !(pressing > 0.0) && approach < GRAZING_SPEED * flow.speed {
        tally.grazes += 1u;
    }
    // The rest of a series that was not replaced by its limit is one flight of the same duration and momentum.
    var longer: Real = 1.0;
    if lasts && !is_rigid && leaving > mesh_speed && e < 1.0 {
        longer = 2.0 / (1.0 - e);
        for (var i = 0u; i < shape.coordinates; i++) {
            next[2u * i + 1u] -= sign_of(side) * kick[i] * (longer - 1.0) * leaving;
        }
        next[2u * gap + 1u] = -sign_of(side) * longer * leaving;
    }
    kick_gap = gap;
    kick_factor = select(1.0 + longer * (e + law[1] * approach), Real(1.0), lasts && is_rigid);
    motion.q = next;
    count_event(gap, side);
    if !lasts {
        tally.impacts += 1u;
    }
    has_outcome = true;
}

// Whether another gap is about to have an impact, too, and the impact of the first gap changes its rate.
fn is_tied_with_another(gap: u32) -> bool {
    for (var other = 0u; other < GAPS; other++) {
        let rate = rate_of_gap(other);
        let side = select(SIDE_LEFT, SIDE_RIGHT, rate > 0.0);
        let wall = wall_ahead(other, side);
        // A gap in the last flights of a series of impacts is always near its wall.
        let is_slow = abs(rate) <= SLOWEST_TIE * TIE * flow.speed;
        if other == gap || is_slow || wall.y == NO_WALL || wall.x != side || wall.y < passable(other, side) {
            continue;
        }
        let is_coupled = abs(mobility(gap, other)) > ROUNDING * sqrt(mobility(gap, gap) * mobility(other, other));
        if is_coupled && abs(wall_at(other, side, wall.y) - motion.q[2u * other]) <= time_of_tie() * abs(rate) {
            return true;
        }
    }
    return false;
}

// Speed of a gap, in units of TIE and of the scale of speed, above which its flights last hundreds of times as long as a tie.
const SLOWEST_TIE: Real = 1000.0;

// Time between two impacts within which their order is not known.
fn time_of_tie() -> Real {
    return TIE * flow.h * Real(shape.steps);
}

// Whether an impact or a series of impacts has ended with the tried modes, and they are not yet entered.
var<private> has_outcome: bool;

// Computes the changes of all rates by an impulse that changes the gap's rate by 1. Returns the bit mask of the resting gaps that leave
// their rigid walls. Other resting gaps stay, because their walls push; gaps in `kept` stay in any case.
fn joint_impact(gap: u32, side: u32, kept: u32) -> u32 {
    var resting: array<u32, 2>;
    var count_of_resting = 0u;
    for (var other = 0u; other < GAPS; other++) {
        if other != gap && is_stuck(gap_modes[other]) {
            resting[count_of_resting] = other;
            count_of_resting += 1u;
        }
    }
    // If no set of released gaps is consistent, the last trial repeats the first one.
    for (var n = 0u; n <= (1u << count_of_resting); n++) {
        iterations += 1u;
        let is_last = n == (1u << count_of_resting);
        let released = select(n, 0u, is_last);
        // Impulses of the walls of held gaps, relative to the impulse of the impact.
        var shares = array<Real, 2>(0.0, 0.0);
        var held: array<u32, 2>;
        var count_of_held = 0u;
        for (var bit = 0u; bit < count_of_resting; bit++) {
            if ((released >> bit) & 1u) == 0u {
                held[count_of_held] = resting[bit];
                count_of_held += 1u;
            }
        }
        if count_of_held == 1u {
            shares[0] = mobility(held[0], gap) / mobility(held[0], held[0]);
        } else if count_of_held == 2u {
            let a = mobility(held[0], held[0]);
            let b = mobility(held[0], held[1]);
            let c = mobility(held[1], held[1]);
            let inverse = 1.0 / (a * c - b * b);
            shares[0] = inverse * (c * mobility(held[0], gap) - b * mobility(held[1], gap));
            shares[1] = inverse * (a * mobility(held[1], gap) - b * mobility(held[0], gap));
        }
        var own = mobility(gap, gap);
        for (var k = 0u; k < count_of_held; k++) {
            own -= shares[k] * mobility(held[k], gap);
        }
        for (var i = 0u; i < shape.coordinates; i++) {
            var moved = mobility(i, gap);
            for (var k = 0u; k < count_of_held; k++) {
                moved -= shares[k] * mobility(i, held[k]);
            }
            kick[i] = moved / own;
        }
        kick[gap] = 1.0;
        held_gaps = 0u;
        var fits = true;
        for (var k = 0u; k < count_of_held; k++) {
            kick[held[k]] = 0.0;
            held_gaps |= 1u << held[k];
            let is_kept_here = ((kept >> held[k]) & 1u) == 1u;
            let at = (gap_modes[held[k]] + 1u) % 2u;
            // The wall pushes the gap away, so all rates change by `-side kick`.
            let push = -sign_of(side) * sign_of(at) * shares[k];
            fits = fits && (is_kept_here || push >= -ROUNDING * sqrt(mobility(gap, gap) / mobility(held[k], held[k])));
        }
        var let_go = 0u;
        for (var bit = 0u; bit < count_of_resting; bit++) {
            if ((released >> bit) & 1u) == 1u {
                let other = resting[bit];
                let at = (gap_modes[other] + 1u) % 2u;
                let_go |= 1u << other;
                fits = fits && ((kept >> other) & 1u) == 0u && -sign_of(side) * kick[other] * sign_of(at) <= 0.0;
            }
        }
        if fits || is_last {
            return let_go;
        }
    }
    return 0u;
}

// Changes of all rates per impulse on each gap. They are copied from the table, because each place that reads it takes long to compile.
var<private> mobilities: array<Real, GAPS * COORDINATES>;

fn load_mobilities() {
    for (var gap = 0u; gap < GAPS; gap++) {
        for (var i = 0u; i < shape.coordinates; i++) {
            mobilities[gap * COORDINATES + i] = number(AT_MOBILITY + i * COORDINATES + gap);
        }
    }
}

fn mobility(i: u32, gap: u32) -> Real {
    return mobilities[gap * COORDINATES + i];
}

// Chooses modes of friction and of other gaps at rest after a jump of the rates to `q`. The tried modes of the gaps are given. Returns
// whether a consistent choice exists.
fn slide_after_jump(q: State, jumps: bool, gap: u32, stopped: u32) -> bool {
    var after = q;
    for (var other = 0u; other < GAPS; other++) {
        rest_side[other] = SIDE_NONE;
        if is_stuck(tried_gaps[other]) {
            rest_side[other] = (tried_gaps[other] + 1u) % 2u;
        }
    }
    if stopped != SIDE_NONE {
        rest_side[gap] = stopped;
    }
    tried_slips = slips;
    for (var i = 0u; i < ELEMENTS; i++) {
        rest_element[i] = 0u;
        if i >= shape.elements {
            continue;
        }
        let row = AT_ELEMENTS + i * (WIDTH + 1u);
        var moved: Real = 0.0;
        var size_of_move: Real = 0.0;
        var rate = number(row + WIDTH - 1u);
        var size = abs(rate);
        for (var j = 0u; j < shape.coordinates; j++) {
            let factor = number(row + 2u * j + 1u);
            moved += factor * kick[j];
            size_of_move += abs(factor * kick[j]);
            rate += factor * after[2u * j + 1u];
            size += abs(factor * after[2u * j + 1u]);
        }
        if jumps && abs(moved) > ROUNDING * size_of_move {
            if abs(rate) <= ROUNDING * size {
                rest_element[i] = 1u;
                tried_slips[i] = STICKS;
            } else {
                tried_slips[i] = select(BACKWARD, FORWARD, rate > 0.0);
            }
        } else {
            rest_element[i] = select(0u, 1u, slips[i] == STICKS);
        }
    }
    return choose(q, false);
}

// Lists all elements at rest: gaps on rigid walls, and elements that stick.
fn list_rest(domain: u32) {
    for (var gap = 0u; gap < GAPS; gap++) {
        rest_side[gap] = SIDE_NONE;
        let mode = gap_modes[gap];
        if is_stuck(mode) {
            rest_side[gap] = contact_of(mode);
        } else if mode < ONSET && wall_side[gap] != SIDE_NONE && is_kept(domain, gap) {
            let wall = wall_ahead(gap, wall_side[gap]);
            let is_last = wall.y != NO_WALL && wall.y + 1u == wall_count(gap, wall.x);
            if is_last && wall.x == wall_side[gap] && last_kind(gap, wall.x) == LAST_RIGID {
                rest_side[gap] = wall.x;
            }
        }
    }
    for (var i = 0u; i < ELEMENTS; i++) {
        rest_element[i] = select(0u, 1u, i < shape.elements && slips[i] == STICKS);
    }
    tried_gaps = gap_modes;
    tried_slips = slips;
}

// Processes an element that breaks away.
fn begin_sliding(i: u32, next: u32, before: u32) {
    let slip = slips[i];
    slips[i] = next;
    let domain = present_domain();
    var freed = 0u;
    for (var gap = 0u; gap < GAPS; gap++) {
        if !(is_kept(before, gap) && !is_still(domain, gap)) {
            continue;
        }
        freed |= 1u << gap;
        if wall_side[gap] == SIDE_NONE || gap_modes[gap] >= ONSET {
            continue;
        }
        let wall = wall_ahead(gap, wall_side[gap]);
        let is_rigid = wall.y != NO_WALL && wall.y + 1u == wall_count(gap, wall.x) && last_kind(gap, wall.x) == LAST_RIGID;
        if is_rigid && wall.x == wall_side[gap] && lead(distance_line(gap, 0.0, 1u - wall.x), domain, motion.q, 3u).value > 0.0 {
            // The wall holds the gap from here on.
            slips[i] = slip;
            count_event(gap, wall.x);
            gap_modes[gap] = STUCK + wall.x;
            wall_side[gap] = SIDE_NONE;
            return;
        }
    }
    from_rate[i] = 2u;
    slid |= 1u << i;
    count_slip(STICKING_ENDS);
    for (var gap = 0u; gap < GAPS; gap++) {
        if ((freed >> gap) & 1u) == 1u {
            wall_order[gap] = RELEASE_ORDER;
            if gap_modes[gap] >= ONSET && gap_modes[gap] < PRESSED {
                from_force[gap] = 1u;
            }
        }
    }
}

// Decides all modes that depend on forces again, after a jump of forces or rates. The exempt gap or element was just decided and is left
// out. The sliding rate of the element `stopped` has just vanished.
fn settle(exempt_gap: u32, exempt_element: u32, stopped: u32) {
    // Round 0 enters the modes that an impact or a series of impacts has ended with.
    for (var n = select(1u, 0u, has_outcome); n <= MOST_DECISIONS; n++) {
        let ends_sliding = n == 1u && stopped < ELEMENTS;
        if n > 0u {
            let domain = present_domain();
            if !ends_sliding && settle_pushing(domain) {
                continue;
            }
            list_rest(domain);
            if ends_sliding {
                rest_element[stopped] = 1u;
            }
            if exempt_gap < GAPS {
                rest_side[exempt_gap] = SIDE_NONE;
            }
            if exempt_element < ELEMENTS {
                rest_element[exempt_element] = 0u;
            }
            let has_choice = choose(motion.q, !ends_sliding);
            if ends_sliding && tried_slips[stopped] == slips[stopped] {
                // The sliding rate only touches 0, or starts with the wrong sign by rounding.
                tally.grazes += 1u;
                note(1u);
                from_rate[stopped] = UNKNOWN_ORDER;
                continue;
            }
            if !has_choice {
                tally.grazes += 1u;
                break;
            }
            if are_tried_modes_present() {
                break;
            }
        }
        change_modes(select(ELEMENTS, stopped, ends_sliding));
    }
}

fn are_tried_modes_present() -> bool {
    var same = true;
    for (var gap = 0u; gap < GAPS; gap++) {
        same = same && tried_gaps[gap] == gap_modes[gap];
    }
    for (var i = 0u; i < ELEMENTS; i++) {
        same = same && tried_slips[i] == slips[i];
    }
    return same;
}

// Decides again the modes of contact onsets and of walls that only push. Returns whether a mode has changed.
fn settle_pushing(domain: u32) -> bool {
    for (var gap = 0u; gap < GAPS; gap++) {
        let mode = gap_modes[gap];
        let is_onset = mode >= ONSET && mode < PRESSED;
        let is_open = mode >= OPEN && mode < STUCK;
        let side = select(pushing_side(gap), contact_of(mode), is_onset || is_open);
        let is_new = from_force[gap] == UNKNOWN_ORDER;
        if side == SIDE_NONE || (from_force[gap] > 0u && !is_new) || (is_onset && is_kept(domain, gap)) {
            continue;
        }
        var line = distance_line(gap, 0.0, 1u - side);
        if !is_onset {
            line = force_line(gap, side, 1.0);
        }
        let found = lead(line, domain, motion.q, select(0u, 2u, is_onset));
        if is_new {
            // The wall's mode has just been decided.
            from_force[gap] = found.order;
            if found.order > 0u {
                continue;
            }
        }
        if is_onset && !(found.value > 0.0) {
            end_contact(gap, side);
            if wall_side[gap] != SIDE_NONE {
                leave(gap, side);
            }
            return true;
        }
        if is_open && found.value > 0.0 {
            begin_force(gap, side);
            from_force[gap] = UNKNOWN_ORDER;
            return true;
        }
        if !is_onset && !is_open && found.value < 0.0 {
            end_contact(gap, side);
            gap_modes[gap] = OPEN + side;
            from_force[gap] = UNKNOWN_ORDER;
            return true;
        }
    }
    return false;
}

// Enters the chosen modes and counts the changes. If the rate of the element `stopped` has vanished, changes of friction are counted first.
fn change_modes(stopped: u32) {
    for (var n = 0u; n < 2u; n++) {
        if (n == 0u) == (stopped < ELEMENTS) {
            change_slips(stopped);
            continue;
        }
        for (var gap = 0u; gap < GAPS; gap++) {
            if is_stuck(gap_modes[gap]) && tried_gaps[gap] < ONSET {
                let side = contact_of(gap_modes[gap]);
                end_contact(gap, side);
                leave(gap, side);
            } else if gap_modes[gap] < ONSET && is_stuck(tried_gaps[gap]) {
                count_event(gap, contact_of(tried_gaps[gap]));
                wall_side[gap] = SIDE_NONE;
            }
            gap_modes[gap] = tried_gaps[gap];
        }
    }
    var q = motion.q;
    hold(&q, 1.0);
    motion.q = q;
}

// Enters the chosen modes of friction.
fn change_slips(stopped: u32) {
    for (var i = 0u; i < ELEMENTS; i++) {
        let before = slips[i];
        let after = tried_slips[i];
        if before == after {
            continue;
        }
        slips[i] = after;
        slid |= select(0u, 1u << i, after != STICKS);
        from_rate[i] = 0u;
        if after != STICKS {
            load_sizes(motion.q);
            let rate = product_and_size(rate_line(i, 1.0).row, 0u);
            // An element that has just stopped has a small rate, because the time of its stop has a rounding error.
            if i == stopped || abs(rate.x) <= ROUNDING * rate.y {
                from_rate[i] = UNKNOWN_ORDER;
            }
        }
        if before == STICKS {
            count_slip(STICKING_ENDS);
        } else if after == STICKS {
            count_slip(NO_SYMBOL);
        } else if i == stopped {
            count_slip(SLIDING_REVERSES);
        }
    }
}
