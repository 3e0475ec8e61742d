"""Times heyoka on the chain of masses of `rattlemap-bench machines`, alternately with the engine of machines.

usage: heyoka_machine.py BINARY FOLDER [--rounds N] [--quick]

Walls are terminal events, whose callbacks apply the law of impact in Python. In extended precision the same integrator gives the
states that errors are measured against. Times are processor times. Writes FOLDER/machines.csv.
"""

import argparse
import csv
import json
import statistics
import subprocess
import time
from pathlib import Path

import heyoka as hy
import numpy as np

from measure import SHORTEST, seconds_per_lane_period

TOLERANCES = (1e-9, 1e-12, 1e-15)
# Tolerance in extended precision, whose rounding error is 1e-19.
EXACT = 1e-18

# Data of the callbacks, as in heyoka_events.py.
now = {}


class Impact:
    """Reverses the rate of a gap: `v += -(1 + e) w M^-1 row / (row M^-1 row)`."""

    def __init__(self, row, response):
        # Pairs of a coordinate and a factor, without zeros.
        self.row = [(i, x) for i, x in enumerate(row) if x]
        self.response = [(i, x) for i, x in enumerate(response) if x]

    def __call__(self, ta, sign):
        state = now["state"]
        w = sum(x * state[2 * i + 1] for i, x in self.row)
        impulse = -now["factor"] * w
        for i, x in self.response:
            state[2 * i + 1] += impulse * x
        now["impacts"] += 1
        return True


def callback(impact):
    """Returns a function: heyoka copies other callable objects."""
    return lambda ta, sign: impact(ta, sign)


class Integrator:
    """An integrator with events, compiled once per tolerance. States are (x1, v1, x2, v2, ...)."""

    def __init__(self, machine, tolerance, number=float):
        self.number = number
        mass = np.array(machine["mass"])
        inverse, n = np.linalg.inv(mass), len(mass)
        names = [name for i in range(n) for name in (f"x{i}", f"v{i}")]
        variables = hy.make_vars(*names)
        x, v = variables[0::2], variables[1::2]

        def combined(factors, terms):
            return hy.sum([number(factor) * term for factor, term in zip(factors, terms) if factor])

        turns = [(order, hy.cos(order * hy.par[0] * hy.time)) for order, _ in machine["drives"]]
        drives = [(factors, cos) for (_, factors), (_, cos) in zip(machine["drives"], turns)]
        force = [
            combined([factors[i] for factors, _ in drives], [cos for _, cos in drives])
            - combined(machine["damping"][i], v)
            - combined(machine["stiffness"][i], x)
            for i in range(n)
        ]
        equations = []
        for i in range(n):
            equations += [(x[i], v[i]), (v[i], combined(inverse[i], force))]
        events = []
        for row, (right, left) in machine["gaps"]:
            response = inverse @ row / (row @ inverse @ row)
            gap, impact = combined(row, x), callback(Impact(row, response))
            for wall, direction in ((right, hy.event_direction.positive), (left, hy.event_direction.negative)):
                events.append(hy.t_event(gap - number(wall), callback=impact, direction=direction, fp_type=number))
        self.ta = hy.taylor_adaptive(
            equations, np.zeros(2 * n, number), pars=np.ones(1, number), tol=number(tolerance), t_events=events, fp_type=number
        )

    def integrate(self, cell):
        """Returns the last state."""
        ta = self.ta
        now.update(state=ta.state, factor=1 + self.number(cell["restitution"]), impacts=0)
        ta.pars[0] = cell["omega"]
        ta.time = self.number(0)
        ta.state[:] = cell["start"]
        ta.reset_cooldowns()
        # The period is that of the frequency in double precision.
        until = cell["periods"] * (2 * np.arctan2(self.number(0), self.number(-1)) / self.number(cell["omega"]))
        outcome, *_ = ta.propagate_until(until)
        if outcome != hy.taylor_outcome.time_limit:
            raise RuntimeError(f"heyoka ended early: {outcome}")
        return ta.state.copy()


class Heyoka:
    """All cells at one tolerance."""

    def __init__(self, report, tolerance, number=float):
        self.cells, self.integrator = report["cells"], Integrator(report["machine"], tolerance, number)
        self.name = f"heyoka, {tolerance:g}"

    def run(self):
        """Returns the last states and the numbers of impacts."""
        return [(self.integrator.integrate(cell), now["impacts"]) for cell in self.cells]


class Reference:
    """The engine of machines. It measures its own time, without the start of the program."""

    name = "reference"

    def __init__(self, binary, folder, quick):
        self.path = Path(folder) / "machines" / "machines.json"
        self.command = [binary, "machines", "--out", str(self.path.parent), "--force", "--quiet"]
        self.command += ["--quick"] if quick else []

    def report(self):
        subprocess.run(self.command, check=True)
        return json.loads(self.path.read_text(encoding="utf-8"))

    def run(self):
        cells = json.loads(self.path.read_text(encoding="utf-8"))["cells"]
        return [(np.array(cell["state"]), cell["impacts"]) for cell in cells]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary")
    parser.add_argument("folder")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="one round on few cells, to check that it works")
    arguments = parser.parse_args()

    reference = Reference(arguments.binary, arguments.folder, arguments.quick)
    report = reference.report()
    exact = Heyoka(report, EXACT, np.longdouble).run()
    peers = [Heyoka(report, tolerance) for tolerance in TOLERANCES]
    lane_periods = sum(cell["periods"] for cell in report["cells"])
    methods = [reference, *peers]
    results = [method.run() for method in methods]
    times = {method: [] for method in methods}
    for _ in range(1 if arguments.quick else arguments.rounds):
        times[reference].append(reference.report()["seconds_per_lane_period"])
        for peer in peers:
            shortest = 0.0 if arguments.quick else SHORTEST
            times[peer].append(seconds_per_lane_period(peer, lane_periods, shortest, time.process_time))

    path = Path(arguments.folder) / "machines.csv"
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["method", "seconds_per_lane_period", "fastest", "slowest", "error_median", "error_worst", "other_impacts"])
        for method, found in zip(methods, results):
            own, median = times[method], statistics.median(times[method])
            errors = [float(np.abs(state - true).max()) for (state, _), (true, _) in zip(found, exact)]
            others = sum(count != true for (_, count), (_, true) in zip(found, exact))
            worst, middle = max(errors), statistics.median_low(errors)
            writer.writerow([method.name, median, min(own), max(own), middle, worst, others])
            print(
                f"{method.name:<14} {1e6 * median:10.2f} us per lane-period, worst {worst:.1e}, median {middle:.1e}, "
                f"{others} with other impacts"
            )
    print(f"{len(exact)} cells, {sum(count for _, count in exact) / lane_periods:.1f} impacts per period; {path}")


if __name__ == "__main__":
    main()
