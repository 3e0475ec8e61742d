//! Words as a layer: a colour for each of the most frequent ones.

use std::collections::HashMap;

use super::colors::{NO_VALUE, distinct};
use super::{Color, Entry, Layer};
use crate::output::cells::Cells;
use crate::record::classify::classify;
use crate::record::{Record, Spelling};
use rattlemap_dynamics::orbit::Class;

/// Words that get a name in the legend.
const NAMED: usize = 20;
/// Words that get a colour of their own.
const COLORED: usize = 240;

/// Places in the palette that no word has.
const EMPTY: u8 = 0;
const NONE: u8 = 1;
const UNFILLED: u8 = 2;
const FIRST_WORD: u8 = 3;

/// Numbers of cells without a word: no periodic motion, or a periodic one whose word is not
/// known: a filled cell between several words, or a lane still far from its cycle.
const APERIODIC: u32 = u32::MAX;
const UNKNOWN: u32 = u32::MAX - 1;

const WITHOUT_EVENTS: Color = [0xf2, 0xf2, 0xf2];
const COMMONEST: Color = [0xb4, 0xd0, 0xe8];
const RARE: Color = [0x5a, 0x5a, 0x5a];
const NOT_KNOWN: Color = [0xcf, 0xcf, 0xcf];

/// Every word on a map, the most frequent first, and which one each cell has.
#[derive(Clone, Debug)]
pub(in crate::output) struct Words {
    /// Texts by number, with the number of cells that have it.
    pub(in crate::output) list: Vec<(String, usize)>,
    /// Number of each cell's word, by id; none of `list` where there is none.
    pub(in crate::output) numbers: Vec<u32>,
}

/// What tells packed words apart; cheap to take from every cell.
type Packed = ([u64; 4], u64, u32);

fn packed(record: &Record) -> Packed {
    (record.word, record.word_hash, record.word_length)
}

/// Collects the words of a map; none if they were not asked for.
pub(in crate::output) fn read(cells: &Cells<'_>) -> Option<Words> {
    if !cells.asks(crate::map::scene::Quantity::Word) {
        return None;
    }
    let [columns, rows] = cells.counts();
    let mut seen: HashMap<Packed, usize> = HashMap::new();
    let mut texts: HashMap<String, usize> = HashMap::new();
    let mut list: Vec<(String, usize)> = Vec::new();
    let mut numbers = Vec::with_capacity(columns * rows);
    for id in 0..columns * rows {
        let record = cells.record(id);
        if record.valid & crate::record::valid::WORD == 0 {
            let is_periodic = matches!(classify(record), Class::Periodic { .. });
            numbers.push(if is_periodic { UNKNOWN } else { APERIODIC });
            continue;
        }
        let number = *seen.entry(packed(record)).or_insert_with(|| {
            // Two packings may be rotations of one word.
            let text = cells.word(id).as_ref().map_or(String::new(), Spelling::text);
            *texts.entry(text.clone()).or_insert_with(|| {
                list.push((text, 0));
                list.len() - 1
            })
        });
        list[number].1 += 1;
        numbers.push(number as u32);
    }
    Some(by_frequency(list, numbers))
}

fn by_frequency(list: Vec<(String, usize)>, mut numbers: Vec<u32>) -> Words {
    let mut order: Vec<usize> = (0..list.len()).collect();
    // Equal counts by text: the same map always has the same colours.
    order.sort_by(|&a, &b| list[b].1.cmp(&list[a].1).then_with(|| list[a].0.cmp(&list[b].0)));
    let mut rank = vec![0; list.len()];
    order.iter().enumerate().for_each(|(place, &number)| rank[number] = place as u32);
    numbers
        .iter_mut()
        .filter(|number| **number < UNKNOWN)
        .for_each(|number| *number = rank[*number as usize]);
    Words { list: order.into_iter().map(|number| list[number].clone()).collect(), numbers }
}

pub(super) fn layer(words: &Words) -> Layer {
    let place = |number: usize| match words.list[number].0.is_empty() {
        true => EMPTY,
        false => FIRST_WORD + number.min(COLORED) as u8,
    };
    let places: Vec<u8> = (0..words.list.len()).map(place).collect();
    let index = |&number: &u32| match number {
        APERIODIC => NONE,
        UNKNOWN => UNFILLED,
        _ => places[number as usize],
    };
    let mut palette = vec![WITHOUT_EVENTS, NO_VALUE, NOT_KNOWN];
    // The word that covers most of the map should not shout.
    palette.push(COMMONEST);
    palette.extend((1..COLORED).map(distinct));
    palette.push(RARE);
    Layer {
        name: "word",
        short: "word",
        title: "word: cyclic sequence of flights",
        indices: words.numbers.iter().map(index).collect(),
        entries: entries(words, &places, &palette),
        palette,
        bar: None,
    }
}

fn entries(words: &Words, places: &[u8], palette: &[Color]) -> Vec<Entry> {
    let named = |(number, (text, cells)): (usize, &(String, usize))| Entry {
        color: palette[usize::from(places[number])],
        text: if text.is_empty() { "no events".to_owned() } else { text.clone() },
        cells: *cells,
    };
    let mut list: Vec<Entry> = words.list.iter().enumerate().take(NAMED).map(named).collect();
    let rest = words.list.iter().skip(NAMED);
    if rest.len() > 0 {
        let text = format!("{} other words", rest.len());
        list.push(Entry { color: RARE, text, cells: rest.map(|(_, cells)| cells).sum() });
    }
    let count = |number: u32| words.numbers.iter().filter(|&&other| other == number).count();
    list.push(Entry { color: NOT_KNOWN, text: "word not known".to_owned(), cells: count(UNKNOWN) });
    list.push(Entry { color: NO_VALUE, text: "not periodic".to_owned(), cells: count(APERIODIC) });
    list.retain(|entry| entry.cells > 0);
    list
}
