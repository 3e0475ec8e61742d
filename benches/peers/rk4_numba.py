"""Classical Runge-Kutta of fixed step with event location, compiled by numba.

A step that ends behind a wall is divided there. Newton's method, with bisection as a fallback, finds the length of the first
part; each iteration integrates from the start of the step. Then the rest of the step follows, so strobes stay on the grid. A
turning point inside a step is checked on the step's cubic Hermite polynomial. After an event the root at the start is divided
out. (A contact force that changes sign during contact onset ends meshing, too. This never happens in these cells, as a unit
test checks.)
"""

import math

import numpy as np
from numba import njit

FREE, SUSTAINED, ONSET = 0, 1, 2
EPS = 2.220446049250313e-16


@njit(cache=True, inline="always")
def acceleration(p, mesh, side, z, w, x, v, cos):
    m1, m2, r1, r2, k1, k2, r, k, force, omega, b, e, mesh_speed = p
    contact = mesh * (r * w + k * (z - side * b))
    a1 = (force * cos - r1 * (w + v) - k1 * (z + x) - contact) / m1
    a2 = (contact - r2 * v - k2 * x) / m2
    return a1 - a2, a2


@njit(cache=True, inline="always")
def step(p, mesh, side, z, w, x, v, h, c0, c1, c2):
    a1, b1 = acceleration(p, mesh, side, z, w, x, v, c0)
    w2, v2 = w + 0.5 * h * a1, v + 0.5 * h * b1
    a2, b2 = acceleration(p, mesh, side, z + 0.5 * h * w, w2, x + 0.5 * h * v, v2, c1)
    w3, v3 = w + 0.5 * h * a2, v + 0.5 * h * b2
    a3, b3 = acceleration(p, mesh, side, z + 0.5 * h * w2, w3, x + 0.5 * h * v2, v3, c1)
    w4, v4 = w + h * a3, v + h * b3
    a4, b4 = acceleration(p, mesh, side, z + h * w3, w4, x + h * v3, v4, c2)
    return (
        z + h / 6 * (w + w4 + 2 * (w2 + w3)),
        w + h / 6 * (a1 + a4 + 2 * (a2 + a3)),
        x + h / 6 * (v + v4 + 2 * (v2 + v3)),
        v + h / 6 * (b1 + b4 + 2 * (b2 + b3)),
    )


@njit(cache=True)
def part(p, mesh, side, z, w, x, v, t, h):
    omega = p[9]
    cos = (math.cos(omega * t), math.cos(omega * (t + 0.5 * h)), math.cos(omega * (t + h)))
    return step(p, mesh, side, z, w, x, v, h, cos[0], cos[1], cos[2])


@njit(cache=True, inline="always")
def distance(mode, side, wall, b, z, w):
    """Returns the distance from the wall that ends the flight, and its rate."""
    if mode == FREE:
        return b - wall * z, -wall * w
    if mode == SUSTAINED:
        return side * z - b, side * w
    return b - side * z, -side * w


@njit(cache=True)
def find_ending(p, mode, side, wall, order, z, w, x, v, t, h, z1, w1):
    """Returns a part of the step after which the distance is negative (nan: there is none), and a first guess of the root."""
    b = p[10]
    f0, s0 = distance(mode, side, wall, b, z, w)
    f1, s1 = distance(mode, side, wall, b, z1, w1)
    if order == 0 and f0 <= 0.0:
        return 0.0, 0.0
    rise, s0, s1 = f1 - f0, h * s0, h * s1
    quadratic, cubic = 3 * rise - 2 * s0 - s1, s0 + s1 - 2 * rise
    if f1 < 0.0:
        if order == 0:
            share = f0 / (f0 - f1)
        elif s0 > 0.0:
            share = 2 * s0 / (math.sqrt(max(quadratic**2 - 4 * cubic * s0, 0.0)) - quadratic)
        else:
            share = 0.5
        return h, h * min(max(share, 0.01), 0.99)
    if s1 <= 0.0 or (s0 > 0.0 and order == 0):
        return math.nan, 0.0
    # The minimum of the cubic, in a form without cancellation.
    start = f0 if order == 0 else 0.0
    root = math.sqrt(max(quadratic**2 - 3 * cubic * s0, 0.0))
    if quadratic > 0.0:
        u = -s0 / (quadratic + root)
    elif cubic != 0.0:
        u = (root - quadratic) / (3 * cubic)
    else:
        return math.nan, 0.0
    if not (0.0 < u < 1.0) or start + u * (s0 + u * (quadratic + u * cubic)) >= 0.0:
        return math.nan, 0.0
    mesh = 0.0 if mode == FREE else 1.0
    low = part(p, mesh, side, z, w, x, v, t, u * h)
    if distance(mode, side, wall, b, low[0], low[1])[0] >= 0.0:
        return math.nan, 0.0
    return u * h, 0.5 * u * h


@njit(cache=True)
def locate(p, mode, side, wall, order, z, w, x, v, t, within, guess):
    mesh = 0.0 if mode == FREE else 1.0
    lo, hi, tau = 0.0, within, guess
    for trial in range(100):
        q = part(p, mesh, side, z, w, x, v, t, tau)
        f, rate = distance(mode, side, wall, p[10], q[0], q[1])
        if f > 0.0:
            lo = tau
        else:
            hi = tau
        slope = rate - order * f / tau
        if slope < 0.0 and trial < 20:
            move = -f / slope
            after = tau + move
            a, _ = acceleration(p, mesh, side, q[0], q[1], q[2], q[3], math.cos(p[9] * (t + tau)))
            done = abs(a) * move * move <= 0.5 * EPS * tau * abs(rate) or abs(move) <= 2 * EPS * tau
            if done and 0.0 <= after <= within:
                return after
            if lo < after < hi:
                tau = after
                continue
        tau = 0.5 * (lo + hi)
        if hi - lo <= 2 * EPS * hi:
            return tau
    return math.nan


@njit(cache=True)
def integrate(p, start, periods, steps):
    """Returns the last state in gap coordinates and the last two event times, the latest first."""
    m1, m2, r1, r2, k1, k2, r, k, force, omega, b, e, mesh_speed = p
    h = 2 * math.pi / omega / steps
    cosines = np.cos(2 * math.pi * np.arange(2 * steps + 1) / (2 * steps))
    z, w, x, v = start
    mode, side = FREE, 1.0
    if abs(z) > b:
        mode, side = SUSTAINED, math.copysign(1.0, z)
    # Wall and order of the root at the start of the step.
    origin, order = 0.0, 0
    latest, before = math.nan, math.nan
    lost = (math.nan, math.nan, math.nan, math.nan)
    for _ in range(periods):
        endings = 0
        for n in range(steps):
            offset = 0.0
            while offset < h:
                t, rest = n * h + offset, h - offset
                mesh = 0.0 if mode == FREE else 1.0
                if offset == 0.0:
                    q = step(p, mesh, side, z, w, x, v, h, cosines[2 * n], cosines[2 * n + 1], cosines[2 * n + 2])
                else:
                    q = part(p, mesh, side, z, w, x, v, t, rest)
                wall = 1.0 if mode == FREE else side
                own = order if origin == wall else 0
                within, guess = find_ending(p, mode, side, wall, own, z, w, x, v, t, rest, q[0], q[1])
                if mode == FREE and math.isnan(within):
                    wall = -1.0
                    own = order if origin == wall else 0
                    within, guess = find_ending(p, mode, side, wall, own, z, w, x, v, t, rest, q[0], q[1])
                if math.isnan(within):
                    z, w, x, v = q
                    order = 0
                    break
                tau = 0.0
                if within > 0.0:
                    tau = locate(p, mode, side, wall, own, z, w, x, v, t, within, guess)
                if math.isnan(tau):
                    return lost, (latest, before)
                z, w, x, v = part(p, mesh, side, z, w, x, v, t, tau)
                z, origin, order = wall * b, wall, 1
                offset += tau
                endings += 1
                if endings > 10_000:
                    return lost, (latest, before)
                now = n * h + offset
                if mode == ONSET:
                    mode = SUSTAINED
                    continue
                if mode == SUSTAINED:
                    if tau == 0.0 and side * w > 0.0:
                        continue
                    mode = FREE
                    latest, before = now, latest
                    continue
                # The impact law (5), (6), (22), and the rule of meshing (37).
                closing = wall * w
                cos = math.cos(omega * now)
                if tau == 0.0 and closing <= 0.0:
                    order = 2 if closing == 0.0 else 1
                    continue
                leaving = e * max(closing, 0.0)
                v += wall * (1 + e) * max(closing, 0.0) * m1 / (m1 + m2)
                w = -wall * leaving
                latest, before = now, latest
                order = 1 if leaving > 0.0 else 2
                if leaving <= mesh_speed:
                    free, _ = acceleration(p, 0.0, wall, z, w, x, v, cos)
                    meshing, _ = acceleration(p, 1.0, wall, z, w, x, v, cos)
                    if wall * free > 0.0 and wall * meshing > 0.0:
                        side = wall
                        mode = ONSET if leaving > 0.0 else SUSTAINED
    return (z, w, x, v), (latest, before)
