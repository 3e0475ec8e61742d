//! A map as coloured layers: what its figures and its report show.
//!
//! A layer gives every cell an index into a palette of at most 256 colours, and says what
//! the colours mean: by name, on a bar, or both.

mod classes;
mod colors;
mod scale;
mod words;

pub(super) use colors::Color;
pub(super) use words::{Words, read as read_words};

use rayon::prelude::*;

use super::cells::{Cells, Row};
use crate::scene::Quantity;
use colors::{DIVERGING, NO_VALUE, SEQUENTIAL, ramp};
use scale::nice_bound;

/// One view of a map.
#[derive(Clone, Debug)]
pub(super) struct Layer {
    /// Name of its file and in the report.
    pub(super) name: &'static str,
    /// What it shows, for headings.
    pub(super) title: &'static str,
    /// A place in the palette for every cell, by id.
    pub(super) indices: Vec<u8>,
    /// The colours.
    pub(super) palette: Vec<Color>,
    /// Colours that have a name, in the order in which a legend lists them.
    pub(super) entries: Vec<Entry>,
    /// Colours that stand for numbers.
    pub(super) bar: Option<Bar>,
}

/// A colour with a name.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) color: Color,
    pub(super) text: String,
    /// Cells of this colour.
    pub(super) cells: usize,
}

/// A range of the palette that stands for a range of numbers.
#[derive(Clone, Debug)]
pub(super) struct Bar {
    pub(super) label: &'static str,
    pub(super) colors: Vec<Color>,
    pub(super) low: f64,
    pub(super) high: f64,
}

/// The layers that the scene asks for, the first being the map itself. Words are read once,
/// for the report needs them, too.
pub(super) fn of(cells: &Cells<'_>, words: Option<&Words>) -> Vec<Layer> {
    let mut layers = Vec::new();
    if cells.asks(Quantity::Class) {
        layers.push(classes::layer(cells));
    }
    let kinds = [
        (
            Quantity::Lyapunov,
            "lyapunov",
            "largest Lyapunov exponent",
            Kind::Signed,
            (|r| r.lyapunov) as Field,
        ),
        (Quantity::Impacts, "impacts", "impacts per forcing period", Kind::Positive, |r| {
            r.impacts_per_period
        }),
        (Quantity::Mesh, "mesh", "fraction of time in meshing", Kind::Positive, |r| r.mesh_fraction),
    ];
    for (quantity, name, title, kind, field) in kinds {
        if cells.asks(quantity) {
            layers.push(continuous(cells, name, title, kind, field));
        }
    }
    layers.extend(words.map(words::layer));
    layers
}

type Field = fn(&Row) -> Option<f64>;

#[derive(Clone, Copy)]
enum Kind {
    /// About zero, which is white.
    Signed,
    /// From zero up.
    Positive,
}

/// Levels of a continuous layer; the next palette place is for cells without a value.
const LEVELS: u8 = 255;

fn continuous(cells: &Cells<'_>, name: &'static str, title: &'static str, kind: Kind, field: Field) -> Layer {
    let values: Vec<Option<f64>> = ids(cells).map(|id| field(&cells.row(id))).collect();
    let high = nice_bound(values.iter().flatten().map(|value| value.abs()));
    let (low, anchors) = match kind {
        Kind::Signed => (-high, &DIVERGING[..]),
        Kind::Positive => (0.0, &SEQUENTIAL[..]),
    };
    let level = |value: f64| {
        let share = ((value - low) / (high - low)).clamp(0.0, 1.0);
        (share * f64::from(LEVELS - 1)).round() as u8
    };
    let indices: Vec<u8> = values.par_iter().map(|value| value.map_or(LEVELS, level)).collect();
    let colors = ramp(anchors, LEVELS.into());
    let absent = values.iter().filter(|value| value.is_none()).count();
    let entry = Entry { color: NO_VALUE, text: "no value".to_owned(), cells: absent };
    Layer {
        name,
        title,
        indices,
        palette: colors.iter().copied().chain([NO_VALUE]).collect(),
        entries: if absent > 0 { vec![entry] } else { Vec::new() },
        bar: Some(Bar { label: title, colors, low, high }),
    }
}

/// Every cell id, to be mapped in parallel and in order.
fn ids(cells: &Cells<'_>) -> rayon::range::Iter<usize> {
    let [columns, rows] = cells.counts();
    (0..columns * rows).into_par_iter()
}
