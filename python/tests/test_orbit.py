"""rattlemap.orbit: what `orbit --json` and its tables say."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import rattlemap as rm
from compare import assert_same_frame
from conftest import Program


@pytest.mark.parametrize(
    ("sets", "more"),
    [
        ({"e": 0.06, "omega": 5.6}, {}),
        ({"e": 0.605, "omega": 5.6}, {"start": [0.1, 0.0, -0.2, 1.5]}),
        # Chaos, with no cycle.
        ({"e": 0.99, "omega": 5.6}, {"periods": 64, "transient": 100}),
    ],
)
def test_an_orbit_is_the_programs(
    program: Program, tmp_path: Path, sets: dict[str, float], more: dict[str, object]
) -> None:
    arguments = [text for name, value in sets.items() for text in ("--set", f"{name}={value}")]
    for name, value in more.items():
        shown = ",".join(map(str, value)) if isinstance(value, list) else value
        arguments += [f"--{name}", str(shown)]
    said = program("orbit", *arguments, "--json", "--out", tmp_path / "orbit")
    expected = json.loads(said.stdout)
    made = rm.orbit(rm.gear_pair(), **sets, **more)
    assert made.to_dict() == expected
    assert (made.class_, made.period, made.word) == (expected["class"], expected["period"], expected["word"])
    assert made.multipliers.tolist() == [complex(*pair) for pair in expected["floquet"] or []]
    assert made.strobe.tolist() == expected["strobe"]
    events = made.events
    assert len(events) == len(expected["events"])
    for name in events.dtype.names:
        assert events[name].tolist() == [event[name] for event in expected["events"]], name
    table = pd.read_csv(tmp_path / "orbit/trajectory.csv", dtype=str, keep_default_na=False)
    for name in table.columns.difference(["domain", "event", "moment", "side"]):
        table[name] = [float(text) for text in table[name]]
    table["side"] = [int(text or 0) for text in table["side"]]
    assert_same_frame(made.trajectory(), table)


def test_a_trajectory_has_the_points_that_are_asked_for() -> None:
    made = rm.orbit(rm.gear_pair(), e=0.605, omega=5.6)
    assert made.period == 1
    path = made.trajectory(400)
    samples = path[path["moment"] == ""]
    assert len(samples) == 401 and samples["t"].iloc[-1] == pytest.approx(made.forcing_period)
    assert len(path) == 401 + 2 * len(made.events)
    assert "periodic, period 1, word 36" in repr(made)


def test_an_orbit_travels_to_other_processes() -> None:
    made = rm.orbit(rm.gear_pair(), e=0.605, omega=5.6, start={"v1": 1.0})
    again = pickle.loads(pickle.dumps(made))
    assert again.to_dict() == made.to_dict() and again.model.parameters == made.model.parameters


def test_orbits_of_other_models_and_states_by_name(program: Program) -> None:
    model = rm.load_model("impact-oscillator", omega=2.8)
    said = program("orbit", "--model", "impact-oscillator", "--set", "omega=2.8", "--start", "0,0.5", "--json")
    assert rm.orbit(model, start={"v": 0.5}).to_dict() == json.loads(said.stdout)
    assert rm.orbit(model, start=[0, 0.5]).events["before"].shape[1] == 2


def test_what_is_wrong_is_told() -> None:
    with pytest.raises(rm.SceneError, match="it must be between 0 and 1"):
        rm.orbit(rm.gear_pair(), e=2)
    with pytest.raises(rm.SceneError, match="four finite numbers, the model's x1, v1, x2, v2; 2 were given"):
        rm.orbit(rm.gear_pair(), start=[0.0, 1.0])
    with pytest.raises(rm.SceneError, match="from 2 to 10000000"):
        rm.orbit(rm.gear_pair(), periods=1)
    with pytest.raises(rm.SceneError, match="periods = 2.5: it must be a whole number"):
        rm.orbit(rm.gear_pair(), periods=2.5)


def test_numbers_that_are_absent_are_not_a_number() -> None:
    cycle = rm.orbit(rm.gear_pair(), e=0.605, omega=5.6)
    assert np.isnan(cycle.lyapunov_error) and cycle.symmetric is False
    chaos = rm.orbit(rm.gear_pair(), e=0.99, omega=5.6)
    assert chaos.lyapunov_error > 0 and chaos.period is None and chaos.multipliers.shape == (0,)
