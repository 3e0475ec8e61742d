"""rattlemap.basins: the labels and the table of attractors that the program writes."""

from __future__ import annotations

from pathlib import Path

import pytest
import rattlemap as rm
from compare import assert_same
from conftest import Program


def test_basins_are_the_programs(program: Program, tmp_path: Path) -> None:
    made = rm.basins(
        rm.load_model("impact-oscillator"), x=(-1, 1, 16), v=(-1, 1, 12), omega=2.8, engine="cpu", quantities=["class", "word"]
    )
    (tmp_path / "scene.toml").write_text(made.attrs["scene"])
    program("map", tmp_path / "scene.toml", "--engine", "cpu", "--quiet", "--out", tmp_path / "own")
    assert_same(made, rm.open(tmp_path / "own"))
    assert made["attractor"].dims == ("v", "x") and made.sizes["label"] >= 2
    assert made["attractor_cells"].sum() == (made["attractor"] >= 0).sum()


def test_components_that_are_not_swept_have_their_values(program: Program, tmp_path: Path) -> None:
    made = rm.basins(rm.gear_pair(), x1=(-1, 1, 6), v1=(-1, 1, 5), x2=0.25, e=0.6, engine="cpu")
    assert "state = [0.0, 0.0, 0.25, 0.0]" in made.attrs["scene"]
    (tmp_path / "scene.toml").write_text(made.attrs["scene"])
    program("map", tmp_path / "scene.toml", "--engine", "cpu", "--quiet", "--out", tmp_path / "own")
    assert_same(made, rm.open(tmp_path / "own"))


def test_an_axis_has_to_sweep_the_start() -> None:
    with pytest.raises(rm.SceneError, match="no components of the start, x1, v1, x2, v2"):
        rm.basins(rm.gear_pair(), e=(0, 1, 4), omega=(1, 2, 4))
