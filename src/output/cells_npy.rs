//! `cells.npy`: the same rows as a structured array for `numpy.load`.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use npyz::{DType, Field, TypeStr, TypeWrite, WriterBuilder};

use super::cells::{Cells, Row};
use super::cells_csv::{ATTRACTOR, ATTRACTORS, places, swept};
use super::words_csv::Rows;
use super::{WriteError, names};
use crate::map::scene::Quantity;

/// What stands for an absent class or an absent symmetry.
pub(super) const ABSENT: i8 = -1;

/// What a column shows: a row, and the rows of `words.csv` that have its word and its pattern.
struct Shown {
    row: Row,
    word: u32,
    pattern: u32,
}

/// Types of the places on the axes, and of the values there, as NumPy writes them.
const PLACE_KIND: &str = "<u4";
const VALUE_KIND: &str = "<f8";

/// A column after those.
struct Column {
    name: &'static str,
    /// Its type.
    kind: &'static str,
    /// What has to be asked for.
    of: Option<Quantity>,
    put: fn(&Shown, &mut Vec<u8>),
}

const fn column(
    name: &'static str,
    kind: &'static str,
    of: Option<Quantity>,
    put: fn(&Shown, &mut Vec<u8>),
) -> Column {
    Column { name, kind, of, put }
}

#[rustfmt::skip]
const COLUMNS: [Column; 12] = [
    column("class", "|i1", Some(Quantity::Class), |shown, to| put_code(shown.row.class.map(names::class_code), to)),
    column("period", "<u2", Some(Quantity::Class), |shown, to| to.extend((shown.row.period.unwrap_or(0) as u16).to_le_bytes())),
    column("lyapunov", "<f8", Some(Quantity::Lyapunov), |shown, to| put_float(shown.row.lyapunov, to)),
    column("lyapunov_error", "<f8", Some(Quantity::Lyapunov), |shown, to| put_float(shown.row.lyapunov_error, to)),
    column("impacts_per_period", "<f8", Some(Quantity::Impacts), |shown, to| put_float(shown.row.impacts_per_period, to)),
    column("mesh_fraction", "<f8", Some(Quantity::Mesh), |shown, to| put_float(shown.row.mesh_fraction, to)),
    column("symmetric", "|i1", Some(Quantity::Symmetric), |shown, to| put_code(shown.row.symmetric.map(i8::from), to)),
    column("word", "<u4", Some(Quantity::Word), |shown, to| to.extend(shown.word.to_le_bytes())),
    column("pattern", "<u4", Some(Quantity::Pattern), |shown, to| to.extend(shown.pattern.to_le_bytes())),
    column("status", "|i1", None, |shown, to| to.push(shown.row.status.code() as u8)),
    column("periods_run", "<u4", None, |shown, to| to.extend(shown.row.periods_run.to_le_bytes())),
    column("source", "|i1", None, |shown, to| to.push(shown.row.source as u8)),
];

const COUNTED: Column = column(ATTRACTORS, "|u1", None, |shown, to| to.extend(shown.row.attractors));

const LABELLED: Column = column(ATTRACTOR, "<i4", None, |shown, to| {
    to.extend(shown.row.attractor.map_or(i32::from(ABSENT), i32::from).to_le_bytes());
});

fn put_code(code: Option<i8>, to: &mut Vec<u8>) {
    to.extend(code.unwrap_or(ABSENT).to_le_bytes());
}

fn put_float(value: Option<f64>, to: &mut Vec<u8>) {
    to.extend(value.unwrap_or(f64::NAN).to_le_bytes());
}

/// Writes the array to `path`: one dimension, the fields of `cells.csv` by name as far as they are asked for. Classes,
/// statuses and sources are their codes, words and patterns rows of `words.csv`; an absent period is 0, an absent float
/// NaN, an absent class or symmetry -1, an absent word or pattern row 0, which is empty. Where attractors are counted, a
/// last field has their number; in a map of basins the start's own, -1 where it has none.
///
/// # Errors
/// If the file cannot be written.
pub(super) fn write(path: &Path, cells: &Cells<'_>, rows: &Rows<'_>) -> Result<(), WriteError> {
    let places = places(cells);
    let is_asked = |column: &&Column| column.of.is_none_or(|quantity| cells.asks(quantity));
    let counted = cells.attractors().map(|_| &COUNTED).or(cells.basins().map(|_| &LABELLED));
    let columns: Vec<&Column> = COLUMNS.iter().filter(is_asked).chain(counted).collect();
    let place = places.iter().map(|&name| (name, PLACE_KIND));
    let value = swept(cells).map(|name| (name, VALUE_KIND));
    let named = place.chain(value).chain(columns.iter().map(|column| (column.name, column.kind)));
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
        let shown = Shown { row: cells.row(id), word: rows.word(id), pattern: rows.pattern(id) };
        bytes.0.clear();
        let indices = &shown.row.indices[..places.len()];
        indices.iter().for_each(|&index| bytes.0.extend((index as u32).to_le_bytes()));
        cells.values(id).iter().for_each(|value| bytes.0.extend(value.to_le_bytes()));
        columns.iter().for_each(|column| (column.put)(&shown, &mut bytes.0));
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
