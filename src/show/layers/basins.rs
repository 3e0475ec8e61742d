//! The main layer of a map of basins: the attractor that each start leads to.

use crate::findings::attractors::{Attractor, Basins, NONE};
use crate::show::cells::Cells;
use crate::show::color::Color;
use crate::show::layers::colors::{self, CHAOTIC, NO_VALUE, QUASI_PERIODIC, SYMMETRIC, UNDECIDED};
use crate::show::layers::layer::{Layer, NamedColor, legend};
use crate::show::table::attractors_csv::attractor_names;
use rattlemap_dynamics::orbit::Class;

/// Numbers of attractors with a colour of their own, and with an entry of their own in the legend.
const COLORED_ATTRACTORS: usize = 63;
const LISTED_ATTRACTORS: usize = 20;

/// Indices into the palette after those of the coloured attractors.
const OTHER_INDEX: u8 = COLORED_ATTRACTORS as u8;
const CHAOS_INDEX: u8 = OTHER_INDEX + 1;
const UNKNOWN_INDEX: u8 = CHAOS_INDEX + 1;
const TORUS_INDEX: u8 = UNKNOWN_INDEX + 1;

/// Returns the layer.
pub(crate) fn layer(cells: &Cells<'_>, basins: &Basins) -> Layer {
    let list = basins.attractors();
    let names = attractor_names(list, &cells.scene().base().state_names());
    let index = |label: usize| match list[label].class {
        Class::Chaotic => CHAOS_INDEX,
        Class::QuasiPeriodic => TORUS_INDEX,
        _ => label.min(COLORED_ATTRACTORS) as u8,
    };
    let labels = basins.labels();
    let index_of_cell = |&label: &u16| if label == NONE { UNKNOWN_INDEX } else { index(label.into()) };
    // The largest basin has a pale colour.
    let palette: Vec<Color> = std::iter::once(SYMMETRIC)
        .chain((1..COLORED_ATTRACTORS).map(colors::distinct))
        .chain([NO_VALUE, CHAOTIC, UNDECIDED, QUASI_PERIODIC])
        .collect();
    let color = |label: usize| palette[usize::from(index(label))];
    let entry = |(label, attractor): (usize, &Attractor)| NamedColor {
        color: color(label),
        text: names[label].clone(),
        cells: attractor.cells,
    };
    let is_listed = |(label, attractor): &(usize, &Attractor)| {
        *label < LISTED_ATTRACTORS || matches!(attractor.class, Class::Chaotic | Class::QuasiPeriodic)
    };
    let mut entries: Vec<NamedColor> = list.iter().enumerate().filter(is_listed).map(entry).collect();
    let is_colored = |label: usize| label < COLORED_ATTRACTORS;
    for (kind, colored, colors) in [("other", true, "a colour each"), ("rare", false, "one colour")] {
        let all = list.iter().enumerate().filter(|some| !is_listed(some) && is_colored(some.0) == colored);
        let some: Vec<(usize, &Attractor)> = all.collect();
        if let Some((first, _)) = some.first() {
            let text = format!("{} {kind} attractors, {colors}", some.len());
            let cells = some.iter().map(|(_, attractor)| attractor.cells).sum();
            entries.push(NamedColor { color: color(*first), text, cells });
        }
    }
    let cells = labels.iter().filter(|&&label| label == NONE).count();
    entries.push(NamedColor { color: UNDECIDED, text: "undecided or failed".to_owned(), cells });
    Layer {
        name: "map".into(),
        short: "attractor".into(),
        title: "basins of attraction".into(),
        indices: labels.iter().map(index_of_cell).collect(),
        palette,
        entries: legend(entries),
        bar: None,
        numbers: None,
    }
}
