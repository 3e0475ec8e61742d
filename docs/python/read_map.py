"""A map of rattlemap in Python: the table with pandas, the array with numpy, all of it as an xarray.Dataset, and a figure.

    pip install -r docs/python/requirements.txt
    python docs/python/read_map.py out/e_omega out/e_omega.png

The scene asks for "lyapunov", "word" and "pattern", and for the files csv and npy.
"""

import json
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.colors import ListedColormap, TwoSlopeNorm


def read_table(folder: Path) -> pd.DataFrame:
    """`cells.csv`, a row per cell. Words and patterns begin with `w`, so they stay text; what is absent is missing.

    Numbers are those that the program had, to the last bit: what pandas 2 does by itself rounds a second time.
    """
    return pd.read_csv(folder / "cells.csv", float_precision="round_trip")


def read_dataset(folder: Path) -> xr.Dataset:
    """`cells.npy` over its axes, with codes and rows of words as text."""
    manifest = json.loads((folder / "manifest.json").read_text())
    if len(manifest.get("axes", [])) != 2:
        sys.exit(f"{folder} has no two axes; read the table of a list of cells as it is, with read_table")
    cells = np.load(folder / "cells.npy")
    first, second = (axis["parameter"] for axis in manifest["axes"])
    columns, rows = (axis["count"] for axis in manifest["axes"])
    grid = cells.reshape(rows, columns)  # the first axis runs fastest
    fields = [name for name in grid.dtype.names if name not in ("i", "j", first, second)]
    dataset = xr.Dataset(
        {name: ((second, first), grid[name]) for name in fields},
        coords={first: grid[first][0, :], second: grid[second][:, 0]},
    )
    for name, codes in manifest["codes"].items():
        if name in dataset:
            names = np.full(256, "", dtype=object)
            for text, code in codes.items():
                names[code] = text  # absent is -1, the last one
            dataset[name] = dataset[name].dims, names[grid[name]]
    spelled = [name for name in ("word", "pattern") if name in dataset]
    if spelled:
        texts = pd.read_csv(folder / "words.csv", keep_default_na=False)["text"].to_numpy(dtype=object)
        for name in spelled:
            dataset[name] = dataset[name].dims, texts[grid[name]]
    return dataset


def draw(dataset: xr.Dataset, path: Path, most: int = 12) -> None:
    """The exponent, and the most frequent patterns."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(15, 6), layout="constrained")
    exponent = dataset["lyapunov"]
    low, high = exponent.quantile([0.02, 0.98]).values
    norm = TwoSlopeNorm(0.0, vmin=min(low, -1e-3), vmax=max(high, 1e-3))
    exponent.plot(ax=left, cmap="RdBu_r", norm=norm, cbar_kwargs={"label": "largest Lyapunov exponent"})
    left.set_title("exponent")

    counts = pd.Series(dataset["pattern"].values.ravel()).value_counts()
    named = [text for text in counts.index if text][:most]
    place = {text: k for k, text in enumerate(named)}
    # The last two places: patterns without a name, and no pattern.
    numbers = [place.get(text, most if text else most + 1) for text in dataset["pattern"].values.ravel()]
    shown = xr.DataArray(np.reshape(numbers, dataset["pattern"].shape), dataset["pattern"].coords, dataset["pattern"].dims)
    colors = [*plt.get_cmap("tab20").colors[:most], "0.45", "0.92"]
    shown.plot(ax=right, cmap=ListedColormap(colors), vmin=-0.5, vmax=most + 1.5, add_colorbar=False)
    labels = [text[1:] or "no events" for text in named]
    handles = [plt.Rectangle((0, 0), 1, 1, color=colors[k]) for k in [*range(len(named)), most, most + 1]]
    right.legend(handles, [*labels, "other patterns", "no cycle"], loc="upper left", bbox_to_anchor=(1.02, 1.0))
    right.set_title("pattern")
    figure.savefig(path, dpi=120)


def main() -> None:
    if len(sys.argv) != 3:
        sys.exit("usage: read_map.py FOLDER PICTURE")
    folder, picture = map(Path, sys.argv[1:])
    dataset, table = read_dataset(folder), read_table(folder)
    missing = {"lyapunov", "word", "pattern"} - set(dataset)
    if missing:
        sys.exit(f"{folder} has no {', '.join(sorted(missing))}; add it to the scene's outputs.quantities")
    print(table.groupby("class").size().to_string())
    for name in ("word", "pattern"):
        texts = table[name].dropna()
        assert texts.map(type).eq(str).all(), f"{name}: not text"
        assert (table[name].fillna("") == dataset[name].values.ravel()).all(), f"{name}: table and array differ"
        most = f", {texts.value_counts().index[0]} most often" if len(texts) else ""
        print(f"{name}: {texts.nunique()} of them{most}")
    assert np.array_equal(table["lyapunov"], dataset["lyapunov"].values.ravel(), equal_nan=True)
    draw(dataset, picture)


main()
