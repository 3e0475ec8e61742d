//! Where two maps differ, as a picture: cells that agree are pale.

use std::path::Path;

use crate::findings::compare::Kind;
use crate::show::caption;
use crate::show::drawing::axes::Frame;
use crate::show::drawing::legend::draw_head;
use crate::show::drawing::{Align, BELOW, Canvas, DARK, RGBColor, Rect, SMALL, save_figure};
use crate::show::error::{DrawError, FigureError};
use crate::show::figure::map::{axis, side};
use crate::show::layers::Color;
use crate::show::symbols::symbol;
use crate::store::compare::Compared;
use rattlemap_dynamics::orbit::Class;

const LEFT: f64 = 140.0;
const TOP: f64 = 162.0;
/// What names of a scene's parameters begin with.
const PARAMETERS: &str = "parameters.";
/// Room for the legend beside the map.
const BESIDE: f64 = 560.0;
const GAP: f64 = 36.0;
/// Height of the picture's inside at least: that of the legend.
const LOWEST: f64 = 460.0;
const ROW: f64 = 33.0;
const PATCH: (f64, f64) = (34.0, 20.0);

/// A colour's meaning.
struct Entry {
    color: Color,
    text: &'static str,
    /// How its cells differ; none where class and period are the same.
    kind: Option<Kind>,
}

const fn entry(color: Color, text: &'static str, kind: Option<Kind>) -> Entry {
    Entry { color, text, kind }
}

/// Every colour, by its place; differing ones are from Okabe and Ito's colour-blind safe set.
const ENTRIES: [Entry; 8] = [
    entry([0xdc, 0xe9, 0xf4], "both periodic", None),
    entry([0xf6, 0xd9, 0x8b], "both periodic, other pattern", None),
    entry([0xbc, 0xbc, 0xbc], "both chaotic", None),
    entry([0xd9, 0xb0, 0xf8], "both undecided or failed", None),
    entry([0xd5, 0x5e, 0x00], "A periodic, B chaotic", Some(Kind::Class)),
    entry([0x00, 0x72, 0xb2], "A chaotic, B periodic", Some(Kind::Class)),
    entry([0xcc, 0x79, 0xa7], "undecided or failed in one", Some(Kind::Class)),
    entry([0x00, 0x9e, 0x73], "both periodic", Some(Kind::Period)),
];

/// Cycles of one period whose patterns differ, or words where there are no patterns: what tells motion without contact from rattling.
const OTHER_WORD: usize = 1;

/// The colour of a cell of these classes, words left aside.
fn place(classes: [Class; 2]) -> usize {
    use Class::{Chaotic, Periodic};
    match classes {
        [Periodic { .. }, Periodic { .. }] if classes[0] != classes[1] => 7,
        [Periodic { .. }, Periodic { .. }] => 0,
        [Chaotic, Chaotic] => 2,
        [a, b] if a == b => 3,
        [Periodic { .. }, Chaotic] => 4,
        [Chaotic, Periodic { .. }] => 5,
        _ => 6,
    }
}

/// Draws the comparison in the format that the file's name tells.
///
/// # Errors
/// A file that cannot be written, by name.
pub(crate) fn write(path: &Path, compared: &Compared<'_>) -> Result<(), FigureError> {
    let mut places: Vec<usize> = compared.classes().map(place).collect();
    for (place, kind) in places.iter_mut().zip(&compared.comparison.kinds) {
        if kind.is_some_and(|kind| !kind.is_decisive()) {
            *place = OTHER_WORD;
        }
    }
    let [width, height] = compared.sides[0].cells.counts().map(side);
    let size = (LEFT + width + GAP + BESIDE, TOP + height.max(LOWEST) + BELOW);
    save_figure(path, (size.0 as u32, size.1 as u32), |canvas| {
        draw(canvas, compared, &places, [width, height])
    })
}

fn draw(
    canvas: &Canvas<'_>,
    compared: &Compared<'_>,
    places: &[usize],
    [width, height]: [f64; 2],
) -> Result<(), DrawError> {
    let [a, b] = compared.sides;
    let title = format!("Where two maps differ: A is {}, B is {}", a.name, b.name);
    draw_head(canvas, &title, &subtitle(compared), &[])?;
    let rect = Rect { left: LEFT, top: TOP, right: LEFT + width, bottom: TOP + height };
    let counts = a.cells.counts();
    canvas.raster(rect, counts, |[i, j]| ENTRIES[places[j * counts[0] + i]].color)?;
    let [x, y] = [0, 1].map(|i| axis(&a.cells.scene().axes()[i]));
    Frame { rect, x, y }.draw_axes(canvas, true)?;
    let other_word = match [Kind::Pattern, Kind::Word].map(|kind| compared.comparison.count(kind)) {
        [_, 0] => ENTRIES[OTHER_WORD].text,
        [0, _] => "both periodic, other word",
        _ => "both periodic, other pattern or word",
    };
    draw_legend(canvas, places, other_word, rect.right + GAP)
}

/// What differs between the runs: scenes, engines, versions.
fn subtitle(compared: &Compared<'_>) -> String {
    let [a, b] = compared.sides;
    let mut parts: Vec<String> = compared
        .scene_differences()
        .iter()
        .map(|differing| {
            let name = symbol(differing.name.trim_start_matches(PARAMETERS));
            format!("{name}: {} in A, {} in B", differing.a, differing.b)
        })
        .collect();
    let engine =
        |side: crate::store::compare::MapSide<'_>| format!("{} {}", side.made.engine, side.made.precision);
    if engine(a) != engine(b) {
        parts.push(format!("A on {}, B on {}", engine(a), engine(b)));
    }
    if (a.crate_version, a.commit) != (b.crate_version, b.commit) {
        let short = |commit: &str| commit.chars().take(7).collect::<String>();
        let version = |side: crate::store::compare::MapSide<'_>| {
            format!("{} ({})", side.crate_version, short(side.commit))
        };
        parts.push(format!("A by version {}, B by {}", version(a), version(b)));
    }
    let told = if parts.is_empty() {
        "scenes, engines and versions are the same".to_owned()
    } else {
        parts.join("; ")
    };
    // Where parameters differ it is those that tell the maps apart.
    let is_one = !compared.scene_differences().iter().any(|differing| differing.name.starts_with(PARAMETERS));
    if is_one { format!("{told}\n{}", caption::of_scene(a.cells.scene())) } else { told }
}

/// Draws what the colours mean, with numbers and shares of cells, below the sum of their kind.
fn draw_legend(canvas: &Canvas<'_>, places: &[usize], other_word: &str, left: f64) -> Result<(), DrawError> {
    let mut counts = [0usize; ENTRIES.len()];
    places.iter().for_each(|&place| counts[place] += 1);
    let right = left + BESIDE - GAP - 20.0;
    let count = |cells: usize| format!("{cells}  ({:.2} %)", 100.0 * cells as f64 / places.len() as f64);
    let mut y = TOP + ROW / 2.0;
    for (kind, text) in [
        (None, "class and period the same"),
        (Some(Kind::Class), "class differs"),
        (Some(Kind::Period), "period differs"),
    ] {
        let entries = || ENTRIES.iter().zip(counts).filter(move |(entry, _)| entry.kind == kind);
        let sum: usize = entries().map(|(_, cells)| cells).sum();
        canvas.text(text, (left, y), SMALL, Align::Left, DARK)?;
        canvas.text(&count(sum), (right, y), SMALL, Align::Right, DARK)?;
        y += ROW;
        for (entry, cells) in entries().filter(|(_, cells)| *cells > 0) {
            let [r, g, b] = entry.color;
            let (top, bottom) = (y - PATCH.1 / 2.0, y + PATCH.1 / 2.0);
            let patch = Rect { left, top, right: left + PATCH.0, bottom };
            canvas.fill(patch, RGBColor(r, g, b), 1.0)?;
            canvas.outline(patch, 1.0)?;
            let text = if entry.color == ENTRIES[OTHER_WORD].color { other_word } else { entry.text };
            canvas.text(text, (left + PATCH.0 + 14.0, y), SMALL, Align::Left, DARK)?;
            canvas.text(&count(cells), (right, y), SMALL, Align::Right, DARK)?;
            y += ROW;
        }
        y += ROW / 2.0;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::show::color_difference::least_difference;
    use crate::show::figure::compare::ENTRIES;

    #[test]
    fn colours_can_be_told_apart_by_all_eyes() {
        for (i, a) in ENTRIES.iter().enumerate() {
            for b in &ENTRIES[i + 1..] {
                let difference = least_difference(a.color, b.color);
                assert!(difference >= 10.0, "{}, {}: {difference}", a.text, b.text);
            }
        }
    }
}
