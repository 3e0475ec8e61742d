// Walls that only push, and walls with a preload. Behind such a wall the motion is in an interval without another wall. Behind a wall that
// only pushes there are two intervals, for closed and for open contact. In both, the distance to the missing wall is replaced by the force
// of spring, damper and preload: contact ends where this force falls to 0, and begins where it rises above 0. The rules are those of the
// reference (dynamics/src/pair/pushing.rs).

// Flag of open contact in `tally.interval`. The other bits are the number of the interval in front of this wall; between the first walls,
// they contain the side.
const OPEN: u32 = 256u;

fn is_open() -> bool {
    return PUSHING && (tally.interval & OPEN) != 0u;
}

// Whether the force of a wall can end the motion in this interval.
fn watches_force() -> bool {
    if !PUSHING || tally.interval == 0u {
        return false;
    }
    let push = flows[cell.flow_index].push;
    return push[0] != 0.0 || push[1] != 0.0 || push[2] != 0.0;
}

// Whether the force bounds a side of the present interval, where no wall bounds it.
fn is_bounded_by_force(side: u32) -> bool {
    return watches_force() && side == side_of_interval();
}

// Returns how far the force is from 0, positive inside the interval.
fn force_inside(q: array<Real, 4>) -> Real {
    let push = flows[cell.flow_index].push;
    return push[0] * q[0] + push[1] * q[1] + push[2];
}

// Returns the sum of the sizes of the force's terms. Its rounding error is relative to this sum.
fn size_of_force(q: array<Real, 4>) -> Real {
    let push = flows[cell.flow_index].push;
    return abs(push[0] * q[0]) + abs(push[1] * q[1]) + abs(push[2]);
}

// Returns the force that bounds the interval, its slope and its curvature at `tau` of the expansion. `start` is the force at the expansion
// point, and `z` the jet of the gap.
fn force_jet(start: Real, z: vec3<Real>, tau: Real) -> vec3<Real> {
    let push = flows[cell.flow_index].push;
    let jerk = pressing_jet(tau).y;
    return vec3<Real>(
        start + (push[0] * z.x + push[1] * (z.y - gap_terms[1])),
        push[0] * z.y + push[1] * z.z,
        push[0] * z.z + push[1] * jerk,
    );
}

// Returns a bound on the sixth derivative of the force that bounds the interval, from bounds on the sixth derivatives of the gap and of its
// rate.
fn force_bound(gap: Real, rate: Real) -> Real {
    let push = flows[cell.flow_index].push;
    return abs(push[0]) * gap + abs(push[1]) * rate;
}

// Whether a wall has a preload.
fn has_preload(side: u32) -> bool {
    let preload = flows[cell.flow_index].preload[side];
    return PUSHING && (preload[0] != 0.0 || preload[1] != 0.0);
}

// The force of a wall that only pushes changes its sign: contact begins or ends. State and vector field are continuous.
fn change_force() -> Jump {
    if VECTORS > 0u {
        crossing.is_smooth = true;
    }
    if MEASURE {
        measure_push(flows[cell.flow_index].push);
    }
    return Jump(true, MODE_PASSING, ALONG_GAP, 0.0, 1.0, 0.0, 0.0);
}

// Measures the energy of the wall's spring and preload, of these forces, if contact ends or begins behind the wall.
fn measure_push(push: array<Real, 3>) {
    let side = side_of_interval();
    let at = walls[1u - side];
    let sign = select(Real(1.0), Real(-1.0), is_open());
    let depth = abs(motion.q[0] - at);
    let preload = sign * (push[2] + push[0] * at);
    add(SUM_RELEASED, sign * (abs(push[0]) * depth + 2.0 * preload) * depth);
}

// Enters open or closed contact where the force has the wrong sign for the present interval. `before` are the forces of the wall before a
// change of the stage.
fn settle_force(before: array<Real, 3>) {
    if watches_force() && force_inside(motion.q) < 0.0 {
        let side = side_of_interval();
        if MEASURE {
            var push = before;
            if is_open() {
                push = flows[cell.flow_index].push;
            }
            measure_push(push);
        }
        count_event(side);
        pass_wall(side);
        tally.order = 0u;
    }
}
