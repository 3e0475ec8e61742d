//! Which files belong to a folder, and are they still what they were? The list `files` of its manifest.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::Path;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};

use crate::show::error::WriteError;
use crate::store::error::OutputError;
use crate::store::folder::{Folder, LOCK};
use crate::store::manifest::MANIFEST;

/// The field of a manifest that has its own hash.
const SEAL: &str = "manifest_sha256";

/// A file as a manifest lists it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileEntry {
    /// Its name in the folder.
    pub name: String,
    /// Its size.
    pub bytes: u64,
    /// Its hash, as `sha256sum` prints it.
    pub sha256: String,
}

/// What is not as the manifest says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The file's name.
    pub name: String,
    /// What is wrong with it.
    pub fault: Fault,
}

/// What is wrong with a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It is there, and not what it was; why one knows.
    Damaged(String),
    /// It is listed and not there.
    Missing,
    /// It is there and not listed.
    Unknown,
}

impl Finding {
    /// Whether the file could be made anew: one that is unknown is somebody's own.
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

/// The entry of a file as it is.
///
/// # Errors
/// If it cannot be read.
pub fn entry(folder: &Path, name: &str) -> io::Result<FileEntry> {
    let mut file = File::open(folder.join(name))?;
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

/// The entries of these files, in their order.
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

/// Whether a folder has a manifest that lists a file.
pub(crate) fn lists(folder: &Folder, name: &str) -> bool {
    let text = fs::read_to_string(folder.path().join(MANIFEST)).unwrap_or_default();
    let mut manifest: Value = serde_json::from_str(&text).unwrap_or_default();
    let listed = manifest.get_mut("files").map(Value::take).unwrap_or_default();
    let listed: Vec<FileEntry> = serde_json::from_value(listed).unwrap_or_default();
    listed.iter().any(|entry| entry.name == name)
}

/// Compares a folder's files with the list in its manifest: what is wrong, the manifest and listed files first.
///
/// # Errors
/// If the folder cannot be read.
pub fn check(folder: &Path, listed: &[FileEntry]) -> io::Result<Vec<Finding>> {
    let manifest = fs::read_to_string(folder.join(MANIFEST))?;
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

/// What is wrong with a listed file, if anything is.
fn fault(folder: &Path, listed: &FileEntry) -> Option<Fault> {
    // A manifest may come from anywhere; its folder's files are all that it may name.
    if listed.name.contains(['/', '\\']) || [".", "..", ""].contains(&listed.name.as_str()) {
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

/// Replaces the manifest by one that lists these files as they are now, the others as before; `timing` is a phase
/// with its seconds.
pub(crate) fn update(folder: &Folder, names: &[&str], timing: (&str, f64)) -> Result<(), OutputError> {
    let path = folder.path().join(MANIFEST);
    let text = fs::read_to_string(&path)
        .map_err(|reason| OutputError::Write { path, reason: WriteError::Io(reason) })?;
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
    // One that was damaged stays so.
    if is_sealed(&text) { write_manifest(folder, &manifest) } else { folder.write_json(MANIFEST, &manifest) }
}

/// Writes a manifest, sealed.
///
/// # Errors
/// As [`Folder::replace`].
pub fn write_manifest(folder: &Folder, manifest: &impl Serialize) -> Result<(), OutputError> {
    let text = sealed(serde_json::to_value(manifest)?)?;
    folder.replace(MANIFEST, |out| Ok(out.write_all(text.as_bytes())?))
}

/// The text of a manifest with its own hash in it: that of the same text with an empty one.
///
/// # Errors
/// If it is no JSON object.
pub fn sealed(mut manifest: Value) -> serde_json::Result<String> {
    manifest[SEAL] = "".into();
    let hash = hex(Sha256::digest(pretty(&manifest)?));
    manifest[SEAL] = hash.into();
    pretty(&manifest)
}

/// Whether a manifest's text is as it was written.
pub fn is_sealed(text: &str) -> bool {
    let manifest = serde_json::from_str::<Value>(text);
    manifest.is_ok_and(|manifest| manifest.is_object() && sealed(manifest).is_ok_and(|sealed| sealed == text))
}

fn pretty(manifest: &Value) -> serde_json::Result<String> {
    Ok(serde_json::to_string_pretty(manifest)? + "\n")
}

fn hex(hash: impl AsRef<[u8]>) -> String {
    hash.as_ref().iter().map(|byte| format!("{byte:02x}")).collect()
}
