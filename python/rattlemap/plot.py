"""Maps of what has names: classes and periods, words, patterns, attractors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr

from . import _native

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: What a cell without a cycle is, in the order of legends.
_WITHOUT_CYCLE = ("chaotic", "undecided", "failed")

Texts = npt.NDArray[Any]


def plot(data: xr.Dataset | xr.DataArray, *, ax: Axes | None = None, most: int = 16, legend: bool = True) -> Axes:
    """Draw a map whose cells have names, in the colours of the program's own figures.

    Numbers (``ds["lyapunov"]``) need nothing of it: ``.plot()`` of xarray draws them.

    Parameters
    ----------
    data
        A map of :func:`rattlemap.map`, :func:`rattlemap.basins` or :func:`rattlemap.open`: attractors where it has them,
        else periods and classes. Or one of its variables: ``ds["class"]``, ``ds["pattern"]``, ``ds["word"]``,
        ``ds["status"]``, ``ds["period"]``, ``ds["attractor"]``; two dimensions.
    ax
        Where to draw; the current axes unless told.
    most
        Names that get a colour and a line in the legend, the most frequent ones; others share one. Of periods the lowest.
    legend
        Whether to list the names, with their share of the cells, beside the map.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ValueError
        If there are not two dimensions, or a Dataset has neither classes nor attractors.

    Examples
    --------
    >>> ds = rm.map(rm.gear_pair(), e=(0, 1, 16), omega=(1, 12, 16), quantities=["class", "pattern"])
    >>> _ = rm.plot(ds)
    >>> _ = rm.plot(ds["pattern"], most=8)
    """
    import matplotlib.pyplot as plt
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    cells = _named(data) if isinstance(data, xr.Dataset) else data
    if cells.ndim != 2:
        raise ValueError(f"a map has two dimensions, and this has {cells.ndim}: {', '.join(map(str, cells.dims))}")
    names, places = _categories(cells, most)
    colors = [_color(name, place, str(cells.name)) for place, name in enumerate(names)]
    # Stubs of xarray do not know that a DataArray has its plot bound.
    drawn: Any = cells.copy(data=places)
    axes = plt.gca() if ax is None else ax
    drawn.plot(ax=axes, cmap=ListedColormap(colors), vmin=-0.5, vmax=len(names) - 0.5, add_colorbar=False)
    axes.set_title("")
    if legend:
        shares = np.bincount(places.ravel(), minlength=len(names)) / max(places.size, 1)
        lines = [f"{_told(name)}  {_percent(share)}" for name, share in zip(names, shares, strict=True)]
        handles = [Patch(facecolor=color, edgecolor="0.4", linewidth=0.5) for color in colors]
        axes.legend(handles, lines, loc="upper left", bbox_to_anchor=(1.01, 1), title=str(cells.name), fontsize="small")
    return axes


def _named(ds: xr.Dataset) -> xr.DataArray:
    """What a Dataset's cells are called."""
    if "attractor" in ds:
        return ds["attractor"]
    if "class" not in ds:
        raise ValueError("there is neither a class nor an attractor to draw; ask for the quantity class, or draw one variable")
    classes, periods = ds["class"].values, ds["period"].values
    known = {period: f"period {period}" for period in np.unique(periods)}
    texts = np.array([known[period] for period in periods.ravel()], dtype=object).reshape(periods.shape)
    return ds["class"].copy(data=np.where(classes == "periodic", texts, classes)).rename("motion")


def _categories(cells: xr.DataArray, most: int) -> tuple[list[str], npt.NDArray[np.intp]]:
    """Names in the order of a legend, and the place among them of every cell."""
    values = cells.values
    if values.dtype.kind in "iu":
        prefix = "attractor" if cells.name == "attractor" else str(cells.name)
        values = np.where(values < 0, "undecided", np.char.add(f"{prefix} ", values.astype(str)))
        values = np.where(values == "period 0", "not periodic", values)
    texts = pd.Series(values.ravel().astype(object)).replace("", "not periodic")
    counts = texts.value_counts()
    last = [name for name in (*_WITHOUT_CYCLE, "not periodic") if name in counts.index]
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
    """The colour of a name that stands at this place of the legend."""
    named, in_a_row = _native.colors()
    kind, _, number = name.rpartition(" ")
    if name == "not periodic":
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


def _told(name: str) -> str:
    """A name as legends have it: words without the letter that makes them text in tables."""
    if name == "w":
        return "no events"
    return name[1:] if name.startswith("w") and name[1:2] in tuple("#123456") else name


def _percent(share: float) -> str:
    return "< 0.1 %" if 0 < share < 0.001 else f"{100 * share:.1f} %"
