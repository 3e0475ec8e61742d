"""Figures of maps whose cells have names (classes and periods, words, patterns, attractors), of diagrams and of orbits."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr

from . import _native
from .orbit import Orbit

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

#: Names of cells without a cycle, in the order of legends.
_WITHOUT_CYCLE = ("chaotic", "quasi-periodic", "undecided", "failed")

#: Name of cells without a value if their class is not known: chaotic, quasi-periodic, undecided or failed.
_NO_VALUE = "not periodic or undecided"

#: Units of a width, in inches; smallest and largest width; type size of figures with a width, in points.
_UNITS = {"mm": 1 / 25.4, "cm": 1 / 2.54, "in": 1.0, "pt": 1 / 72}
_WIDTHS = (60 / 25.4 - 1e-9, 300 / 25.4 + 1e-9)
_POINTS = 7.4

Texts = npt.NDArray[Any]


def plot(
    data: xr.Dataset | xr.DataArray | Orbit,
    *,
    y: str | None = None,
    ax: Axes | None = None,
    most: int = 16,
    legend: bool = True,
    width: str | None = None,
) -> Axes:
    """Draw a map whose cells have names, a bifurcation diagram or an orbit, in the colours of the program's figures.

    Use ``.plot()`` of xarray for numbers of a map, such as ``ds["lyapunov"]``.

    Parameters
    ----------
    data
        A map of :func:`rattlemap.map`, :func:`rattlemap.basins` or :func:`rattlemap.open`: draws its attractors if it has any,
        else periods and classes. Or one of its variables: ``ds["class"]``, ``ds["pattern"]``, ``ds["word"]``, ``ds["status"]``,
        ``ds["period"]``, ``ds["attractor"]``; two dimensions. Without the classes of its map, a variable cannot tell why a cell has
        no value. Or a diagram of :func:`rattlemap.bifurcation`, or an orbit of :func:`rattlemap.orbit`.
    y
        What to draw. Of a map: one of the variables above, such as ``"pattern"``. Cells without a value have the names of the
        program's figures: not periodic, undecided, failed, not known. Of a diagram: a component of the state at the walls, before
        contact, or a variable over the parameter, such as ``"lyapunov"``, whose branches are lines; by default the first component
        that is not the same at all walls. Of an orbit: a column of its trajectory against time; by default the velocity of the
        first gap against the gap.
    ax
        Axes to draw on; by default the current ones.
    most
        Largest number of names with a colour and a line in the legend: the most frequent ones, or the lowest periods. Other
        names share one.
    legend
        Whether to list the names and their shares of the cells.
    width
        Width of a new figure, such as ``"85mm"``, also in cm, in or pt. Its text has at least 7 points, and the legend is below
        the map. Without it the map is drawn on the current figure.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If a map does not have two dimensions, a Dataset has neither classes with periods nor attractors, ``width`` is not a
        length, both ``width`` and ``ax`` are given, or there is no ``y`` of this name.

    Examples
    --------
    >>> ds = rm.map(rm.gear_pair(), e=(0, 1, 16), omega=(1, 12, 16), quantities=["class", "pattern"])
    >>> _ = rm.plot(ds)
    >>> _ = rm.plot(ds, y="pattern", most=8)
    >>> _ = rm.plot(rm.orbit(rm.gear_pair(), e=0.605, omega=5.6))
    """
    import matplotlib.pyplot as plt
    from matplotlib.text import Text

    is_diagram = isinstance(data, xr.Dataset) and "point" in data.dims
    cells = _cell_names(data, y) if isinstance(data, xr.Dataset) and not is_diagram else data
    if isinstance(cells, xr.DataArray) and cells.ndim != 2:
        raise ValueError(f"a map must have two dimensions; this has {cells.ndim}: {', '.join(map(str, cells.dims))}")
    inches = None if width is None else _inches(width)
    if inches is None:
        axes = plt.gca() if ax is None else ax
    elif ax is not None:
        raise ValueError("width is for a new figure; give either width or ax, and set the size of your own figure with figsize")
    else:
        axes = plt.figure(figsize=(inches, inches), layout="constrained").add_subplot()
    if isinstance(cells, Orbit):
        title, keys = None, _draw_orbit(axes, cells, y)
    elif isinstance(cells, xr.Dataset):
        title, keys = None, _draw_diagram(axes, cells, y)
    else:
        title, keys = str(cells.name), _draw_cells(axes, cells, most)
    axes.set_title("")
    if legend and keys:
        lines, handles = [*keys], [*keys.values()]
        if inches is None:
            axes.legend(handles, lines, loc="upper left", bbox_to_anchor=(1.01, 1), title=title, fontsize="small")
        else:
            _legend_below(axes, handles, lines, inches)
    if inches is not None:
        for text in axes.figure.findobj(Text):
            text.set_fontsize(_POINTS)
    return axes


def _draw_cells(axes: Axes, cells: xr.DataArray, most: int) -> dict[str, Artist]:
    """Draw the names of cells. Returns the legend."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    names, places = _categories(cells, most)
    colors = [_color(name, place, str(cells.name)) for place, name in enumerate(names)]
    # The type stubs of xarray do not describe the method `plot`.
    image: Any = cells.copy(data=places)
    image.plot(ax=axes, cmap=ListedColormap(colors), vmin=-0.5, vmax=len(names) - 0.5, add_colorbar=False)
    shares = np.bincount(places.ravel(), minlength=len(names)) / max(places.size, 1)
    lines = [f"{_label(name)}  {_percent(share)}" for name, share in zip(names, shares, strict=True)]
    return {line: Patch(facecolor=color, edgecolor="0.4", linewidth=0.5) for line, color in zip(lines, colors, strict=True)}


def _draw_diagram(axes: Axes, ds: xr.Dataset, y: str | None) -> dict[str, Artist]:
    """Draw section points, coloured by wall or direction, or the branches of a variable. Returns the legend."""
    from matplotlib.lines import Line2D

    parameter = next(str(dim) for dim in ds["class"].dims if dim != "direction")
    states = {str(name).removesuffix("_before"): ds[name] for name in ds.data_vars if str(name).endswith("_before")}
    varied = [name for name, values in states.items() if values.size and np.ptp(values.values) > 1e-9]
    name = y or (varied or ["lyapunov"])[0]
    variable = states.get(name, ds.get(name))
    if variable is None or variable.dtype.kind not in "fiu":
        raise ValueError(f"y = {name!r}: the diagram has no numbers of this name")
    _label_axes(axes, ds[parameter].attrs, variable.attrs)
    names = ("upwards", "downwards") if "direction" in ds.dims else ("right wall", "left wall")
    colors = [_color(side, 0, "") for side in ("right", "left")]
    if name in states:
        is_first = ds["point_direction"] == "up" if "direction" in ds.dims else ds["side"] == 1
        for part, color in zip((is_first, ~is_first), colors, strict=True):
            axes.plot(ds[f"point_{parameter}"][part], variable[part], ".", ms=4 if part.size < 5000 else 1, mew=0, color=color)
        return {label: Line2D([], [], marker=".", ls="", color=color) for label, color in zip(names, colors, strict=True)}
    passes = [variable] if "direction" not in variable.dims else [variable.sel(direction=way) for way in ("up", "down")]
    # Where both passes agree, the second line lies within the first.
    drawn: dict[str, Artist] = {
        label: axes.plot(*_branches(ds[parameter].values, values.values), ".-", ms=2 * width, lw=width, color=color)[0]
        for label, values, color, width in zip(names, passes, colors, (2.5, 1), strict=False)
    }
    return drawn if len(passes) > 1 else {}


def _branches(x: npt.NDArray[Any], y: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return a curve with a gap at each jump: a step of a large share of the span, and much larger than those beside it."""
    y = np.where(np.isfinite(y), y, np.nan)
    steps = np.abs(np.diff(y))
    beside = np.fmax(np.append(0, steps[:-1]), np.append(steps[1:], 0))
    jumps = np.flatnonzero((steps > 0.15 * (np.fmax.reduce(y) - np.fmin.reduce(y))) & (steps > 4 * beside)) + 1
    return np.insert(x, jumps, np.nan), np.insert(y, jumps, np.nan)


def _draw_orbit(axes: Axes, orbit: Orbit, y: str | None) -> dict[str, Artist]:
    """Draw the phase plane of the first gap, or a column against time. An orbit needs no legend."""
    table = orbit.trajectory()
    names = tuple(table.columns[2:4]) if y is None else ("t", y)
    if y is not None and (y not in table or table[y].dtype.kind != "f"):
        raise ValueError(f"y = {y!r}: the trajectory has no numbers of this name; it has {', '.join(table.select_dtypes('float'))}")
    axes.plot(*(table[name] for name in names), lw=1, color="0.15")
    _label_axes(axes, *({"long_name": name, "units": orbit.units.get(name)} for name in names))
    return {}


def _label_axes(axes: Axes, *attrs: Any) -> None:
    """Write the names of both axes with their units."""
    axes.ticklabel_format(scilimits=(-3, 4))
    names = [each["long_name"] + (f" [{each['units']}]" if each.get("units") else "") for each in attrs]
    axes.set(xlabel=names[0], ylabel=names[1])


def _inches(width: str) -> float:
    """Return a width in inches."""
    length = re.fullmatch(r"\s*([0-9.]+)\s*(mm|cm|in|pt)\s*", str(width))
    try:
        inches = float(length[1]) * _UNITS[length[2]] if length else 0.0
    except ValueError:
        inches = 0.0
    if not _WIDTHS[0] <= inches <= _WIDTHS[1]:
        raise ValueError(f'width={width!r}: it must be a length from 60 mm to 300 mm with its unit, such as "85mm"')
    return inches


def _legend_below(axes: Axes, handles: list[Artist], lines: list[str], inches: float) -> None:
    """Draw the legend below the map, and make the figure higher by its height. Long words are cut in the middle."""
    # In millimetres: a patch with its margins, and a character.
    patch, character, page = 12, 1.7, inches * 25.4
    most = int((page - patch) / character)
    lines = [line if len(line) <= most else f"{line[: most - 12]}…{line[-11:]}" for line in lines]
    columns = max(1, int(page / (character * max(map(len, lines)) + patch)))
    rows = -(-len(lines) // columns)
    figure: Any = axes.figure
    figure.legend(handles, lines, loc="outside lower center", ncols=columns, fontsize=_POINTS, frameon=False)
    figure.set_figheight(inches + rows * 1.5 * _POINTS / 72)


def _cell_names(ds: xr.Dataset, y: str | None) -> xr.DataArray:
    """Return the names of a Dataset's cells, or the variable ``y`` with the classes of cells without a value."""
    if y is not None:
        if y not in ds:
            raise ValueError(f"the map has no variable {y!r}; it has {', '.join(map(str, ds))}")
        values = ds[y].astype(object) if ds[y].dtype.kind in "OU" else ds[y]
        if "class" not in ds or values.dtype.kind != "O":
            return values
        without = {"chaotic": "not periodic", "quasi-periodic": "not periodic", "periodic": "not known"}
        reasons = np.array([without.get(name, name) for name in ds["class"].values.ravel()], dtype=object)
        return values.where(values != "", reasons.reshape(values.shape)).rename(y)
    if "attractor" in ds:
        return ds["attractor"]
    if "class" not in ds:
        raise ValueError("the map has neither classes nor attractors; compute it with the quantity class, or draw one variable")
    if "period" not in ds:
        raise ValueError('the map has no variable "period", which colours periodic cells; draw its classes with rm.plot(ds["class"])')
    classes, periods = ds["class"].values, ds["period"].values
    known = {period: f"period {period}" for period in np.unique(periods)}
    texts = np.array([known[period] for period in periods.ravel()], dtype=object).reshape(periods.shape)
    return ds["class"].copy(data=np.where(classes == "periodic", texts, classes)).rename("motion")


def _categories(cells: xr.DataArray, most: int) -> tuple[list[str], npt.NDArray[np.intp]]:
    """Return the names in the order of the legend, and the place of each cell's name in it."""
    values = cells.values
    if values.dtype.kind in "iu":
        prefix = "attractor" if cells.name == "attractor" else str(cells.name)
        values = np.where(values < 0, "undecided", np.char.add(f"{prefix} ", values.astype(str)))
        values = np.where(values == "period 0", _NO_VALUE, values)
    texts = pd.Series(values.ravel().astype(object)).replace("", _NO_VALUE)
    counts = texts.value_counts()
    last = [name for name in ("not known", "not periodic", *_WITHOUT_CYCLE, _NO_VALUE) if name in counts.index]
    rest = [name for name in counts.index if name not in last]
    if all(str(name).rpartition(" ")[2].isdecimal() for name in rest):
        rest.sort(key=lambda name: int(str(name).rpartition(" ")[2]))
    names = rest[:most]
    others = len(rest) - len(names)
    if others:
        names.append(f"{others} others")
    names += last
    place = {name: number for number, name in enumerate(names)}
    return [str(name) for name in names], texts.map(lambda name: place.get(name, most)).to_numpy(np.intp).reshape(values.shape)


def _color(name: str, place: int, variable: str) -> tuple[float, float, float]:
    """Return the colour of a name at this place of the legend."""
    named, in_a_row = _native.colors()
    kind, _, number = name.rpartition(" ")
    if name in ("not periodic", _NO_VALUE):
        rgb = named["chaotic"]
    elif name in named and name != "rare":
        rgb = named[name]
    elif name.endswith(" others"):
        rgb = named["rare"]
    elif name == "w":
        rgb = named["without events"]
    elif kind == "period" and number.isdecimal():
        rgb = in_a_row[(int(number) - 2) % len(in_a_row)]
    elif place == 0:
        rgb = named["period 1" if variable == "attractor" else "commonest"]
    else:
        rgb = in_a_row[(place - 1) % len(in_a_row)]
    red, green, blue = rgb
    return red / 255, green / 255, blue / 255


def _label(name: str) -> str:
    """Return a name for the legend: words without the letter `w` that makes them text in tables."""
    if name == "w":
        return "no events"
    return name[1:] if name.startswith("w") and name[1:2] in tuple("#01234567") else name


def _percent(share: float) -> str:
    return "< 0.1 %" if 0 < share < 0.001 else f"{100 * share:.1f} %"
