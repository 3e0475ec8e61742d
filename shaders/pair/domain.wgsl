// Constants of a lane in registers. Storage is slow, so a lane copies the constants that every pass uses. The domain that governs the
// motion changes only at events.

// The domain that governs the motion.
var<private> here: Domain;
var<private> walls: array<Real, 2>;
var<private> kick: Real;
var<private> h: Real;
var<private> speed: Real;
var<private> closing: Real;
var<private> law: Law;
var<private> shape: FlowShape;

// All three domains, in variants that keep copies (KEEP). A software driver reads storage lane by lane, which takes longer than the
// arithmetic. On a graphics device, lanes of one flow read the same address together, and copies would not fit into registers.
var<private> free: Domain;
var<private> on_right: Domain;
var<private> on_left: Domain;

fn fetch_constants() {
    let f = cell.flow_index;
    law = laws[cell.law_index];
    shape = shapes[f];
    walls = flows[f].walls;
    kick = flows[f].kick;
    h = flows[f].h;
    speed = flows[f].speed;
    closing = flows[f].closing;
    if STAGES {
        load_change();
    }
    if KEEP {
        free = flows[f].domains[0];
        on_right = flows[f].domains[1];
        on_left = flows[f].domains[2];
    }
    enter(domain_of(tally.mode));
}

// Restitution at a wall. The law's arrays are not indexed by a variable, because such arrays do not stay in registers.
fn restitution(side: u32) -> Real {
    return select(law.restitution[1], law.restitution[0], side == SIDE_RIGHT);
}

// Largest leaving speed, per free step, at which contact lasts under a pressing load.
fn mesh_speed(side: u32) -> Real {
    return select(law.mesh_speed[1], law.mesh_speed[0], side == SIDE_RIGHT) * h;
}

// Makes domain `d` govern the motion.
fn enter(d: u32) {
    if !KEEP {
        here = flows[cell.flow_index].domains[d];
    } else if d == 0u {
        here = free;
    } else if d == 1u {
        here = on_right;
    } else {
        here = on_left;
    }
}

// Propagator of one step in the domain that governs the motion. Careful passes do not use it.
fn propagator() -> array<Real, 28> {
    if !KEEP {
        return flows[cell.flow_index].domains[domain_of(tally.mode)].step;
    }
    return here.step;
}

// Constants of the accelerations in a domain.
struct Pull {
    gap_row: array<Real, 7>,
    x_row: array<Real, 7>,
    share: Real,
    angle: Real,
    // Places of the harmonics' factors (harmonics.wgsl).
    gap_place: u32,
    x_place: u32,
}

// Accelerations in the domain that governs the motion.
fn present_pull() -> Pull {
    let d = domain_of(tally.mode);
    return Pull(here.gap_row, here.x_row, here.share, here.angle, place_of_gap(d), place_of_x(d));
}

// Accelerations while meshing on a side.
fn meshing_pull(side: u32) -> Pull {
    let d = 1u + side;
    if !KEEP {
        let f = cell.flow_index;
        return Pull(flows[f].domains[d].gap_row, flows[f].domains[d].x_row, flows[f].domains[d].share, flows[f].domains[d].angle, place_of_gap(d), place_of_x(d));
    }
    if side == SIDE_RIGHT {
        return Pull(on_right.gap_row, on_right.x_row, on_right.share, on_right.angle, place_of_gap(d), place_of_x(d));
    }
    return Pull(on_left.gap_row, on_left.x_row, on_left.share, on_left.angle, place_of_gap(d), place_of_x(d));
}
