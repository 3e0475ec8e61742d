//! The layers of words and patterns: a colour for each of the most frequent ones.

use crate::show::color::Color;
use crate::show::layers::colors::{self, CHAOTIC, distinct};
use crate::show::layers::layer::{Layer, NamedColor, legend};
use crate::show::symbols::with_powers;
use crate::show::words::{APERIODIC, FAILED, UNDECIDED, UNKNOWN, WordIndex};

/// Numbers of words with an entry of their own in the legend, and with a colour of their own.
const LISTED_WORDS: usize = 20;
const COLORED_WORDS: usize = 240;

/// Number, colour and text of cells without a word, in the order of the legend. The text of a word that is not known follows the
/// name of the layer.
const WITHOUT_WORD: [(u32, Color, &str); 4] = [
    (UNKNOWN, NOT_KNOWN, "not known"),
    (APERIODIC, CHAOTIC, "not periodic"),
    (UNDECIDED, colors::UNDECIDED, "undecided"),
    (FAILED, colors::FAILED, "failed"),
];
/// Indices into the palette of cells without events, and of the most frequent word. Between them are cells without a word.
const NO_EVENTS_INDEX: u8 = 0;
const FIRST_WORD: u8 = 1 + WITHOUT_WORD.len() as u8;

pub(crate) const WITHOUT_EVENTS: Color = [0xf2, 0xf2, 0xf2];
pub(crate) const COMMONEST: Color = [0xb4, 0xd0, 0xe8];
pub(crate) const RARE: Color = [0x5a, 0x5a, 0x5a];
pub(crate) const NOT_KNOWN: Color = [0xc4, 0xc4, 0xc4];

/// Names and explanations of the two layers.
pub(crate) const WORDS: [&str; 2] = ["word", "cyclic sequence of flights"];
pub(crate) const PATTERNS: [&str; 2] = ["pattern", "the word with each run of one flight counted once"];

/// Returns the layer of words or of patterns.
pub(crate) fn layer(words: &WordIndex, [name, explanation]: [&'static str; 2]) -> Layer {
    let spellings = words.spellings();
    let index_of_word = |(number, spelling): (usize, &String)| match spelling.is_empty() {
        true => NO_EVENTS_INDEX,
        false => FIRST_WORD + number.min(COLORED_WORDS) as u8,
    };
    let indices: Vec<u8> = spellings.iter().enumerate().map(index_of_word).collect();
    let index = |&number: &u32| match WITHOUT_WORD.iter().position(|(without, ..)| *without == number) {
        Some(position) => 1 + position as u8,
        None => indices[number as usize],
    };
    // The word that covers most of the map has a pale colour.
    let mut palette = vec![WITHOUT_EVENTS];
    palette.extend(WITHOUT_WORD.map(|(_, color, _)| color));
    palette.push(COMMONEST);
    palette.extend((1..COLORED_WORDS).map(distinct));
    palette.push(RARE);
    Layer {
        name: name.into(),
        short: name.into(),
        title: format!("{name}: {explanation}").into(),
        indices: words.numbers.iter().map(index).collect(),
        entries: entries(words, name, &spellings, |number| palette[usize::from(indices[number])]),
        palette,
        bar: None,
        numbers: None,
    }
}

fn entries(
    words: &WordIndex,
    name: &str,
    spellings: &[String],
    color: impl Fn(usize) -> Color,
) -> Vec<NamedColor> {
    let entry = |(number, spelling): (usize, &String)| NamedColor {
        color: color(number),
        text: if spelling.is_empty() { "no events".to_owned() } else { with_powers(spelling) },
        cells: words.list[number].1,
    };
    let mut list: Vec<NamedColor> = spellings.iter().enumerate().take(LISTED_WORDS).map(entry).collect();
    let ends = [LISTED_WORDS, COLORED_WORDS, usize::MAX].map(|end| end.min(words.list.len()));
    let other = [("more", ", a colour each"), ("rare", ", one colour")];
    for ((kind, colors), ends) in other.into_iter().zip(ends.windows(2)).filter(|(_, ends)| ends[0] < ends[1])
    {
        let some = &words.list[ends[0]..ends[1]];
        let text = format!("{} {kind}{colors}", some.len());
        let cells = some.iter().map(|(_, cells)| cells).sum();
        list.push(NamedColor { color: color(ends[0]), text, cells });
    }
    list.extend(WITHOUT_WORD.map(|(without, color, text)| NamedColor {
        color,
        text: if without == UNKNOWN { format!("{name} {text}") } else { text.to_owned() },
        cells: words.numbers.iter().filter(|&&number| number == without).count(),
    }));
    legend(list)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Spelling;
    use crate::show::color_difference::least_difference;

    /// The legend once showed one grey for cells that had colours of their own.
    #[test]
    fn every_colour_of_the_legend_is_that_of_its_cells() {
        for count in [3, LISTED_WORDS + 1, 100, COLORED_WORDS + 50] {
            let word = |n: usize| (Spelling::Hashed { hash: n as u64, length: 70 }, count - n);
            let list: Vec<_> = (0..count).map(word).collect();
            let cells = list.iter().enumerate().flat_map(|(n, (_, cells))| vec![n as u32; *cells]);
            let layer = layer(&WordIndex { numbers: cells.collect(), list }, WORDS);
            let colors = layer.indices.iter().map(|index| layer.palette[usize::from(*index)]);
            let colors: Vec<Color> = colors.collect();
            let mut cell = 0;
            for entry in &layer.entries {
                assert_eq!(entry.color, colors[cell], "{count} words: {}", entry.text);
                cell += entry.cells;
            }
            assert_eq!(cell, colors.len());
        }
    }

    #[test]
    fn neighbours_in_a_legend_differ_also_for_colour_blind_people() {
        let named: Vec<Color> = [COMMONEST].into_iter().chain((1..LISTED_WORDS).map(distinct)).collect();
        // One of them may be the word without events, which has its own colour.
        let near = |apart: usize| (0..LISTED_WORDS - apart).map(move |i| (i, i + apart));
        let among = near(1).chain(near(2)).map(|(i, j)| (named[i], named[j]));
        let any = named.iter().flat_map(|&color| [(color, WITHOUT_EVENTS), (color, CHAOTIC)]);
        let last = named[LISTED_WORDS - 2..].iter().map(|&color| (color, RARE));
        let ends = [RARE, NOT_KNOWN, CHAOTIC, colors::UNDECIDED, colors::FAILED, WITHOUT_EVENTS];
        let ends = (0..6).flat_map(|i| (0..i).map(move |j| (ends[i], ends[j])));
        // Undecided cells have a hatching.
        let shown = |color| match color {
            colors::UNDECIDED => vec![color, colors::HATCH],
            _ => vec![color],
        };
        for (a, b) in among.chain(any).chain(last).chain(ends) {
            let pairs = shown(a).into_iter().flat_map(|a| shown(b).into_iter().map(move |b| (a, b)));
            let difference = pairs.map(|(a, b)| least_difference(a, b)).fold(0.0, f64::max);
            assert!(difference >= 10.0, "{a:02x?} {b:02x?}: {difference}");
        }
    }
}
