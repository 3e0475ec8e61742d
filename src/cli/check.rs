//! `rattlemap check`: compares a folder's files with its manifest, and repairs them.

use crate::cli::arguments::Check;
use crate::cli::console::Console;
use crate::cli::failure::Failure;
use crate::cli::say;
use crate::job::check;
use crate::store::folder::Folder;
use crate::store::map::MANIFEST;

/// Lists the damaged and missing files, and recreates them with `--repair`.
pub(crate) fn run(arguments: &Check) -> Result<(), Failure> {
    let (dir, quiet) = (&arguments.folder, arguments.quiet);
    let folder = match arguments.repair && dir.is_dir() {
        true => Some(Folder::open(dir, true)?),
        false => None,
    };
    let checked = check::check(dir)?;
    for finding in checked.findings().iter().filter(|finding| finding.is_lost() || !quiet) {
        say::note(format_args!("{}: {finding}", dir.display()));
    }
    if checked.findings().is_empty() && !quiet {
        say::note(format_args!("{}: all {} files are as {MANIFEST} says", dir.display(), checked.files()));
    }
    let repaired =
        folder.map(|folder| checked.repair(&folder, &Console::new(quiet, "", false))).transpose()?;
    for name in repaired.iter().flatten().filter(|_| !quiet) {
        say::note(format_args!("{}: {name} was recreated", dir.display()));
    }
    Ok(checked.require_good(repaired.as_deref().unwrap_or_default(), repaired.is_some())?)
}
