"""How answers are compared with the program's: to the bit."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr


def assert_same(made: xr.Dataset, of_program: xr.Dataset) -> None:
    """The same variables, coordinates, types and bits; of the attributes all but times."""
    assert [*made.variables] == [*of_program.variables]
    for name in made.variables:
        a, b = made[name], of_program[name]
        assert (a.dims, a.dtype, a.attrs.keys()) == (b.dims, b.dtype, b.attrs.keys()), name
        if a.dtype == object:
            assert a.values.tolist() == b.values.tolist(), name
        else:
            assert a.values.tobytes() == b.values.tobytes(), name
    times = {"elapsed_seconds", "timings", "set", "scene"}
    assert {**made.attrs, **dict.fromkeys(times)} == {**of_program.attrs, **dict.fromkeys(times)}


def assert_same_frame(made: pd.DataFrame, of_program: pd.DataFrame) -> None:
    """The same columns with the same values; text that is empty is what a table has as nothing."""
    assert [*made.columns] == [*of_program.columns]
    for name in made.columns:
        values, expected = made[name].to_numpy(), of_program[name].to_numpy()
        if values.dtype.kind in "fiu":
            assert np.array_equal(values, expected, equal_nan=True), name
        else:
            assert values.tolist() == expected.tolist(), name
