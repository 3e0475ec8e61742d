//! Layers of a map of shares: the likeliest attractor, the number of attractors, and the shares of the most frequent ones.

use crate::map::shares::{CellShares, Kind, Name, Names};
use crate::show::color::Color;
use crate::show::layers::attractors;
use crate::show::layers::bar::Bar;
use crate::show::layers::colors::{self, QUASI_PERIODIC, UNDECIDED};
use crate::show::layers::layer::{Layer, NamedColor, legend};
use crate::show::layers::words::WITHOUT_EVENTS;

/// Largest number of attractors whose shares have a layer, and of those with a colour of their own.
const SHOWN: usize = 6;
const COLORED: usize = 200;

/// Number of colours of a share.
const LEVELS: usize = 255;

/// Returns the layers of a map of shares, the main one first.
pub fn of(cells: &[CellShares], names: &Names) -> Vec<Layer> {
    let counts: Vec<u8> = cells.iter().map(|cell| cell.attractors.len().min(255) as u8).collect();
    let number = attractors::layer(&counts);
    let number = Layer { title: "number of attractors that the starts reach".into(), ..number };
    let shares =
        names.list.iter().take(SHOWN).enumerate().map(|(place, name)| share(cells, names, place, name));
    [likeliest(cells, names), number].into_iter().chain(shares).collect()
}

/// Returns the layer of the attractor with the largest share of each cell.
fn likeliest(cells: &[CellShares], names: &Names) -> Layer {
    let place = |of_cell: &Vec<usize>| of_cell.first().map_or(COLORED + 1, |place| (*place).min(COLORED));
    let indices: Vec<u8> = names.of_cells.iter().map(|of_cell| place(of_cell) as u8).collect();
    let mut palette: Vec<Color> =
        names.list.iter().take(COLORED).enumerate().map(|(place, name)| color(place, name)).collect();
    palette.resize(COLORED + 1, colors::distinct(COLORED));
    palette.push(UNDECIDED);
    let count = |index: usize| indices.iter().filter(|own| usize::from(**own) == index).count();
    let listed = names.list.iter().take(COLORED).enumerate();
    let entries = listed.map(|(place, name)| NamedColor {
        color: palette[place],
        text: name.text(),
        cells: count(place),
    });
    let rare =
        NamedColor { color: palette[COLORED], text: "rare attractors".to_owned(), cells: count(COLORED) };
    let none = NamedColor { color: UNDECIDED, text: "none decided".to_owned(), cells: count(COLORED + 1) };
    Layer {
        name: "map".into(),
        short: "likeliest".into(),
        title: format!("attractor that most of {} starts reach", most_starts(cells)).into(),
        entries: legend(entries.chain([rare, none])),
        indices,
        palette,
        bar: None,
        numbers: None,
    }
}

fn most_starts(cells: &[CellShares]) -> u32 {
    cells.iter().map(|cell| cell.count).max().unwrap_or(0)
}

fn color(place: usize, name: &Name) -> Color {
    match name.kind {
        Kind::Free => WITHOUT_EVENTS,
        Kind::Chaos => colors::CHAOTIC,
        Kind::Torus => QUASI_PERIODIC,
        Kind::Cycle => colors::distinct(place + 1),
    }
}

/// Returns the layer of the share of an attractor.
fn share(cells: &[CellShares], names: &Names, place: usize, name: &Name) -> Layer {
    let of = |(cell, of_cell): (&CellShares, &Vec<usize>)| {
        let nth = of_cell.iter().position(|own| *own == place);
        nth.map_or(0.0, |nth| cell.share(&cell.attractors[nth].starts).mean)
    };
    let values: Vec<f64> = cells.iter().zip(&names.of_cells).map(of).collect();
    let colors: Vec<Color> =
        (0..LEVELS).map(|level| colors::linear(level as f64 / (LEVELS - 1) as f64)).collect();
    let title = format!("share of starts that lead to: {}", name.text());
    Layer {
        name: format!("share_{place}").into(),
        short: name.text().into(),
        indices: values.iter().map(|value| (value * (LEVELS - 1) as f64).round() as u8).collect(),
        numbers: Some(values.iter().map(|value| *value as f32).collect()),
        palette: colors.clone(),
        entries: Vec::new(),
        bar: Some(Bar { label: "share".into(), colors, low: 0.0, high: 1.0, is_fixed: true, beyond: [0, 0] }),
        title: title.into(),
    }
}
