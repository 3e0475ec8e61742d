//! `rattlemap orbit`: one motion, read and written down.

use rattlemap_dynamics::orbit::{self, Class};

use super::arguments::{DEFAULT_RESTITUTION, Orbit};
use super::error::{Failure, fail_if};
use crate::map::scene;
use crate::output::{self, Folder};

pub(crate) fn run(ask: &Orbit) -> Result<(), Failure> {
    let model = scene::single_cell(DEFAULT_RESTITUTION, &ask.set)?;
    let folder = ask.out.as_ref().map(|dir| Folder::open(dir, ask.force)).transpose()?;
    if let Some(folder) = &folder {
        folder.refuse_links(output::orbit::names())?;
    }
    let orbit = orbit::analyse(&*model, ask.start(), &ask.settings())?;
    output::orbit::print(&*model, &orbit, ask.json)?;
    let failed = orbit.class == Class::Failed;
    if let Some(folder) = folder {
        output::orbit::write(&folder, &*model, &orbit)?;
    }
    fail_if(failed, "the integration failed; `status` says why")
}
