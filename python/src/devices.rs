//! Processor and graphics adapters of the machine.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use rattlemap::gpu;
use rattlemap::job;

use crate::problem::Problem;
use crate::worker;

/// Returns the processor, the graphics adapters, and the engine that `auto` takes.
#[pyfunction]
pub(crate) fn devices(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let found = worker::run(py, None, |_| Ok::<_, Problem>(Some(job::devices::devices()?)))?;
    let adapters = PyList::empty(py);
    for adapter in &found.adapters {
        let precisions: Vec<&str> = adapter.precisions.iter().map(|precision| precision.name()).collect();
        let row = PyDict::new(py);
        row.set_item("number", adapter.number)?;
        row.set_item("name", gpu::describe(&adapter.info))?;
        row.set_item("is_hardware", gpu::is_hardware(&adapter.info))?;
        row.set_item("precisions", precisions.join(" "))?;
        row.set_item("interface", format!("{:?}", adapter.info.backend))?;
        row.set_item("pci", adapter.id().pci)?;
        row.set_item("largest_binding", adapter.largest_binding)?;
        row.set_item("most_lanes", adapter.most_lanes)?;
        adapters.append(row)?;
    }
    let dict = PyDict::new(py);
    dict.set_item("processor", found.processor)?;
    dict.set_item("adapters", adapters)?;
    dict.set_item("engine", found.engine)?;
    dict.set_item("precision", found.precision)?;
    dict.set_item("reason", found.reason)?;
    Ok(dict)
}
