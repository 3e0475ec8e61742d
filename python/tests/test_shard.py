"""Shards and merging in the native module: equal to the map of one run."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest
import rattlemap as rm
from conftest import TIMES, assert_same
from rattlemap import _native, scenes


def test_all_shards_are_the_map(tmp_path: Path) -> None:
    model = rm.gear_pair(F=60)
    axes = {"e": (0.0, 1.0, 10), "omega": (1.0, 12.0, 8)}
    # A task on another machine receives the scene as a pickle.
    scene = pickle.loads(pickle.dumps(scenes.scene_of(model, None, axes, purpose="map", axes=2)))
    parts = [str(tmp_path / f"part-{index}") for index in (1, 2, 3)]
    for index, part in enumerate(parts, 1):
        _native.shard(scene, index, 3, "cpu", None, part)
    with pytest.raises(rm.FolderError, match="2/3"):
        _native.merge(parts[::2], str(tmp_path / "all"))
    _native.merge(parts[::-1], str(tmp_path / "all"))
    assert_same(rm.map(model, **axes, engine="cpu"), rm.open(tmp_path / "all"), (*TIMES, "processor", "shards"))


def test_wrong_shards_are_refused(tmp_path: Path) -> None:
    axes = {"e": (0, 1, 4), "omega": (1, 12, 4)}
    scene = scenes.scene_of(rm.gear_pair(), None, axes, purpose="map", axes=2)
    with pytest.raises(rm.EngineError, match='engine="auto" may choose different engines on different machines'):
        _native.shard(scene, 1, 2, "auto", None, str(tmp_path / "part"))
    with pytest.raises(rm.SceneError, match='shard="0/2": shards are counted from 1'):
        _native.shard(scene, 0, 2, "cpu", None, str(tmp_path / "part"))
