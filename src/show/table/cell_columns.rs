//! Columns of a map's rows: texts for `cells.csv`, typed values for `cells.npy` and Python.

use std::borrow::Cow;

use crate::map::scene::Quantity;
use crate::record::Spelling;
use crate::show::cells::{Cells, Row, Source};
use crate::show::names::{float, optional};
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

    /// Returns indices and swept values as texts.
    pub(crate) fn location(&self) -> impl Iterator<Item = String> {
        let values = self.cells.values(self.id).into_iter().map(|value| format!("{value:?}"));
        self.indices().iter().map(ToString::to_string).chain(values)
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
    pub(crate) text: Box<dyn Fn(&CellRow<'_>) -> String + Send + Sync>,
    pub(crate) value: TypedValue,
}

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

fn column(
    name: &'static str,
    quantity: Option<Quantity>,
    text: impl Fn(&CellRow<'_>) -> String + Send + Sync + 'static,
    value: TypedValue,
) -> CellColumn {
    CellColumn { name: name.into(), quantity, text: Box::new(text), value }
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
        text: Box::new(move |c| float(text(c))),
        value: TypedValue::F64(Box::new(move |c, _| value(c).unwrap_or(f64::NAN))),
    }
}

/// Returns all columns of a map, in their order.
#[rustfmt::skip]
fn all(cells: &Cells<'_>) -> Vec<CellColumn> {
    let mut columns = vec![
        column("class", Some(Quantity::Class), |c| optional(c.row.class.map(Class::name)),
            TypedValue::I8(Box::new(|c, _| c.row.class.map_or(ABSENT, |class| class.index() as i8)))),
        column("period", Some(Quantity::Class), |c| optional(c.row.period),
            TypedValue::U16(Box::new(|c, _| c.row.period.unwrap_or(0) as u16))),
        number("lyapunov", Quantity::Lyapunov, |c| c.row.lyapunov),
        number("lyapunov_error", Quantity::Lyapunov, |c| c.row.lyapunov_error),
        number("impacts_per_period", Quantity::Impacts, |c| c.row.impacts_per_period),
        number("mesh_fraction", Quantity::Mesh, |c| c.row.mesh_fraction),
        column("symmetric", Some(Quantity::Symmetric), |c| optional(c.row.symmetric),
            TypedValue::I8(Box::new(|c, _| c.row.symmetric.map_or(ABSENT, i8::from)))),
        column("word", Some(Quantity::Word), |c| spelling(c.cells.word(c.id)),
            TypedValue::U32(Box::new(|c, rows| rows.word(c.id)))),
        column("pattern", Some(Quantity::Pattern), |c| spelling(c.cells.pattern(c.id)),
            TypedValue::U32(Box::new(|c, rows| rows.pattern(c.id)))),
    ];
    columns.extend(cells.numbers().into_iter().map(|measured| {
        number(measured.name.clone(), measured.quantity, move |c| measured.of_cell(c.cells, c.id, &c.row))
    }));
    columns.extend([
        column("status", None, |c| c.row.status.name().to_owned(),
            TypedValue::I8(Box::new(|c, _| c.row.status.code() as i8))),
        column("periods_run", None, |c| c.row.periods_run.to_string(),
            TypedValue::U32(Box::new(|c, _| c.row.periods_run))),
        column("source", None, |c| c.row.source.name().to_owned(),
            TypedValue::I8(Box::new(|c, _| c.row.source as i8))),
    ]);
    // The number of attractors, in maps whose cells have several starts.
    columns.extend(cells.attractors().map(|_| column("attractors", None, |c| optional(c.row.attractors),
        TypedValue::U8(Box::new(|c, _| c.row.attractors.unwrap_or(0))))));
    // The label of the attractor that the start leads to, in maps of basins.
    columns.extend(cells.basins().map(|_| column("attractor", None, |c| optional(c.row.attractor),
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
    fixed.chain(["attractors".to_owned(), "attractor".to_owned()]).collect()
}

// `Source::ALL` gives the codes.
const _: () = assert!(Source::Integrated as i8 == 0 && Source::Filled as i8 == 1);

fn spelling(word: Option<Spelling>) -> String {
    word.map_or(String::new(), |word| word.in_table())
}

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
