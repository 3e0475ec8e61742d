//! The layer of the number of coexisting attractors.

use crate::show::color::Color;
use crate::show::layers::colors::{self, UNDECIDED};
use crate::show::layers::layer::{Layer, NamedColor, legend};

/// Colour of cells with one attractor, which are the most common.
const ONE_ATTRACTOR: Color = [0xe6, 0xec, 0xf2];

/// Largest number with an entry of its own in the legend.
const LISTED_COUNTS: usize = 12;

/// Returns the layer of the number of attractors of each cell, by id.
pub(crate) fn layer(counts: &[u8]) -> Layer {
    let mut cells = [0usize; 256];
    counts.iter().for_each(|&count| cells[usize::from(count)] += 1);
    let palette: Vec<Color> = (0..=255).map(color).collect();
    let entry = |count: usize, text: String| NamedColor { color: palette[count], text, cells: cells[count] };
    let mut entries = vec![entry(1, "1 attractor".to_owned())];
    entries.extend((2..=LISTED_COUNTS).map(|count| entry(count, format!("{count} attractors"))));
    entries.push(NamedColor {
        cells: cells[LISTED_COUNTS + 1..].iter().sum(),
        ..entry(LISTED_COUNTS + 1, "more, a colour each".to_owned())
    });
    entries.push(entry(0, "none decided".to_owned()));
    Layer {
        name: "attractors".into(),
        short: "attractors".into(),
        title: "coexisting attractors, symmetry-conjugate orbits as one".into(),
        indices: counts.to_vec(),
        palette,
        entries: legend(entries),
        bar: None,
        numbers: None,
    }
}

fn color(count: u32) -> Color {
    match count {
        0 => UNDECIDED,
        1 => ONE_ATTRACTOR,
        count => colors::period(count),
    }
}
