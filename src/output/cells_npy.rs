//! `cells.npy`: the same rows as a structured array for `numpy.load`.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use npyz::{DType, Field, TypeStr, TypeWrite, WriterBuilder};

use super::cells::{Cells, Row};
use super::cells_csv::{ATTRACTORS, FIELDS, places, swept};
use super::{WriteError, names};
use crate::record::Spelling;

/// What stands for an absent class or an absent symmetry.
pub(super) const ABSENT: i8 = -1;

/// NumPy's types of the places on the axes, of the values there, then of [`FIELDS`].
const PLACE_TYPE: &str = "<u4";
const VALUE_TYPE: &str = "<f8";
const TYPES: [&str; 11] = ["|i1", "<u2", "<f8", "<f8", "<f8", "<f8", "|i1", "|S64", "|i1", "<u4", "|i1"];
const ATTRACTORS_TYPE: &str = "|u1";
const WORD_BYTES: usize = 64;

/// Writes the array to `path`: one dimension, the fields of `cells.csv` by name. Classes,
/// statuses and sources are their codes; an absent period is 0, an absent float NaN, an
/// absent class or symmetry -1, an absent word empty. Where attractors are counted, a last
/// field has their number.
///
/// # Errors
/// If the file cannot be written.
pub(super) fn write(path: &Path, cells: &Cells<'_>) -> Result<(), WriteError> {
    let places = places(cells);
    let first =
        places.iter().map(|&name| (name, PLACE_TYPE)).chain(swept(cells).map(|name| (name, VALUE_TYPE)));
    let counted = cells.attractors().map(|_| (ATTRACTORS, ATTRACTORS_TYPE));
    let fields = first.chain(FIELDS.into_iter().zip(TYPES)).chain(counted).map(|(name, kind)| {
        let kind: TypeStr = kind.parse()?;
        Ok(Field { name: name.to_owned(), dtype: DType::Plain(kind) })
    });
    let fields = fields.collect::<Result<Vec<_>, npyz::ParseTypeStrError>>()?;
    let [columns, rows] = cells.counts();
    let count = columns * rows;
    let mut array = npyz::WriteOptions::<Packed>::new()
        .dtype(DType::Record(fields))
        .shape(&[count as u64])
        .writer(BufWriter::new(File::create(path)?))
        .begin_nd()?;
    for id in 0..count {
        let (row, word) = (cells.row(id), cells.word(id));
        array.push(&Packed { places: places.len(), values: cells.values(id), row, word })?;
    }
    Ok(array.finish()?)
}

/// A row as bytes in the order of [`TYPES`].
struct Packed {
    /// How many of the row's indices are told.
    places: usize,
    values: Vec<f64>,
    row: Row,
    word: Option<Spelling>,
}

struct PackedWriter;

impl npyz::Serialize for Packed {
    type TypeWriter = PackedWriter;

    fn writer(_: &DType) -> Result<PackedWriter, npyz::DTypeError> {
        // The one type that this module asks for.
        Ok(PackedWriter)
    }
}

impl TypeWrite for PackedWriter {
    type Value = Packed;

    fn write_one<W: Write>(&self, mut to: W, packed: &Packed) -> io::Result<()> {
        let Packed { places, values, row, word } = packed;
        let mut bytes = Vec::with_capacity(WORD_BYTES + 64);
        row.indices[..*places].iter().for_each(|&index| bytes.extend((index as u32).to_le_bytes()));
        values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        bytes.extend(row.class.map_or(ABSENT, names::class_code).to_le_bytes());
        bytes.extend((row.period.unwrap_or(0) as u16).to_le_bytes());
        for value in [row.lyapunov, row.lyapunov_error, row.impacts_per_period, row.mesh_fraction] {
            bytes.extend(value.unwrap_or(f64::NAN).to_le_bytes());
        }
        bytes.extend(row.symmetric.map_or(ABSENT, i8::from).to_le_bytes());
        let word = word.as_ref().map_or(String::new(), |word| word.text());
        bytes.extend(word.as_bytes());
        bytes.resize(bytes.len() + WORD_BYTES - word.len(), 0);
        bytes.push(row.status.code() as u8);
        bytes.extend(row.periods_run.to_le_bytes());
        bytes.push(row.source as u8);
        bytes.extend(row.attractors);
        to.write_all(&bytes)
    }
}
