// Constants of a flow of an oscillator with one gap, as lanes read them.

// A linear domain in units of its own step: time tau = t / h, rates per step.
struct Domain {
    // Propagator of one step minus the identity. Rows: gap, its rate, x, its rate. Columns: these four, then cos,
    // sin, 1.
    step: array<Real, 28>,
    // Accelerations of the gap and of x: factors of gap, rate, x, rate, cos, 1, sin. Only variants with SINE read the last.
    gap_row: array<Real, 7>,
    x_row: array<Real, 7>,
    // Quadratic form in the n-th derivatives of the motion. It bounds the square of the (n+1)-th derivative of the gap. Factors of rate^2,
    // rate * x_rate, x_rate^2, gap^2, gap * x, x^2.
    energy: array<Real, 6>,
    // Growth of this bound per step: the part that the force adds, for n = 5, and the factor by negative damping and stiffness.
    growth: Real,
    swell: Real,
    // Forcing angle of one step; tan of half of it; sin of it.
    angle: Real,
    turn_half: Real,
    turn_sin: Real,
    // Power of the dampers as a quadratic form in the rates, in the units of measure.wgsl: factors of rate^2, rate * x_rate, x_rate^2.
    damping: array<Real, 3>,
    // Free steps per step of this domain: a power of two, at most 1.
    share: Real,
    // Steps of this domain per free step.
    substeps: Real,
}

// Constants that lanes share if they differ only in the contact law. Each stage and each interval between walls has such a struct.
struct Flow {
    // Free motion, meshing on the right, meshing on the left. Meshing domains measure the gap from their wall.
    domains: array<Domain, 3>,
    // Positions of the right and of the left wall.
    walls: array<Real, 2>,
    // Change of the rate of x if the contact impulse reduces the gap's rate by 1.
    kick: Real,
    // Length of a free step in time units.
    h: Real,
    // Scale of length: with two first walls, half of their distance.
    length: Real,
    // Unit of speeds: the scale of length times the rate of free motion, per free step.
    speed: Real,
    // Longest duration of an infinite series of impacts that its limit replaces, in free steps.
    closing: Real,
    // Motion has escaped if the sum of the sizes of gap and x exceeds this. Negative if only the force can raise the energy.
    escape: Real,
    // Contact-free motion. `steady`: steady state at phase 0, in lane units. `contact_free_size`: if the transient is smaller than this by
    // the free domain's energy form, no contact will follow; negative if no transient is small enough. `transient_growth`: growth of the
    // transient per period, in octaves.
    steady: array<Real, 4>,
    contact_free_size: Real,
    transient_growth: Real,
    // Acceleration of a gap that rests on the right and on the left wall: a `gap_row` with the gap measured from that wall.
    pressing: array<array<Real, 7>, 2>,
    // Where the motion enters an elastic wall, tangent vectors change: change of their rates of gap and x per displacement of their gap.
    damper: array<array<Real, 2>, 2>,
    // Contact force of the right and of the left wall per displacement and per rate of the gap, in the units of
    // measure.wgsl.
    springs: array<array<Real, 2>, 2>,
    // Both displacements of the model as factors of gap and x.
    displacements: array<array<Real, 2>, 2>,
    // Contact force of the walls that the gap has passed, positive to the left: factors of gap, rate and 1, in the units of
    // measure.wgsl.
    held: array<Real, 3>,
    // Force of a wall that only pushes, positive inside the interval that it bounds: factors of gap, rate and 1, in the units of
    // measure.wgsl.
    push: array<Real, 3>,
    // Changes of the accelerations of gap and x by the preload of the right and of the left wall, where the motion enters the wall.
    preload: array<array<Real, 2>, 2>,
}

// Whole numbers of a flow.
struct FlowShape {
    // Free steps per forcing period.
    steps: u32,
    // Index in `pairs` of its first phasor.
    phasors: u32,
    // Number of displacements. With one displacement, x rests at 0.
    degrees: u32,
    // 1 if contact-free motion also requires that x rests at 0.
    must_rest: u32,
    // CONTACT_* of the right and of the left wall.
    contacts: array<u32, 2>,
    // Index in `pairs` of its harmonics beside the first (harmonics.wgsl), and their number.
    harmonics: u32,
    harmonic_count: u32,
    // Index in `pairs` of the changes of its stage (stages.wgsl), and their number; 0 if there are none.
    schedule: u32,
    changes: u32,
    // Flows of the intervals behind the right and behind the left wall, or NO_FLOW (intervals.wgsl).
    behind: array<u32, 2>,
}

// Contact law of the right and of the left wall: restitution, and the largest leaving speed at which contact lasts under a pressing load.
struct Law {
    restitution: array<Real, 2>,
    mesh_speed: array<Real, 2>,
}

@group(0) @binding(1) var<storage, read> flows: array<Flow>;
@group(0) @binding(2) var<storage, read> shapes: array<FlowShape>;
@group(0) @binding(3) var<storage, read> pairs: array<array<Real, 2>>;
@group(0) @binding(4) var<storage, read> laws: array<Law>;

// Modes of the motion. For all modes except the first, add the side: mode + SIDE_*.
const MODE_FREE: u32 = 0u;
const MODE_SUSTAINED: u32 = 1u;
const MODE_ONSET: u32 = 3u;
const MODE_STUCK: u32 = 5u;

const SIDE_RIGHT: u32 = 0u;
const SIDE_LEFT: u32 = 1u;
const SIDE_NONE: u32 = 2u;
