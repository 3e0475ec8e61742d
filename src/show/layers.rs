//! A map as coloured layers: what its figures and its report show.
//!
//! A layer gives every cell an index into a palette of at most 256 colours, and says what
//! the colours mean: by name, on a bar, or both.

mod attractors;
mod basins;
mod classes;
mod colors;
mod scale;
mod words;

pub(crate) use colors::Color;

use rayon::prelude::*;

use crate::map::scene::Quantity;
use crate::show::cells::{Cells, Row};
use crate::show::symbols::number;
use crate::show::words::Spelled;
use colors::{NO_VALUE, diverging, sequential};
use scale::nice_bound;

/// The colours of figures, for those of other programs: red, green and blue.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Colors {
    /// By name.
    pub named: Vec<(&'static str, Color)>,
    /// Of things in a row, the most common one left out.
    pub in_a_row: Vec<Color>,
}

pub(crate) fn shared_colors() -> Colors {
    let named = vec![
        ("commonest", words::COMMONEST),
        ("period 1", colors::SYMMETRIC),
        ("without events", words::WITHOUT_EVENTS),
        ("chaotic", words::NOT_PERIODIC),
        ("undecided", colors::UNDECIDED),
        ("failed", colors::FAILED),
        ("rare", words::RARE),
    ];
    Colors { named, in_a_row: (1..64).map(colors::distinct).collect() }
}

/// One view of a map.
#[derive(Clone, Debug)]
pub(crate) struct Layer {
    /// Name of its file and in the report.
    pub(crate) name: &'static str,
    /// What it shows, in a word.
    pub(crate) short: &'static str,
    /// What it shows, for headings.
    pub(crate) title: &'static str,
    /// A place in the palette for every cell, by id.
    pub(crate) indices: Vec<u8>,
    /// The colours.
    pub(crate) palette: Vec<Color>,
    /// Colours that have a name, in the order in which a legend lists them.
    pub(crate) entries: Vec<Entry>,
    /// Colours that stand for numbers.
    pub(crate) bar: Option<Bar>,
}

/// A colour with a name.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub(crate) color: Color,
    pub(crate) text: String,
    /// Cells of this colour.
    pub(crate) cells: usize,
}

/// A range of the palette that stands for a range of numbers.
#[derive(Clone, Debug)]
pub(crate) struct Bar {
    pub(crate) label: &'static str,
    pub(crate) colors: Vec<Color>,
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Cells whose numbers lie below `low` and above `high`.
    pub(crate) beyond: [usize; 2],
}

impl Bar {
    /// What the bar does not show, if anything; `total` are all cells.
    pub(crate) fn left_out(&self, total: usize) -> Vec<String> {
        let [below, above] = self.beyond;
        let sides = [(above, "above", self.high), (below, "below", self.low)];
        let told = sides.into_iter().filter(|(cells, ..)| *cells > 0);
        told.map(|(cells, side, end)| format!("values {side} {}: {}", number(end), share(cells, total)))
            .collect()
    }
}

/// Cells as a share of all, or their number if they are few.
pub(crate) fn share(cells: usize, total: usize) -> String {
    let percent = 100.0 * cells as f64 / total as f64;
    match cells {
        _ if percent >= 0.1 => format!("{percent:.1} %"),
        1 => "1 cell".to_owned(),
        cells => format!("{cells} cells"),
    }
}

/// The layer of classes where another is the map.
pub(crate) const CLASS: &str = "class";

/// The layers that the scene asks for, the first being the map itself, patterns before words.
pub(crate) fn of(cells: &Cells<'_>, spelled: &Spelled) -> Vec<Layer> {
    let mut layers: Vec<Layer> = cells.basins().map(basins::layer).into_iter().collect();
    if cells.asks(Quantity::Class) {
        let classes = classes::layer(cells);
        layers.push(if layers.is_empty() { classes } else { Layer { name: CLASS, ..classes } });
    }
    layers.extend(SCALES.iter().filter(|scale| cells.asks(scale.quantity)).map(|scale| scale.layer(cells)));
    layers.extend(spelled.patterns.as_ref().map(words::patterns));
    layers.extend(spelled.words.as_ref().map(words::words));
    layers.extend(cells.attractors().map(attractors::layer));
    layers
}

/// A quantity whose numbers become colours.
struct Scale {
    quantity: Quantity,
    name: &'static str,
    short: &'static str,
    title: &'static str,
    field: fn(&Row) -> Option<f64>,
    colors: fn(f64) -> Color,
}

const SCALES: [Scale; 3] = [
    Scale {
        quantity: Quantity::Lyapunov,
        name: "lyapunov",
        short: "exponent",
        title: "largest Lyapunov exponent, \u{3bb}",
        field: |row| row.lyapunov,
        colors: diverging,
    },
    Scale {
        quantity: Quantity::Impacts,
        name: "impacts",
        short: "impacts",
        title: "impacts per forcing period",
        field: |row| row.impacts_per_period,
        colors: sequential,
    },
    Scale {
        quantity: Quantity::Mesh,
        name: "mesh",
        short: "meshing",
        title: "fraction of time in meshing",
        field: |row| row.mesh_fraction,
        colors: sequential,
    },
];

/// Levels of a scale; the next palette place is for cells without a value.
const LEVELS: u8 = 255;

impl Scale {
    fn layer(&self, cells: &Cells<'_>) -> Layer {
        // What has no value is no number.
        let values: Vec<f64> =
            ids(cells).map(|id| (self.field)(&cells.row(id)).unwrap_or(f64::NAN)).collect();
        let numbers = || values.iter().copied().filter(|value| !value.is_nan());
        let sizes = |sign: f64| numbers().map(move |value| sign * value).filter(|size| *size > 0.0);
        let high = match numbers().all(|value| value < 0.0) && sizes(-1.0).next().is_some() {
            true => 0.0,
            false => nice_bound(sizes(1.0)),
        };
        let low = if sizes(-1.0).next().is_some() { -nice_bound(sizes(-1.0)) } else { 0.0 };
        let beyond = beyond(numbers(), low, high);
        let value_of = |share: f64| low + share * (high - low);
        let level = |value: f64| {
            let share = ((value - low) / (high - low)).clamp(0.0, 1.0);
            (share * f64::from(LEVELS - 1)).round() as u8
        };
        let color = |level: u8| {
            let value = value_of(f64::from(level) / f64::from(LEVELS - 1));
            // In units of its own side's end, so that both sides use all their colours.
            (self.colors)(match value {
                negative if negative < 0.0 => negative / -low,
                positive if high > 0.0 => positive / high,
                _ => 0.0,
            })
        };
        let colors: Vec<Color> = (0..LEVELS).map(color).collect();
        let absent = values.iter().filter(|value| value.is_nan()).count();
        let entry = Entry { color: NO_VALUE, text: "no value".to_owned(), cells: absent };
        Layer {
            name: self.name,
            short: self.short,
            title: self.title,
            indices: values
                .par_iter()
                .map(|&value| if value.is_nan() { LEVELS } else { level(value) })
                .collect(),
            palette: colors.iter().copied().chain([NO_VALUE]).collect(),
            entries: if absent > 0 { vec![entry] } else { Vec::new() },
            bar: Some(Bar { label: self.title, colors, low, high, beyond }),
        }
    }
}

/// How many numbers lie below and above the ends of a scale.
fn beyond(values: impl Iterator<Item = f64>, low: f64, high: f64) -> [usize; 2] {
    values.fold([0, 0], |[below, above], value| {
        [below + usize::from(value < low), above + usize::from(value > high)]
    })
}

/// Every cell id, to be mapped in parallel and in order.
fn ids(cells: &Cells<'_>) -> rayon::range::Iter<usize> {
    let [columns, rows] = cells.counts();
    (0..columns * rows).into_par_iter()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::plan::Plan;
    use crate::map::scene::{Purpose, Scene};
    use crate::record::{Record, valid};

    /// The exponents' layer of a map of 400 cells.
    fn exponents(value: impl Fn(usize) -> f64) -> Layer {
        let axis = |name: &str| format!("[[axis]]\nparameter = '{name}'\nmin = 0.1\nmax = 1.0\ncount = 20\n");
        let scene = Scene::parse(&(axis("e") + &axis("omega")), "s", &[], Purpose::Map).unwrap();
        let plan = Plan::new(&scene);
        let record = |id| Record {
            lyapunov: value(id),
            period: 1,
            valid: valid::LYAPUNOV | valid::PERIOD,
            ..Record::default()
        };
        let records: Vec<Record> = (0..plan.run_count()).map(record).collect();
        let cells = Cells::new(&scene, &plan, &records);
        let layers = of(&cells, &crate::show::words::read(&cells));
        layers.into_iter().find(|layer| layer.name == "lyapunov").unwrap()
    }

    /// A scale ends where values do: there is no red on a map without chaos.
    #[test]
    fn a_scale_has_the_sides_that_values_have() {
        let ends = |layer: &Layer| layer.bar.as_ref().map(|bar| (bar.low, bar.high)).unwrap();
        let negative = exponents(|id| -0.001 * (id + 1) as f64);
        assert_eq!(ends(&negative), (-0.4, 0.0));
        assert_eq!(negative.palette[254], diverging(0.0), "its upper end is white");
        assert!(exponents(|_| -0.1).palette.contains(&diverging(-1.0)));
        assert_eq!(ends(&exponents(|id| if id < 200 { -0.2 } else { 1.9 })), (-0.2, 2.0));
        assert_eq!(ends(&exponents(|_| 0.0)), (0.0, 1.0));
    }

    /// A few extremes do not stretch it; how many there are is told.
    #[test]
    fn what_a_scale_leaves_out_is_counted() {
        let layer = exponents(|id| if id == 7 { -5.0 } else { -0.2 });
        let bar = layer.bar.unwrap();
        assert_eq!((bar.low, bar.beyond), (-0.2, [1, 0]));
        assert_eq!(bar.left_out(2000), ["values below \u{2212}0.2: 1 cell"]);
        assert_eq!(bar.left_out(100), ["values below \u{2212}0.2: 1.0 %"]);
    }
}
