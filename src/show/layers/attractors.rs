//! How many attractors coexist in a cell.

use crate::show::layers::colors::{self, NO_VALUE};
use crate::show::layers::{Color, Entry, Layer};

/// One attractor is the rule and stays pale.
const ALONE: Color = [0xe6, 0xec, 0xf2];

/// Numbers that have a name in the legend of their own.
const NAMED: usize = 12;

/// Counts, by cell id.
pub(crate) fn layer(counts: &[u8]) -> Layer {
    let mut cells = [0usize; 256];
    counts.iter().for_each(|&count| cells[usize::from(count)] += 1);
    let palette: Vec<Color> = (0..=255).map(color).collect();
    let entry = |count: usize, text: String| Entry { color: palette[count], text, cells: cells[count] };
    let mut entries = vec![entry(1, "1 attractor".to_owned())];
    entries.extend((2..=NAMED).map(|count| entry(count, format!("{count} attractors"))));
    entries.push(Entry {
        color: palette[NAMED + 1],
        text: "more, a colour each".to_owned(),
        cells: cells[NAMED + 1..].iter().sum(),
    });
    entries.push(entry(0, "none decided".to_owned()));
    entries.retain(|entry| entry.cells > 0);
    Layer {
        name: "attractors",
        short: "attractors",
        title: "coexisting attractors, symmetry-conjugate orbits as one",
        indices: counts.to_vec(),
        palette,
        entries,
        bar: None,
    }
}

fn color(count: u32) -> Color {
    match count {
        0 => NO_VALUE,
        1 => ALONE,
        more => colors::period(more),
    }
}
