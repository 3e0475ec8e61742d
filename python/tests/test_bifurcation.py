"""rattlemap.bifurcation: the tables of the program's folder."""

from __future__ import annotations

from pathlib import Path

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
