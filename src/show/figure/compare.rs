//! The differences of two maps as a picture. Cells that agree have pale colours.

use crate::findings::compare::Kind;
use crate::map::scene::FigureStyle;
use crate::show::caption;
use crate::show::color::Color;
use crate::show::drawing::Canvas;
use crate::show::figure::map_layout::{LegendKey, LegendRow, MapFigure};
use crate::show::layers::colors::QUASI_PERIODIC;
use crate::show::map_pair::{MapPair, MapSide, SceneDifference};
use crate::show::symbols::symbol;
use rattlemap_dynamics::orbit::Class;

/// Prefix of the names of a scene's parameters.
const PARAMETERS: &str = "parameters.";
/// Width and height of the legend.
const LEGEND: (f64, f64) = (560.0, 460.0);

/// A colour and the cells that it represents.
struct CellColor {
    color: Color,
    text: &'static str,
    /// Kind of difference; none if class and period agree.
    kind: Option<Kind>,
}

const fn entry(color: Color, text: &'static str, kind: Option<Kind>) -> CellColor {
    CellColor { color, text, kind }
}

/// All colours. Those of differences are from Okabe and Ito's colour-blind safe set.
const COLORS: [CellColor; 10] = [
    entry([0xdc, 0xe9, 0xf4], "both periodic", None),
    entry([0xf6, 0xd9, 0x8b], "same period, other", None),
    entry([0xbc, 0xbc, 0xbc], "both chaotic", None),
    entry([0xd9, 0xb0, 0xf8], "both undecided or failed", None),
    entry([0xd5, 0x5e, 0x00], "A periodic, B chaotic", Some(Kind::Class)),
    entry([0x00, 0x72, 0xb2], "A chaotic, B periodic", Some(Kind::Class)),
    entry([0xcc, 0x79, 0xa7], "undecided or failed in one", Some(Kind::Class)),
    entry([0x00, 0x9e, 0x73], "both periodic", Some(Kind::Period)),
    entry([0xeb, 0xf5, 0xdc], "both quasi-periodic", None),
    entry(QUASI_PERIODIC, "quasi-periodic in one", Some(Kind::Class)),
];

/// Index of the colour of cells of equal period that differ otherwise.
const OTHER: usize = 1;

/// Returns the index of the colour of a cell with the given classes in A and B.
fn color_index(classes: [Class; 2]) -> usize {
    use Class::{Chaotic, Periodic, QuasiPeriodic};
    match classes {
        [Periodic { .. }, Periodic { .. }] if classes[0] != classes[1] => 7,
        [Periodic { .. }, Periodic { .. }] => 0,
        [Chaotic, Chaotic] => 2,
        [QuasiPeriodic, QuasiPeriodic] => 8,
        [QuasiPeriodic, _] | [_, QuasiPeriodic] => 9,
        [a, b] if a == b => 3,
        [Periodic { .. }, Chaotic] => 4,
        [Chaotic, Periodic { .. }] => 5,
        _ => 6,
    }
}

/// Draws the comparison.
pub fn draw(style: &FigureStyle, pair: &MapPair<'_>) -> Canvas {
    let index = |(classes, kind): ([Class; 2], &Option<Kind>)| match kind {
        Some(kind) if !kind.is_decisive() => OTHER,
        _ => color_index(classes),
    };
    let indices: Vec<usize> = pair.classes().zip(&pair.comparison.kinds).map(index).collect();
    let [a, b] = pair.sides;
    let title = format!("Where two maps differ: A is {}, B is {}", a.name, b.name);
    let others = Kind::ALL.into_iter().filter(|kind| !kind.is_decisive() && pair.comparison.count(*kind) > 0);
    let others: Vec<&str> = others.map(Kind::name).collect();
    let other = match &others[..] {
        [one] => format!("{} {one}", COLORS[OTHER].text),
        _ => "same period, otherwise different".to_owned(),
    };
    let (subtitle, rows) = (subtitle(pair), rows(&indices, &other));
    let figure =
        MapFigure { cells: a.cells, title: &title, subtitle: &subtitle, rows, bar: None, legend: LEGEND };
    figure.draw(style, |id| COLORS[indices[id]].color, |_, _| {})
}

/// Describes the differences of scenes, engines and versions.
fn subtitle(pair: &MapPair<'_>) -> String {
    let [a, b] = pair.sides;
    let differences = pair.scene_differences();
    let part = |difference: &SceneDifference| {
        let name = symbol(difference.name.trim_start_matches(PARAMETERS));
        format!("{name}: {} in A, {} in B", difference.a, difference.b)
    };
    let mut parts: Vec<String> = differences.iter().map(part).collect();
    let engine = |side: MapSide<'_>| format!("{} {}", side.provenance.engine, side.provenance.precision);
    if engine(a) != engine(b) {
        parts.push(format!("A on {}, B on {}", engine(a), engine(b)));
    }
    if (a.crate_version, a.provenance.commit) != (b.crate_version, b.provenance.commit) {
        let short = |commit: &str| commit.chars().take(7).collect::<String>();
        let version =
            |side: MapSide<'_>| format!("{} ({})", side.crate_version, short(side.provenance.commit));
        parts.push(format!("A by version {}, B by {}", version(a), version(b)));
    }
    let text = match parts.is_empty() {
        true => "scenes, engines and versions are the same".to_owned(),
        false => parts.join("; "),
    };
    // The parameters are those of both maps unless they differ.
    let is_one = !differences.iter().any(|difference| difference.name.starts_with(PARAMETERS));
    if is_one { format!("{text}\n{}", caption::of_scene(a.cells.scene())) } else { text }
}

/// Returns the rows of the legend: colours with numbers and shares of cells, below the sum of their kind.
fn rows(indices: &[usize], other: &str) -> Vec<LegendRow> {
    let mut counts = [0usize; COLORS.len()];
    indices.iter().for_each(|&index| counts[index] += 1);
    let count = |cells: usize| format!("{cells}  ({:.2} %)", 100.0 * cells as f64 / indices.len() as f64);
    let mut rows = Vec::new();
    for (kind, text) in [
        (None, "class and period the same"),
        (Some(Kind::Class), "class differs"),
        (Some(Kind::Period), "period differs"),
    ] {
        let entries =
            || COLORS.iter().zip(counts).enumerate().filter(move |(_, (entry, _))| entry.kind == kind);
        let sum: usize = entries().map(|(_, (_, cells))| cells).sum();
        let (is_apart, text) = (!rows.is_empty(), text.to_owned());
        rows.push(LegendRow { key: LegendKey::Heading, text, cells: count(sum), is_apart });
        for (index, (entry, cells)) in entries().filter(|(_, (_, cells))| *cells > 0) {
            let text = if index == OTHER { other } else { entry.text };
            rows.push(LegendRow::of_color(entry.color, text, count(cells)));
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use crate::show::color_difference::least_difference;
    use crate::show::figure::compare::COLORS;

    #[test]
    fn colours_differ_also_for_colour_blind_people() {
        for (i, a) in COLORS.iter().enumerate() {
            for b in &COLORS[i + 1..] {
                let difference = least_difference(a.color, b.color);
                assert!(difference >= 10.0, "{}, {}: {difference}", a.text, b.text);
            }
        }
    }
}
