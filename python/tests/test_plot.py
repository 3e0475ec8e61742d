"""rattlemap.plot: names, colours and shares of cells, equal to those of the program's figures."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
import rattlemap as rm
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.text import Text
from rattlemap.plot import _branches


@pytest.fixture(scope="module")
def ds() -> xr.Dataset:
    return rm.map(rm.gear_pair(), e=(0, 1, 20), omega=(1, 12, 16), engine="cpu", quantities=["class", "word", "pattern"])


@pytest.fixture
def axes() -> Iterator[Axes]:
    figure, axes = plt.subplots()
    yield axes
    plt.close(figure)


def legend(axes: Axes) -> dict[str, tuple[str, str]]:
    """Returns share and colour by name."""
    found = axes.get_legend()
    assert found is not None
    lines = [text.get_text().split("  ") for text in found.get_texts()]
    colors = [to_hex(patch.get_facecolor()) for patch in found.get_patches()]
    return {name: (share, color) for (name, share), color in zip(lines, colors, strict=True)}


def cell_color(axes: Axes, place: tuple[int, int]) -> str:
    """Returns the colour of a cell."""
    mesh = axes.collections[0]
    numbers = np.asarray(mesh.get_array())
    return to_hex(mesh.cmap(mesh.norm(numbers[place])))


def test_periods_and_classes_of_a_map(ds: xr.Dataset, axes: Axes) -> None:
    assert rm.plot(ds, ax=axes) is axes
    lines = legend(axes)
    names = list(lines)
    assert names[:2] == ["period 1", "period 3"] and names[names.index("chaotic") - 1].startswith("period ")
    share = (ds["class"] == "chaotic").mean().item()
    assert lines["chaotic"] == (f"{100 * share:.1f} %", "#2a2a2a")
    # Colours of map.png.
    assert [lines[name][1] for name in ("period 1", "period 3")] == ["#c9e5fc", "#059d76"]
    for place in np.ndindex(ds["class"].shape):
        cell = ds.isel(omega=place[0], e=place[1])
        name = f"period {cell['period'].item()}" if cell["class"] == "periodic" else cell["class"].item()
        assert cell_color(axes, place) == lines[name][1], place
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("coefficient of restitution", "excitation frequency")


def test_the_most_frequent_words_have_names(ds: xr.Dataset, axes: Axes) -> None:
    rm.plot(ds["pattern"], ax=axes, most=4)
    lines = legend(axes)
    counts = ds["pattern"].to_series().value_counts().drop("")
    assert list(lines)[:4] == [text[1:] or "no events" for text in counts.index[:4]]
    assert list(lines)[4:] == [f"{len(counts) - 4} others", "not periodic or undecided"]
    assert lines["36"][1] == "#b4d0e8" and lines["no events"][1] == "#f2f2f2"


def test_cells_without_a_pattern_have_the_names_of_their_classes(ds: xr.Dataset, axes: Axes) -> None:
    classes = ds["class"].copy(deep=True)
    classes.values[0, :4] = ["undecided", "failed", "chaotic", "periodic"]
    pattern = ds["pattern"].copy(deep=True)
    pattern.values[0, :4] = ""
    rm.plot(ds.assign({"class": classes, "pattern": pattern}), y="pattern", ax=axes)
    lines = legend(axes)
    names = ["undecided", "failed", "not periodic", "not known"]
    assert [cell_color(axes, (0, i)) for i in range(4)] == [lines[name][1] for name in names]
    assert len({lines[name][1] for name in names}) == 4 and "not periodic or undecided" not in lines
    with pytest.raises(ValueError, match="no variable 'moment'"):
        rm.plot(ds, y="moment", ax=axes)


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
    with pytest.raises(ValueError, match=r'no variable "period".*rm.plot\(ds\["class"\]\)'):
        rm.plot(ds.drop_vars("period"), ax=axes)


def test_a_figure_of_a_given_width_holds_all_its_texts_in_type_of_seven_points(ds: xr.Dataset) -> None:
    for data, width in [(ds, "85mm"), (ds["pattern"], "85mm"), (ds, "180mm")]:
        axes = rm.plot(data, width=width)
        figure: Any = axes.figure
        figure.canvas.draw()
        page = figure.bbox
        assert page.width / figure.dpi * 25.4 == pytest.approx(float(width[:-2]))
        # Matplotlib keeps labels of ticks beyond the axes, and does not draw them.
        drawn: list[Text] = []
        for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            drawn += [tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
        drawn += [*figure.legends[0].get_texts(), axes.xaxis.label, axes.yaxis.label]
        for text in figure.findobj(Text):
            assert not text.get_text() or text.get_fontsize() >= 7, text
            if text in drawn:
                box = text.get_window_extent()
                assert box.x0 >= 0 and box.x1 <= page.x1 and box.y0 >= 0 and box.y1 <= page.y1, (text, box, page)
        assert len(figure.legends) == 1
        plt.close("all")
    assert not rm.plot(ds, width="85mm", legend=False).figure.legends
    plt.close("all")


def test_a_wrong_width_is_refused(ds: xr.Dataset, axes: Axes) -> None:
    for width in ("85", "85 m", "5mm", "1.2.3mm"):
        with pytest.raises(ValueError, match="a length from 60 mm"):
            rm.plot(ds, width=width)
    with pytest.raises(ValueError, match="either width or ax"):
        rm.plot(ds, ax=axes, width="85mm")


def test_a_diagram_has_points_by_wall_and_branches_as_lines(axes: Axes) -> None:
    line = rm.bifurcation(rm.gear_pair(), e=(0.05, 0.2, 12), omega=5.6)
    assert rm.plot(line, ax=axes) is axes
    drawn = {curve.get_color(): len(np.asarray(curve.get_xdata())) for curve in axes.lines}
    assert sum(drawn.values()) == line.sizes["point"] and len(drawn) == 2
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("coefficient of restitution", "displacement of gear 1 before the event")
    both = rm.bifurcation(rm.load_model("impact-oscillator"), omega=(0.6, 0.9, 6), start="both", quantities="amplitude")
    axes.clear()
    rm.plot(both, y="amplitude_x", ax=axes)
    assert [curve.get_linewidth() for curve in axes.lines] == [2.5, 1]
    with pytest.raises(ValueError, match="no numbers of this name"):
        rm.plot(both, y="word", ax=axes)


def test_a_jump_ends_a_branch() -> None:
    x, y = _branches(np.arange(6.0), np.array([1.0, 1.1, 1.2, 0.1, 0.2, -np.inf]))
    assert x.tolist()[:3] == [0, 1, 2] and np.isnan(x[3]) and x.tolist()[4:] == [3, 4, 5]
    assert np.isnan(y[[3, 6]]).all()


def test_an_orbit_is_drawn_in_its_phase_plane_or_against_time(axes: Axes) -> None:
    orbit = rm.orbit(rm.load_model("loose-gear"))
    rm.plot(orbit, ax=axes)
    gap, rate = orbit.trajectory().columns[2:4]
    assert axes.get_xlabel() == f"{gap} [{orbit.units[gap]}]" and axes.get_ylabel().startswith(rate)
    axes.clear()
    rm.plot(orbit, y=gap, ax=axes)
    assert axes.get_xlabel() == "t [s]"
    with pytest.raises(ValueError, match="the trajectory has no numbers"):
        rm.plot(orbit, y="moment", ax=axes)
