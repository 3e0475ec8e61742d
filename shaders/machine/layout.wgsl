// Constants of machines: oscillators of one to eight coordinates with several gaps and dry friction.
//
// A domain is a stage, a mode of each gap, and a mode of each element with friction. A lane is in one domain at a time. The host writes the
// equations of motion of all domains to a table (src/gpu/machine.rs). Constants that no file declares, such as WIDTH and AT_WALLS, are
// sizes and places in this table.
//
// A point lists the numbers that forces depend on: displacements and rates in turn, the cosine and the sine of each harmonic, zeros up to a
// multiple of four numbers, and 1. A row lists the factors by which a force or an acceleration depends on these numbers.

struct Flow {
    // Excitation frequency, and length of a step of the grid in time units.
    omega: Real,
    h: Real,
    // Scales of length and speed. `escape`: displacement beyond which the motion has escaped.
    length: Real,
    speed: Real,
    escape: Real,
    // Time in which the fastest harmonic turns by one radian.
    radian: Real,
    // Contact-free motion. Twice the energy of the transient below which no contact follows, negative if no transient is small enough;
    // growth of the transient per period, in octaves; steady state at phase 0.
    contact_free_energy: Real,
    transient_growth: Real,
    steady: array<Real, 16>,
}

struct FlowShape {
    // Steps of the grid per forcing period.
    steps: u32,
    // Places in the table: phasors of the grid, changes of the stage, and everything else.
    phasors: u32,
    schedule: u32,
    machine: u32,
    // Number of changes of the stage.
    changes: u32,
    // Number of elements with friction, and of coordinates.
    elements: u32,
    degrees: u32,
    // The constants COORDINATES, DIM, WIDTH and TERMS. As constants, they would be known bounds of loops; some drivers unroll such loops
    // and take minutes to compile them.
    coordinates: u32,
    dim: u32,
    width: u32,
    terms: u32,
    // Orders of the harmonics.
    orders: array<u32, 8>,
    // Number of right and of left walls of each gap. Kind of the last wall: LAST_*.
    walls: array<u32, 6>,
    kinds: array<u32, 6>,
}

// Kinds of the last wall of a side.
const LAST_NONE: u32 = 0u;
const LAST_ELASTIC: u32 = 1u;
const LAST_PUSHING: u32 = 2u; // its force differs from that of an elastic wall
const LAST_IMPACT: u32 = 3u;
const LAST_RIGID: u32 = 4u;

@group(0) @binding(1) var<storage, read> flows: array<Flow>;
@group(0) @binding(2) var<storage, read> shapes: array<FlowShape>;
@group(0) @binding(3) var<storage, read> table: array<Real>;
// Law of the last right and the last left wall of each gap: restitution (constant, factor and power of the speed) and mesh speed.
@group(0) @binding(4) var<storage, read> laws: array<array<array<Real, 4>, 6>>;

const SIDE_RIGHT: u32 = 0u;
const SIDE_LEFT: u32 = 1u;
const SIDE_NONE: u32 = 2u;

// Modes of a gap. BEYOND plus the number of right walls, or minus the number of left walls, that the gap has passed. For the other modes,
// add the side. ONSET: lasting contact after an impact, with the gap in front of its wall. PRESSED: lasting contact after an impact, with
// the gap behind its wall. OPEN: the gap is behind a wall that only pushes, and the wall's force is 0. STUCK: at rest on a rigid wall.
const BEYOND: u32 = 4u;
const ONSET: u32 = 9u;
const PRESSED: u32 = 11u;
const OPEN: u32 = 13u;
const STUCK: u32 = 15u;

// Modes of friction.
const STICKS: u32 = 0u;
const FORWARD: u32 = 1u;
const BACKWARD: u32 = 2u;

var<private> flow: Flow;
var<private> shape: FlowShape;
// The present modes, and the present stage of the forces.
var<private> gap_modes: array<u32, GAPS>;
var<private> slips: array<u32, ELEMENT_SLOTS>;
var<private> stage: u32;
// For a gap on a wall: the direction from the gap to the wall, and the order of the root of their distance.
var<private> wall_side: array<u32, GAPS>;
var<private> wall_order: array<u32, GAPS>;
// Orders of the roots of pushing forces and of sliding rates; 0 without a root.
var<private> from_force: array<u32, GAPS>;
var<private> from_rate: array<u32, ELEMENT_SLOTS>;
// Bit mask of the elements that have slid since the cycle's start. It is stored in the counter `scanned`, which machines do not
// need.
var<private> slid: u32;
// Bit of `slid`: the columns of the monodromy matrix are new.
const NEW_COLUMNS: u32 = 4u;
// Side of each gap's last event.
var<private> origins: array<u32, GAPS>;

fn fetch_constants() {
    flow = flows[cell.flow_index];
    shape = shapes[cell.flow_index];
    unpack_modes();
}

// The modes of a lane are packed into the numbers `mode`, `origin` and `order` of its counters.
fn unpack_modes() {
    for (var i = 0u; i < GAPS; i++) {
        gap_modes[i] = (tally.mode >> (5u * i)) & 31u;
        origins[i] = (tally.origin >> (2u * i)) & 3u;
        wall_side[i] = (tally.origin >> (6u + 2u * i)) & 3u;
        wall_order[i] = (tally.order >> (3u * i)) & 7u;
        from_force[i] = (tally.order >> (9u + 3u * i)) & 7u;
    }
    for (var i = 0u; i < ELEMENTS; i++) {
        slips[i] = (tally.mode >> (15u + 2u * i)) & 3u;
        from_rate[i] = (tally.order >> (18u + 3u * i)) & 7u;
    }
    stage = tally.mode >> 19u;
    slid = tally.scanned;
}

fn pack_modes() {
    tally.mode = stage << 19u;
    tally.scanned = slid;
    tally.origin = 0u;
    tally.order = 0u;
    for (var i = 0u; i < GAPS; i++) {
        tally.mode |= gap_modes[i] << (5u * i);
        tally.origin |= (origins[i] << (2u * i)) | (wall_side[i] << (6u + 2u * i));
        tally.order |= (wall_order[i] << (3u * i)) | (from_force[i] << (9u + 3u * i));
    }
    for (var i = 0u; i < ELEMENTS; i++) {
        tally.mode |= slips[i] << (15u + 2u * i);
        tally.order |= from_rate[i] << (18u + 3u * i);
    }
}

fn sign_of(side: u32) -> Real {
    return select(Real(-1.0), Real(1.0), side == SIDE_RIGHT);
}

fn number(place: u32) -> Real {
    return table[shape.machine + place];
}

fn wall_count(gap: u32, side: u32) -> u32 {
    return shape.walls[2u * gap + side];
}

fn last_kind(gap: u32, side: u32) -> u32 {
    return shape.kinds[2u * gap + side];
}

// Position of a wall, numbered from the inside.
fn wall_at(gap: u32, side: u32, nth: u32) -> Real {
    return number(AT_WALLS + (2u * gap + side) * WALLS + nth);
}

fn last_wall_at(gap: u32, side: u32) -> Real {
    return wall_at(gap, side, wall_count(gap, side) - 1u);
}

// Stiffness, damping and preload of a wall in the present stage.
fn spring(gap: u32, side: u32, nth: u32) -> array<Real, 3> {
    let place = AT_SPRINGS + 3u * (((stage * GAPS + gap) * 2u + side) * WALLS + nth);
    return array<Real, 3>(number(place), number(place + 1u), number(place + 2u));
}

// Number of walls of a side behind which the motion can continue.
fn passable(gap: u32, side: u32) -> u32 {
    return wall_count(gap, side) - select(0u, 1u, last_kind(gap, side) >= LAST_IMPACT);
}

// Number of walls of a side whose springs may act.
fn reach_of(gap: u32, side: u32) -> u32 {
    return wall_count(gap, side) - select(0u, 1u, last_kind(gap, side) == LAST_RIGID);
}

// Mode of a gap beyond `count` walls of a side.
fn beyond_walls(side: u32, count: u32) -> u32 {
    return select(BEYOND - count, BEYOND + count, side == SIDE_RIGHT);
}

// Mode of a gap in front of the last wall of a side.
fn before_last(gap: u32, side: u32) -> u32 {
    return beyond_walls(side, wall_count(gap, side) - 1u);
}

// Place in the table of the domain that has these modes in the present stage.
fn domain_of(modes: array<u32, GAPS>, slips_of: array<u32, ELEMENT_SLOTS>) -> u32 {
    var of_gap = modes;
    var of_element = slips_of;
    var index = stage;
    for (var gap = 0u; gap < GAPS; gap++) {
        let left = reach_of(gap, SIDE_LEFT);
        let right = reach_of(gap, SIDE_RIGHT);
        let mode = of_gap[gap];
        let side = (mode + 1u) % 2u;
        var code = left + mode - BEYOND;
        if mode >= STUCK {
            // The place of a rigid left wall follows that of a rigid right wall.
            let is_second = side == SIDE_LEFT && last_kind(gap, SIDE_RIGHT) == LAST_RIGID;
            code = left + right + 1u + select(0u, 1u, is_second);
        } else if mode >= OPEN {
            code = select(1u, left + right - 1u, side == SIDE_RIGHT);
        } else if mode >= ONSET {
            code = select(0u, left + right, side == SIDE_RIGHT);
        }
        let rigid = select(0u, 1u, last_kind(gap, SIDE_RIGHT) == LAST_RIGID) + select(0u, 1u, last_kind(gap, SIDE_LEFT) == LAST_RIGID);
        index = index * (left + right + 1u + rigid) + code;
    }
    for (var i = 0u; i < ELEMENTS; i++) {
        if i < shape.elements {
            index = index * 3u + of_element[i];
        }
    }
    return AT_DOMAINS + index * DOMAIN;
}

fn present_domain() -> u32 {
    return domain_of(gap_modes, slips);
}

// Side of a mode; SIDE_NONE between the walls.
fn contact_of(mode: u32) -> u32 {
    if mode >= ONSET {
        return (mode + 1u) % 2u;
    }
    return select(select(SIDE_LEFT, SIDE_RIGHT, mode > BEYOND), SIDE_NONE, mode == BEYOND);
}
