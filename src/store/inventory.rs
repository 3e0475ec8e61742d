//! The list `files` of a manifest: name, size and hash of each file, and the comparison with the folder.

use std::fs::{self, OpenOptions};
use std::io::{self, Read, Write};
use std::path::Path;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use crate::map::scene::Format;
use crate::show::error::WriteError;
use crate::show::replay::MODEL;
use crate::store::error::OutputError;
use crate::store::file_names::{LIST, MANIFEST};
use crate::store::folder::{Folder, LOCK};
use crate::store::plain_file;

/// Field of the manifest's own hash.
const SEAL: &str = "manifest_sha256";

/// Largest size of a manifest, in bytes. Axes of a million listed values take 130 MB.
pub(crate) const MOST_MANIFEST_BYTES: u64 = 256_000_000;

/// A file in the list of a manifest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileEntry {
    /// Name in the folder.
    pub name: String,
    /// Size in bytes.
    pub bytes: u64,
    /// SHA-256 in hexadecimal digits, as `sha256sum` prints it.
    pub sha256: String,
}

/// A difference between the folder and its manifest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// Name of the file.
    pub name: String,
    /// Kind of the difference.
    pub fault: Fault,
}

/// Kind of a difference.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The file has changed; the text describes the change.
    Damaged(String),
    /// The file is listed and does not exist.
    Missing,
    /// The file exists and is not listed.
    Unknown,
}

impl Finding {
    /// Whether a listed file is damaged or missing. Unknown files may be the user's own.
    pub fn is_lost(&self) -> bool {
        self.fault != Fault::Unknown
    }
}

impl std::fmt::Display for Finding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let name = self.name.escape_debug();
        match &self.fault {
            Fault::Damaged(why) => write!(f, "{name} is damaged: {why}"),
            Fault::Missing => write!(f, "{name} is missing"),
            Fault::Unknown => write!(f, "{name} is unknown: {MANIFEST} does not list it"),
        }
    }
}

/// Computes the entry of a file.
///
/// # Errors
/// If it cannot be read.
pub fn entry(folder: &Path, name: &str) -> io::Result<FileEntry> {
    let mut file = plain_file::open(&folder.join(name), OpenOptions::new().read(true))?;
    let (mut hasher, mut bytes, mut part) = (Sha256::new(), 0, vec![0; 1 << 16]);
    loop {
        match file.read(&mut part)? {
            0 => break,
            read => {
                hasher.update(&part[..read]);
                bytes += read as u64;
            }
        }
    }
    Ok(FileEntry { name: name.to_owned(), bytes, sha256: hex(hasher.finalize()) })
}

/// Computes the entries of these files, in their order.
///
/// # Errors
/// If one cannot be read.
pub fn entries<N: AsRef<str> + Sync>(folder: &Folder, names: &[N]) -> Result<Vec<FileEntry>, OutputError> {
    let of = |name: &N| {
        let name = name.as_ref();
        entry(folder.path(), name).map_err(|reason| OutputError::Write {
            path: folder.path().join(name),
            reason: WriteError::Io(reason),
        })
    };
    names.par_iter().map(of).collect()
}

/// Reads the manifest of a folder; null if there is none or it is not JSON.
pub(crate) fn stored(folder: &Path) -> Value {
    serde_json::from_str(&text(folder).unwrap_or_default()).unwrap_or_default()
}

/// Reads the text of a folder's manifest.
///
/// # Errors
/// If it cannot be read, or is larger than any that a command writes.
pub(crate) fn text(folder: &Path) -> io::Result<String> {
    plain_file::read_text(&folder.join(MANIFEST), MOST_MANIFEST_BYTES, "no command writes a larger one")
}

/// Returns the files that a manifest lists.
pub(crate) fn listed(manifest: &Value) -> Vec<FileEntry> {
    Vec::deserialize(&manifest["files"]).unwrap_or_default()
}

/// Returns the formats of the figures in a folder, if this command wrote its manifest.
pub fn figure_formats(folder: &Path, command: &str) -> Vec<Format> {
    let manifest = stored(folder);
    let files = if manifest["command"] == command { listed(&manifest) } else { Vec::new() };
    let has = |format: &Format| files.iter().any(|file| file.name.ends_with(&format!(".{}", format.name())));
    Format::FIGURES.into_iter().filter(has).collect()
}

/// Removes the results of an earlier run of any command: the manifest first, the files that it lists, and the files `names`.
/// Files for which `keeps` holds stay.
///
/// # Errors
/// [`OutputError::Replace`] if a file cannot be removed.
pub(crate) fn clear<'n>(
    folder: &Folder,
    names: impl IntoIterator<Item = &'n str>,
    keeps: impl Fn(&str) -> bool,
) -> Result<(), OutputError> {
    let is_result = |name: &String| is_in_folder(name) && !folder.path().join(name).is_dir();
    let listed = listed(&stored(folder.path())).into_iter().map(|file| file.name).filter(is_result);
    let all = [MANIFEST.to_owned()].into_iter().chain(listed).chain(names.into_iter().map(str::to_owned));
    folder.remove(&all.filter(|name| !keeps(name)).collect::<Vec<_>>())
}

/// Removes the results of an earlier run, like [`clear`], before a command other than `map` writes its own. The list and the
/// model of a map stay: they may be the files that the user wrote.
///
/// # Errors
/// As [`clear`].
pub(crate) fn clear_for<'n>(
    folder: &Folder,
    names: impl IntoIterator<Item = &'n str>,
) -> Result<(), OutputError> {
    clear(folder, names, |name| [LIST, MODEL].contains(&name))
}

/// Whether a name in a manifest, which may come from an unknown source, is that of a file in its folder.
fn is_in_folder(name: &str) -> bool {
    !name.contains(['/', '\\', ':']) && !name.starts_with('.') && !name.is_empty()
}

/// Compares a folder's files with the list in its manifest. Differences are sorted: the manifest, listed files, others.
///
/// # Errors
/// If the folder cannot be read.
pub fn check(folder: &Path, listed: &[FileEntry]) -> io::Result<Vec<Finding>> {
    let manifest = text(folder)?;
    let damaged = || Fault::Damaged("its contents are not what they were".to_owned());
    let of_manifest = (!is_sealed(&manifest)).then(|| (MANIFEST.to_owned(), damaged()));
    let faults = listed.par_iter().map(|entry| fault(folder, entry)).collect::<Vec<_>>();
    let of_listed = listed.iter().zip(faults).filter_map(|(entry, fault)| Some((entry.name.clone(), fault?)));
    let mut unknown = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_known = name == MANIFEST || name == LOCK || listed.iter().any(|listed| listed.name == name);
        if !is_known && !entry.file_type()?.is_dir() {
            unknown.push((name, Fault::Unknown));
        }
    }
    unknown.sort_by(|(a, _), (b, _)| a.cmp(b));
    Ok(of_manifest
        .into_iter()
        .chain(of_listed)
        .chain(unknown)
        .map(|(name, fault)| Finding { name, fault })
        .collect())
}

/// Compares a file with its entry.
pub(crate) fn fault(folder: &Path, listed: &FileEntry) -> Option<Fault> {
    if !is_in_folder(&listed.name) {
        return Some(Fault::Damaged("this is no name of a file in the folder".to_owned()));
    }
    let damaged = |why: String| Some(Fault::Damaged(why));
    match fs::symlink_metadata(folder.join(&listed.name)) {
        Err(reason) if reason.kind() == io::ErrorKind::NotFound => return Some(Fault::Missing),
        Err(reason) => return damaged(reason.to_string()),
        Ok(data) if !data.is_file() => return damaged("it is not a plain file".to_owned()),
        Ok(data) if data.len() != listed.bytes => {
            return damaged(format!("it has {} bytes, and had {}", data.len(), listed.bytes));
        }
        Ok(_) => {}
    }
    match entry(folder, &listed.name) {
        Err(reason) => damaged(reason.to_string()),
        Ok(entry) if entry.sha256 != listed.sha256 => {
            damaged("its contents are not what they were".to_owned())
        }
        Ok(_) => None,
    }
}

/// Updates the entries of these files in the manifest and adds the seconds of a phase to its timings.
pub(crate) fn update(folder: &Folder, names: &[&str], timing: (&str, f64)) -> Result<(), OutputError> {
    let path = folder.path().join(MANIFEST);
    let text =
        text(folder.path()).map_err(|reason| OutputError::Write { path, reason: WriteError::Io(reason) })?;
    let mut manifest: Value = serde_json::from_str(&text)?;
    let mut listed: Vec<FileEntry> = serde_json::from_value(manifest["files"].take())?;
    for entry in entries(folder, names)? {
        match listed.iter_mut().find(|listed| listed.name == entry.name) {
            Some(listed) => *listed = entry,
            None => listed.push(entry),
        }
    }
    manifest["files"] = serde_json::to_value(listed)?;
    let (phase, seconds) = timing;
    if !manifest["timings"].is_object() {
        manifest["timings"] = serde_json::json!({});
    }
    manifest["timings"][phase] = seconds.into();
    // The seal of a damaged manifest is not renewed.
    if is_sealed(&text) { write_manifest(folder, &manifest) } else { folder.write_json(MANIFEST, &manifest) }
}

/// Writes a manifest with its seal.
///
/// # Errors
/// As [`Folder::replace`].
pub fn write_manifest(folder: &Folder, manifest: &impl Serialize) -> Result<(), OutputError> {
    let text = sealed(serde_json::to_value(manifest)?)?;
    folder.replace(MANIFEST, |out| Ok(out.write_all(text.as_bytes())?))
}

/// Returns the text of a manifest with a seal: the hash of the text with an empty seal.
///
/// # Errors
/// If it is not a JSON object.
pub fn sealed(mut manifest: Value) -> serde_json::Result<String> {
    manifest[SEAL] = "".into();
    let hash = hex(Sha256::digest(pretty(&manifest)?));
    manifest[SEAL] = hash.into();
    pretty(&manifest)
}

/// Whether the seal of a manifest's text is right.
pub fn is_sealed(text: &str) -> bool {
    let manifest = serde_json::from_str::<Value>(text);
    manifest.is_ok_and(|manifest| manifest.is_object() && sealed(manifest).is_ok_and(|sealed| sealed == text))
}

/// Whether a manifest that was read has the right seal.
pub(crate) fn has_seal(manifest: &Value) -> bool {
    pretty(manifest).is_ok_and(|text| is_sealed(&text))
}

fn pretty(manifest: &Value) -> serde_json::Result<String> {
    Ok(serde_json::to_string_pretty(manifest)? + "\n")
}

fn hex(hash: impl AsRef<[u8]>) -> String {
    hash.as_ref().iter().map(|byte| format!("{byte:02x}")).collect()
}
