//! `rattlemap explore`: opens a page that computes a map on demand.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::anyhow;

use super::arguments::Explore;
use super::console::Console;
use super::failure::Failure;
use super::interrupt::Interrupt;
use crate::cli::say;
use crate::job::explore;
use crate::job::scene_file::SceneFile;
use crate::store::folder::Folder;
use crate::store::map::REPORT;
use crate::store::plain_file;

/// Writes the page of a scene, or finds that of a finished map, and opens it.
pub(crate) fn run(arguments: &Explore) -> Result<(), Failure> {
    let page = match arguments.what.is_dir() {
        true if !arguments.set.is_empty() || arguments.out.is_some() => {
            return Err(Failure::Usage(anyhow!(
                "--set and --out are for a scene; a folder has its page, {REPORT}: give the scene, or neither option"
            )));
        }
        true => report_of(&arguments.what)?,
        false => written(arguments)?,
    };
    if arguments.no_open {
        return Ok(());
    }
    let page = fs::canonicalize(&page).unwrap_or(page);
    if let Err(error) = opener::open_browser(&page) {
        say::note(format_args!(
            "could not start a browser ({error}); open {} in a browser yourself",
            say::path(&page)
        ));
    }
    Ok(())
}

/// Returns the report of a finished map.
fn report_of(folder: &Path) -> Result<PathBuf, Failure> {
    let report = folder.join(REPORT);
    if report.is_file() {
        return Ok(report);
    }
    Err(Failure::Usage(anyhow!(
        "{}: the folder has no {REPORT}; give a scene, or compute the map with --set 'outputs.files=[\"html\"]'",
        say::path(folder)
    )))
}

/// Computes the coarse map of a scene and writes its page.
fn written(arguments: &Explore) -> Result<PathBuf, Failure> {
    let Explore { what, set, quiet, .. } = arguments;
    let scene = SceneFile::map(what).load(set)?;
    let out = arguments.out();
    if arguments.out.is_some() && out.exists() && !arguments.force {
        return Err(Failure::Usage(anyhow!("{}: the file exists; --force replaces it", say::path(&out))));
    }
    let free = out.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Folder::check_writable(free)?;
    plain_file::refuse_link(&out).map_err(|error| Failure::Usage(anyhow!("{}: {error}", say::path(free))))?;
    let interrupt = Interrupt::listen(*quiet)?;
    let console = Arc::new(Console::new(*quiet, "cells", false));
    let page = explore::page(&scene, set, console.clone(), interrupt.raised())?;
    let page = page.ok_or_else(|| interrupt.failure("interrupted; nothing was written".to_owned()))?;
    let written =
        fs::create_dir_all(free).and_then(|()| plain_file::replace(&out, |file| file.write_all(&page)));
    written.map_err(|error| anyhow!("{}: {error}", say::path(&out)))?;
    console.finish(&format!("{}: {}", say::path(&out), scene.title()));
    Ok(out)
}
