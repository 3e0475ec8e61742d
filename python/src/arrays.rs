//! Converts columns to NumPy arrays without copying them.

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rattlemap::show::table::cell_columns::Values;

/// Converts columns to a dictionary by name, in their order.
pub(crate) fn columns(py: Python<'_>, columns: Vec<(String, Values)>) -> PyResult<Bound<'_, PyDict>> {
    let by_name = PyDict::new(py);
    for (name, values) in columns {
        let array = match values {
            Values::I8(values) => PyArray1::from_vec(py, values).into_any(),
            Values::U8(values) => PyArray1::from_vec(py, values).into_any(),
            Values::U16(values) => PyArray1::from_vec(py, values).into_any(),
            Values::U32(values) => PyArray1::from_vec(py, values).into_any(),
            Values::I32(values) => PyArray1::from_vec(py, values).into_any(),
            Values::F64(values) => PyArray1::from_vec(py, values).into_any(),
        };
        by_name.set_item(name, array)?;
    }
    Ok(by_name)
}
