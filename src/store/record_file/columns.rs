//! Records as compressed columns: the first bytes of all numbers of a column, then the second bytes, and so on.
//!
//! A column that is zero in every cell is left out. Of strobe states a file contains as many entries as the model has, but four at
//! least. Decoding returns the encoded records bit for bit.

use std::io::{self, Read, Write};
use std::mem::offset_of;
use std::ops::Range;

use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;

use crate::record::Record;
use crate::record::measures::{FURTHER, GROUPS, places_before};

/// Number of bytes of an id and its record in memory.
pub(crate) const ROW: usize = ID + size_of::<Record>();
const ID: usize = size_of::<u32>();

/// Number of columns without measured quantities, and of all columns. The last one has the measured quantities of displacements and gaps
/// that oscillators of at most two coordinates with one gap do not have.
const BEFORE: usize = 17;
const LAST: usize = BEFORE + GROUPS.len();
const COUNT: usize = LAST + 1;

/// Names of the columns, in the order of their bits. A later version may add columns at the end.
pub(crate) const NAMES: [&str; COUNT] = {
    let mut names = [""; COUNT];
    let mut i = 0;
    while i < COUNT {
        names[i] = match i {
            LAST => "further_displacements",
            _ if i < BEFORE => FIRST_NAMES[i],
            _ => GROUPS[i - BEFORE].name,
        };
        i += 1;
    }
    names
};

const FIRST_NAMES: [&str; BEFORE] = [
    "id",
    "lyapunov",
    "lyapunov_error",
    "impacts_per_period",
    "mesh_fraction",
    "strobe",
    "word",
    "word_hash",
    "word_length",
    "period",
    "periods_run",
    "status",
    "symmetric",
    "valid",
    "pattern",
    "pattern_hash",
    "pattern_length",
];

/// Returns the offset of a column in a row and the size of its numbers in bytes.
fn place(column: usize) -> (usize, usize) {
    let of_measure = |place: usize| (ID + offset_of!(Record, measures) + 8 * place, 8);
    match column {
        LAST => of_measure(FURTHER),
        _ => PLACES.get(column).copied().unwrap_or_else(|| of_measure(places_before(column - BEFORE))),
    }
}

/// Places of the columns without measured quantities. The last one includes the reserved bytes.
const PLACES: [(usize, usize); BEFORE] = [
    (0, 4),
    (ID + offset_of!(Record, lyapunov), 8),
    (ID + offset_of!(Record, lyapunov_error), 8),
    (ID + offset_of!(Record, impacts_per_period), 8),
    (ID + offset_of!(Record, mesh_fraction), 8),
    (ID + offset_of!(Record, strobe), 8),
    (ID + offset_of!(Record, word), 8),
    (ID + offset_of!(Record, word_hash), 8),
    (ID + offset_of!(Record, word_length), 4),
    (ID + offset_of!(Record, period), 4),
    (ID + offset_of!(Record, periods_run), 4),
    (ID + offset_of!(Record, status), 4),
    (ID + offset_of!(Record, symmetric), 4),
    (ID + offset_of!(Record, valid), 4),
    (ID + offset_of!(Record, pattern), 8),
    (ID + offset_of!(Record, pattern_hash), 8),
    (ID + offset_of!(Record, pattern_length), 4),
];

/// Place of the strobe state in the lists.
const STROBE: usize = 5;

/// Returns the range of a column's bytes in a row, if files contain this number of entries of strobe states.
fn range_of(column: usize, strobes: usize) -> Range<usize> {
    let begin = place(column).0;
    match column {
        STROBE => begin..begin + 8 * strobes,
        _ if column + 1 < COUNT => begin..place(column + 1).0,
        _ => begin..ROW,
    }
}

/// Returns the places of a column's bytes in a row, the most significant byte of each number first.
fn bytes_of(column: usize, strobes: usize) -> impl Iterator<Item = usize> {
    let width = place(column).1;
    range_of(column, strobes).step_by(width).flat_map(move |number| (number..number + width).rev())
}

type RecordBytes = [u8; ROW];

/// Returns a bit for each column that is stored, and the compressed columns. `strobes` is the number of entries of strobe states.
pub(crate) fn encode(batch: &[(u32, Record)], strobes: usize) -> io::Result<(u32, Vec<u8>)> {
    let rows = rows(batch);
    let mut mask = 0;
    let mut output = DeflateEncoder::new(Vec::new(), Compression::fast());
    for column in 0..COUNT {
        let range = range_of(column, strobes);
        if rows.iter().all(|row| row[range.clone()].iter().all(|byte| *byte == 0)) {
            continue;
        }
        mask |= 1 << column;
        for at in bytes_of(column, strobes) {
            output.write_all(&rows.iter().map(|row| row[at]).collect::<Vec<_>>())?;
        }
    }
    Ok((mask, output.finish()?))
}

/// Returns the records of a batch of `cells` cells, or none if the bytes do not encode so many.
pub(crate) fn decode(mask: u32, cells: usize, strobes: usize, bytes: &[u8]) -> Option<Vec<(u32, Record)>> {
    if mask >> COUNT != 0 {
        return None;
    }
    let stored = (0..COUNT).filter(|column| mask >> column & 1 == 1);
    let places: Vec<usize> = stored.flat_map(|column| bytes_of(column, strobes)).collect();
    let whole = places.len() * cells;
    let mut planes = Vec::with_capacity(whole);
    // One byte more than expected, so that data that is too long is noticed.
    DeflateDecoder::new(bytes).take(whole as u64 + 1).read_to_end(&mut planes).ok()?;
    if planes.len() != whole {
        return None;
    }
    let mut rows = vec![[0; ROW]; cells];
    for (plane, at) in planes.chunks_exact(cells.max(1)).zip(places) {
        rows.iter_mut().zip(plane).for_each(|(row, byte)| row[at] = *byte);
    }
    Some(batch(&rows))
}

fn rows(batch: &[(u32, Record)]) -> Vec<RecordBytes> {
    let mut before = 0;
    let row = |&(id, record): &(u32, Record)| {
        let mut row = [0; ROW];
        // Differences of ids compress better than ids.
        row[..ID].copy_from_slice(&u32::wrapping_sub(id, before).to_le_bytes());
        row[ID..].copy_from_slice(bytemuck::bytes_of(&record));
        before = id;
        row
    };
    batch.iter().map(row).collect()
}

fn batch(rows: &[RecordBytes]) -> Vec<(u32, Record)> {
    let mut before = 0;
    let cell = |row: &RecordBytes| {
        before = u32::wrapping_add(before, u32::from_le_bytes([row[0], row[1], row[2], row[3]]));
        (before, bytemuck::pod_read_unaligned(&row[ID..]))
    };
    rows.iter().map(cell).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::model::state;

    #[test]
    fn files_contain_the_strobe_entries_that_the_model_has() {
        for (coordinates, bytes) in [(2, 376), (3, 392), (8, 472)] {
            let strobes = 2 * coordinates;
            let whole: usize = (1..LAST).map(|column| bytes_of(column, strobes).count()).sum();
            assert_eq!(whole, bytes, "{coordinates} coordinates");
            let entries: Vec<f64> = (1..=strobes).map(|n| n as f64 / 3.0).collect();
            let record = Record { strobe: state(&entries), period: 3, ..Record::default() };
            let batch: Vec<(u32, Record)> = (0..5).map(|id| (7 * id, record)).collect();
            let (mask, body) = encode(&batch, strobes).unwrap();
            assert_eq!(decode(mask, 5, strobes, &body), Some(batch));
            assert_eq!(decode(mask, 5, strobes + 2, &body), None);
        }
    }
}
