"""rattlemap.basins: the labels and the table of attractors that the program writes."""

from __future__ import annotations

import pytest
import rattlemap as rm
from conftest import Rerun, assert_same


def test_basins_are_the_programs(rerun: Rerun) -> None:
    ds = rm.basins(
        rm.load_model("impact-oscillator"), x=(-1, 1, 12), v=(-1, 1, 10), omega=2.8, engine="cpu", quantities=["class", "word"]
    )
    assert_same(ds, rerun(ds))
    assert ds["attractor"].dims == ("v", "x") and ds.sizes["label"] >= 2
    assert ds["attractor_cells"].sum() == (ds["attractor"] >= 0).sum()


def test_components_that_are_not_swept_have_their_values(rerun: Rerun) -> None:
    ds = rm.basins(rm.gear_pair(), x1=(-1, 1, 4), v1=(-1, 1, 3), x2=0.25, e=0.6, engine="cpu")
    assert "state = [0.0, 0.0, 0.25, 0.0]" in ds.attrs["scene"]
    assert_same(ds, rerun(ds))


def test_an_axis_must_sweep_the_start() -> None:
    with pytest.raises(rm.SceneError, match="is a component of the start \\(x1, v1, x2, v2\\)"):
        rm.basins(rm.gear_pair(), e=(0, 1, 4), omega=(1, 2, 4))
