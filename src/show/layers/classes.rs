//! The main layer of a map: a colour per period, and shades of grey for the exponents of chaos.

use rayon::prelude::*;

use crate::map::scene::Quantity;
use crate::record::classify::classify;
use crate::record::measures::contacts_of_gap;
use crate::record::{Record, valid};
use crate::show::cells::Cells;
use crate::show::color::Color;
use crate::show::layers::bar::{Bar, count_beyond, round_bound};
use crate::show::layers::colors::{
    self, ALWAYS_IN_CONTACT, FAILED, NO_CONTACT, QUASI_PERIODIC, SYMMETRIC, SYMMETRY_UNKNOWN, UNDECIDED,
    UNSYMMETRIC, chaos,
};
use crate::show::layers::layer::{Layer, NamedColor, legend};
use rattlemap_dynamics::orbit::Class;

/// Indices into the palette: five kinds of period 1, periods 2 to 64, undecided, failed, quasi-periodic,
/// then shades of chaos.
const FIRST_PERIOD: u8 = 5;
const EXCEPTIONS: u8 = FIRST_PERIOD + 63;
const FIRST_SHADE: u8 = EXCEPTIONS + 3;
const SHADES: u8 = 64;

/// Forcing periods T to which the legend refers the rate at which chaos ends.
const PERIODS: u32 = 1000;

/// Longest period with an entry of its own in the legend. Longer ones share one, because no more colours differ from all others.
pub(crate) const LISTED_PERIOD: usize = 12;

/// Returns the layer.
pub(crate) fn layer(cells: &Cells<'_>) -> Layer {
    let shows_chaos = cells.has(Quantity::Lyapunov);
    let exponents = || {
        let chaos = cells.classes().enumerate().filter(|(_, class)| *class == Class::Chaotic);
        chaos.map(|(id, _)| cells.record(id).lyapunov)
    };
    let high = round_bound(exponents());
    let gap = cells.contact_gap();
    let nth = gap.as_ref().map(|(nth, _)| *nth);
    let index = |record: &Record| match classify(record) {
        Class::Periodic { period: 1 } => first_period(record, nth, cells.has(Quantity::Symmetric)),
        Class::Periodic { period } => FIRST_PERIOD + (period.min(64) - 2) as u8,
        Class::Undecided => EXCEPTIONS,
        Class::Failed => EXCEPTIONS + 1,
        Class::QuasiPeriodic => EXCEPTIONS + 2,
        Class::Chaotic if !shows_chaos => FIRST_SHADE + SHADES - 1,
        Class::Chaotic => {
            let share = (record.lyapunov / high).clamp(0.0, 1.0);
            FIRST_SHADE + (share * f64::from(SHADES - 1)).round() as u8
        }
    };
    let indices: Vec<u8> = cells.ids().map(|id| index(&cells.record(id))).collect();
    let palette = palette();
    let bar = Bar {
        label: "chaos: largest Lyapunov exponent, \u{3bb}".into(),
        colors: palette[FIRST_SHADE.into()..].to_vec(),
        low: 0.0,
        high,
        is_fixed: false,
        beyond: count_beyond(exponents(), 0.0, high),
    };
    let chaos = match cells.chaos_ends() {
        // The legend has no room for the interval, which `map` prints.
        Some(rate) => {
            let text = rate.text_within(PERIODS).replace("below", "<");
            let share = text.split(',').next().unwrap_or_default();
            format!("chaos, {share} end in {PERIODS} T")
        }
        None => "chaos".to_owned(),
    };
    let gap = gap.map(|(_, name)| name);
    let has_symmetry = cells.has(Quantity::Symmetric);
    let entries = entries(&indices, &palette, (chaos, gap.as_deref()), shows_chaos, has_symmetry);
    let has_chaos = indices.iter().any(|&index| index >= FIRST_SHADE);
    Layer {
        name: "map".into(),
        short: "period and chaos".into(),
        title: if shows_chaos { "period, and chaos by exponent" } else { "period and chaos" }.into(),
        entries,
        bar: (has_chaos && shows_chaos).then_some(bar),
        indices,
        palette,
        numbers: None,
    }
}

/// Returns the index of a cell of period 1, by the contact of `gap` if there are several. Its symmetry is unknown where the motion
/// converges slowly.
fn first_period(record: &Record, gap: Option<usize>, shows_symmetry: bool) -> u8 {
    let measured = |bit| record.valid & bit != 0;
    let of_gap =
        gap.and_then(|gap| contacts_of_gap(record, gap)).map(|[impacts_per_period, mesh_fraction]| Record {
            impacts_per_period,
            mesh_fraction,
            valid: record.valid,
            ..Record::default()
        });
    let contacts = of_gap.as_ref().unwrap_or(record);
    if contacts.is_contact_free() {
        0
    } else if contacts.is_always_in_contact() {
        4
    } else if shows_symmetry && !measured(valid::SYMMETRIC) {
        3
    } else if shows_symmetry && record.symmetric == 0 {
        2
    } else {
        1
    }
}

fn palette() -> Vec<Color> {
    let mut palette = vec![NO_CONTACT, SYMMETRIC, UNSYMMETRIC, SYMMETRY_UNKNOWN, ALWAYS_IN_CONTACT];
    palette.extend((2..=64).map(colors::period));
    palette.extend([UNDECIDED, FAILED, QUASI_PERIODIC]);
    palette.extend((0..SHADES).map(|shade| chaos(f64::from(shade) / f64::from(SHADES - 1))));
    palette
}

/// Returns the legend: short periods first, then chaos, quasi-periodic, undecided and failed.
fn entries(
    indices: &[u8],
    palette: &[Color],
    (chaos_text, gap): (String, Option<&str>),
    shows_chaos: bool,
    shows_symmetry: bool,
) -> Vec<NamedColor> {
    let mut counts = [0usize; 256];
    indices.iter().for_each(|&index| counts[usize::from(index)] += 1);
    let entry = |index: usize, text: String| NamedColor { color: palette[index], text, cells: counts[index] };
    let has_several_kinds = counts[0] + counts[2] + counts[3] + counts[4] > 0;
    let with_contact = match (has_several_kinds, shows_symmetry) {
        (true, true) => "period 1, symmetric",
        (true, false) => "period 1, intermittent contact",
        (false, _) => "period 1",
    };
    let of_gap = |all: &str, state: &str| match gap {
        None => format!("period 1, {all}"),
        Some(gap) => format!("period 1, {gap} always {state}"),
    };
    let mut list = vec![
        entry(0, of_gap("no contact", "open")),
        entry(4, of_gap("always in contact", "closed")),
        entry(1, with_contact.to_owned()),
        entry(2, "period 1, unsymmetric".to_owned()),
        entry(3, "period 1, symmetry unknown".to_owned()),
    ];
    let period = |period: usize| entry(usize::from(FIRST_PERIOD) + period - 2, format!("period {period}"));
    list.extend((2..=LISTED_PERIOD).map(period));
    let mut longer = legend((LISTED_PERIOD + 1..=64).map(period));
    if longer.len() > 1 {
        let text = format!("periods above {LISTED_PERIOD}, a colour each");
        let cells = longer.iter().map(|entry| entry.cells).sum();
        longer = vec![NamedColor { text, cells, ..longer.swap_remove(0) }];
    }
    list.extend(longer);
    let chaos = counts[FIRST_SHADE.into()..].iter().sum();
    let middle = if shows_chaos { usize::from(FIRST_SHADE + SHADES / 2) } else { palette.len() - 1 };
    let exceptions = usize::from(EXCEPTIONS);
    list.push(NamedColor { color: palette[middle], text: chaos_text, cells: chaos });
    list.push(entry(exceptions + 2, "quasi-periodic".to_owned()));
    list.push(entry(exceptions, "undecided".to_owned()));
    list.push(entry(exceptions + 1, "failed".to_owned()));
    legend(list)
}

#[test]
fn long_periods_share_one_row() {
    let rows = |periods: &[u8]| -> Vec<String> {
        let indices: Vec<u8> = periods.iter().map(|period| FIRST_PERIOD + period - 2).collect();
        let list = entries(&indices, &palette(), ("chaos".to_owned(), None), false, false);
        list.into_iter().map(|entry| format!("{} {}", entry.text, entry.cells)).collect()
    };
    assert_eq!(rows(&[12, 24, 2, 24]), ["period 2 1", "period 12 1", "period 24 2"]);
    let all: Vec<u8> = (2..=64).collect();
    assert_eq!(rows(&all)[10..], ["period 12 1", "periods above 12, a colour each 52"]);
}
