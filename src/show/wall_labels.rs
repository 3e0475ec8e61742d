//! Labels of a model's gaps and walls in figures.

use rattlemap_dynamics::model::{Model, Side};

use crate::model_file::{Definition, FileModel, gap_names};
use crate::show::names;
use crate::show::symbols::{number, symbol};
use crate::text::expression::Expression;

/// Largest number of characters of a position in a legend.
const LONGEST_POSITION: usize = 24;

/// A gap and the positions of its walls, by the symbols of the model.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WallLabels {
    /// Symbol of the gap. One of several gaps has its own name. A single gap has that of its displacement if it is one, else `z`.
    gap: String,
    /// Positions of the right and the left wall: none without a wall, empty if too long for a legend.
    at: [Option<String>; 2],
}

impl WallLabels {
    /// Returns the labels of the gap with this index. Positions given as expressions in the model's file do not depend on parameter
    /// values.
    pub(crate) fn of(model: &dyn Model, index: usize) -> WallLabels {
        // The library's own models are described by the files of the same name.
        let named = FileModel::built_in(model.name());
        let [gap, _] = gap_names(model);
        match model.downcast_ref::<FileModel>().or(named.as_ref()) {
            Some(file) => WallLabels::of_file(file.definition(), index, gap),
            None => WallLabels::of_values(model, gap),
        }
    }

    /// Returns the labels of the only gap. With several gaps the labels have no positions, because walls of a side differ between gaps.
    pub(crate) fn of_all(model: &dyn Model) -> WallLabels {
        let count = model.oscillator().map_or(1, |oscillator| oscillator.gaps.len());
        if count == 1 {
            return WallLabels::of(model, 0);
        }
        let gaps: Vec<WallLabels> = (0..count).map(|index| WallLabels::of(model, index)).collect();
        let has = |side: Side| gaps.iter().any(|gap| gap.has(side)).then(String::new);
        WallLabels { gap: String::new(), at: Side::BOTH.map(has) }
    }

    fn of_file(definition: &Definition, index: usize, gap: &str) -> WallLabels {
        let motion = &definition.motion;
        let is = |entry: &Expression, value: f64| entry.as_number() == Some(value);
        let read = &motion.gaps[index];
        let alone = (0..motion.degrees()).find(|&i| {
            is(&read.row[i], 1.0) && (0..motion.degrees()).all(|j| j == i || is(&read.row[j], 0.0))
        });
        let walls = &definition.walls[index];
        let at = |side: Side| walls[side.index()].first().map(|wall| position(&wall.at));
        let alone = alone.map(|i| symbol(&motion.coordinates[i]));
        let own = read.name.as_ref().filter(|_| motion.gaps.len() > 1).map(|name| symbol(name));
        WallLabels::new(own.or(alone).unwrap_or_else(|| gap.to_owned()), Side::BOTH.map(at))
    }

    fn of_values(model: &dyn Model, gap: &str) -> WallLabels {
        let Ok(oscillator) = model.oscillator() else {
            return WallLabels::new(gap.to_owned(), [None, None]);
        };
        let (row, names) = (&oscillator.gaps[0].row, model.state_names());
        let alone = (0..row.len()).find(|&i| (0..row.len()).all(|j| row[j] == f64::from(u8::from(i == j))));
        let at = oscillator.gaps[0].walls.each_ref().map(|walls| walls.first().map(|wall| number(wall.at)));
        let alone = alone.and_then(|i| names.get(2 * i)).map(|name| symbol(name));
        WallLabels::new(alone.unwrap_or_else(|| gap.to_owned()), at)
    }

    fn new(gap: String, at: [Option<String>; 2]) -> WallLabels {
        let mut labels = WallLabels { gap, at };
        if labels.half().is_some() {
            let [right, _] = &mut labels.at;
            *right = right.take().map(|half| format!("+{half}"));
        }
        labels
    }

    /// Whether there is a wall on a side.
    pub(crate) fn has(&self, side: Side) -> bool {
        self.at[side.index()].is_some()
    }

    /// Returns the symbol of the gap.
    pub(crate) fn gap(&self) -> &str {
        &self.gap
    }

    /// Returns the position of a wall as an equation: `z = +b`.
    pub(crate) fn position(&self, side: Side) -> Option<String> {
        let at = self.at[side.index()].as_ref().filter(|at| !at.is_empty())?;
        Some(format!("{} = {at}", self.gap))
    }

    /// Returns the legend entry of a wall: `right wall, z = +b`.
    pub(crate) fn entry(&self, side: Side) -> String {
        let position = self.position(side).map_or(String::new(), |position| format!(", {position}"));
        format!("{} wall{position}", names::side(side))
    }

    /// Returns the label of all walls: `|z| = b` if they are symmetric about zero.
    pub(crate) fn section(&self) -> String {
        match (self.half(), &self.at) {
            (Some(half), _) => format!("|{}| = {half}", self.gap),
            (None, [Some(_), Some(_)]) => "the walls".to_owned(),
            _ => "the wall".to_owned(),
        }
    }

    /// Returns the distance of both walls from zero, if they are symmetric about zero.
    pub(crate) fn half(&self) -> Option<&str> {
        let [Some(right), Some(left)] = &self.at else { return None };
        let half = right.trim_start_matches('+');
        let is_simple = !half.is_empty() && half.chars().all(|c| c.is_alphanumeric() || c == '.' || c == '_');
        (is_simple && left.strip_prefix('\u{2212}') == Some(half)).then_some(half)
    }
}

/// Returns an expression with mathematical symbols, or nothing if it is too long.
fn position(at: &Expression) -> String {
    if let Some(value) = at.as_number() {
        return number(value);
    }
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.';
    let mut text = String::new();
    let mut rest = at.text();
    while let Some(first) = rest.chars().next() {
        let end = match is_word(first) {
            true => rest.find(|c| !is_word(c)).unwrap_or(rest.len()),
            false => first.len_utf8(),
        };
        let (part, after) = rest.split_at(end);
        match first {
            '-' => text.push('\u{2212}'),
            _ if first.is_ascii_alphabetic() => text += &symbol(part),
            _ => text += part,
        }
        rest = after;
    }
    if text.chars().count() > LONGEST_POSITION { String::new() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::model::{GearPair, Stops};

    fn labels(model: &dyn Model) -> [String; 3] {
        let labels = WallLabels::of(model, 0);
        let entry = |side: Side| if labels.has(side) { labels.entry(side) } else { String::new() };
        [entry(Side::Right), entry(Side::Left), labels.section()]
    }

    #[test]
    fn walls_have_the_symbols_of_the_model() {
        let pair = ["right wall, z = +b", "left wall, z = \u{2212}b", "|z| = b"];
        assert_eq!(labels(&GearPair::paper(0.5)), pair);
        let built_in = |name: &str| labels(&FileModel::built_in(name).unwrap());
        assert_eq!(built_in("gear-pair"), pair);
        assert_eq!(built_in("impact-oscillator"), ["right wall, x = \u{3c3}", "", "the wall"]);
        assert_eq!(built_in("shaking-table"), ["", "left wall, x = 0", "the wall"]);
        let two = ["right wall, z = \u{3b4}\u{2082}", "left wall, z = \u{2212}\u{3b4}\u{2081}", "the walls"];
        assert_eq!(built_in("two-masses"), two);
        let stops = ["right wall, x = +0.5", "left wall, x = \u{2212}0.5", "|x| = 0.5"];
        assert_eq!(labels(&Stops::with_restitution(0.5)), stops);
        let gears = FileModel::built_in("two-loose-gears").unwrap();
        let positions =
            [0, 1].map(|gap| Side::BOTH.map(|side| WallLabels::of(&gears, gap).position(side).unwrap()));
        let expected = [["a = 0", "a = \u{2212}b\u{2081}"], ["b = 0", "b = \u{2212}b\u{2082}"]];
        assert_eq!(positions, expected);
        let all = WallLabels::of_all(&gears);
        assert_eq!([all.entry(Side::Right), all.section()], ["right wall", "the walls"]);
    }

    #[test]
    fn positions_have_mathematical_symbols_and_are_empty_if_too_long() {
        let names = ["omega", "sigma", "k1"];
        let position = |text: &str| position(&Expression::parse(text, &names).unwrap());
        assert_eq!(position("sigma - 2e-3*k1"), "\u{3c3} \u{2212} 2e\u{2212}3*k\u{2081}");
        assert_eq!(position("sqrt(omega)"), "sqrt(\u{3c9})");
        assert_eq!(position("-0.5"), "\u{2212}0.5");
        assert_eq!(position("sigma + sigma + sigma + sigma + sigma + sigma + sigma + sigma"), "");
    }
}
