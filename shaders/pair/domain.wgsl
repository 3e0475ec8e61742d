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
    here = flows[cell.flow_index].domains[d];
}

// Propagator of one step in the domain that governs the motion. Careful passes do not use it.
fn propagator() -> array<Real, 28> {
    return flows[cell.flow_index].domains[domain_of(tally.mode)].step;
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
    let f = cell.flow_index;
    return Pull(flows[f].domains[d].gap_row, flows[f].domains[d].x_row, flows[f].domains[d].share, flows[f].domains[d].angle, place_of_gap(d), place_of_x(d));
}
