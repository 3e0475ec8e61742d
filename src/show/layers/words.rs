//! Words or patterns as a layer: a colour for each of the most frequent ones.

use crate::show::layers::colors::distinct;
use crate::show::layers::{Color, Entry, Layer};
use crate::show::words::{APERIODIC, UNKNOWN, Words};

/// Words that get a name in the legend.
const NAMED: usize = 20;
/// Words that get a colour of their own.
const COLORED: usize = 240;

/// Places in the palette that no word has.
const EMPTY: u8 = 0;
const NONE: u8 = 1;
const UNFILLED: u8 = 2;
const FIRST_WORD: u8 = 3;

pub(crate) const WITHOUT_EVENTS: Color = [0xf2, 0xf2, 0xf2];
pub(crate) const COMMONEST: Color = [0xb4, 0xd0, 0xe8];
pub(crate) const RARE: Color = [0x5a, 0x5a, 0x5a];
const NOT_KNOWN: Color = [0xc4, 0xc4, 0xc4];
/// As dark as chaos, which most of it is.
pub(crate) const NOT_PERIODIC: Color = [0x2a, 0x2a, 0x2a];

/// What a layer of words is called.
struct Named {
    name: &'static str,
    title: &'static str,
    /// Of several.
    plural: &'static str,
}

const WORDS: Named = Named { name: "word", title: "word: cyclic sequence of flights", plural: "words" };

const PATTERNS: Named = Named {
    name: "pattern",
    title: "pattern: the word with each run of one flight counted once",
    plural: "patterns",
};

pub(crate) fn words(words: &Words) -> Layer {
    layer(words, &WORDS)
}

pub(crate) fn patterns(patterns: &Words) -> Layer {
    layer(patterns, &PATTERNS)
}

fn layer(words: &Words, named: &Named) -> Layer {
    let texts: Vec<String> = words.list.iter().map(|(spelling, _)| spelling.text()).collect();
    let place = |number: usize| match texts[number].is_empty() {
        true => EMPTY,
        false => FIRST_WORD + number.min(COLORED) as u8,
    };
    let places: Vec<u8> = (0..words.list.len()).map(place).collect();
    let index = |&number: &u32| match number {
        APERIODIC => NONE,
        UNKNOWN => UNFILLED,
        _ => places[number as usize],
    };
    let mut palette = vec![WITHOUT_EVENTS, NOT_PERIODIC, NOT_KNOWN];
    // The word that covers most of the map should not shout.
    palette.push(COMMONEST);
    palette.extend((1..COLORED).map(distinct));
    palette.push(RARE);
    Layer {
        name: named.name,
        short: named.name,
        title: named.title,
        indices: words.numbers.iter().map(index).collect(),
        entries: entries(words, named, &texts, &places, &palette),
        palette,
        bar: None,
    }
}

fn entries(words: &Words, named: &Named, texts: &[String], places: &[u8], palette: &[Color]) -> Vec<Entry> {
    let entry = |(number, text): (usize, &String)| Entry {
        color: palette[usize::from(places[number])],
        text: if text.is_empty() { "no events".to_owned() } else { text.clone() },
        cells: words.list[number].1,
    };
    let mut list: Vec<Entry> = texts.iter().enumerate().take(NAMED).map(entry).collect();
    let rest = words.list.iter().skip(NAMED);
    if rest.len() > 0 {
        let text = format!("{} other {}", rest.len(), named.plural);
        list.push(Entry { color: RARE, text, cells: rest.map(|(_, cells)| cells).sum() });
    }
    let count = |number: u32| words.numbers.iter().filter(|&&other| other == number).count();
    list.push(Entry { color: NOT_KNOWN, text: format!("{} not known", named.name), cells: count(UNKNOWN) });
    list.push(Entry { color: NOT_PERIODIC, text: "not periodic".to_owned(), cells: count(APERIODIC) });
    list.retain(|entry| entry.cells > 0);
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::show::color_difference::least_difference;

    #[test]
    fn neighbours_in_a_legend_can_be_told_apart_by_all_eyes() {
        let named: Vec<Color> = [COMMONEST].into_iter().chain((1..NAMED).map(distinct)).collect();
        // One of them may have no events, and its own colour.
        let near = |apart: usize| (0..NAMED - apart).map(move |i| (i, i + apart));
        let among = near(1).chain(near(2)).map(|(i, j)| (named[i], named[j]));
        let any = named.iter().flat_map(|&color| [(color, WITHOUT_EVENTS), (color, NOT_PERIODIC)]);
        let last = named[NAMED - 2..].iter().map(|&color| (color, RARE));
        let ends = [RARE, NOT_KNOWN, NOT_PERIODIC, WITHOUT_EVENTS];
        let ends = (0..4).flat_map(|i| (0..i).map(move |j| (ends[i], ends[j])));
        for (a, b) in among.chain(any).chain(last).chain(ends) {
            assert!(least_difference(a, b) >= 10.0, "{a:02x?} {b:02x?}: {}", least_difference(a, b));
        }
    }
}
