"""heyoka's adaptive Taylor integrator with terminal events.

One integrator carries all three domains: two parameters switch the contact force on and say on
which side. The walls are terminal events whose callback applies the contact law and goes on,
so that heyoka's own cool-down keeps an event from being found twice. (Pressing that ceases
during contact onset ends meshing, too; the cells never do that, a unit test says.)

Callbacks are Python. `Steps` has none: it takes as many steps with its walls out of reach, so that
what is left is compiled code, one lane at a time or several in the processor's wide registers.
"""

import math

import heyoka as hy
import numpy as np

NAMES = ("m1", "m2", "r1", "r2", "k1", "k2", "r", "k", "F", "omega", "b", "e", "mesh_speed")
MESH, SIDE = len(NAMES), len(NAMES) + 1

# What callbacks work on: heyoka copies them into the integrator, but functions by reference.
# Views of its memory and plain floats, since attributes and numpy scalars cost more than the law.
events = []
now = {}


def contact_law(wall, t):
    m1, m2, r1, r2, k1, k2, r, k, force, omega, b, e, mesh_speed = now["parameters"]
    _, w, x, v = now["state"].tolist()
    closing = max(wall * w, 0.0)
    leaving = e * closing
    v += wall * (1 + e) * closing * m1 / (m1 + m2)
    w = -wall * leaving
    now["state"][:] = (wall * b, w, x, v)
    if leaving > mesh_speed:
        return
    a1 = (force * math.cos(omega * t) - r1 * (w + v) - k1 * (wall * b + x)) / m1
    a2 = (-r2 * v - k2 * x) / m2
    damping = r * w * (1 / m1 + 1 / m2)
    if wall * (a1 - a2) > 0.0 and wall * (a1 - a2 - damping) > 0.0:
        mesh(wall)


def mesh(wall):
    """The teeth mesh on a side, +1 or -1, or not at all: 0."""
    now["mesh"] = wall
    now["pars"][MESH], now["pars"][SIDE] = abs(wall), wall


def at_wall(ta, wall, into):
    """A wall is crossed, into it or out of it."""
    if now["mesh"] == 0.0:
        if into:
            t = ta.time
            events.append(t)
            contact_law(wall, t)
    elif not into and now["mesh"] == wall:
        mesh(0.0)
        now["state"][0] = wall * now["parameters"][10]
        events.append(ta.time)
    return True


def at_right(ta, sign):
    return at_wall(ta, 1.0, sign > 0)


def at_left(ta, sign):
    return at_wall(ta, -1.0, sign < 0)


def motion():
    """The equations in gap coordinates, and what is zero on the right and on the left wall."""
    z, w, x, v = hy.make_vars("z", "w", "x", "v")
    m1, m2, r1, r2, k1, k2, r, k, force, omega, b = (hy.par[i] for i in range(11))
    contact = hy.par[MESH] * (r * w + k * (z - hy.par[SIDE] * b))
    a1 = (force * hy.cos(omega * hy.time) - r1 * (w + v) - k1 * (z + x) - contact) / m1
    a2 = (contact - r2 * v - k2 * x) / m2
    return [(z, w), (w, a1 - a2), (x, v), (v, a2)], (z - b, z + b)


class Integrator:
    """Compiled once per tolerance."""

    def __init__(self, tolerance):
        equations, (right, left) = motion()
        self.ta = hy.taylor_adaptive(
            equations,
            [0.0] * 4,
            pars=[1.0] * (len(NAMES) + 2),
            tol=tolerance,
            t_events=[hy.t_event(right, callback=at_right), hy.t_event(left, callback=at_left)],
        )

    def integrate(self, parameters, start, until):
        """The last state in gap coordinates; event times are in `events`, the count of steps in `self.steps`."""
        events.clear()
        ta = self.ta
        now.update(parameters=parameters, state=ta.state, pars=ta.pars)
        now["pars"][: len(NAMES)] = parameters
        beyond = abs(start[0]) > parameters[NAMES.index("b")]
        mesh(math.copysign(1.0, start[0]) if beyond else 0.0)
        ta.time = 0.0
        now["state"][:] = start
        ta.reset_cooldowns()
        outcome, _, _, self.steps, *_ = ta.propagate_until(until)
        return ta.state.tolist() if outcome == hy.taylor_outcome.time_limit else [math.nan] * 4


class Steps:
    """As many compiled steps of free motion, walls out of reach but watched all the same: no callback runs."""

    # Half the backlash, and a time, far beyond what any lane comes to.
    BACKLASH, LATE = 1e3, 1e6

    def __init__(self, tolerance, batch):
        """`batch` lanes side by side; 1 for the scalar integrator."""
        equations, walls = motion()
        shape, self.batch = (batch,) if batch > 1 else (), batch
        event = hy.t_event_batch if batch > 1 else hy.t_event
        self.ta = (hy.taylor_adaptive_batch if batch > 1 else hy.taylor_adaptive)(
            equations,
            np.zeros((4, *shape)),
            pars=np.ones((len(NAMES) + 2, *shape)),
            tol=tolerance,
            t_events=[event(wall) for wall in walls],
        )

    def integrate(self, parameters, starts, steps):
        """Whether all lanes take so many steps; of parameters and starts each lane has a column, or a number."""
        ta = self.ta
        ta.pars[: len(NAMES)] = parameters
        ta.pars[NAMES.index("b")] = self.BACKLASH
        ta.pars[MESH:] = 0.0
        ta.state[:] = starts
        ta.reset_cooldowns()
        if self.batch == 1:
            ta.time = 0.0
            return ta.propagate_until(self.LATE, max_steps=steps)[0] == hy.taylor_outcome.step_limit
        ta.set_time(0.0)
        ta.propagate_until(self.LATE, max_steps=steps)
        return all(outcome == hy.taylor_outcome.step_limit for outcome, *_ in ta.propagate_res)
