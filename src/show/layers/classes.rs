//! The map itself: one colour per period, chaos by exponent.

use rayon::prelude::*;

use crate::map::scene::Quantity;
use crate::record::classify::classify;
use crate::record::{Record, valid};
use crate::show::cells::Cells;
use crate::show::layers::colors::{
    self, FAILED, NO_CONTACT, SYMMETRIC, SYMMETRY_UNKNOWN, UNDECIDED, UNSYMMETRIC, chaos,
};
use crate::show::layers::scale::nice_bound;
use crate::show::layers::{Bar, Color, Entry, Layer, beyond, ids};
use rattlemap_dynamics::orbit::Class;

/// Places in the palette: four kinds of period 1, periods 2 to 64, the two exceptions, then
/// shades of chaos.
const FIRST_PERIOD: u8 = 4;
const EXCEPTIONS: u8 = FIRST_PERIOD + 63;
const FIRST_SHADE: u8 = EXCEPTIONS + 2;
const SHADES: u8 = 64;

/// Names listed in a legend before the rest is summed up.
const LISTED: usize = 17;

pub(crate) fn layer(cells: &Cells<'_>) -> Layer {
    let shows_chaos = cells.asks(Quantity::Lyapunov);
    let exponents = || {
        let chaos = cells.classes().enumerate().filter(|(_, class)| *class == Class::Chaotic);
        chaos.map(|(id, _)| cells.record(id).lyapunov)
    };
    let high = nice_bound(exponents());
    let place = |record: &Record| match classify(record) {
        Class::Periodic { period: 1 } => first_period(record, cells.asks(Quantity::Symmetric)),
        Class::Periodic { period } => FIRST_PERIOD + (period.min(64) - 2) as u8,
        Class::Undecided => EXCEPTIONS,
        Class::Failed => EXCEPTIONS + 1,
        Class::Chaotic if !shows_chaos => FIRST_SHADE + SHADES - 1,
        Class::Chaotic => {
            let share = (record.lyapunov / high).clamp(0.0, 1.0);
            FIRST_SHADE + (share * f64::from(SHADES - 1)).round() as u8
        }
    };
    let indices: Vec<u8> = ids(cells).map(|id| place(&cells.record(id))).collect();
    let palette = palette();
    let bar = Bar {
        label: "chaos: largest Lyapunov exponent, \u{3bb}",
        colors: palette[FIRST_SHADE.into()..].to_vec(),
        low: 0.0,
        high,
        beyond: beyond(exponents(), 0.0, high),
    };
    let entries = entries(&indices, &palette, shows_chaos, cells.asks(Quantity::Symmetric));
    let has_chaos = indices.iter().any(|&index| index >= FIRST_SHADE);
    Layer {
        name: "map",
        short: "period and chaos",
        title: if shows_chaos { "period, and chaos by exponent" } else { "period and chaos" },
        entries,
        bar: (has_chaos && shows_chaos).then_some(bar),
        indices,
        palette,
    }
}

/// Which kind of period 1, as far as it was measured; on a slow approach lanes do not know.
fn first_period(record: &Record, asks_symmetry: bool) -> u8 {
    let measured = |bit| record.valid & bit != 0;
    if record.is_contact_free() {
        0
    } else if asks_symmetry && !measured(valid::SYMMETRIC) {
        3
    } else if asks_symmetry && record.symmetric == 0 {
        2
    } else {
        1
    }
}

fn palette() -> Vec<Color> {
    let mut palette = vec![NO_CONTACT, SYMMETRIC, UNSYMMETRIC, SYMMETRY_UNKNOWN];
    palette.extend((2..=64).map(colors::period));
    palette.extend([UNDECIDED, FAILED]);
    palette.extend((0..SHADES).map(|shade| chaos(f64::from(shade) / f64::from(SHADES - 1))));
    palette
}

/// What there is on the map: low periods first, then chaos and exceptions.
fn entries(indices: &[u8], palette: &[Color], shows_chaos: bool, asks_symmetry: bool) -> Vec<Entry> {
    let counts = indices.par_iter().fold(
        || [0usize; 256],
        |mut counts, &index| {
            counts[usize::from(index)] += 1;
            counts
        },
    );
    let counts = counts.reduce(|| [0; 256], |a, b| std::array::from_fn(|i| a[i] + b[i]));
    let entry = |index: usize, text: String| Entry { color: palette[index], text, cells: counts[index] };
    let has_kinds = counts[0] + counts[2] + counts[3] > 0;
    // Whether it is symmetric is known where it was asked.
    let symmetric = match (has_kinds, asks_symmetry) {
        (true, true) => "period 1, symmetric",
        (true, false) => "period 1, contact",
        (false, _) => "period 1",
    };
    let mut list = vec![
        entry(0, "period 1, no contact".to_owned()),
        entry(1, symmetric.to_owned()),
        entry(2, "period 1, unsymmetric".to_owned()),
        entry(3, "period 1, symmetry unknown".to_owned()),
    ];
    let periods = usize::from(FIRST_PERIOD)..usize::from(EXCEPTIONS);
    list.extend(
        periods.map(|index| entry(index, format!("period {}", index - usize::from(FIRST_PERIOD) + 2))),
    );
    list.retain(|entry| entry.cells > 0);
    if list.len() > LISTED + 1 {
        let rest: usize = list[LISTED..].iter().map(|entry| entry.cells).sum();
        let color = list[LISTED].color;
        list.truncate(LISTED);
        list.push(Entry { color, text: "longer, a colour each".to_owned(), cells: rest });
    }
    let chaos = counts[FIRST_SHADE.into()..].iter().sum();
    let middle = if shows_chaos { usize::from(FIRST_SHADE + SHADES / 2) } else { palette.len() - 1 };
    let exceptions = usize::from(EXCEPTIONS);
    list.push(Entry { color: palette[middle], text: "chaos".to_owned(), cells: chaos });
    list.push(entry(exceptions, "undecided".to_owned()));
    list.push(entry(exceptions + 1, "failed".to_owned()));
    list.retain(|entry| entry.cells > 0);
    list
}
