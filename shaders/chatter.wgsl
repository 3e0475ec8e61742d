// Infinite chatter: without a meshing speed the load presses ever slower impacts together.

// A threshold below this, relative to the walls' distance, is none.
const NO_THRESHOLD: Real = 1e-10;

// Closes an infinite series of impacts by its limit, once it is so short that what the
// formula leaves out is nothing: the gap comes to rest on the wall and meshing starts.
//
// `u` is the leaving speed, with G the pressing acceleration, J its rate of change while the
// gap stays closed and gamma the damping of the gap: the series lasts
// `T (1 - J T / (3 G) - gamma T / 6)`, `T = 2 u / (G (1 - e))`, up to the third order.
// Meanwhile the other coordinate moves as it does with the gap closed.
fn close_chatter(side: u32, u: Real) {
    let e = law.restitution;
    if e >= 1.0 || law.mesh_speed * h > NO_THRESHOLD * (walls[0] - walls[1]) {
        return;
    }
    let sign = sign_of(side);
    let rate = motion.q[3] + kick * motion.q[1];
    let closed = array<Real, 4>(motion.q[0], 0.0, motion.q[2], rate);
    // The wall takes up the acceleration of the gap, and x its share of it.
    let taken = acceleration(here.gap_row, here.share, closed);
    let v_rate = acceleration(here.x_row, here.share, closed) + kick * taken;
    let pressing = sign * taken;
    let whole = 2.0 * u / (pressing * (1.0 - e));
    if !(pressing > 0.0 && whole < closing) {
        return;
    }
    let row = here.gap_row;
    let change = sign * (row[2] * rate + row[3] * v_rate - row[4] * here.angle * motion.phasor[1]);
    let damping = kick * row[3] - row[1];
    let lasts = whole * (1.0 - (change / (3.0 * pressing) + damping * (1.0 / 6.0)) * whole);
    // A series cut by the strobe goes on bouncing until it lies within one stretch.
    if lasts <= 0.0 || lasts >= to_mark(next_mark()) {
        return;
    }
    crossing.pressing = sign * pressing;
    crossing.leaving = sign * u;
    motion.q = array<Real, 4>(0.0, 0.0, closed[2] + lasts * (rate + 0.5 * lasts * v_rate), rate + lasts * v_rate);
    advance_phase(lasts);
    turn_phasor(lasts);
    count_event(side);
    tally.mode = MODE_PRESSED + side;
    tally.order = 2u;
    enter(domain_of(tally.mode));
}
