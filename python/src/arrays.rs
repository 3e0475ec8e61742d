//! Converts columns to NumPy arrays without copying them.

use numpy::{Element, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rattlemap::show::table::cell_columns::Values;

/// Converts a vector.
pub(crate) fn array<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyAny> {
    PyArray1::from_vec(py, values).into_any()
}

/// Converts columns to a dictionary by name, in their order.
pub(crate) fn columns(py: Python<'_>, columns: Vec<(String, Values)>) -> PyResult<Bound<'_, PyDict>> {
    let by_name = PyDict::new(py);
    for (name, values) in columns {
        let values = match values {
            Values::I8(values) => array(py, values),
            Values::U8(values) => array(py, values),
            Values::U16(values) => array(py, values),
            Values::U32(values) => array(py, values),
            Values::I32(values) => array(py, values),
            Values::F64(values) => array(py, values),
        };
        by_name.set_item(name, values)?;
    }
    Ok(by_name)
}
