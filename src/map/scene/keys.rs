//! Table of every key of a scene. The parser takes its names from here, and `docs/scenes.md` lists it.

use super::limits::{LONGEST_TITLE, MAX_COUNT, MAX_PERIODS, MAX_STARTS};
use super::{Continuous, Format, Quantity};
use crate::record::limits::{LONGEST_CYCLE, MOST_STEPS};

/// A key of a scene.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// TOML table that contains the key; empty for keys before any table.
    pub table: &'static str,
    /// Name of the key.
    pub name: &'static str,
    /// Value when the scene does not set the key.
    pub default: KeyDefault,
    /// Values that the key accepts.
    pub takes: Takes,
    /// Meaning of the key in one phrase.
    pub meaning: &'static str,
}

/// Default of a key.
#[derive(Clone, Copy, Debug)]
pub enum KeyDefault {
    /// A value, as TOML.
    Value(&'static str),
    /// A default that depends on the scene, in words.
    Words(&'static str),
    /// No default.
    None,
}

/// Values that a key accepts.
#[derive(Clone, Copy, Debug)]
pub enum Takes {
    /// A whole number in this range, both ends included.
    Whole(u32, u32),
    /// A whole number in this range, both ends included, or "auto".
    WholeOrAuto(u32, u32),
    /// A number between 0 and 1, both ends excluded.
    Fraction,
    /// true or false.
    Flag,
    /// One of these texts.
    OneOf(&'static [&'static str]),
    /// A list of some of these texts.
    List(&'static [&'static str]),
    /// Text with at most this number of characters.
    Text(usize),
    /// Values that depend on the model, in words.
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

const END: Takes = Takes::Words("the range of the parameter; any finite number for a start");

/// All keys, in the order in which messages list them. The keys of `[parameters]` are the parameters of the model.
#[rustfmt::skip]
pub const KEYS: &[Key] = &[
    key("", "title", Words("made from the axes"), Takes::Text(LONGEST_TITLE), "heading of figures and of the report"),
    key("", "model", Value("\"gear-pair\""), Takes::Words("a name that `rattlemap models` lists, or the path of a model file (`.toml`), relative to the scene"), "the oscillator"),
    key("axis", "parameter", KeyDefault::None, Takes::Words("a parameter of the model"), "parameter that varies along the axis; the first axis is horizontal"),
    key("axis", "start", KeyDefault::None, Takes::Words("a component of the start, such as v1"), "instead of `parameter`: start component that varies along the axis (basins of attraction)"),
    key("axis", "min", KeyDefault::None, END, "first value"),
    key("axis", "max", KeyDefault::None, END, "last value, greater than min"),
    key("axis", "count", KeyDefault::None, Takes::Whole(2, MAX_COUNT), "number of values, both ends included"),
    key("axis", "scale", Value("\"linear\""), Takes::OneOf(&["linear", "log"]), "linear: equal differences; log: equal ratios (min above 0)"),
    key("axis", "values", KeyDefault::None, Takes::Words("2 to 1000000 increasing numbers in the range of the parameter"), "instead of min, max, count and scale: list of the values"),
    key("cells", "file", KeyDefault::None, Takes::Words("path of a CSV table, relative to the scene"), "instead of axes: a table with one row per cell and one column per parameter or start component"),
    key("integration", "steps_per_period", Value("\"auto\""), Takes::WholeOrAuto(1, MOST_STEPS), "steps per forcing period on the GPU engine; the CPU engine has no fixed step"),
    key("integration", "transient_periods", Value("400"), Takes::Whole(1, MAX_PERIODS), "forcing periods before the motion is analysed; with early stops, the maximum"),
    key("integration", "observed_periods", Value("128"), Takes::Whole(2, MAX_PERIODS), "forcing periods in which the motion is analysed; with early stops, the maximum"),
    key("integration", "early_stop", Value("true"), Takes::Flag, "stop a cell as soon as its class is decided"),
    key("integration", "undecided_periods", Value("0"), Takes::Whole(0, MAX_PERIODS), "additional periods for undecided cells; needs early_stop. If they are as many as all others, the processor computes them, also with --engine gpu, and those of confirm_chaos"),
    key("integration", "confirm_chaos", Value("0"), Takes::Whole(0, MAX_PERIODS), "additional periods for chaotic cells, after all others; a cell whose chaos ends in them gets its new class. Needs the quantity class or lyapunov"),
    key("integration", "max_period", Value("64"), Takes::Whole(1, LONGEST_CYCLE), "longest period that is searched for, at most half of observed_periods; the default is lowered to that half"),
    key("start", "policy", Value("\"rest\""), Takes::OneOf(&["rest", "state", "up", "down", "both"]), "rest or state: every cell starts there; up or down: a cell starts from the final state of its neighbour along the last axis; both: up and down in one `bifurcation`"),
    key("start", "state", KeyDefault::None, Takes::Words("[x1, v1, x2, v2], finite"), "state at `phase`, for policy = \"state\""),
    key("start", "phase", Value("0"), Takes::Words("a finite number of radians, or an expression such as \"pi/2\""), "phase of the forcing at which cells start; strobe states, sections and event times count from it"),
    key("start", "count", Value("1"), Takes::Whole(1, MAX_STARTS), "starts per cell of a map; all except the first are random. With `sample`: 8 to 10000 starts, a multiple of 8"),
    key("start", "seed", Value("1"), Takes::Whole(0, u32::MAX), "seed of the random starts, for count above 1"),
    key("start", "sample", KeyDefault::None, Takes::OneOf(&["box", "normal"]), "instead of `policy`: a map of the shares of attractors among `count` starts, uniform between `low` and `high`, or normal with `mean` and `deviation`"),
    key("start", "low", KeyDefault::None, Takes::Words("[x1, v1, x2, v2], finite"), "for sample = \"box\": least start components"),
    key("start", "high", KeyDefault::None, Takes::Words("[x1, v1, x2, v2], finite"), "for sample = \"box\": largest start components"),
    key("start", "mean", KeyDefault::None, Takes::Words("[x1, v1, x2, v2], finite"), "for sample = \"normal\": mean of the start components"),
    key("start", "deviation", KeyDefault::None, Takes::Words("[x1, v1, x2, v2], finite and not negative"), "for sample = \"normal\": standard deviation of the start components"),
    key("start", "width", KeyDefault::None, Takes::Words("between 0 and 1, both ends excluded"), "for `sample`: a cell stops early once no 95 % interval of a share is wider"),
    key("refine", "minimum_grid", Value("8"), Takes::Whole(1, 1024), "along each axis, at least every n-th cell is integrated"),
    key("refine", "rounds", Words("until blocks are single cells"), Takes::Whole(0, 32), "maximum number of times that a block is halved"),
    key("refine", "max_error", Value("0.003"), Takes::Fraction, "accepted share of wrong filled cells; if the audit finds more, the map is refined further"),
    key("refine", "audit", Words("2000, or a quarter of the filled cells"), Takes::Whole(1, 10_000_000), "number of filled cells that the first audit integrates"),
    key("refine", "word", Value("false"), Takes::Flag, "also refine where only the word changes (only the pattern, if the scene requests patterns)"),
    key("refine", "continuous", Value("\"interpolated\""), Takes::OneOf(&Continuous::NAMES), "exponent, impacts, mesh fraction and measured quantities of filled cells"),
    key("outputs", "quantities", Value("[\"class\", \"lyapunov\"]"), Takes::List(&Quantity::NAMES), "quantities to compute"),
    key("outputs", "files", Value("[\"csv\", \"npy\", \"png\", \"html\"]"), Takes::List(&Format::NAMES), "files to write; png, svg and pdf are figures. `bifurcation` accepts figures and csv; a list of cells accepts csv and npy"),
    key("figure", "width", Words("depends on the figure"), Takes::Words("\"60mm\" to \"300mm\"; also cm, in, pt"), "width of all figures. PNG files then have 600 dots per inch"),
    key("figure", "font_size", Words("7.4"), Takes::Words("7 to 24, and at most width / 21"), "size of tick labels and legends, in points. Exponents are smaller; headings and names of axes are at least as large"),
    key("figure", "title", Words("the scene's title"), Takes::Text(LONGEST_TITLE), "title of figures; \"\" removes the heading, with its lines below the title"),
    key("figure", "legend", Value("true"), Takes::Flag, "whether figures have a legend. Without it, maps have no colour bar either"),
    key("figure", "panels", Words("all"), Takes::Words("a list of section, lyapunov, and names of requested quantities"), "panels of diagrams"),
    key("figure", "files", Value("\"pages\""), Takes::OneOf(&["pages", "panels"]), "pages: as many panels of a diagram in one figure as fit a page; panels: one figure for each panel. The second figure is bifurcation_2, and so on"),
    key("figure", "scale", Words("\"linear\", with ends from the numbers"), Takes::Words("{ LAYER = \"log\", ... }: linear, log or dB; ends such as [0, 2]; or both, such as [\"log\", 1e-6, 1]"), "colours of layers of numbers; 20 dB are a factor of 10"),
    key("figure", "contours", KeyDefault::None, Takes::Words("{ LAYER = [NUMBER, ...], ... } of requested quantities, at most 32 numbers each"), "lines on the class map and on the layer itself, where its numbers have these values"),
    key("figure", "gap", Words("the first gap with an impact law, else the first"), Takes::Words("the name of a gap of a model with several gaps"), "gap whose contact the classes of period 1 tell"),
    key("figure", "lines", KeyDefault::None, Takes::Words("{ \"name\" = \"expression\", ... } with at most 32 names, in parameters of the model, also derived ones"), "lines on maps, where an expression is zero"),
];

/// Returns the names of the keys in one table.
pub(super) fn names(table: &str) -> Vec<&'static str> {
    KEYS.iter().filter(|key| key.table == table).map(|key| key.name).collect()
}

impl Takes {
    /// Describes the accepted values in words.
    pub fn in_words(self) -> String {
        match self {
            Takes::Whole(least, most) => format!("{least} to {most}"),
            Takes::WholeOrAuto(least, most) => format!("\"auto\" or {least} to {most}"),
            Takes::Fraction => "between 0 and 1, both ends excluded".to_owned(),
            Takes::Flag => "true or false".to_owned(),
            Takes::OneOf(names) => names.join(", "),
            Takes::List(names) => format!("a list of {}", names.join(", ")),
            Takes::Text(most) => format!("text of at most {most} characters"),
            Takes::Words(words) => words.to_owned(),
        }
    }
}

impl KeyDefault {
    /// Describes the default in words; a dash if there is none.
    pub fn in_words(self) -> &'static str {
        match self {
            Value(words) | Words(words) => words,
            KeyDefault::None => "-",
        }
    }
}
