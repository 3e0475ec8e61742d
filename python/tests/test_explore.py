"""The page that computes a map on demand, and the motion of a cell that is selected in it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import rattlemap as rm
from conftest import SCENES
from rattlemap.explore import _QUANTITIES, replayed


def test_a_page_is_written_and_a_selection_becomes_an_orbit(tmp_path: Path) -> None:
    page = rm.explore(rm.gear_pair(F=50), e=(0.5, 0.7), omega=(5, 6, 5), progress=False)
    page.save(tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert text.startswith("<!doctype html>") and '"at_once":true' in text
    assert page.command is None and page.orbit is None
    # The page's script sets this value.
    page.widget.command = "rattlemap orbit --set e=0.605 --set omega=5.6 --set F=45.0 --start 0.1,0,-0.2,1.5"
    assert page.orbit is not None
    expected = rm.orbit(rm.gear_pair(), e=0.605, omega=5.6, F=45, start=[0.1, 0, -0.2, 1.5])
    assert (page.orbit.word, page.orbit.parameters) == (expected.word, expected.parameters)


def test_the_command_of_a_page_names_all_that_differs_from_the_models_defaults() -> None:
    text = rm.load_model("two-masses").text
    command = "rattlemap orbit --set omega=1.2 --model model.toml --set start.phase=0.5 --transient 300"
    own = replayed(command, ("model.toml", text.replace("two-masses", "mine")))
    expected = rm.orbit(rm.load_model("two-masses"), omega=1.2, phase=0.5, transient=300)
    assert own.parameters == expected.parameters and own.class_ == expected.class_


def test_a_map_can_be_explored() -> None:
    ds = rm.map(rm.gear_pair(F=50), e=(0.5, 0.7, 4), omega=(5, 6, 4), engine="cpu", progress=False)
    assert f">{ds.attrs['title']}</title>" in ds.rattlemap.explore(progress=False).page
    with pytest.raises(rm.SceneError, match="does not describe a map"):
        ds.drop_attrs().rattlemap.explore()


def test_a_page_shows_the_quantities_of_the_main_scene() -> None:
    assert f"quantities = {json.dumps(_QUANTITIES)}" in (SCENES / "e_omega.toml").read_text()
    assert "pattern" in rm.explore(rm.gear_pair(), e=(0, 1, 2), omega=(1, 2, 2), progress=False).page
