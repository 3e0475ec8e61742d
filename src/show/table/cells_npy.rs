//! `cells.npy`: the same rows as a structured array for `numpy.load`.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use npyz::{DType, Field, TypeStr, TypeWrite, WriterBuilder};

use crate::show::cells::Cells;
use crate::show::error::WriteError;
use crate::show::table::cell_columns::{self, Shown};
use crate::show::table::cells_csv::{places, swept};
use crate::show::table::words_csv::Rows;

/// Types of the places on the axes, and of the values there, as NumPy writes them.
const PLACE_KIND: &str = "<u4";
const VALUE_KIND: &str = "<f8";

/// Writes the array to `path`: one dimension, the fields of `cells.csv` by name as far as they are asked for. Classes,
/// statuses and sources are their codes, words and patterns rows of `words.csv`; an absent period is 0, an absent float
/// NaN, an absent class or symmetry -1, an absent word or pattern row 0, which is empty. Where attractors are counted, a
/// last field has their number; in a map of basins the start's own, -1 where it has none.
///
/// # Errors
/// If the file cannot be written.
pub(crate) fn write(path: &Path, cells: &Cells<'_>, rows: &Rows<'_>) -> Result<(), WriteError> {
    let places = places(cells);
    let columns = cell_columns::asked(cells);
    let place = places.iter().map(|&name| (name, PLACE_KIND));
    let value = swept(cells).map(|name| (name, VALUE_KIND));
    let named = place.chain(value).chain(columns.iter().map(|column| (column.name, column.read.kind())));
    let fields = named.map(|(name, kind)| {
        let kind: TypeStr = kind.parse()?;
        Ok(Field { name: name.to_owned(), dtype: DType::Plain(kind) })
    });
    let fields = fields.collect::<Result<Vec<_>, npyz::ParseTypeStrError>>()?;
    let [count0, count1] = cells.counts();
    let count = count0 * count1;
    let mut array = npyz::WriteOptions::<Bytes>::new()
        .dtype(DType::Record(fields))
        .shape(&[count as u64])
        .writer(BufWriter::new(File::create(path)?))
        .begin_nd()?;
    let mut bytes = Bytes(Vec::new());
    for id in 0..count {
        let shown = Shown::new(cells, rows, id);
        bytes.0.clear();
        let indices = &shown.row.indices[..places.len()];
        indices.iter().for_each(|&index| bytes.0.extend((index as u32).to_le_bytes()));
        cells.values(id).iter().for_each(|value| bytes.0.extend(value.to_le_bytes()));
        columns.iter().for_each(|column| column.read.put(&shown, &mut bytes.0));
        array.push(&bytes)?;
    }
    Ok(array.finish()?)
}

/// A row as its columns' bytes.
struct Bytes(Vec<u8>);

struct BytesWriter;

impl npyz::Serialize for Bytes {
    type TypeWriter = BytesWriter;

    fn writer(_: &DType) -> Result<BytesWriter, npyz::DTypeError> {
        // The one type that this module asks for.
        Ok(BytesWriter)
    }
}

impl TypeWrite for BytesWriter {
    type Value = Bytes;

    fn write_one<W: Write>(&self, mut to: W, Bytes(bytes): &Bytes) -> io::Result<()> {
        to.write_all(bytes)
    }
}
