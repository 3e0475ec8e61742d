//! The table of all keys of a scene. The parser accepts these names, and `docs/scenes.md` is generated from them.

use super::limits::{LONGEST_TITLE, MAX_COUNT, MAX_PERIODS, MAX_STARTS};
use crate::record::limits::{LONGEST_CYCLE, MOST_STEPS};

/// One key of a scene.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// Name of the table that contains the key; empty for keys outside of any table.
    pub table: &'static str,
    /// Name of the key.
    pub name: &'static str,
    /// Value that applies if the key is not written.
    pub default: KeyDefault,
    /// Values that are allowed.
    pub takes: Takes,
    /// Meaning of the key in one phrase.
    pub meaning: &'static str,
}

/// The value that applies if a key is not written.
#[derive(Clone, Copy, Debug)]
pub enum KeyDefault {
    /// A value, as TOML.
    Value(&'static str),
    /// A description in words.
    Words(&'static str),
    /// None: the key is required where it applies.
    None,
}

/// The values that a key allows.
#[derive(Clone, Copy, Debug)]
pub enum Takes {
    /// A whole number between these bounds, which are included.
    Whole(u32, u32),
    /// "auto", or a whole number between these bounds, which are included.
    WholeOrAuto(u32, u32),
    /// A number greater than 0 and less than 1.
    Fraction,
    /// true or false.
    Flag,
    /// One of these names.
    OneOf(&'static [&'static str]),
    /// A list of some of these names.
    List(&'static [&'static str]),
    /// Text with at most this number of characters.
    Text(usize),
    /// Values that depend on the model, described in words.
    Words(&'static str),
}

use KeyDefault::{Value, Words};

const fn key(
    table: &'static str,
    name: &'static str,
    default: KeyDefault,
    takes: Takes,
    meaning: &'static str,
) -> Key {
    Key { table, name, default, takes, meaning }
}

const END: Takes = Takes::Words("the parameter's range; of a start any finite number");

/// All keys, in the order in which messages list them. `[parameters]` has the names of the model's parameters as keys.
#[rustfmt::skip]
pub const KEYS: &[Key] = &[
    key("", "title", Words("from the axes"), Takes::Text(LONGEST_TITLE), "heading of figures and of the report"),
    key("", "model", Value("\"gear-pair\""), Takes::Words("a name that `rattlemap models` lists, or the path of a model's file (`.toml`), from the scene's folder"), "what moves"),
    key("axis", "parameter", KeyDefault::None, Takes::Words("a parameter of the model"), "what the axis sweeps; the first axis runs along columns"),
    key("axis", "start", KeyDefault::None, Takes::Words("a component of the start, such as v1"), "what the axis sweeps instead: cells then belong to basins"),
    key("axis", "min", KeyDefault::None, END, "first value"),
    key("axis", "max", KeyDefault::None, END, "last value, greater than min"),
    key("axis", "count", KeyDefault::None, Takes::Whole(2, MAX_COUNT), "how many values, both ends included"),
    key("axis", "scale", Value("\"linear\""), Takes::OneOf(&["linear", "log"]), "values by equal differences, or by equal ratios (min above 0)"),
    key("axis", "values", KeyDefault::None, Takes::Words("2 to 1000000 numbers in the parameter's range, each greater than the one before"), "the values themselves, in the place of min, max, count and scale"),
    key("cells", "file", KeyDefault::None, Takes::Words("path of a CSV table, from the scene's folder"), "cells in the place of axes: a column per parameter or component of the start, a row per cell"),
    key("integration", "steps_per_period", Value("\"auto\""), Takes::WholeOrAuto(1, MOST_STEPS), "grid of the lanes; the reference has none"),
    key("integration", "transient_periods", Value("400"), Takes::Whole(1, MAX_PERIODS), "forcing periods before anything is read; an upper bound where cells may stop early"),
    key("integration", "observed_periods", Value("128"), Takes::Whole(2, MAX_PERIODS), "forcing periods after that, likewise"),
    key("integration", "early_stop", Value("true"), Takes::Flag, "cells stop once they are decided"),
    key("integration", "undecided_periods", Value("0"), Takes::Whole(0, MAX_PERIODS), "periods that undecided cells get beyond these, with early stops alone"),
    key("integration", "max_period", Value("64"), Takes::Whole(1, LONGEST_CYCLE), "longest cycle that is searched for; at most, and by default no more than, half of observed_periods"),
    key("start", "policy", Value("\"rest\""), Takes::OneOf(&["rest", "state", "up", "down", "both"]), "where cells start; up and down: where the neighbour along the last axis ended; both: up and down in one `bifurcation`"),
    key("start", "state", KeyDefault::None, Takes::Words("[x1, v1, x2, v2], finite"), "state at phase 0, with policy = \"state\" alone"),
    key("start", "count", Value("1"), Takes::Whole(1, MAX_STARTS), "starts per cell of a map, all but the first drawn at random"),
    key("start", "seed", Value("1"), Takes::Whole(0, u32::MAX), "decides the draw, with a count above 1 alone"),
    key("refine", "minimum_grid", Value("8"), Takes::Whole(1, 1024), "every so many cells along an axis one is integrated in any case"),
    key("refine", "rounds", Words("down to single cells"), Takes::Whole(0, 32), "how often a block is halved at most"),
    key("refine", "max_error", Value("0.003"), Takes::Fraction, "share of filled cells that may be wrong; above it the map is refined further"),
    key("refine", "audit", Words("2000, or a quarter of what is filled"), Takes::Whole(1, 10_000_000), "filled cells that an audit integrates at first"),
    key("refine", "word", Value("false"), Takes::Flag, "a change of the word alone is a border; of the pattern alone, where patterns are asked for"),
    key("refine", "continuous", Value("\"interpolated\""), Takes::OneOf(&["interpolated", "empty"]), "exponent, impacts and mesh fraction of filled cells"),
    key("outputs", "quantities", Value("[\"class\", \"lyapunov\"]"), Takes::List(&["class", "lyapunov", "impacts", "mesh", "symmetric", "word", "pattern"]), "what is not asked for is not computed"),
    key("outputs", "files", Value("[\"csv\", \"npy\", \"png\", \"html\"]"), Takes::List(&["csv", "npy", "png", "svg", "pdf", "html"]), "what is written; png, svg and pdf are figures; `bifurcation` knows them and csv, a list of cells csv and npy"),
];

/// Returns the names of the keys in one table.
pub(super) fn names(table: &str) -> Vec<&'static str> {
    KEYS.iter().filter(|key| key.table == table).map(|key| key.name).collect()
}

impl Takes {
    /// Describes the allowed values.
    pub fn in_words(self) -> String {
        match self {
            Takes::Whole(least, most) => format!("{least} to {most}"),
            Takes::WholeOrAuto(least, most) => format!("\"auto\" or {least} to {most}"),
            Takes::Fraction => "between 0 and 1, ends excluded".to_owned(),
            Takes::Flag => "true or false".to_owned(),
            Takes::OneOf(names) => names.join(", "),
            Takes::List(names) => format!("a list of {}", names.join(", ")),
            Takes::Text(most) => format!("text of at most {most} characters"),
            Takes::Words(words) => words.to_owned(),
        }
    }
}

impl KeyDefault {
    /// Describes the default; a dash if there is none.
    pub fn in_words(self) -> &'static str {
        match self {
            Value(words) | Words(words) => words,
            KeyDefault::None => "-",
        }
    }
}
