"""heyoka's adaptive Taylor integrator with terminal events.

One integrator carries all three domains: two parameters switch the contact force on and say on
which side. The walls are terminal events whose callback applies the contact law and goes on,
so that heyoka's own cool-down keeps an event from being found twice. (Pressing that ceases
inside the dip at the start of meshing ends it, too; the cells never do that, a unit test says.)
"""

import math

import heyoka as hy

NAMES = ("m1", "m2", "r1", "r2", "k1", "k2", "r", "k", "F", "omega", "b", "e", "mesh_speed")
MESH, SIDE = len(NAMES), len(NAMES) + 1

# Callbacks are copied into the integrator, functions by reference: what they note goes here.
events = []


def contact_law(ta, wall):
    m1, m2, r1, r2, k1, k2, r, k, force, omega, b, e, mesh_speed = ta.pars[:13]
    z, w, x, v = ta.state
    closing = wall * w
    leaving = e * max(closing, 0.0)
    v += wall * (1 + e) * max(closing, 0.0) * m1 / (m1 + m2)
    w = -wall * leaving
    ta.state[:] = (wall * b, w, x, v)
    if leaving > mesh_speed:
        return
    x1, v1 = wall * b + x, w + v
    a1 = (force * math.cos(omega * ta.time) - r1 * v1 - k1 * x1) / m1
    a2 = (-r2 * v - k2 * x) / m2
    damping = r * w * (1 / m1 + 1 / m2)
    if wall * (a1 - a2) > 0.0 and wall * (a1 - a2 - damping) > 0.0:
        ta.pars[MESH], ta.pars[SIDE] = 1.0, wall


def at_wall(ta, wall, direction):
    """A wall is crossed; `direction` is +1 into it."""
    if ta.pars[MESH] == 0.0:
        if direction > 0:
            events.append(ta.time)
            contact_law(ta, wall)
    elif direction < 0 and ta.pars[SIDE] == wall:
        ta.pars[MESH] = 0.0
        ta.state[0] = wall * ta.pars[NAMES.index("b")]
        events.append(ta.time)
    return True


def at_right(ta, sign):
    return at_wall(ta, 1.0, sign)


def at_left(ta, sign):
    return at_wall(ta, -1.0, -sign)


class Integrator:
    """Compiled once per tolerance."""

    def __init__(self, tolerance):
        z, w, x, v = hy.make_vars("z", "w", "x", "v")
        m1, m2, r1, r2, k1, k2, r, k, force, omega, b = (hy.par[i] for i in range(11))
        contact = hy.par[MESH] * (r * w + k * (z - hy.par[SIDE] * b))
        a1 = (force * hy.cos(omega * hy.time) - r1 * (w + v) - k1 * (z + x) - contact) / m1
        a2 = (contact - r2 * v - k2 * x) / m2
        self.ta = hy.taylor_adaptive(
            [(z, w), (w, a1 - a2), (x, v), (v, a2)],
            [0.0] * 4,
            pars=[1.0] * (len(NAMES) + 2),
            tol=tolerance,
            t_events=[hy.t_event(z - b, callback=at_right), hy.t_event(z + b, callback=at_left)],
        )

    def integrate(self, parameters, start, until):
        """The last state in gap coordinates; event times are in `events`."""
        events.clear()
        ta = self.ta
        beyond = abs(start[0]) > parameters[NAMES.index("b")]
        ta.pars[:] = (*parameters, float(beyond), 1.0 if start[0] > 0 else -1.0)
        ta.time = 0.0
        ta.state[:] = start
        ta.reset_cooldowns()
        outcome = ta.propagate_until(until)[0]
        return ta.state.tolist() if outcome == hy.taylor_outcome.time_limit else [float("nan")] * 4
