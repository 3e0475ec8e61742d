//! A map as coloured layers: the content of its figures and its report.
//!
//! A layer assigns each cell an index into a palette of at most 256 colours. Names, a colour bar, or both explain the
//! colours.

mod attractors;
mod bar;
mod basins;
mod classes;
pub(crate) mod colors;
mod continuous;
mod layer;
#[cfg(feature = "files")]
pub mod shares;
mod words;

pub use bar::Bar;
pub(crate) use bar::share;
pub use layer::{Layer, NamedColor};

use crate::map::scene::Quantity;
use crate::show::cells::Cells;
use crate::show::color::Color;
use crate::show::drawing::wall_color;
use crate::show::words::MapWords;
use rattlemap_dynamics::model::Side;

/// Colours of the program's figures, for plots by other programs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SharedColors {
    /// Colours by name.
    pub named: Vec<(&'static str, Color)>,
    /// Colours of all but the most common item of a list.
    pub in_a_row: Vec<Color>,
}

/// Returns the colours of the program's figures.
pub fn shared_colors() -> SharedColors {
    let named = vec![
        ("commonest", words::COMMONEST),
        ("period 1", colors::SYMMETRIC),
        ("without events", words::WITHOUT_EVENTS),
        ("chaotic", colors::CHAOTIC),
        ("undecided", colors::UNDECIDED),
        ("failed", colors::FAILED),
        ("quasi-periodic", colors::QUASI_PERIODIC),
        ("rare", words::RARE),
        ("not known", words::NOT_KNOWN),
        ("right", wall_color(Side::Right)),
        ("left", wall_color(Side::Left)),
    ];
    SharedColors { named, in_a_row: (1..64).map(colors::distinct).collect() }
}

/// Name of the layer of classes in maps whose main layer shows basins.
pub const CLASS: &str = "class";

/// Returns the layers that the scene requests, the main layer first, patterns before words.
pub fn of(cells: &Cells<'_>, words: &MapWords) -> Vec<Layer> {
    let mut layers: Vec<Layer> = cells.basins().map(|of| basins::layer(cells, of)).into_iter().collect();
    if cells.has(Quantity::Class) {
        let classes = classes::layer(cells);
        layers.push(if layers.is_empty() { classes } else { Layer { name: CLASS.into(), ..classes } });
    }
    layers.extend(continuous::layers(cells));
    layers.extend(words.patterns.iter().map(|index| words::layer(index, words::PATTERNS)));
    layers.extend(words.words.iter().map(|index| words::layer(index, words::WORDS)));
    layers.extend(cells.attractors().map(attractors::layer));
    layers
}
