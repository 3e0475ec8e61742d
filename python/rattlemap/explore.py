"""A page that computes a map on demand, as a widget of a notebook."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from . import _native, scenes
from .engine import interruptible
from .errors import SceneError
from .model import Model, gear_pair
from .orbit import Orbit, orbit
from .progress import Report, reporter

if TYPE_CHECKING:
    import anywidget

#: Shows the page in a frame, and passes on the command of the cell that is selected in it.
_SCRIPT = """
function render({ model, el }) {
  const frame = document.createElement("iframe");
  frame.style = `width: 100%; height: ${model.get("height")}px; border: 1px solid #8888; border-radius: 6px;`;
  frame.sandbox = "allow-scripts allow-downloads";
  frame.srcdoc = model.get("page");
  const receive = ({ source, data }) => {
    if (source !== frame.contentWindow || data?.kind !== "rattlemap") return;
    model.set("command", data.command);
    model.save_changes();
  };
  addEventListener("message", receive);
  el.append(frame);
  return () => removeEventListener("message", receive);
}
export default { render };
"""


#: What a page shows by default: the quantities of ``scenes/e_omega.toml``.
_QUANTITIES = ("class", "lyapunov", "impacts", "mesh", "symmetric", "word", "pattern")


class Explorer:
    """A page that shows a map and computes what is visible in it. :func:`explore` returns it.

    A notebook displays the page. After a zoom, or a move of a slider, the page computes new cells. A click selects a cell.
    """

    def __init__(self, model_file: tuple[str, str] | None, page: str, height: int) -> None:
        self.page = page
        """The page as HTML. It needs no other file and no network."""
        self._model_file = model_file
        self._height = height
        self._widget: anywidget.AnyWidget | None = None

    @property
    def widget(self) -> anywidget.AnyWidget:
        """The widget that the notebook shows; it needs the package anywidget."""
        if self._widget is None:
            self._widget = _widget_of(self.page, self._height)
        return self._widget

    @property
    def command(self) -> str | None:
        """The command ``rattlemap orbit ...`` of the selected cell; None before a selection."""
        return None if self._widget is None else self._widget.command or None

    @property
    def orbit(self) -> Orbit | None:
        """The motion of the selected cell, computed by this process; None before a selection."""
        return None if self.command is None else replayed(self.command, self._model_file)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the page to a file, which any browser opens."""
        Path(path).write_text(self.page, encoding="utf-8")

    def _repr_mimebundle_(self, **options: Any) -> Any:
        return self.widget._repr_mimebundle_(**options)


def _widget_of(page: str, height: int) -> anywidget.AnyWidget:
    import anywidget
    import traitlets

    class PageWidget(anywidget.AnyWidget):
        _esm = _SCRIPT
        page = traitlets.Unicode().tag(sync=True)
        height = traitlets.Int().tag(sync=True)
        command = traitlets.Unicode().tag(sync=True)

    return PageWidget(page=page, height=height)


def replayed(command: str, model_file: tuple[str, str] | None) -> Orbit:
    """Return the motion of a command ``rattlemap orbit ...`` that a page shows.

    ``model_file`` is the name and the text of the page's model file, None if its model is built in.
    """
    arguments = [part.split(" ", 1) for part in command.removeprefix("rattlemap orbit").split(" --")[1:]]
    sets = {key: float(value) for name, text in arguments if name == "set" for key, value in [text.split("=", 1)]}
    options = {name: text for name, text in arguments}
    # The command names values that differ from the defaults of the model.
    if model_file is not None:
        model = Model(_native.Model(model_file[1], model_file[0]))
    else:
        model = Model(_native.Model.find(options["model"])) if "model" in options else gear_pair()
    start = [float(x) for x in options["start"].split(",")] if "start" in options else None
    phase = sets.pop("start.phase", None)
    if "transient" in options:
        return orbit(model, parameters=sets, start=start, phase=phase, transient=int(options["transient"]))
    return orbit(model, parameters=sets, start=start, phase=phase)


def explore(
    model: Model | None = None,
    *,
    scene: str | os.PathLike[str] | None = None,
    set: Iterable[str] = (),  # noqa: A002
    axes: scenes.Axes | None = None,
    parameters: scenes.Parameters | None = None,
    quantities: Iterable[str] | None = None,
    start: scenes.Start | None = None,
    settings: Mapping[str, Any] | None = None,
    height: int = 760,
    progress: bool | Report = True,
    **names: Any,
) -> Explorer:
    """Return a page that computes a map on demand, like ``rattlemap explore``.

    Parameters
    ----------
    model, scene, set, axes, parameters, quantities, start, settings, **names
        The map, as in :func:`map`. Counts above 65 are reduced to 65, because the page computes finer cells of the visible
        part. The count may be left out: ``e=(0, 1)``. With a model, ``quantities`` are by default classes, exponents, impacts,
        meshing, symmetry, words and patterns.
    height
        Height of the page in a notebook, in pixels.
    progress
        As in :func:`map`.

    Returns
    -------
    Explorer
        A notebook displays it if the package ``anywidget`` is installed. ``.orbit`` is the motion of the selected cell.

    Raises
    ------
    SceneError
        If the request is wrong.
    ModelError
        If the model has no motion in a cell.

    Examples
    --------
    >>> page = rm.explore(rm.gear_pair(F=50), e=(0, 1), omega=(1, 12))
    >>> page.save("gear_pair.html")
    """
    ranges = {name: (*value, 65) if isinstance(value, tuple) and len(value) == 2 else value for name, value in names.items()}
    request = scenes.scene_of(
        model,
        scene,
        scenes.all_names(ranges, axes, parameters),
        purpose="map",
        axes=2,
        sets=set,
        quantities=_QUANTITIES if quantities is None and scene is None else quantities,
        start=start,
        settings=settings,
    )
    return _of_scene(request, height, progress)


def _of_scene(request: _native.Scene, height: int, progress: bool | Report) -> Explorer:
    with interruptible(None, resumable=False), reporter(progress, "cells") as report:
        page = _native.explore_page(request, report)
    return Explorer(request.__getnewargs__()[2], page, height)


@xr.register_dataset_accessor("rattlemap")  # type: ignore[no-untyped-call]
class Accessor:
    """Methods of a map: ``ds.rattlemap.explore()``."""

    def __init__(self, ds: xr.Dataset) -> None:
        self._ds = ds

    def explore(self, *, height: int = 760, progress: bool | Report = True) -> Explorer:
        """Return a page that computes this map on demand; see :func:`explore`."""
        attrs = self._ds.attrs
        if "scene" not in attrs or "model" not in attrs or "axes" not in attrs:
            raise SceneError("this Dataset does not describe a map; use one that rm.map or rm.open returned")
        model = json.loads(attrs["model"])
        file = None if model["text"] is None else (f"{model['name']}.toml", model["text"])
        return _of_scene(_native.Scene(attrs["scene"], json.loads(attrs["set"]), file), height, progress)
