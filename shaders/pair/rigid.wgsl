// Rigid walls: a gap that comes to rest under a pressing load sticks until the load pulls it off.
//
// While a gap sticks, it stays on the wall, and x moves in the domain of that side. In this domain the wall's force cancels the gap's
// acceleration. Contact ends when the cancelled acceleration changes its sign; its series takes the place of the gap's series.

fn is_rigid(side: u32) -> bool {
    return KINDS && contact_at(side) == CONTACT_RIGID;
}

fn sticks() -> bool {
    return KINDS && tally.mode >= MODE_STUCK;
}

// Whether the motion is in the contact onset: the gap has left its wall slowly and is pressed back.
fn is_onset() -> bool {
    return tally.mode >= MODE_ONSET && !sticks();
}

// Returns the constants of the accelerations of x and of a gap that rests on its wall.
fn stuck_pull(side: u32) -> Pull {
    let behind = meshing_pull(side);
    return Pull(flows[cell.flow_index].pressing[side], behind.x_row, behind.share, behind.angle, PLACE_OF_PRESSING + side, behind.x_place);
}

// Makes a gap that has come to rest stick if the load presses it: its rate becomes 0. Otherwise returns no event.
fn stick(side: u32) -> Jump {
    var jump = Jump(false, MODE_FREE, ALONG_GAP, motion.q[1], 0.0, kick, 0.0);
    let removed = sign_of(side) * max(sign_of(side) * motion.q[1], Real(0.0));
    let rest = array<Real, 4>(0.0, 0.0, motion.q[2], motion.q[3] + kick * removed);
    if presses(stuck_pull(side), side, rest) {
        jump.event = true;
        jump.mode = MODE_STUCK + side;
        motion.q = rest;
    }
    return jump;
}

// Releases the gap where the load pulls it off the wall. It leaves with zero rate and zero acceleration.
fn let_go(side: u32) -> Jump {
    motion.q[0] = walls[side];
    motion.q[1] = 0.0;
    if VECTORS > 0u {
        crossing.is_smooth = true;
    }
    return Jump(true, MODE_FREE, ALONG_GAP, 0.0, 1.0, 0.0, 0.0);
}

// Returns the order of the root of the pressing acceleration at the start of sticking: 1 if the load is balanced.
fn stuck_order(side: u32) -> u32 {
    let pull = stuck_pull(side);
    let pressing = acceleration(pull.gap_row, pull.share, motion.q, pull.gap_place);
    return select(0u, 1u, abs(pressing) <= balance(pull.gap_row, pull.share, motion.q, pull.gap_place));
}

// Expands the motion of x while the gap sticks. The series of the acceleration that the wall cancels replaces the gap's series.
fn expand_stuck() {
    let side = side_of(tally.mode);
    let p = flows[cell.flow_index].pressing[side];
    expand_harmonics(PLACE_OF_PRESSING + side, place_of_x(1u + side));
    let r = here.x_row;
    // Derivatives of order k and k + 1, and the reciprocal of k!.
    var x = motion.q[2];
    var v = here.share * motion.q[3];
    var part: Real = 1.0;
    var force = Forcing(forcing(p), forcing(r));
    var load = vec2<Real>(p[5], r[5]);
    let turn = -here.angle * here.angle;
    //% for k in 0..TERMS
    {
        x_terms[$k] = part * x;
        gap_terms[$k] = part * (p[2] * x + (p[3] * v + with_term(force.gap.x + load.x, gap_force[$k])));
        let b = r[2] * x + (r[3] * v + with_term(force.x.x + load.y, x_force[$k]));
        part *= 1.0 / $(k+1).0;
        x = v;
        v = b;
        load = vec2<Real>(0.0, 0.0);
        force = Forcing(vec2<Real>(force.gap.y, turn * force.gap.x), vec2<Real>(force.x.y, turn * force.x.x));
    }
    //% end
    if tally.order == 1u {
        gap_terms[0] = 0.0;
    }
}

// Returns a bound on the sixth derivative of the acceleration that the wall cancels, over the step. This acceleration is a sum of x, its
// rate and the forcing. The energy of the differentiated motion bounds their derivatives.
fn stuck_bound() -> Real {
    let side = side_of(tally.mode);
    let place = place_of_x(1u + side);
    let p = flows[cell.flow_index].pressing[side];
    let square = here.angle * here.angle;
    let fifth = square * square * here.angle;
    let force = with_sine(abs(here.x_row[4]), abs(here.x_row[6]), 1.0) * fifth;
    let growth = with_bound(force, place, 5u);
    let later_growth = with_bound(force * here.angle, place, 6u);
    let x = here.swell * (growth + derivative_bound(0.0, 0.0, 120.0 * x_terms[5], 720.0 * x_terms[6]));
    let v = here.swell * (later_growth + derivative_bound(0.0, 0.0, 720.0 * x_terms[6], 5040.0 * x_terms[7]));
    let pressing = with_sine(abs(p[4]), abs(p[6]), 1.0) * (fifth * here.angle);
    return (abs(p[2]) * x + abs(p[3]) * v) + with_bound(pressing, PLACE_OF_PRESSING + side, 6u);
}
