// Elastic walls: there is no impact, and the motion continues behind the wall.

// Returns the kind of the wall on a side.
fn contact_at(side: u32) -> u32 {
    return select(shape.contacts[1], shape.contacts[0], side == SIDE_RIGHT);
}

fn is_elastic(side: u32) -> bool {
    return KINDS && contact_at(side) == CONTACT_ELASTIC;
}

// Free motion reaches an elastic wall. If the gap is at rest there, the first nonzero derivative decides on which side it continues. The
// vector fields of both sides differ by the damper's force alone, which is zero at rest.
fn enter_elastic(side: u32) -> Jump {
    let closing = sign_of(side) * motion.q[1];
    var jump = Jump(false, MODE_FREE, ALONG_GAP, motion.q[1], 1.0, 0.0, 0.0);
    let is_pressed = closing == 0.0 && presses(present_pull(), side, motion.q);
    if closing > 0.0 || is_pressed {
        jump.event = true;
        pass_damper(side, 1.0);
        jump.mode = MODE_SUSTAINED + side;
        motion.q[0] = 0.0;
    }
    return jump;
}

// Whether a gap that has returned to its elastic wall is at rest and pressed there. If so, it stays behind the wall.
fn stays_behind(side: u32) -> bool {
    if sign_of(side) * motion.q[1] < 0.0 {
        return false;
    }
    let rest = array<Real, 4>(0.0, 0.0, motion.q[2], motion.q[3]);
    return presses(present_pull(), side, rest);
}

// Sets the change of tangent vectors across a wall with a damper, inwards (`way` = 1) or outwards (-1). The fields of both sides differ by
// the damper's force alone, which is proportional to the rate. The rate cancels in the saltation matrix, so grazing is no special case.
fn pass_damper(side: u32, way: Real) {
    if VECTORS > 0u {
        let damper = flows[cell.flow_index].damper[side];
        crossing.is_smooth = true;
        crossing.jolt = array<Real, 2>(way * damper[0], way * damper[1]);
    }
}
