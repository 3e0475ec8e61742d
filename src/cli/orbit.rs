//! `rattlemap orbit`: one motion, read and written down.

use std::time::Instant;

use anyhow::anyhow;
use rattlemap_dynamics::orbit::{self, Class};

use super::arguments::{DEFAULT_RESTITUTION, Orbit};
use super::error::{Failure, fail_if};
use super::interrupt::Interrupt;
use crate::map::scene;
use crate::output::orbit::Asked;
use crate::output::{self, Folder};

pub(crate) fn run(ask: &Orbit) -> Result<(), Failure> {
    let model = scene::single_cell(DEFAULT_RESTITUTION, &ask.set)?;
    let interrupt = Interrupt::listen(true)?;
    let folder = ask.out.as_ref().map(|dir| Folder::open(dir, ask.force)).transpose()?;
    if let Some(folder) = &folder {
        folder.refuse_links(output::orbit::names())?;
    }
    let clock = Instant::now();
    let (start, settings) = (ask.start(), ask.settings());
    let (shown, halt) = (orbit::SHOWN_PERIODS, interrupt.raised());
    let Some(orbit) = orbit::analyse_until(&*model, start, &settings, shown, halt)? else {
        return Err(
            interrupt.failure(anyhow!("interrupted before the motion was decided; nothing was written"))
        );
    };
    let asked = Asked { start, settings, elapsed: clock.elapsed() };
    output::orbit::print(&*model, &orbit, ask.json)?;
    let failed = orbit.class == Class::Failed;
    if let Some(folder) = folder {
        output::orbit::write(&folder, &*model, &orbit, &asked)?;
    }
    fail_if(failed, "the integration failed; `status` says why")
}
