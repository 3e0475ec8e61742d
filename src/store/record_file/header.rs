//! What a record file begins with: whose records follow and in which columns, twice, each copy with its checksum.

use serde::{Deserialize, Serialize};

use crate::store::record_file::batch;
use crate::store::record_file::columns::{BEFORE_PATTERNS, NAMES};
use crate::store::record_file::identity::Identity;

/// Raised whenever a file of the one before cannot be read any more.
const FORMAT: u32 = 2;

/// What both copies begin with.
const MAGIC: [u8; 8] = *b"RTLMAP2\0";
/// What files of format 1 begin with.
const OLD_MAGIC: [u8; 8] = *b"RTLMAP\0\x02";
/// Magic, length and checksum.
const HEAD: usize = 16;

/// Bytes of a file in which its header is looked for: far more than any takes.
pub(crate) const SEARCHED: usize = 1 << 20;

#[derive(Serialize, Deserialize)]
struct Body {
    format: u32,
    /// Names of the columns, in the order of the bits that batches have for them.
    columns: Vec<String>,
    #[serde(flatten)]
    identity: Identity,
}

/// What stands where a header should.
pub(crate) enum Found {
    /// One.
    Header {
        identity: Identity,
        /// How many columns it names: fewer in files from before there were patterns.
        columns: usize,
        /// Where batches begin.
        end: u64,
        /// Whether both copies are good.
        is_whole: bool,
    },
    /// The beginning of one, or nothing at all, and no batch: the run ended before it kept anything.
    Nothing,
    /// A file of format 1.
    OldFormat,
    /// One of this format whose records have fields that this version does not know.
    OtherFields,
    /// What no run leaves.
    Damaged(&'static str),
}

/// Both copies.
pub(crate) fn bytes(identity: &Identity) -> serde_json::Result<Vec<u8>> {
    bytes_of(identity, &NAMES)
}

/// Both copies, in a file of these columns.
pub(crate) fn bytes_of(identity: &Identity, columns: &[&str]) -> serde_json::Result<Vec<u8>> {
    let columns = columns.iter().map(|&name| name.to_owned()).collect();
    let body = serde_json::to_vec(&Body { format: FORMAT, columns, identity: identity.clone() })?;
    let length = (body.len() as u32).to_le_bytes();
    Ok([&MAGIC[..], &length, &checksum(length, &body).to_le_bytes(), &body].concat().repeat(2))
}

/// Looks for a header in the first bytes of a file, `whole` if these are all.
pub(crate) fn find(bytes: &[u8], whole: bool) -> Found {
    let copy = copy_at(bytes, 0).map(|(body, end)| (body, end, copy_at(bytes, end).is_some(), 2 * end));
    let copy = copy.or_else(|| second_copy(bytes).map(|(body, end)| (body, end, false, end)));
    if let Some((body, _, is_whole, end)) = copy {
        return match serde_json::from_slice::<Body>(body) {
            Ok(Body { format: FORMAT, columns, identity })
                if columns == NAMES || columns == NAMES[..BEFORE_PATTERNS] =>
            {
                Found::Header { identity, columns: columns.len(), end: end as u64, is_whole }
            }
            Ok(Body { format: FORMAT, .. }) => Found::OtherFields,
            _ => Found::Damaged("its header is not one of this version"),
        };
    }
    let length = bytes.len().min(MAGIC.len());
    if bytes.starts_with(&OLD_MAGIC) {
        return Found::OldFormat;
    }
    let begins = bytes[..length] == MAGIC[..length] || bytes.iter().all(|&byte| byte == 0);
    match begins {
        true if whole && batch::find(bytes).is_none() => Found::Nothing,
        true => Found::Damaged("neither copy of its header matches its checksum"),
        false => Found::Damaged("it is no record file of this version"),
    }
}

/// The body of the good copy that begins there, and where it ends.
fn copy_at(bytes: &[u8], at: usize) -> Option<(&[u8], usize)> {
    let head = bytes.get(at..at + HEAD)?;
    let word = |at: usize| [head[at], head[at + 1], head[at + 2], head[at + 3]];
    let end = (at + HEAD).checked_add(u32::from_le_bytes(word(8)) as usize)?;
    let body = bytes.get(at + HEAD..end)?;
    let is_good = head[..8] == MAGIC && checksum(word(8), body) == u32::from_le_bytes(word(12));
    is_good.then_some((body, end))
}

/// The second copy, where the first does not tell its length.
fn second_copy(bytes: &[u8]) -> Option<(&[u8], usize)> {
    let places = bytes.windows(MAGIC.len()).enumerate().skip(1).filter(|(_, place)| *place == MAGIC);
    places.map(|(at, _)| at).find_map(|at| copy_at(bytes, at))
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
    fn a_file_of_other_fields_is_not_taken_for_a_damaged_one() {
        let identity = Identity::new("cpu", "f64", "d", Vec::new());
        let found = |columns: &[&str]| find(&bytes_of(&identity, columns).unwrap(), true);
        assert!(matches!(found(&NAMES), Found::Header { columns: 17, is_whole: true, .. }));
        // As versions wrote them whose records had no patterns.
        assert!(matches!(found(&NAMES[..14]), Found::Header { columns: 14, is_whole: true, .. }));
        assert!(matches!(found(&NAMES[..13]), Found::OtherFields));
        assert!(matches!(found(&[&NAMES[..], &["later"]].concat()), Found::OtherFields));
    }
}
