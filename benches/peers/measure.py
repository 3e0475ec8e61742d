"""Times peers on the cells of `rattlemap-bench work-precision`, alternately with its one-core engine.

usage: measure.py BINARY FOLDER [--rounds N] [--quick]

Gets the cells from BINARY, times every method once per round on one core, and writes FOLDER/peers.csv for the command's
option `--peers`. Also times heyoka's compiled steps with walls out of reach, and writes FOLDER/steps.csv. Those find no event,
so they have a time but no error.
"""

import argparse
import csv
import math
import statistics
import subprocess
import time
from pathlib import Path

import heyoka
import numba
import numpy as np

import cells as cell_files
import heyoka_events
import rk4_numba

NUMBA_STEPS = (128, 256, 512, 1024, 2048)
HEYOKA_TOLERANCES = (1e-9, 1e-12)
# Numbers of lanes that heyoka's compiled steps run together.
BATCHES = (1, 4, 8)
# Shortest time of a measurement, in seconds. The cells run repeatedly until it has passed.
SHORTEST = 0.2

COLUMNS = (
    "method device precision steps tolerance cores lanes periods rounds seconds_per_lane_period fastest slowest "
    "state_error_median state_error_worst event_error_median event_error_worst lost"
).split()


class Numba:
    method, tolerance = "rk4-numba", None
    device = f"one core, numba {numba.__version__}"

    def __init__(self, steps, cells):
        self.steps = steps
        names = heyoka_events.NAMES
        self.work = [
            (tuple(float(cell.parameters[name]) for name in names), tuple(cell_files.to_gap(cell.start)), cell.periods)
            for cell in cells
        ]

    def run(self):
        return [rk4_numba.integrate(p, start, periods, self.steps) for p, start, periods in self.work]


class Heyoka:
    method, steps = "heyoka", None
    device = f"one core, heyoka {heyoka.__version__}"

    def __init__(self, tolerance, cells):
        self.tolerance = tolerance
        self.integrator = heyoka_events.Integrator(tolerance)
        self.work = [
            (
                [float(cell.parameters[name]) for name in heyoka_events.NAMES],
                cell_files.to_gap(cell.start),
                cell.periods * cell.period,
                cell.period,
            )
            for cell in cells
        ]

    def run(self):
        results = []
        for parameters, start, until, period in self.work:
            q = self.integrator.integrate(parameters, start, until)
            results.append((q, [t % period for t in heyoka_events.events[:-3:-1]]))
        return results

    def step_counts(self):
        """Returns the number of steps of each lane."""
        counts = []
        for parameters, start, until, _ in self.work:
            self.integrator.integrate(parameters, start, until)
            counts.append(self.integrator.steps)
        return counts


class Steps:
    """heyoka without events, so without Python callbacks. Each lane takes as many steps as with events."""

    def __init__(self, heyoka_with_events, batch):
        self.tolerance, self.batch = heyoka_with_events.tolerance, batch
        self.integrator = heyoka_events.Steps(self.tolerance, batch)
        lanes = list(zip(heyoka_with_events.work, heyoka_with_events.step_counts()))
        self.work = []
        for at in range(0, len(lanes), batch):
            # An incomplete batch repeats its last lane, which is not counted. All lanes take the largest number of steps.
            group = lanes[at : at + batch]
            group += group[-1:] * (batch - len(group))
            parameters, starts = (np.array([work[i] for work, _ in group]).T for i in (0, 1))
            if batch == 1:
                parameters, starts = parameters[:, 0], starts[:, 0]
            self.work.append((parameters, starts, max(steps for _, steps in group)))

    def run(self):
        if not all([self.integrator.integrate(*work) for work in self.work]):
            raise RuntimeError("heyoka reached a wall that should be out of reach")


class Reference:
    """The one-core engine of rattlemap. It measures its own time, without the start of the program."""

    def __init__(self, binary, folder):
        self.folder = Path(folder) / "reference"
        self.command = [binary, "work-precision", "--methods", "reference", "--rounds", "1"]
        self.command += ["--out", str(self.folder), "--force", "--quiet"]

    def seconds(self):
        subprocess.run(self.command, check=True)
        with open(self.folder / "work_precision.csv", encoding="utf-8") as file:
            (self.row,) = csv.DictReader(file)
        return float(self.row["seconds_per_lane_period"])


def seconds_per_lane_period(method, lane_periods, shortest, clock=time.perf_counter):
    runs, start = 0, clock()
    while True:
        method.run()
        runs += 1
        elapsed = clock() - start
        if elapsed >= shortest:
            return elapsed / (runs * lane_periods)


def row(method, times, cells):
    results = method.run()
    state = [cell_files.state_error(cell, q) for cell, (q, _) in zip(cells, results)]
    event = [cell_files.event_error(cell, latest) for cell, (_, latest) in zip(cells, results)]
    event = [error for error in event if error is not None]
    return {
        "method": method.method,
        "device": method.device,
        "precision": "f64",
        "steps": method.steps,
        "tolerance": method.tolerance,
        "cores": 1,
        "lanes": len(cells),
        "periods": cells[0].periods,
        "rounds": len(times),
        "seconds_per_lane_period": statistics.median(times),
        "fastest": min(times),
        "slowest": max(times),
        "state_error_median": statistics.median_low(state),
        "state_error_worst": max(state),
        "event_error_median": statistics.median_low(event),
        "event_error_worst": max(event),
        "lost": sum(map(math.isinf, state)),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary")
    parser.add_argument("folder")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="one round of one setting each, to check that it works")
    arguments = parser.parse_args()

    Path(arguments.folder).mkdir(parents=True, exist_ok=True)
    reference = Reference(arguments.binary, arguments.folder)
    reference.seconds()
    cells = cell_files.read(reference.folder / "cells.json")
    steps, tolerances = (NUMBA_STEPS, HEYOKA_TOLERANCES) if not arguments.quick else (NUMBA_STEPS[:1], HEYOKA_TOLERANCES[:1])
    with_events = [Heyoka(tolerance, cells) for tolerance in tolerances]
    methods = [Numba(n, cells) for n in steps] + with_events
    steps_alone = [Steps(method, batch) for method in with_events for batch in BATCHES]
    lane_periods = sum(cell.periods for cell in cells)
    for method in methods + steps_alone:
        method.run()  # compiles

    times = {method: [] for method in methods + steps_alone}
    own = []
    for _ in range(1 if arguments.quick else arguments.rounds):
        own.append(reference.seconds())
        for method in methods + steps_alone:
            times[method].append(seconds_per_lane_period(method, lane_periods, 0.0 if arguments.quick else SHORTEST))

    # Ratios use this measurement of the reference, because it alternated with the peers.
    reference_row = dict(reference.row, method="reference-beside-peers", rounds=len(own))
    reference_row |= {"seconds_per_lane_period": statistics.median(own), "fastest": min(own), "slowest": max(own)}
    rows = [row(method, times[method], cells) for method in methods]
    path = Path(arguments.folder) / "peers.csv"
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows([reference_row, *rows])
    for r in [reference_row, *rows]:
        setting = r["steps"] or r["tolerance"] or "-"
        print(
            f"{r['method']:<24} {setting!s:>8} {1e6 * float(r['seconds_per_lane_period']):10.3f} us per lane-period, "
            f"worst {float(r['state_error_worst']):.1e}, median {float(r['state_error_median']):.1e}, lost {r['lost']}"
        )
    print(path)

    path = Path(arguments.folder) / "steps.csv"
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["tolerance", "batch", "seconds_per_lane_period", "fastest", "slowest"])
        for method in steps_alone:
            median = statistics.median(times[method])
            writer.writerow([method.tolerance, method.batch, median, min(times[method]), max(times[method])])
            print(
                f"heyoka, walls out of reach  {method.tolerance!s:>8}, {method.batch} lanes together "
                f"{1e6 * median:10.3f} us per lane-period"
            )
    print(path)


if __name__ == "__main__":
    main()
