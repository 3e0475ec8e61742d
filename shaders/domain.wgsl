// Constants in reach of a lane. Storage is far away, so what every pass needs lies in
// registers; which domain governs the motion changes at events alone.

// The domain that governs the motion.
var<private> here: Domain;
var<private> walls: array<Real, 2>;
var<private> kick: Real;
var<private> h: Real;
var<private> speed: Real;
var<private> closing: Real;
var<private> law: Law;
var<private> shape: FlowShape;

// All three, where the variant keeps copies: software drivers gather from storage lane by
// lane, which costs them more than the arithmetic. On a graphics device lanes of one flow
// read the same address at once, and the copies would spill.
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
    if KEEP {
        free = flows[f].domains[0];
        on_right = flows[f].domains[1];
        on_left = flows[f].domains[2];
    }
    enter(domain_of(tally.mode));
}

// The law at a wall. Arrays that are indexed would not stay in registers.
fn restitution(side: u32) -> Real {
    return select(law.restitution[1], law.restitution[0], side == SIDE_RIGHT);
}

// Leaving speed per free step at or below which a pressed contact lasts.
fn mesh_speed(side: u32) -> Real {
    return select(law.mesh_speed[1], law.mesh_speed[0], side == SIDE_RIGHT) * h;
}

// Domain `d` governs from here on.
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

// The propagator of one step in the domain that governs. Careful passes do without it.
fn propagator() -> array<Real, 28> {
    if !KEEP {
        return flows[cell.flow_index].domains[domain_of(tally.mode)].step;
    }
    return here.step;
}

// What accelerations take.
struct Pull {
    gap_row: array<Real, 6>,
    x_row: array<Real, 6>,
    share: Real,
    angle: Real,
}

// Those of meshing on a side.
fn meshing_pull(side: u32) -> Pull {
    if !KEEP {
        let f = cell.flow_index;
        let d = 1u + side;
        return Pull(flows[f].domains[d].gap_row, flows[f].domains[d].x_row, flows[f].domains[d].share, flows[f].domains[d].angle);
    }
    if side == SIDE_RIGHT {
        return Pull(on_right.gap_row, on_right.x_row, on_right.share, on_right.angle);
    }
    return Pull(on_left.gap_row, on_left.x_row, on_left.share, on_left.angle);
}
