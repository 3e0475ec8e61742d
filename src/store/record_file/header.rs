//! The header of a record file: the format, the columns, the identity of the run, and a checksum of these.

use serde::{Deserialize, Serialize};

use crate::store::record_file::batch;
use crate::store::record_file::columns::NAMES;
use crate::store::record_file::identity::Identity;

/// Version of the file format. It is raised when files of the version before become unreadable.
const RECORD_FORMAT: u32 = 3;

/// First bytes of a record file: a name and the version of the format.
const MAGIC: [u8; 8] = *b"RTLMAP3\0";
/// Number of bytes of the name in [`MAGIC`].
const NAME: usize = 6;
/// Number of bytes of magic, length and checksum.
const PREFIX: usize = 16;

/// Number of bytes at the beginning of a file in which the header must lie. Headers are far shorter.
pub(crate) const MOST_BYTES: usize = 1 << 20;

#[derive(Serialize, Deserialize)]
struct Body {
    format: u32,
    /// Names of the columns, in the order of the bits that stand for them in batches.
    columns: Vec<String>,
    #[serde(flatten)]
    identity: Identity,
}

/// Contents of the first bytes of a file.
pub(crate) enum Found {
    /// A header.
    Header {
        identity: Identity,
        /// Offset of the first batch.
        end: u64,
    },
    /// No header and no batch: the run ended before it wrote anything.
    Nothing,
    /// A header of another format, or with columns that this version does not have at these places.
    OtherVersion,
    /// Bytes that no run leaves; the text describes the damage.
    Damaged(&'static str),
}

/// Returns the header of a run's record file.
pub(crate) fn bytes(identity: &Identity) -> serde_json::Result<Vec<u8>> {
    bytes_of(identity, &NAMES)
}

fn bytes_of(identity: &Identity, columns: &[&str]) -> serde_json::Result<Vec<u8>> {
    let columns = columns.iter().map(|&name| name.to_owned()).collect();
    let body = serde_json::to_vec(&Body { format: RECORD_FORMAT, columns, identity: identity.clone() })?;
    let length = (body.len() as u32).to_le_bytes();
    Ok([&MAGIC[..], &length, &checksum(length, &body).to_le_bytes(), &body].concat())
}

/// Reads the header from the first bytes of a file; `is_all` says whether the file has no more bytes than these.
pub(crate) fn find(bytes: &[u8], is_all: bool) -> Found {
    if let Some((body, end)) = body(bytes) {
        return match serde_json::from_slice::<Body>(body) {
            Ok(Body { format: RECORD_FORMAT, columns, identity }) if columns == NAMES => {
                Found::Header { identity, end: end as u64 }
            }
            Ok(_) => Found::OtherVersion,
            Err(_) => Found::Damaged("its header is not one of this version"),
        };
    }
    let length = bytes.len().min(MAGIC.len());
    let is_begun = bytes[..length] == MAGIC[..length] || bytes.iter().all(|&byte| byte == 0);
    match is_begun {
        true if is_all && batch::find(bytes).is_none() => Found::Nothing,
        true => Found::Damaged("its header does not match its checksum"),
        false if bytes.starts_with(&MAGIC[..NAME]) && bytes.get(MAGIC.len() - 1) == Some(&0) => {
            Found::OtherVersion
        }
        false => Found::Damaged("it is no record file"),
    }
}

/// Returns the body of an undamaged header and the offset of its end.
fn body(bytes: &[u8]) -> Option<(&[u8], usize)> {
    let (head, rest) = bytes.split_first_chunk::<PREFIX>()?;
    let word = |at: usize| [head[at], head[at + 1], head[at + 2], head[at + 3]];
    let body = rest.get(..u32::from_le_bytes(word(8)) as usize)?;
    let is_good = head[..8] == MAGIC && checksum(word(8), body) == u32::from_le_bytes(word(12));
    is_good.then_some((body, PREFIX + body.len()))
}

fn checksum(length: [u8; 4], body: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    [&MAGIC[..], &length, body].into_iter().for_each(|part| hasher.update(part));
    hasher.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_of_another_version_is_not_reported_as_damaged() {
        let identity = Identity::new("cpu", "f64", "d", Vec::new());
        let found = |columns: &[&str]| find(&bytes_of(&identity, columns).unwrap(), true);
        assert!(matches!(found(&NAMES), Found::Header { .. }));
        assert!(matches!(found(&NAMES[1..]), Found::OtherVersion));
        assert!(matches!(found(&[&NAMES[..], &["later"]].concat()), Found::OtherVersion));
        let older = [&b"RTLMAP2\0"[..], &[7; 100]].concat();
        assert!(matches!(find(&older, true), Found::OtherVersion));
        assert!(matches!(find(b"another file of that length", true), Found::Damaged(_)));
    }
    #[test]
    fn more_than_two_coordinates_stand_in_the_header() {
        let identity = |coordinates| Identity::new("cpu", "f64", "d", Vec::new()).of_coordinates(coordinates);
        let header = |coordinates| bytes(&identity(coordinates)).unwrap();
        assert_eq!(header(1), header(2));
        assert!(!String::from_utf8_lossy(&header(2)).contains("coordinates"));
        for (coordinates, strobes) in [(1, 4), (2, 4), (3, 6), (8, 16)] {
            let Found::Header { identity: found, .. } = find(&header(coordinates), true) else { panic!() };
            assert_eq!((found.strobes(), found == identity(coordinates)), (strobes, true));
        }
    }
}
