// The model: domains, the contact law, and what it takes to mesh.

fn domain_of(mode: u32) -> u32 {
    if mode == MODE_FREE {
        return 0u;
    }
    return 1u + ((mode - 1u) & 1u);
}

fn side_of(mode: u32) -> u32 {
    return (mode - 1u) & 1u;
}

fn sign_of(side: u32) -> Real {
    return select(Real(-1.0), Real(1.0), side == SIDE_RIGHT);
}

// Acceleration of the gap in a domain, in units of its step. `q` in lane units.
fn gap_acceleration(d: u32, q: array<Real, 4>) -> Real {
    let row = flows[cell.flow_index].domains[d].gap_row;
    let share = flows[cell.flow_index].domains[d].share;
    return (row[0] * q[0] + row[2] * q[2]) + share * (row[1] * q[1] + row[3] * q[3])
        + (row[4] * motion.phasor[0] + row[5]);
}

// The first derivative of the gap from the second on that is not zero points into the wall.
fn presses(d: u32, side: u32, q: array<Real, 4>) -> bool {
    let a = gap_acceleration(d, q);
    if a != 0.0 {
        return sign_of(side) * a > 0.0;
    }
    expand(d, q);
    let first = select(select(gap_terms[5], gap_terms[4], gap_terms[4] != 0.0), gap_terms[3], gap_terms[3] != 0.0);
    return sign_of(side) * first > 0.0;
}

// Order of the root of the distance for a gap that rests on the wall.
fn rest_order(d: u32, q: array<Real, 4>) -> u32 {
    return select(2u, 3u, gap_acceleration(d, q) == 0.0);
}

// Free motion reaches a wall: the impact law, then meshing or not. The gap is on the wall.
fn contact(side: u32) {
    let sign = sign_of(side);
    let e = laws[cell.law_index].restitution;
    let approach = max(sign * motion.q[1], Real(0.0));
    let leaving = e * approach;
    let before = motion.q;
    motion.q[1] = -sign * leaving;
    motion.q[3] += flows[cell.flow_index].kick * (sign * (1.0 + e) * approach);

    motion.q[0] = flows[cell.flow_index].walls[side];
    let pressed = presses(0u, side, motion.q);
    var meshes = false;
    if pressed && leaving <= laws[cell.law_index].mesh_speed * flows[cell.flow_index].h {
        var on_wall = motion.q;
        on_wall[0] = 0.0;
        meshes = presses(1u + side, side, on_wall);
    }
    if !pressed && approach < GRAZING_SPEED * flows[cell.flow_index].h {
        tally.grazes += 1u;
    }
    count_event(side);
    if EXPONENT {
        var next = motion.q;
        next[0] = select(next[0], 0.0, meshes);
        let after = field(select(0u, 1u + side, meshes), next);
        let kick = flows[cell.flow_index].kick * (1.0 + e);
        saltate(field(0u, before), after, ALONG_GAP, before[1], -e, kick);
    }
    if meshes {
        start_meshing(side, leaving);
    } else {
        tally.impacts += 1u;
        leave(side);
    }
}

// Approach speeds below this, with the load pulling away, count as near grazing.
const GRAZING_SPEED: Real = 1e-4;

// The gradient of the gap.
const ALONG_GAP = array<Real, 4>(1.0, 0.0, 0.0, 0.0);

fn start_meshing(side: u32, leaving: Real) {
    motion.q[0] = 0.0;
    if leaving > 0.0 {
        tally.mode = MODE_DIP + side;
        tally.order = 1u;
    } else {
        tally.mode = MODE_PRESSED + side;
        tally.order = rest_order(1u + side, motion.q);
    }
}

// Free motion starts on a wall.
fn leave(side: u32) {
    tally.mode = MODE_FREE;
    tally.origin = side;
    motion.q[0] = flows[cell.flow_index].walls[side];
    tally.order = 1u;
    if motion.q[1] == 0.0 {
        tally.order = rest_order(0u, motion.q);
    }
}

fn count_event(side: u32) {
    note_symbol(side);
    note_strobe();
    tally.origin = side;
    tally.events += 1u;
    tally.events_in_period += 1u;
    if tally.events_in_period > settings.events_per_period {
        tally.status = STATUS_CAP_EVENTS;
    }
}
