"""rattlemap.bifurcation: the tables of the program's folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rattlemap as rm
from conftest import SCENES, Program, Rerun, assert_same


@pytest.mark.parametrize("start", ["rest", "both"])
def test_a_diagram_is_the_programs(rerun: Rerun, start: str) -> None:
    ds = rm.bifurcation(rm.gear_pair(), e=(0, 0.999, 30), omega=5.6, start=start)
    assert_same(ds, rerun(ds, "bifurcation"))
    assert ds["class"].dims == (("e",) if start == "rest" else ("direction", "e"))


def test_a_line_of_a_plane(program: Program, tmp_path: Path) -> None:
    scene = SCENES / "e_omega.toml"
    arguments = ["--along", "e", "--at", "omega=5.6", "--set", "axis.0.count=20"]
    program("bifurcation", scene, *arguments, "--quiet", "--out", tmp_path / "line")
    ds = rm.bifurcation(scene=scene, along="e", at={"omega": 5.6}, set=["axis.0.count=20"])
    assert_same(ds, rm.open(tmp_path / "line"))


def test_errors_name_the_remedy() -> None:
    with pytest.raises(rm.SceneError, match="one axis must be given, and these are: none"):
        rm.bifurcation(rm.gear_pair())
    with pytest.raises(rm.SceneError, match="did you mean `e`|valid names"):
        rm.bifurcation(rm.gear_pair(), ee=(0, 1, 5))
    with pytest.raises(rm.SceneError, match='with along="e" at={"omega": VALUE}'):
        rm.bifurcation(scene=SCENES / "e_omega.toml")


def test_measured_quantities_are_variables_with_names(tmp_path: Path) -> None:
    wanted = ["amplitude", "impact_rate", "multiplier"]
    model = rm.load_model("impact-oscillator")
    diagram = rm.bifurcation(model, F=(0.5, 1.5, 5), omega=2.8, quantities=wanted, start="both")
    assert diagram["amplitude_x"].dims == ("direction", "F") and bool((diagram["amplitude_x"] > 0).all())
    ds = rm.map(model, F=(0.5, 1.5, 3), omega=(2.0, 2.8, 3), quantities=[*wanted, "state"], engine="cpu", out=tmp_path / "map")
    names = {"amplitude_x", "mean_x", "amplitude_gap", "mean_gap", "impact_rate", "multiplier", "multiplier_argument"}
    assert names | {"state_x", "state_v"} <= {*ds.data_vars} and names <= {*diagram.data_vars}
    for data in (ds, diagram, rm.open(tmp_path / "map")):
        assert data["amplitude_gap"].attrs["long_name"] == "amplitude of gap"
    orbit = rm.orbit(model, F=1.5, omega=2.8)
    assert np.isclose(orbit.quantities["amplitude_x"], ds["amplitude_x"].sel(F=1.5, omega=2.8))
    assert np.isfinite(orbit.events["impulse"]).all()
