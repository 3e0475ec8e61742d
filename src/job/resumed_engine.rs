//! The engine of a run that resumes.

use std::path::Path;

use crate::gpu::Precision;
use crate::job::engine_choice::{Ask, Who};
use crate::store::record_file::{Identity, RECORDS};

/// Returns the requested engine; if the request leaves it open, the engine that computed the folder's records.
#[must_use]
pub fn engine_of(request: Ask, folder: &Path) -> Ask {
    if request.engine != Who::Auto || request.precision.is_some() {
        return request;
    }
    match Identity::read(&folder.join(RECORDS)) {
        Ok(Some(identity)) if identity.engine() == "cpu" && request.adapter.is_none() => {
            Ask { engine: Who::Cpu, ..request }
        }
        Ok(Some(identity)) => {
            let precision = Precision::ALL.into_iter().find(|p| p.name() == identity.precision());
            Ask { engine: Who::Gpu, precision, ..request }
        }
        // An unreadable file is reported when the records are resumed.
        Ok(None) | Err(_) => request,
    }
}
