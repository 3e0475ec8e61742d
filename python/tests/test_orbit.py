"""rattlemap.orbit: equal to `orbit --json` and its tables."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import rattlemap as rm
from conftest import Program, assert_same_columns


def moments(folder: Path) -> pd.DataFrame:
    """Reads the table of a motion."""
    table = pd.read_csv(folder / "trajectory.csv", dtype=str, keep_default_na=False)
    for name in table.columns.difference(["domain", "event", "moment", "side"]):
        table[name] = [float(text) for text in table[name]]
    table["side"] = [int(text or 0) for text in table["side"]]
    return table


@pytest.mark.parametrize(
    ("sets", "more"),
    [
        ({"e": 0.06, "omega": 5.6}, {}),
        ({"e": 0.605, "omega": 5.6}, {"start": [0.1, 0.0, -0.2, 1.5]}),
        # Chaos.
        ({"e": 0.99, "omega": 5.6}, {"periods": 64, "transient": 100}),
    ],
)
def test_an_orbit_is_the_programs(
    program: Program, tmp_path: Path, sets: dict[str, float], more: dict[str, object]
) -> None:
    arguments = [text for name, value in sets.items() for text in ("--set", f"{name}={value}")]
    for name, value in more.items():
        arguments += [f"--{name}", ",".join(map(str, value)) if isinstance(value, list) else str(value)]
    expected = json.loads(program("orbit", *arguments, "--json", "--out", tmp_path / "orbit").stdout)
    orbit = rm.orbit(rm.gear_pair(), **sets, **more)
    assert orbit.to_dict() == expected
    assert (orbit.class_, orbit.period, orbit.word) == (expected["class"], expected["period"], expected["word"])
    assert orbit.multipliers.tolist() == [complex(*pair) for pair in expected["floquet"] or []]
    assert orbit.strobe.tolist() == expected["strobe"]
    events = orbit.events
    assert len(events) == len(expected["events"])
    for name in events.dtype.names:
        assert events[name].tolist() == [event[name] for event in expected["events"]], name
    assert_same_columns(orbit.trajectory(), moments(tmp_path / "orbit"))


def test_a_trajectory_has_the_requested_points() -> None:
    orbit = rm.orbit(rm.gear_pair(), e=0.605, omega=5.6)
    assert orbit.period == 1
    path = orbit.trajectory(400)
    samples = path[path["moment"] == ""]
    assert len(samples) == 401 and samples["t"].iloc[-1] == pytest.approx(orbit.forcing_period)
    assert len(path) == 401 + 2 * len(orbit.events)
    assert "periodic, period 1, word 36" in repr(orbit)
    with pytest.raises(ValueError, match="points = 100000000: it must be a whole number from 1 to 10000000"):
        orbit.trajectory(100_000_000)


def test_a_history_is_the_programs(program: Program, tmp_path: Path) -> None:
    orbit = rm.orbit(rm.gear_pair(), e=0.06, start=[0.1, 0.0, -0.2, 1.5])
    line = ["orbit", "--set", "e=0.06", "--start", "0.1,0,-0.2,1.5", "--from-start"]
    program(*line, "5", "--out", tmp_path / "first")
    first = orbit.history(5)
    assert_same_columns(first, moments(tmp_path / "first"))
    assert first.iloc[0][["x1", "v1", "x2", "v2"]].tolist() == pytest.approx([0.1, 0.0, -0.2, 1.5], rel=1e-15)
    program(*line, "2", "--to-period", "9", "--out", tmp_path / "later")
    assert_same_columns(orbit.history(2, to_period=9), moments(tmp_path / "later"))
    assert (orbit.history(2, points=10)["moment"] == "").sum() == 11
    for periods, to_period, part in ((0, None, "periods = 0"), (5, 4, "to_period = 4"), (1.5, None, "periods = 1.5")):
        with pytest.raises(ValueError, match=part):
            orbit.history(periods, to_period=to_period)


def test_an_orbit_can_be_pickled() -> None:
    orbit = rm.orbit(rm.gear_pair(), e=0.605, omega=5.6, start={"v1": 1.0})
    again = pickle.loads(pickle.dumps(orbit))
    assert again.to_dict() == orbit.to_dict() and again.model.parameters == orbit.model.parameters


def test_orbits_of_other_models_and_states_by_name(program: Program) -> None:
    model = rm.load_model("impact-oscillator", omega=2.8)
    printed = program("orbit", "--model", "impact-oscillator", "--set", "omega=2.8", "--start", "0,0.5", "--json")
    assert rm.orbit(model, start={"v": 0.5}).to_dict() == json.loads(printed.stdout)
    assert rm.orbit(model, start=[0, 0.5]).events["before"].shape[1] == 2


def test_an_orbit_can_start_at_another_phase(program: Program) -> None:
    printed = program("orbit", "--set", "e=0.605", "--set", "omega=5.6", "--set", "start.phase=1.5", "--json")
    orbit = rm.orbit(rm.gear_pair(), e=0.605, omega=5.6, phase=1.5)
    assert orbit.to_dict() == json.loads(printed.stdout) and orbit.to_dict()["start_phase"] == 1.5
    assert pickle.loads(pickle.dumps(orbit)).model == orbit.model != rm.gear_pair(e=0.605, omega=5.6)
    axes = {"e": (0.6, 0.7, 2), "omega": (5.5, 5.6, 2)}
    by_model = rm.map(rm.gear_pair().replace(**{"start.phase": 1.5}), axes=axes, engine="cpu")
    by_setting = rm.map(rm.gear_pair(), axes=axes, engine="cpu", settings={"start.phase": 1.5})
    assert by_model.equals(by_setting)
    assert not by_model.equals(rm.map(rm.gear_pair(), axes=axes, engine="cpu"))


def test_errors_name_the_remedy() -> None:
    with pytest.raises(rm.SceneError, match="it must be between 0 and 1"):
        rm.orbit(rm.gear_pair(), e=2)
    with pytest.raises(rm.SceneError, match="four finite numbers, the model's x1, v1, x2, v2; 2 were given"):
        rm.orbit(rm.gear_pair(), start=[0.0, 1.0])
    with pytest.raises(rm.SceneError, match="from 2 to 10000000"):
        rm.orbit(rm.gear_pair(), periods=1)
    with pytest.raises(rm.SceneError, match="periods = 2.5: it must be a whole number"):
        rm.orbit(rm.gear_pair(), periods=2.5)


def test_absent_numbers_are_nan() -> None:
    cycle = rm.orbit(rm.gear_pair(), e=0.605, omega=5.6)
    assert np.isnan(cycle.lyapunov_error) and cycle.symmetric is False
    chaos = rm.orbit(rm.gear_pair(), e=0.99, omega=5.6)
    assert chaos.lyapunov_error > 0 and chaos.period is None and chaos.multipliers.shape == (0,)


def test_a_spectrum_is_the_programs(program: Program, tmp_path: Path) -> None:
    program("orbit", "--model", "loose-gear", "--out", tmp_path / "orbit")
    lines = rm.orbit(rm.load_model("loose-gear")).spectrum()
    assert_same_columns(lines, pd.read_csv(tmp_path / "orbit" / "spectrum.csv", float_precision="round_trip"))
    assert lines.attrs["units"] == {name: unit for name, unit in [*zip(lines.columns[1:], ("m", "m/s"), strict=True)]}


def test_the_exponent_of_a_superstable_cycle_is_minus_infinity_everywhere(program: Program, tmp_path: Path) -> None:
    model = rm.load_model("impact-oscillator", e=0, omega=2.8)
    orbit = rm.orbit(model)
    assert orbit.period and not orbit.multipliers.any() and orbit.lyapunov == -np.inf
    line = rm.bifurcation(model, omega=(2.8, 2.9, 2), progress=False)
    ds = rm.map(model, omega=(2.8, 2.9, 2), e=(0, 0.5, 2), engine="cpu", out=tmp_path / "map", settings={"outputs.files": ["csv", "npy"]})
    assert line["lyapunov"].values[0] == ds["lyapunov"].values.ravel()[0] == -np.inf
    assert pd.read_csv(tmp_path / "map" / "cells.csv")["lyapunov"][0] == -np.inf
    assert "Lyapunov exponent     -inf" in program("orbit", "--model", "impact-oscillator", "--set", "e=0", "--set", "omega=2.8").stdout


def test_derivatives_are_those_of_the_programs_cycle() -> None:
    chaos = rm.orbit(rm.gear_pair(), e=0.8, omega=5.6)
    assert chaos.refined(period=1, word="563")["word"] == "356"
    cycle = rm.orbit(rm.gear_pair(), e=0.4)
    slope, step = cycle.derivative("amplitude_x1", "e"), 1e-4
    near = [rm.orbit(rm.gear_pair(), e=0.4 + sign * step).quantities["amplitude_x1"] for sign in (1, -1)]
    assert slope == pytest.approx((near[0] - near[1]) / (2 * step), rel=1e-5)
    assert cycle.derivative("strobe", "e").shape == (4,)
    assert cycle.derivative("multipliers", "e").dtype == complex
    with pytest.raises(rm.SceneError, match="q: unknown name. Use one of: strobe, event_times, multipliers, impact_speed"):
        cycle.derivative("q", "e")
    with pytest.raises(rm.SceneError, match="unknown parameter `q`"):
        cycle.derivative("strobe", "q")
    with pytest.raises(rm.EngineError, match="impact_speed_max by T: it has no derivative here"):
        rm.orbit(rm.load_model("drag-gear")).derivative("impact_speed_max", "T")
    with pytest.raises(rm.EngineError, match="the motion is not periodic"):
        chaos.derivative("strobe", "e")
