//! Records as compressed columns: the first bytes of all numbers of a column, then the second bytes, and so on.
//!
//! A column that is zero in every cell is left out. Of strobe states a file contains as many entries as the model has, but four at
//! least. Decoding returns the encoded records bit for bit.

use std::io::{self, Read, Write};

use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;

use crate::record::Record;
use crate::record::fields::{FIELDS, STROBE};

/// Number of bytes of an id and its record in files of the largest models.
pub(crate) const ROW: usize = ID + Record::BYTES;
const ID: usize = size_of::<u32>();

/// Number of columns: ids and fields.
const COUNT: usize = 1 + FIELDS.len();
const _: () = assert!(COUNT <= u32::BITS as usize, "a mask has a bit for each column");

/// Names of the columns, in the order of their bits. A later version may add columns at the end.
pub(crate) const NAMES: [&str; COUNT] = {
    let mut names = ["id"; COUNT];
    let mut field = 0;
    while field < FIELDS.len() {
        names[1 + field] = FIELDS[field].name;
        field += 1;
    }
    names
};

/// Returns the number of numbers in a column, and the bytes of each, if files contain this number of entries of strobe states.
fn size(column: usize, strobes: usize) -> (usize, usize) {
    match column.checked_sub(1) {
        None => (1, ID),
        Some(STROBE) => (strobes, FIELDS[STROBE].width),
        Some(field) => (FIELDS[field].count, FIELDS[field].width),
    }
}

/// Returns a bit for each column that is stored, and the compressed columns. `strobes` is the number of entries of strobe states.
pub(crate) fn encode(batch: &[(u32, Record)], strobes: usize) -> io::Result<(u32, Vec<u8>)> {
    let mut mask = 0;
    let mut output = DeflateEncoder::new(Vec::new(), Compression::fast());
    for column in 0..COUNT {
        let (count, width) = size(column, strobes);
        let get = |(i, nth): (usize, usize)| match column.checked_sub(1) {
            // Differences of ids compress better than ids.
            None => batch[i].0.wrapping_sub(i.checked_sub(1).map_or(0, |before| batch[before].0)).into(),
            Some(field) => FIELDS[field].get(&batch[i].1, nth),
        };
        let numbers = |nth: usize| (0..batch.len()).map(move |i| (i, nth)).map(get);
        if (0..count).flat_map(numbers).all(|number| number == 0) {
            continue;
        }
        mask |= 1 << column;
        for nth in 0..count {
            let numbers: Vec<u64> = numbers(nth).collect();
            // The most significant byte first.
            for byte in (0..width).rev() {
                output.write_all(
                    &numbers.iter().map(|number| (number >> (8 * byte)) as u8).collect::<Vec<_>>(),
                )?;
            }
        }
    }
    Ok((mask, output.finish()?))
}

/// Returns the records of a batch of `cells` cells, or none if the bytes do not encode so many.
pub(crate) fn decode(mask: u32, cells: usize, strobes: usize, bytes: &[u8]) -> Option<Vec<(u32, Record)>> {
    if mask.checked_shr(COUNT as u32).is_some_and(|unknown| unknown != 0) {
        return None;
    }
    let stored =
        (0..COUNT).filter(|column| mask >> column & 1 == 1).map(|column| (column, size(column, strobes)));
    let whole = stored.clone().map(|(_, (count, width))| count * width).sum::<usize>() * cells;
    let mut planes = Vec::with_capacity(whole);
    // One byte more than expected, so that data that is too long is noticed.
    DeflateDecoder::new(bytes).take(whole as u64 + 1).read_to_end(&mut planes).ok()?;
    if planes.len() != whole {
        return None;
    }
    let mut batch = vec![(0, Record::default()); cells];
    let mut planes = planes.chunks_exact(cells.max(1));
    for (column, (count, width)) in stored {
        for nth in 0..count {
            let mut numbers = vec![0; cells];
            for plane in planes.by_ref().take(width) {
                numbers
                    .iter_mut()
                    .zip(plane)
                    .for_each(|(number, &byte)| *number = *number << 8 | u64::from(byte));
            }
            let mut before = 0;
            for ((id, record), number) in batch.iter_mut().zip(numbers) {
                match column.checked_sub(1) {
                    None => {
                        before = u32::wrapping_add(before, number as u32);
                        *id = before;
                    }
                    Some(field) => FIELDS[field].set(record, nth, number),
                }
            }
        }
    }
    Some(batch)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_contain_the_strobe_entries_that_the_model_has() {
        for (coordinates, bytes) in [(2, 376), (3, 392), (8, 472)] {
            let strobes = 2 * coordinates;
            let bytes_of = |column| {
                let (count, width) = size(column, strobes);
                count * width
            };
            let whole: usize = (1..COUNT - 3).map(bytes_of).sum();
            assert_eq!(whole, bytes, "{coordinates} coordinates");
            let entries: Vec<f64> = (1..=strobes).map(|n| n as f64 / 3.0).collect();
            let record = Record { strobe: entries.into_iter().collect(), period: 3, ..Record::default() };
            let batch: Vec<(u32, Record)> = (0..5).map(|id| (7 * id, record.clone())).collect();
            let (mask, body) = encode(&batch, strobes).unwrap();
            assert_eq!(decode(mask, 5, strobes, &body), Some(batch));
            assert_eq!(decode(mask, 5, strobes + 2, &body), None);
        }
    }
}
