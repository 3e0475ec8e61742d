"""rattlemap.plot: names, colours and shares of a map's cells, as the program's figures have them."""

from __future__ import annotations

from collections.abc import Iterator

import matplotlib.pyplot as plt
import numpy as np
import pytest
import rattlemap as rm
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import to_hex


@pytest.fixture(scope="module")
def ds() -> xr.Dataset:
    return rm.map(rm.gear_pair(), e=(0, 1, 20), omega=(1, 12, 16), engine="cpu", quantities=["class", "word", "pattern"])


@pytest.fixture
def axes() -> Iterator[Axes]:
    figure, axes = plt.subplots()
    yield axes
    plt.close(figure)


def legend(axes: Axes) -> dict[str, tuple[str, str]]:
    """By name the share and the colour."""
    shown = axes.get_legend()
    assert shown is not None
    lines = [text.get_text().split("  ") for text in shown.get_texts()]
    colors = [to_hex(patch.get_facecolor()) for patch in shown.get_patches()]
    return {name: (share, color) for (name, share), color in zip(lines, colors, strict=True)}


def drawn(axes: Axes, place: tuple[int, int]) -> str:
    """The colour of a cell."""
    mesh = axes.collections[0]
    numbers = np.asarray(mesh.get_array())
    return to_hex(mesh.cmap(mesh.norm(numbers[place])))


def test_periods_and_classes_of_a_map(ds: xr.Dataset, axes: Axes) -> None:
    assert rm.plot(ds, ax=axes) is axes
    told = legend(axes)
    names = list(told)
    assert names[:2] == ["period 1", "period 3"] and names[names.index("chaotic") - 1].startswith("period ")
    share = (ds["class"] == "chaotic").mean().item()
    assert told["chaotic"] == (f"{100 * share:.1f} %", "#2a2a2a")
    # Those of map.png.
    assert [told[name][1] for name in ("period 1", "period 3")] == ["#c9e5fc", "#059d76"]
    for place in np.ndindex(ds["class"].shape):
        cell = ds.isel(omega=place[0], e=place[1])
        name = f"period {cell['period'].item()}" if cell["class"] == "periodic" else cell["class"].item()
        assert drawn(axes, place) == told[name][1], place
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("e", "omega")


def test_the_most_frequent_words_have_names(ds: xr.Dataset, axes: Axes) -> None:
    rm.plot(ds["pattern"], ax=axes, most=4)
    told = legend(axes)
    counts = ds["pattern"].to_series().value_counts().drop("")
    assert list(told)[:4] == [text[1:] or "no events" for text in counts.index[:4]]
    assert list(told)[4:] == [f"{len(counts) - 4} others", "not periodic"]
    assert told["36"][1] == "#b4d0e8" and told["no events"][1] == "#f2f2f2"


def test_attractors_and_single_variables(ds: xr.Dataset, axes: Axes) -> None:
    basins = rm.basins(rm.load_model("impact-oscillator"), x=(-1, 1, 12), v=(-1, 1, 10), omega=2.8, engine="cpu")
    rm.plot(basins, ax=axes)
    assert list(legend(axes))[:2] == ["attractor 0", "attractor 1"]
    for name in ("class", "status", "period"):
        axes.clear()
        rm.plot(ds[name], ax=axes, legend=False)
        assert axes.get_legend() is None
    with pytest.raises(ValueError, match="two dimensions"):
        rm.plot(ds["class"].isel(e=0), ax=axes)
    with pytest.raises(ValueError, match="neither"):
        rm.plot(ds.drop_vars("class"), ax=axes)
