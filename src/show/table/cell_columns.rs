//! Columns of a map's rows: texts for `cells.csv`, typed values for `cells.npy` and Python.

use std::borrow::Cow;
use std::fmt::{self, Display, Write};

use crate::map::scene::Quantity;
use crate::show::cells::{Cells, Finished, Row, Source};
use crate::show::names;
use crate::show::table::words_csv::WordRows;
use rattlemap_dynamics::orbit::Class;

/// Code of an absent class or an absent symmetry.
pub const ABSENT: i8 = -1;

/// A cell whose columns are read.
pub(crate) struct CellRow<'a> {
    cells: &'a Cells<'a>,
    id: usize,
    row: Row,
}

impl<'a> CellRow<'a> {
    pub(crate) fn new(cells: &'a Cells<'a>, id: usize) -> CellRow<'a> {
        CellRow { cells, id, row: cells.row(id) }
    }

    /// Returns the indices on the axes, which a list of cells does not have.
    pub(crate) fn indices(&self) -> &[usize] {
        &self.row.indices[..index_names(self.cells).len()]
    }

    /// Returns indices and swept values, for tables of texts.
    pub(crate) fn location(&self) -> impl Iterator<Item = Place> {
        let values = self.cells.values(self.id).into_iter().map(Place::Value);
        self.indices().iter().map(|&index| Place::Index(index)).chain(values)
    }
}

/// An index on an axis, or the value of a swept parameter.
pub(crate) enum Place {
    Index(usize),
    Value(f64),
}

impl Display for Place {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Index(index) => write!(to, "{index}"),
            Place::Value(value) => write!(to, "{value:?}"),
        }
    }
}

/// Returns the names of the columns of indices on the axes, which a list of cells does not have.
fn index_names(cells: &Cells<'_>) -> &'static [&'static str] {
    if cells.scene().list().is_some() { &[] } else { &["i", "j"] }
}

/// Returns the names of the columns of swept values.
fn swept_names<'a>(cells: &Cells<'a>) -> impl Iterator<Item = &'a str> {
    cells.scene().swept().map(|parameter| &*parameter.name)
}

/// Returns the names of the columns of indices and swept values.
pub(crate) fn location_names<'a>(cells: &Cells<'a>) -> impl Iterator<Item = &'a str> {
    index_names(cells).iter().copied().chain(swept_names(cells))
}

/// A column after indices and swept values.
pub(crate) struct CellColumn {
    pub(crate) name: Cow<'static, str>,
    /// Quantity that the scene must request.
    quantity: Option<Quantity>,
    pub(crate) text: WriteText,
    pub(crate) value: TypedValue,
}

/// A function that writes the text of a value; nothing if the value is absent.
type WriteText = Box<dyn Fn(&CellRow<'_>, &WordRows<'_>, &mut String) -> fmt::Result + Send + Sync>;

/// A function that reads a value of a column.
type Read<T> = Box<dyn Fn(&CellRow<'_>, &WordRows<'_>) -> T + Send + Sync>;

/// Defines the types of columns: [`TypedValue`] reads one value, [`Values`] holds those of all cells.
macro_rules! types {
    ($($(#[$doc:meta])* $name:ident, $type:ty, $numpy:literal;)*) => {
        /// A function that reads one value of a column, by its type.
        pub(crate) enum TypedValue {
            $($name(Read<$type>),)*
        }

        /// Values of a column, one per cell.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Values {
            $($(#[$doc])* $name(Vec<$type>),)*
        }

        impl TypedValue {
            /// Returns the type in NumPy's notation.
            pub(crate) fn numpy_type(&self) -> &'static str {
                match self {
                    $(TypedValue::$name(_) => $numpy,)*
                }
            }

            /// Appends the bytes of the value.
            pub(crate) fn put(&self, cell: &CellRow<'_>, rows: &WordRows<'_>, to: &mut Vec<u8>) {
                match self {
                    $(TypedValue::$name(value) => to.extend(value(cell, rows).to_le_bytes()),)*
                }
            }

            fn empty(&self, count: usize) -> Values {
                match self {
                    $(TypedValue::$name(_) => Values::$name(Vec::with_capacity(count)),)*
                }
            }

            fn push(&self, cell: &CellRow<'_>, rows: &WordRows<'_>, to: &mut Values) {
                match (self, to) {
                    $((TypedValue::$name(value), Values::$name(to)) => to.push(value(cell, rows)),)*
                    _ => unreachable!("the values have the type of their column"),
                }
            }
        }
    };
}

types! {
    /// Codes; -1 where absent.
    I8, i8, "|i1";
    /// Counts up to 255.
    U8, u8, "|u1";
    /// Periods; 0 where absent.
    U16, u16, "<u2";
    /// Counts, indices, and rows of the table of words.
    U32, u32, "<u4";
    /// Labels; -1 where absent.
    I32, i32, "<i4";
    /// Numbers; NaN where absent.
    F64, f64, "<f8";
}

/// Returns a column whose texts are those of `shown`.
fn column<T: Display>(
    name: &'static str,
    quantity: Option<Quantity>,
    shown: impl Fn(&CellRow<'_>) -> Option<T> + Send + Sync + 'static,
    value: TypedValue,
) -> CellColumn {
    let text = Box::new(move |c: &CellRow<'_>, _: &WordRows<'_>, to: &mut String| {
        shown(c).map_or(Ok(()), |value| write!(to, "{value}"))
    });
    CellColumn { name: name.into(), quantity, text, value }
}

/// Returns a column of words or of patterns. `row` returns the row of a cell's word.
fn words(
    name: &'static str,
    quantity: Quantity,
    row: impl Fn(&WordRows<'_>, usize) -> u32 + Copy + Send + Sync + 'static,
) -> CellColumn {
    CellColumn {
        name: name.into(),
        quantity: Some(quantity),
        text: Box::new(move |c, rows, to| to.write_str(&rows.texts()[row(rows, c.id) as usize])),
        value: TypedValue::U32(Box::new(move |c, rows| row(rows, c.id))),
    }
}

/// Returns a column of numbers.
fn number(
    name: impl Into<Cow<'static, str>>,
    quantity: Quantity,
    value: impl Fn(&CellRow<'_>) -> Option<f64> + Clone + Send + Sync + 'static,
) -> CellColumn {
    let text = value.clone();
    CellColumn {
        name: name.into(),
        quantity: Some(quantity),
        text: Box::new(move |c, _, to| {
            // The shortest decimal that reads back as the same number.
            text(c).filter(|x| names::is_told(*x)).map_or(Ok(()), |x| write!(to, "{x:?}"))
        }),
        value: TypedValue::F64(Box::new(move |c, _| value(c).unwrap_or(f64::NAN))),
    }
}

/// Returns all columns of a map, in their order.
#[rustfmt::skip]
fn all(cells: &Cells<'_>) -> Vec<CellColumn> {
    let mut columns = vec![
        column("class", Some(Quantity::Class), |c| c.row.class.map(Class::name),
            TypedValue::I8(Box::new(|c, _| c.row.class.map_or(ABSENT, |class| class.index() as i8)))),
        column("period", Some(Quantity::Class), |c| c.row.period,
            TypedValue::U16(Box::new(|c, _| c.row.period.unwrap_or(0) as u16))),
        number("lyapunov", Quantity::Lyapunov, |c| c.row.lyapunov),
        number("lyapunov_error", Quantity::Lyapunov, |c| c.row.lyapunov_error),
        number("impacts_per_period", Quantity::Impacts, |c| c.row.impacts_per_period),
        number("mesh_fraction", Quantity::Mesh, |c| c.row.mesh_fraction),
        column("symmetric", Some(Quantity::Symmetric), |c| c.row.symmetric,
            TypedValue::I8(Box::new(|c, _| c.row.symmetric.map_or(ABSENT, i8::from)))),
        words("word", Quantity::Word, |rows, id| rows.word(id)),
        words("pattern", Quantity::Pattern, |rows, id| rows.pattern(id)),
    ];
    columns.extend(cells.numbers().into_iter().map(|measured| {
        number(measured.name.clone(), measured.quantity, move |c| measured.of_cell(c.cells, c.id, &c.row))
    }));
    columns.extend([
        column("status", None, |c| Some(c.row.status.name()),
            TypedValue::I8(Box::new(|c, _| c.row.status.code() as i8))),
        column("periods_run", None, |c| Some(c.row.periods_run),
            TypedValue::U32(Box::new(|c, _| c.row.periods_run))),
        column("source", None, |c| Some(c.row.source.name()),
            TypedValue::I8(Box::new(|c, _| c.row.source as i8))),
    ]);
    columns.extend(cells.are_of_lanes().then(|| column("finished", None, |c| c.row.finished.map(Finished::name),
        TypedValue::I8(Box::new(|c, _| c.row.finished.map_or(ABSENT, |finished| finished as i8))))));
    // The number of attractors, in maps whose cells have several starts.
    columns.extend(cells.attractors().map(|_| column("attractors", None, |c| c.row.attractors,
        TypedValue::U8(Box::new(|c, _| c.row.attractors.unwrap_or(0))))));
    // The label of the attractor that the start leads to, in maps of basins.
    columns.extend(cells.basins().map(|_| column("attractor", None, |c| c.row.attractor,
        TypedValue::I32(Box::new(|c, _| c.row.attractor.map_or(i32::from(ABSENT), i32::from))))));
    columns
}

/// Returns the names of all columns after indices and swept values, without those that contain a component of the state.
#[cfg(test)]
pub(super) fn all_names() -> Vec<String> {
    use crate::map::plan::Plan;
    use crate::map::scene::{Purpose, Scene};
    use crate::record::Record;

    let axis = |name: &str| format!("[[axis]]\nparameter = '{name}'\nmin = 0.1\nmax = 1.0\ncount = 2\n");
    let quantities: Vec<&str> = Quantity::measured().into_iter().map(Quantity::name).collect();
    let text = format!("{}{}[outputs]\nquantities = {quantities:?}\n", axis("e"), axis("omega"));
    let scene = Scene::parse(&text, "s", &[], Purpose::Map).unwrap();
    let plan = Plan::new(&scene);
    let records = vec![Record::default(); plan.run_count()];
    let names = all(&Cells::new(&scene, &plan, &records)).into_iter().map(|column| column.name.into_owned());
    let fixed =
        names.filter(|name| !["x1", "v1", "x2", "v2"].iter().any(|of| name.ends_with(&format!("_{of}"))));
    fixed.chain(["finished", "attractors", "attractor"].map(str::to_owned)).collect()
}

// `ALL` gives the codes.
const _: () = assert!(Source::Integrated as i8 == 0 && Source::Filled as i8 == 1);
const _: () = assert!(Finished::Device as i8 == 0 && Finished::Reference as i8 == 1);

/// Returns the columns of `cells.csv`. The first quantities have a column even where the scene does not request them.
pub(crate) fn of_csv(cells: &Cells<'_>) -> Vec<CellColumn> {
    let is_present = |quantity| quantity < Quantity::Pattern || cells.has(quantity);
    all(cells).into_iter().filter(|column| column.quantity.is_none_or(is_present)).collect()
}

/// Returns the columns that the scene requests.
pub(crate) fn requested(cells: &Cells<'_>) -> Vec<CellColumn> {
    all(cells)
        .into_iter()
        .filter(|column| column.quantity.is_none_or(|quantity| cells.has(quantity)))
        .collect()
}

/// Returns all columns of `cells.npy`, by name.
pub fn read(cells: &Cells<'_>, rows: &WordRows<'_>) -> Vec<(String, Values)> {
    let count = cells.count();
    let mut indices: Vec<Vec<u32>> = index_names(cells).iter().map(|_| Vec::with_capacity(count)).collect();
    let mut swept: Vec<Vec<f64>> = swept_names(cells).map(|_| Vec::with_capacity(count)).collect();
    let columns = requested(cells);
    let mut measured: Vec<Values> = columns.iter().map(|column| column.value.empty(count)).collect();
    for id in 0..count {
        let cell = CellRow::new(cells, id);
        indices.iter_mut().zip(cell.indices()).for_each(|(to, &index)| to.push(index as u32));
        swept.iter_mut().zip(cells.values(id)).for_each(|(to, value)| to.push(value));
        columns.iter().zip(&mut measured).for_each(|(column, to)| column.value.push(&cell, rows, to));
    }
    let location = indices.into_iter().map(Values::U32).chain(swept.into_iter().map(Values::F64));
    let names = location_names(cells).chain(columns.iter().map(|column| &*column.name));
    names.map(str::to_owned).zip(location.chain(measured)).collect()
}

/// Returns names and NumPy types of all columns of `cells.npy`.
pub(crate) fn numpy_types<'a>(
    cells: &Cells<'a>,
    columns: &'a [CellColumn],
) -> impl Iterator<Item = (&'a str, &'static str)> {
    let indices = index_names(cells).iter().map(|&name| (name, "<u4"));
    let swept = swept_names(cells).map(|name| (name, "<f8"));
    indices.chain(swept).chain(columns.iter().map(|column| (&*column.name, column.value.numpy_type())))
}
