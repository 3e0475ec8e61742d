//! Records as columns: bytes of one significance side by side, compressed.
//!
//! A column that is zero in every cell is left out, as are all that no output asks for. What is read back is what
//! was written, to the bit.

use std::io::{self, Read, Write};
use std::mem::offset_of;

use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;

use crate::record::Record;

/// An id and its record.
const ROW: usize = ID + size_of::<Record>();
const ID: usize = size_of::<u32>();

/// Names of the columns, in the order of their bits.
pub(crate) const NAMES: [&str; 17] = [
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

/// How many of them files have from before there were patterns: the first ones.
pub(crate) const BEFORE_PATTERNS: usize = 14;

/// The row of those files: what was reserved then, 32 bytes, is where patterns begin now.
const ROW_BEFORE_PATTERNS: usize = ID + offset_of!(Record, pattern) + 32;

/// Where each begins in a row, in their order there, and how many bytes its numbers have. What is reserved goes with the last.
const PLACES: [(usize, usize); 17] = [
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

/// Places in a row of a column's bytes, the most significant of each number first, in a file of so many columns.
fn bytes_of(column: usize, columns: usize) -> impl Iterator<Item = usize> {
    let (from, width) = PLACES[column];
    let to = match PLACES[..columns].get(column + 1) {
        Some(&(next, _)) => next,
        None if columns == BEFORE_PATTERNS => ROW_BEFORE_PATTERNS,
        None => ROW,
    };
    (from..to).step_by(width).flat_map(move |number| (number..number + width).rev())
}

type Row = [u8; ROW];

/// Which columns there are, a bit for each, and the columns.
pub(crate) fn encode(batch: &[(u32, Record)]) -> io::Result<(u32, Vec<u8>)> {
    let rows = rows(batch);
    let mut mask = 0;
    let mut output = DeflateEncoder::new(Vec::new(), Compression::fast());
    for column in 0..NAMES.len() {
        if bytes_of(column, NAMES.len()).all(|at| rows.iter().all(|row| row[at] == 0)) {
            continue;
        }
        mask |= 1 << column;
        for at in bytes_of(column, NAMES.len()) {
            output.write_all(&rows.iter().map(|row| row[at]).collect::<Vec<_>>())?;
        }
    }
    Ok((mask, output.finish()?))
}

/// The batch of so many cells that was written, in a file of so many columns; none if these are no columns of one.
pub(crate) fn decode(columns: usize, mask: u32, cells: usize, bytes: &[u8]) -> Option<Vec<(u32, Record)>> {
    if mask >> columns != 0 {
        return None;
    }
    let places: Vec<usize> = (0..columns)
        .filter(|column| mask >> column & 1 == 1)
        .flat_map(|column| bytes_of(column, columns))
        .collect();
    let whole = places.len() * cells;
    let mut planes = Vec::with_capacity(whole);
    // One more byte than there should be, lest a wrong one go unseen.
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

fn rows(batch: &[(u32, Record)]) -> Vec<Row> {
    let mut before = 0;
    let row = |&(id, record): &(u32, Record)| {
        let mut row = [0; ROW];
        // Neighbours come one after the other.
        row[..ID].copy_from_slice(&u32::wrapping_sub(id, before).to_le_bytes());
        row[ID..].copy_from_slice(bytemuck::bytes_of(&record));
        before = id;
        row
    };
    batch.iter().map(row).collect()
}

fn batch(rows: &[Row]) -> Vec<(u32, Record)> {
    let mut before = 0;
    let cell = |row: &Row| {
        before = u32::wrapping_add(before, u32::from_le_bytes([row[0], row[1], row[2], row[3]]));
        (before, bytemuck::pod_read_unaligned(&row[ID..]))
    };
    rows.iter().map(cell).collect()
}
