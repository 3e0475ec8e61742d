//! What figures call the gap of a model and its walls.

use rattlemap_dynamics::model::{Model, Side};

use crate::model_file::{Definition, FileModel};
use crate::show::symbols::{number, symbol};
use crate::text::expression::Expression;

/// Characters of a position that a legend has room for.
const LONGEST: usize = 24;

/// The gap and the positions of its walls, in the model's own words.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WallWords {
    /// The gap: its coordinate's name where it is one displacement, else `z`.
    gap: String,
    /// Positions of the right and the left wall: none where there is no wall, empty where a legend has no room.
    at: [Option<String>; 2],
}

impl WallWords {
    /// Those of a model, whatever its parameters' values where its file has expressions.
    pub(crate) fn of(model: &dyn Model) -> WallWords {
        // A model of the library's own is described by the file of its name.
        let named = FileModel::built_in(model.name());
        match model.downcast_ref::<FileModel>().or(named.as_ref()) {
            Some(file) => WallWords::of_file(file.definition()),
            None => WallWords::of_values(model),
        }
    }

    fn of_file(definition: &Definition) -> WallWords {
        let motion = &definition.motion;
        let is = |entry: &Expression, value: f64| entry.as_number() == Some(value);
        let alone = (0..motion.degrees()).find(|&i| {
            is(&motion.gap[i], 1.0) && (0..motion.degrees()).all(|j| j == i || is(&motion.gap[j], 0.0))
        });
        let at = |side| definition.wall(side).map(|wall| position(&wall.at));
        WallWords::new(alone.map(|i| symbol(&motion.coordinates[i])), Side::BOTH.map(at))
    }

    fn of_values(model: &dyn Model) -> WallWords {
        let Ok(oscillator) = model.oscillator() else { return WallWords::new(None, [None, None]) };
        let alone = [[1.0, 0.0], [0.0, 1.0]].iter().position(|row| *row == oscillator.gap);
        let names = model.state_names();
        let at = oscillator.walls.map(|wall| wall.is_finite().then(|| number(wall)));
        WallWords::new(alone.and_then(|i| names.get(2 * i)).map(|name| symbol(name)), at)
    }

    fn new(gap: Option<String>, at: [Option<String>; 2]) -> WallWords {
        let mut words = WallWords { gap: gap.unwrap_or_else(|| "z".to_owned()), at };
        if words.half().is_some() {
            let [right, _] = &mut words.at;
            *right = right.take().map(|half| format!("+{half}"));
        }
        words
    }

    /// Whether there is a wall on a side.
    pub(crate) fn has(&self, side: Side) -> bool {
        self.at[side.index()].is_some()
    }

    /// The gap's name.
    pub(crate) fn gap(&self) -> &str {
        &self.gap
    }

    /// Where a wall is: `z = +b`.
    pub(crate) fn position(&self, side: Side) -> Option<String> {
        let at = self.at[side.index()].as_ref().filter(|at| !at.is_empty())?;
        Some(format!("{} = {at}", self.gap))
    }

    /// A wall in a legend: `right wall, z = +b`.
    pub(crate) fn entry(&self, side: Side) -> String {
        let position = self.position(side).map_or(String::new(), |position| format!(", {position}"));
        format!("{} wall{position}", name(side))
    }

    /// All walls: `|z| = b` where they lie as far on either side.
    pub(crate) fn section(&self) -> String {
        match (self.half(), &self.at) {
            (Some(half), _) => format!("|{}| = {half}", self.gap),
            (None, [Some(_), Some(_)]) => "the walls".to_owned(),
            _ => "the wall".to_owned(),
        }
    }

    /// How far each of two walls is from the middle between them, where they lie about zero.
    pub(crate) fn half(&self) -> Option<&str> {
        let [Some(right), Some(left)] = &self.at else { return None };
        let half = right.trim_start_matches('+');
        let is_simple = !half.is_empty() && half.chars().all(|c| c.is_alphanumeric() || c == '.' || c == '_');
        (is_simple && left.strip_prefix('\u{2212}') == Some(half)).then_some(half)
    }
}

/// The name of a side.
pub(crate) fn name(side: Side) -> &'static str {
    match side {
        Side::Right => "right",
        Side::Left => "left",
    }
}

/// An entry as it was written, in the field's symbols; empty where it is too long.
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
    if text.chars().count() > LONGEST { String::new() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::model::{GearPair, Stops};

    fn words(model: &dyn Model) -> [String; 3] {
        let words = WallWords::of(model);
        let entry = |side: Side| if words.has(side) { words.entry(side) } else { String::new() };
        [entry(Side::Right), entry(Side::Left), words.section()]
    }

    #[test]
    fn walls_have_the_models_own_words() {
        let pair = ["right wall, z = +b", "left wall, z = \u{2212}b", "|z| = b"];
        assert_eq!(words(&GearPair::paper(0.5)), pair);
        let built_in = |name: &str| words(&FileModel::built_in(name).unwrap());
        assert_eq!(built_in("gear-pair"), pair);
        assert_eq!(built_in("impact-oscillator"), ["right wall, x = \u{3c3}", "", "the wall"]);
        assert_eq!(built_in("shaking-table"), ["", "left wall, x = 0", "the wall"]);
        let two = ["right wall, z = \u{3b4}\u{2082}", "left wall, z = \u{2212}\u{3b4}\u{2081}", "the walls"];
        assert_eq!(built_in("two-masses"), two);
        let stops = ["right wall, x = +0.5", "left wall, x = \u{2212}0.5", "|x| = 0.5"];
        assert_eq!(words(&Stops::with_restitution(0.5)), stops);
    }

    #[test]
    fn positions_are_typeset_and_left_out_where_they_are_long() {
        let names = ["omega", "sigma", "k1"];
        let position = |text: &str| position(&Expression::parse(text, &names).unwrap());
        assert_eq!(position("sigma - 2e-3*k1"), "\u{3c3} \u{2212} 2e\u{2212}3*k\u{2081}");
        assert_eq!(position("sqrt(omega)"), "sqrt(\u{3c9})");
        assert_eq!(position("-0.5"), "\u{2212}0.5");
        assert_eq!(position("sigma + sigma + sigma + sigma + sigma + sigma + sigma + sigma"), "");
    }
}
