//! A map's rows by column, each of its own type: what `cells.npy` holds, and what goes to Python.

use crate::map::scene::Quantity;
use crate::show::cells::{Cells, Row};
use crate::show::names;
use crate::show::table::cells_csv::{ATTRACTOR, ATTRACTORS, places, swept};
use crate::show::table::words_csv::Rows;

/// What stands for an absent class or an absent symmetry.
pub(crate) const ABSENT: i8 = -1;

/// What a column shows: a row, and the rows of `words.csv` that have its word and its pattern.
pub(crate) struct Shown {
    pub(crate) row: Row,
    word: u32,
    pattern: u32,
}

impl Shown {
    /// The cell `id`.
    pub(crate) fn new(cells: &Cells<'_>, rows: &Rows<'_>, id: usize) -> Shown {
        Shown { row: cells.row(id), word: rows.word(id), pattern: rows.pattern(id) }
    }
}

/// A column after places and values.
pub(crate) struct Column {
    pub(crate) name: &'static str,
    /// What has to be asked for.
    of: Option<Quantity>,
    pub(crate) read: Read,
}

/// How a value of a column is read, by its type.
pub(crate) enum Read {
    I8(fn(&Shown) -> i8),
    U8(fn(&Shown) -> u8),
    U16(fn(&Shown) -> u16),
    U32(fn(&Shown) -> u32),
    I32(fn(&Shown) -> i32),
    F64(fn(&Shown) -> f64),
}

const fn column(name: &'static str, of: Option<Quantity>, read: Read) -> Column {
    Column { name, of, read }
}

#[rustfmt::skip]
const COLUMNS: [Column; 12] = [
    column("class", Some(Quantity::Class), Read::I8(|shown| shown.row.class.map_or(ABSENT, names::class_code))),
    column("period", Some(Quantity::Class), Read::U16(|shown| shown.row.period.unwrap_or(0) as u16)),
    column("lyapunov", Some(Quantity::Lyapunov), Read::F64(|shown| float(shown.row.lyapunov))),
    column("lyapunov_error", Some(Quantity::Lyapunov), Read::F64(|shown| float(shown.row.lyapunov_error))),
    column("impacts_per_period", Some(Quantity::Impacts), Read::F64(|shown| float(shown.row.impacts_per_period))),
    column("mesh_fraction", Some(Quantity::Mesh), Read::F64(|shown| float(shown.row.mesh_fraction))),
    column("symmetric", Some(Quantity::Symmetric), Read::I8(|shown| shown.row.symmetric.map_or(ABSENT, i8::from))),
    column("word", Some(Quantity::Word), Read::U32(|shown| shown.word)),
    column("pattern", Some(Quantity::Pattern), Read::U32(|shown| shown.pattern)),
    column("status", None, Read::I8(|shown| shown.row.status.code() as i8)),
    column("periods_run", None, Read::U32(|shown| shown.row.periods_run)),
    column("source", None, Read::I8(|shown| shown.row.source as i8)),
];

const COUNTED: Column = column(ATTRACTORS, None, Read::U8(|shown| shown.row.attractors.unwrap_or(0)));

const LABELLED: Column =
    column(ATTRACTOR, None, Read::I32(|shown| shown.row.attractor.map_or(i32::from(ABSENT), i32::from)));

fn float(value: Option<f64>) -> f64 {
    value.unwrap_or(f64::NAN)
}

impl Read {
    /// The type as NumPy writes it.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Read::I8(_) => "|i1",
            Read::U8(_) => "|u1",
            Read::U16(_) => "<u2",
            Read::U32(_) => "<u4",
            Read::I32(_) => "<i4",
            Read::F64(_) => "<f8",
        }
    }

    /// Appends the value's bytes.
    pub(crate) fn put(&self, shown: &Shown, to: &mut Vec<u8>) {
        match self {
            Read::I8(read) => to.extend(read(shown).to_le_bytes()),
            Read::U8(read) => to.push(read(shown)),
            Read::U16(read) => to.extend(read(shown).to_le_bytes()),
            Read::U32(read) => to.extend(read(shown).to_le_bytes()),
            Read::I32(read) => to.extend(read(shown).to_le_bytes()),
            Read::F64(read) => to.extend(read(shown).to_le_bytes()),
        }
    }
}

/// The columns that a map has.
pub(crate) fn asked(cells: &Cells<'_>) -> Vec<&'static Column> {
    let is_asked = |column: &&Column| column.of.is_none_or(|quantity| cells.asks(quantity));
    let counted = cells.attractors().map(|_| &COUNTED).or(cells.basins().map(|_| &LABELLED));
    COLUMNS.iter().filter(is_asked).chain(counted).collect()
}

/// A column's values, a value per cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Codes, -1 where absent.
    I8(Vec<i8>),
    /// Counts up to 255.
    U8(Vec<u8>),
    /// Periods, 0 where absent.
    U16(Vec<u16>),
    /// Counts, places, and rows of the table of texts.
    U32(Vec<u32>),
    /// Labels, -1 where absent.
    I32(Vec<i32>),
    /// Numbers; NaN where absent.
    F64(Vec<f64>),
}

impl Values {
    fn like(read: &Read, count: usize) -> Values {
        match read {
            Read::I8(_) => Values::I8(Vec::with_capacity(count)),
            Read::U8(_) => Values::U8(Vec::with_capacity(count)),
            Read::U16(_) => Values::U16(Vec::with_capacity(count)),
            Read::U32(_) => Values::U32(Vec::with_capacity(count)),
            Read::I32(_) => Values::I32(Vec::with_capacity(count)),
            Read::F64(_) => Values::F64(Vec::with_capacity(count)),
        }
    }

    fn push(&mut self, read: &Read, shown: &Shown) {
        match (self, read) {
            (Values::I8(to), Read::I8(read)) => to.push(read(shown)),
            (Values::U8(to), Read::U8(read)) => to.push(read(shown)),
            (Values::U16(to), Read::U16(read)) => to.push(read(shown)),
            (Values::U32(to), Read::U32(read)) => to.push(read(shown)),
            (Values::I32(to), Read::I32(read)) => to.push(read(shown)),
            (Values::F64(to), Read::F64(read)) => to.push(read(shown)),
            _ => unreachable!("values are made for their column"),
        }
    }
}

/// Every column by name, in the order of `cells.npy`: places on the axes, values there, what was measured.
pub(crate) fn read(cells: &Cells<'_>, rows: &Rows<'_>) -> Vec<(String, Values)> {
    let count = cells.counts().iter().product();
    let mut places: Vec<Vec<u32>> = places(cells).iter().map(|_| Vec::with_capacity(count)).collect();
    let mut values: Vec<Vec<f64>> = swept(cells).map(|_| Vec::with_capacity(count)).collect();
    let columns = asked(cells);
    let mut measured: Vec<Values> = columns.iter().map(|column| Values::like(&column.read, count)).collect();
    for id in 0..count {
        let shown = Shown::new(cells, rows, id);
        places.iter_mut().zip(shown.row.indices).for_each(|(to, index)| to.push(index as u32));
        values.iter_mut().zip(cells.values(id)).for_each(|(to, value)| to.push(value));
        columns.iter().zip(&mut measured).for_each(|(column, to)| to.push(&column.read, &shown));
    }
    let places = self::places(cells).iter().map(ToString::to_string).zip(places.into_iter().map(Values::U32));
    let values = swept(cells).map(str::to_owned).zip(values.into_iter().map(Values::F64));
    let measured = columns.iter().map(|column| column.name.to_owned()).zip(measured);
    places.chain(values).chain(measured).collect()
}
