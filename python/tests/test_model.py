"""Models: built in and of files, with values that the library checks."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest
import rattlemap as rm


def test_a_model_has_names_and_values() -> None:
    model = rm.gear_pair(F=60)
    assert model.parameters["F"] == 60.0 and model.parameters["m1"] == 2.0
    assert model.state_names == ["x1", "v1", "x2", "v2"]
    assert model.name in repr(model) and "F=60.0" in repr(model)
    assert "e = 0.605: coefficient of restitution; between 0 and 1" in model.help
    assert model == rm.gear_pair().replace(F=60) != rm.gear_pair()
    assert pickle.loads(pickle.dumps(model)) == model
    assert 'name = "gear-pair"' in model.text and model.equations


def test_errors_name_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(rm.SceneError, match="unknown field `parameters.G = 1.0`"):
        rm.gear_pair(G=1)
    with pytest.raises(rm.SceneError, match="out of range: it must be between 0 and 1"):
        rm.load_model("gear-pair", e=1.5)
    with pytest.raises(rm.SceneError, match="wrong type"):
        rm.gear_pair(e="half")
    with pytest.raises(rm.ModelError, match="no model is called `gear`; the built-in models are gear-pair"):
        rm.load_model("gear")
    (tmp_path / "mine.toml").write_text('name = "mine"\n')
    with pytest.raises(rm.ModelError, match="mine.toml"):
        rm.load_model(tmp_path / "mine.toml")


def test_units_of_a_model_are_attributes(tmp_path: Path) -> None:
    text = rm.load_model("bilinear").text.replace('name = "bilinear"', 'name = "mine"')
    text = text.replace('meaning = "damping ratio"', 'meaning = "damping", unit = "kg/s"')
    text = text.replace("[motion]", '[motion]\nunits = ["mm"]\ntime_unit = "s"')
    (tmp_path / "mine.toml").write_text(text)
    model = rm.load_model(tmp_path / "mine.toml")
    assert "zeta = 0.05: damping [kg/s]; " in model.help
    assert rm.orbit(model).units == {"zeta": "kg/s", "x": "mm", "v": "mm/s", "z": "mm", "w": "mm/s", "t": "s"}
    line = rm.bifurcation(model, zeta=(0.1, 0.2, 2))
    for name, meaning, unit in (
        ("zeta", "damping", "kg/s"),
        ("point_zeta", "damping", "kg/s"),
        ("x", "displacement", "mm"),
        ("v_before", "velocity before the event", "mm/s"),
    ):
        assert line[name].attrs == {"long_name": meaning, "units": unit}, name
    basins = rm.map(model, x=(-1, 1, 2), omega=(1.0, 1.1, 2), engine="cpu")
    assert basins["x"].attrs == {"long_name": "displacement", "units": "mm"}
    assert basins["omega"].attrs == {"long_name": "excitation frequency"}
