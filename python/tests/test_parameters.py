"""Parameters whose names are keywords of the functions: swept through ``axes`` and set through ``parameters``."""

from __future__ import annotations

from pathlib import Path

import pytest
import rattlemap as rm
from conftest import Rerun, assert_same

NAMES = ("force", "out", "scene", "engine", "set")
MODEL = """
name = "keywords"
[parameters]
omega = 2.0
force = 1.0
out = { default = 0.2, min = 0.0, max = 1.0 }
scene = 1.0
engine = { default = 0.02, min = 0.0 }
set = { default = 0.8, min = 0.0, max = 1.0 }
[motion]
coordinates = ["x"]
mass = [["1"]]
damping = [["2*engine"]]
stiffness = [["scene"]]
force = ["force"]
frequency = "omega"
gap = ["1"]
[[contact]]
side = "right"
at = "out"
law = "impact"
restitution = "set"
"""


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> rm.Model:
    path = tmp_path_factory.mktemp("model") / "keywords.toml"
    path.write_text(MODEL)
    return rm.load_model(path)


@pytest.mark.parametrize("name", NAMES)
def test_every_function_accepts_the_name(model: rm.Model, name: str) -> None:
    values = (0.3, 0.6, 3)
    ds = rm.map(model, axes={name: values}, omega=(2, 3, 2), engine="cpu")
    assert ds["class"].dims == ("omega", name) and ds[name].values.tolist() == pytest.approx([0.3, 0.45, 0.6])
    other = NAMES[NAMES.index(name) - 1]
    one = rm.map(model, axes={name: values}, parameters={other: 0.5}, omega=(2, 3, 2), engine="cpu")
    assert f"{other} = 0.5" in one.attrs["scene"]
    line = rm.bifurcation(model, axes={name: values}, parameters={other: 0.5})
    assert line["class"].dims == (name,)
    starts = rm.basins(model, axes={name: values}, parameters={other: 0.5}, x=(-0.1, 0.1, 2), engine="cpu")
    assert starts["attractor"].dims == ("x", name)
    rows = rm.cells(model, {name: [0.3, 0.6]}, parameters={other: 0.5}, engine="cpu", omega=2)
    assert rows["class"].tolist() == one["class"].values[0, [0, 2]].tolist()
    assert rm.orbit(model, parameters={name: 0.5}).parameters[name] == 0.5


def test_the_map_is_the_programs(model: rm.Model, rerun: Rerun, tmp_path: Path) -> None:
    (tmp_path / "keywords.toml").write_text(MODEL)
    ds = rm.map(model, axes={"force": (0.3, 0.6, 3), "set": (0.3, 0.6, 2)}, parameters={"out": 0.5}, engine="cpu")
    assert_same(ds, rerun(ds))


def test_a_name_has_one_value() -> None:
    with pytest.raises(rm.SceneError, match="`e` is given twice"):
        rm.map(rm.gear_pair(), axes={"e": (0, 1, 4)}, e=(0, 1, 4), omega=(1, 2, 4))
    with pytest.raises(rm.SceneError, match="axes: `e = 0.5` must be a tuple"):
        rm.map(rm.gear_pair(), axes={"e": 0.5}, omega=(1, 2, 4))
    with pytest.raises(rm.SceneError, match="parameters: .* must be one number"):
        rm.map(rm.gear_pair(), parameters={"e": (0, 1, 4)}, omega=(1, 2, 4))
