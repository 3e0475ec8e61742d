//! The native module of the Python package `rattlemap`: the library's functions, and the program.

mod program;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::program::{main, missing_variable};

    use super::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
