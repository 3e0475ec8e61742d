"""Shards and merging in the native module: the map is that of one run."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest
import rattlemap as rm
from compare import assert_same
from rattlemap import _native, asking


def test_all_shards_are_the_map(tmp_path: Path) -> None:
    model = rm.gear_pair(F=60)
    axes = {"e": (0.0, 1.0, 20), "omega": (1.0, 12.0, 16)}
    scene = asking.scene(model, axes, purpose="map", axes=2)
    # As a task on another machine gets it.
    scene = pickle.loads(pickle.dumps(scene))
    parts = [str(tmp_path / f"part-{index}") for index in (1, 2, 3)]
    for index, part in enumerate(parts, 1):
        _native.shard(scene, index, 3, "cpu", None, part)
    with pytest.raises(rm.FolderError, match="2/3"):
        _native.merge(parts[::2], str(tmp_path / "all"))
    made = _native.merge(parts[::-1], str(tmp_path / "all"))
    assert "cells.npy" in made["files"]
    whole = rm.map(model, **axes, engine="cpu")
    merged = rm.open(tmp_path / "all")
    for name in ("processor", "shards"):
        merged.attrs[name] = whole.attrs.get(name)
        whole.attrs[name] = merged.attrs[name]
    assert_same(whole, merged)


def test_what_cannot_be_a_shard_is_refused(tmp_path: Path) -> None:
    scene = asking.scene(rm.gear_pair(), {"e": (0, 1, 4), "omega": (1, 12, 4)}, purpose="map", axes=2)
    with pytest.raises(rm.EngineError, match="auto may choose otherwise on another machine"):
        _native.shard(scene, 1, 2, "auto", None, str(tmp_path / "part"))
    with pytest.raises(rm.SceneError, match="--shard 0/2: shards are counted from 1"):
        _native.shard(scene, 0, 2, "cpu", None, str(tmp_path / "part"))
