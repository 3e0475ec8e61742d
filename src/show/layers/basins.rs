//! To which attractor each start leads.

use crate::findings::attractors::{Basins, NONE};
use crate::show::layers::colors::{self, NO_VALUE, SYMMETRIC, UNDECIDED};
use crate::show::layers::{Color, Entry, Layer};
use crate::show::table::attractors_csv::named;
use rattlemap_dynamics::orbit::Class;

/// Attractors that have a colour, and a name in the legend, of their own.
const COLORED: usize = 63;
const NAMED: usize = 20;

/// Places in the palette.
const REST: u8 = COLORED as u8;
const CHAOS: u8 = REST + 1;
const UNKNOWN: u8 = CHAOS + 1;

/// As dark as in the map of classes.
const CHAOTIC: Color = [0x2a, 0x2a, 0x2a];

pub(crate) fn layer(basins: &Basins) -> Layer {
    let list = basins.attractors();
    let place = |label: usize| match list[label].class {
        Class::Chaotic => CHAOS,
        _ => label.min(COLORED) as u8,
    };
    let index = |&label: &u16| if label == NONE { UNKNOWN } else { place(usize::from(label)) };
    let indices: Vec<u8> = basins.labels().iter().map(index).collect();
    // The largest basin stays pale.
    let palette: Vec<Color> = std::iter::once(SYMMETRIC)
        .chain((1..COLORED).map(colors::distinct))
        .chain([NO_VALUE, CHAOTIC, UNDECIDED])
        .collect();
    let entry = |(label, attractor): (usize, &_)| Entry {
        color: palette[usize::from(place(label))],
        text: named(label, attractor),
        cells: attractor.cells,
    };
    let mut entries: Vec<Entry> = list.iter().enumerate().take(NAMED).map(entry).collect();
    let rest = &list[list.len().min(NAMED)..];
    if !rest.is_empty() {
        let cells = rest.iter().map(|attractor| attractor.cells).sum();
        let color = palette[usize::from(place(NAMED))];
        entries.push(Entry { color, text: format!("{} more attractors", rest.len()), cells });
    }
    let unknown = basins.labels().iter().filter(|&&label| label == NONE).count();
    entries.push(Entry { color: UNDECIDED, text: "undecided or failed".to_owned(), cells: unknown });
    entries.retain(|entry| entry.cells > 0);
    Layer {
        name: "map",
        short: "attractor",
        title: "basins of attraction",
        indices,
        palette,
        entries,
        bar: None,
    }
}
