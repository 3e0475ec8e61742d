"""Frequency response of `z'' + 2 zeta z' + g(z) = F_m + F_a omega^2 cos(omega t)` by harmonic balance.

g is elastic backlash: 0 within +-1, with slope 1 outside (Kahraman and Singh 1990). The balance uses time samples (alternating
frequency and time) and is continued in omega by pseudo-arclength. At a fold the tangent's component in omega changes sign. The
method has no events, flights or strobes, so it is independent of rattlemap. Usage: python harmonic_balance.py > ../../tests/gallery/data/backlash.csv
"""

import numpy as np

ZETA, MEAN, ALTERNATING = 0.05, 0.1, 0.05
HARMONICS, SAMPLES = 40, 1024

phase = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
orders = np.arange(1, HARMONICS + 1)
# Columns: mean, cosines, sines.
basis = np.hstack([np.ones((SAMPLES, 1)), np.cos(np.outer(phase, orders)), np.sin(np.outer(phase, orders))])
weights = np.full(2 * HARMONICS + 1, 2.0 / SAMPLES)
weights[0] = 1.0 / SAMPLES


def balance(u, omega):
    """Returns the residual and its derivatives with respect to the coefficients and omega."""
    z = basis @ u
    restoring = np.where(z > 1, z - 1, np.where(z < -1, z + 1, 0.0))
    slope = (np.abs(z) > 1).astype(float)
    cosines, sines = u[1 : HARMONICS + 1], u[HARMONICS + 1 :]
    w = orders * omega
    linear = np.concatenate([[0.0], -(w**2) * cosines + 2 * ZETA * w * sines, -(w**2) * sines - 2 * ZETA * w * cosines])
    residual = linear + weights * (basis.T @ restoring)
    residual[0] -= MEAN
    residual[1] -= ALTERNATING * omega**2
    by_u = weights[:, None] * (basis.T @ (slope[:, None] * basis))
    i, c, s = np.arange(HARMONICS), 1 + np.arange(HARMONICS), 1 + HARMONICS + np.arange(HARMONICS)
    by_u[c, c] -= w[i] ** 2
    by_u[s, s] -= w[i] ** 2
    by_u[c, s] += 2 * ZETA * w[i]
    by_u[s, c] -= 2 * ZETA * w[i]
    by_omega = np.concatenate(
        [[0.0], -2 * omega * orders**2 * cosines + 2 * ZETA * orders * sines, -2 * omega * orders**2 * sines - 2 * ZETA * orders * cosines]
    )
    by_omega[1] -= 2 * ALTERNATING * omega
    return residual, by_u, by_omega


def solve(point, tangent, length):
    """Finds the solution at an arclength from a point by Newton's method."""
    start = point + length * tangent
    x = start.copy()
    for _ in range(12):
        residual, by_u, by_omega = balance(x[:-1], x[-1])
        system = np.vstack([np.hstack([by_u, by_omega[:, None]]), tangent])
        step = np.linalg.solve(system, -np.append(residual, tangent @ (x - start)))
        x += step
        if np.abs(step).max() < 1e-12:
            return x
    return None


def tangent_at(x, before):
    """Returns the unit tangent at a solution, in the direction of the tangent before."""
    _, by_u, by_omega = balance(x[:-1], x[-1])
    system = np.vstack([np.hstack([by_u, by_omega[:, None]]), before])
    tangent = np.linalg.solve(system, np.append(np.zeros(len(x) - 1), 1.0))
    return tangent / np.linalg.norm(tangent)


def main():
    omega = 0.6
    u = np.zeros(2 * HARMONICS + 1)
    response = ALTERNATING * omega**2 / (1 - omega**2 + 2j * ZETA * omega)
    u[0], u[1], u[1 + HARMONICS] = 1 + MEAN, response.real, -response.imag
    point, tangent = np.append(u, omega), np.append(np.zeros_like(u), 1.0)
    tangent = tangent_at(point, tangent)
    print("kind,omega,x0,v0,largest")

    def write(kind, x):
        u, w = x[:-1], x[-1]
        z = basis @ u
        position = u[0] + u[1 : HARMONICS + 1].sum()
        velocity = (orders * w * u[HARMONICS + 1 :]).sum()
        print(f"{kind},{w:.9f},{position:.9f},{velocity:.9f},{z.max():.9f}")

    length, count = 0.01, 0
    while point[-1] < 1.6 and count < 3000:
        next_point = solve(point, tangent, length)
        if next_point is None:
            length /= 2
            assert length > 1e-7, point[-1]
            continue
        next_tangent = tangent_at(next_point, tangent)
        if next_tangent[-1] * tangent[-1] < 0:
            low, high, fold = 0.0, length, next_point
            for _ in range(40):
                middle = 0.5 * (low + high)
                fold = solve(point, tangent, middle)
                if tangent_at(fold, tangent)[-1] * tangent[-1] < 0:
                    high = middle
                else:
                    low = middle
            write("fold", fold)
        point, tangent, count = next_point, next_tangent, count + 1
        if count % 2 == 0:
            write("stable" if tangent[-1] > 0 else "unstable", point)
        length = min(1.5 * length, 0.02)


main()
