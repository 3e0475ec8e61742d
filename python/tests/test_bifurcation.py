"""rattlemap.bifurcation: the tables of the program's folder."""

from __future__ import annotations

from pathlib import Path

import pytest
import rattlemap as rm
from compare import assert_same
from conftest import SCENES, Program


def test_a_diagram_is_the_programs(program: Program, tmp_path: Path) -> None:
    for start in ("rest", "both"):
        made = rm.bifurcation(rm.gear_pair(), e=(0, 0.999, 60), omega=5.6, start=start)
        (tmp_path / "scene.toml").write_text(made.attrs["scene"])
        program("bifurcation", tmp_path / "scene.toml", "--quiet", "--out", tmp_path / start)
        assert_same(made, rm.open(tmp_path / start))
    assert made["class"].dims == ("direction", "e")


def test_a_line_of_a_plane(program: Program, tmp_path: Path) -> None:
    scene = SCENES / "e_omega.toml"
    arguments = ["--along", "e", "--at", "omega=5.6", "--set", "axis.0.count=40"]
    program("bifurcation", scene, *arguments, "--quiet", "--out", tmp_path / "line")
    made = rm.bifurcation(scene=scene, along="e", at={"omega": 5.6}, set=["axis.0.count=40"])
    assert_same(made, rm.open(tmp_path / "line"))


def test_what_is_wrong_is_told() -> None:
    with pytest.raises(rm.SceneError, match="one axis must be given, and these are: none"):
        rm.bifurcation(rm.gear_pair())
    with pytest.raises(rm.SceneError, match="did you mean `e`|valid names"):
        rm.bifurcation(rm.gear_pair(), ee=(0, 1, 5))
    with pytest.raises(rm.SceneError, match="with --along e --at omega=VALUE"):
        rm.bifurcation(scene=SCENES / "e_omega.toml")
