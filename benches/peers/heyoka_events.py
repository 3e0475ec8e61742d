"""heyoka's adaptive Taylor integrator with terminal events.

One integrator has all three domains: two parameters switch the contact force on and select its wall. The walls are terminal
events whose callback applies the contact law and continues, so heyoka's own cool-down prevents that an event is found twice.
(A contact force that changes sign during contact onset ends meshing, too. This never happens in these cells, as a unit test
checks.)

Callbacks are Python. `Steps` has no callbacks: it takes as many steps with its walls out of reach, so only compiled code runs,
for one lane at a time or for several in the processor's wide registers.
"""

import math

import heyoka as hy
import numpy as np

NAMES = ("m1", "m2", "r1", "r2", "k1", "k2", "r", "k", "F", "omega", "b", "e", "mesh_speed")
MESH, SIDE = len(NAMES), len(NAMES) + 1

# Data of the callbacks: heyoka copies callable objects into the integrator, but not functions. These are views of its memory
# and plain floats, because attributes and numpy scalars would cost more time than the contact law.
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
    """Sets the wall on which the teeth mesh, +1 or -1, or 0 for free motion."""
    now["mesh"] = wall
    now["pars"][MESH], now["pars"][SIDE] = abs(wall), wall


def at_wall(ta, wall, into):
    """Handles a crossing of a wall, into it or out of it."""
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
    """Returns the equations in gap coordinates, and functions that are zero on the right and on the left wall."""
    z, w, x, v = hy.make_vars("z", "w", "x", "v")
    m1, m2, r1, r2, k1, k2, r, k, force, omega, b = (hy.par[i] for i in range(11))
    contact = hy.par[MESH] * (r * w + k * (z - hy.par[SIDE] * b))
    a1 = (force * hy.cos(omega * hy.time) - r1 * (w + v) - k1 * (z + x) - contact) / m1
    a2 = (contact - r2 * v - k2 * x) / m2
    return [(z, w), (w, a1 - a2), (x, v), (v, a2)], (z - b, z + b)


class Integrator:
    """An integrator with events, compiled once per tolerance."""

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
        """Returns the last state in gap coordinates. Writes event times to `events` and the count of steps to `self.steps`."""
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
    """Compiled steps of free motion. The walls are checked but out of reach, so no callback runs."""

    # Half the backlash and the end time, far larger than any lane needs.
    BACKLASH, LATE = 1e3, 1e6

    def __init__(self, tolerance, batch):
        """`batch` lanes run together; 1 selects the scalar integrator."""
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
        """Takes `steps` steps of all lanes and returns whether all took them. Each lane has a column of parameters and starts."""
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
