//! Which words and patterns are on a map, and which of them has each cell?

use std::collections::HashMap;

use crate::map::scene::Quantity;
use crate::record::classify::classify;
use crate::record::{Record, Spelling, valid};
use crate::show::cells::Cells;
use rattlemap_dynamics::orbit::Class;

/// Numbers of cells without a word: no periodic motion, or a periodic one whose word is not
/// known: a filled cell between several words, or a lane still far from its cycle.
pub(crate) const APERIODIC: u32 = u32::MAX;
pub(crate) const UNKNOWN: u32 = u32::MAX - 1;

/// Every word on a map, or every pattern, the most frequent first, and which one each cell has.
#[derive(Clone, Debug)]
pub(crate) struct Words {
    /// Spellings by number, with the number of cells that have it.
    pub(crate) list: Vec<(Spelling, usize)>,
    /// Number of each cell's word, by id; none of `list` where there is none.
    pub(crate) numbers: Vec<u32>,
}

/// Both, as far as the scene asks for them.
#[derive(Clone, Debug)]
pub(crate) struct Spelled {
    pub(crate) words: Option<Words>,
    pub(crate) patterns: Option<Words>,
}

/// Collects the words and the patterns of a map.
pub(crate) fn read(cells: &Cells<'_>) -> Spelled {
    let (words, patterns) = rayon::join(
        || cells.asks(Quantity::Word).then(|| Words::read(cells, &WORD)),
        || cells.asks(Quantity::Pattern).then(|| Words::read(cells, &PATTERN)),
    );
    Spelled { words, patterns }
}

/// What tells packed words apart; cheap to take from every cell.
type Packed = ([u64; 4], u64, u32);

/// Where a record has what is read.
struct Field {
    bit: u32,
    packed: fn(&Record) -> Packed,
    spelling: fn(&Record) -> Option<Spelling>,
}

const WORD: Field = Field {
    bit: valid::WORD,
    packed: |record| (record.word, record.word_hash, record.word_length),
    spelling: Record::spelling,
};

const PATTERN: Field = Field {
    bit: valid::PATTERN,
    packed: |record| (record.pattern, record.pattern_hash, record.pattern_length),
    spelling: Record::pattern,
};

impl Words {
    fn read(cells: &Cells<'_>, field: &Field) -> Words {
        let [columns, rows] = cells.counts();
        let mut seen: HashMap<Packed, u32> = HashMap::new();
        let mut spellings: HashMap<Spelling, u32> = HashMap::new();
        let mut list: Vec<(Spelling, usize)> = Vec::new();
        let mut numbers = Vec::with_capacity(columns * rows);
        for id in 0..columns * rows {
            let record = &cells.record(id);
            let number = match seen.get(&(field.packed)(record)) {
                _ if record.valid & field.bit == 0 => None,
                Some(&number) => Some(number),
                None => (field.spelling)(record).map(|spelling| {
                    // Two packings may be rotations of one word.
                    let number = *spellings.entry(spelling.clone()).or_insert_with(|| {
                        list.push((spelling, 0));
                        list.len() as u32 - 1
                    });
                    seen.insert((field.packed)(record), number);
                    number
                }),
            };
            let without = || match classify(record) {
                Class::Periodic { .. } => UNKNOWN,
                _ => APERIODIC,
            };
            numbers.push(number.unwrap_or_else(without));
            number.into_iter().for_each(|number| list[number as usize].1 += 1);
        }
        by_frequency(&list, numbers)
    }
}

fn by_frequency(list: &[(Spelling, usize)], mut numbers: Vec<u32>) -> Words {
    let mut order: Vec<usize> = (0..list.len()).collect();
    // Equal counts by text: the same map always has the same order.
    order.sort_by_cached_key(|&number| (std::cmp::Reverse(list[number].1), list[number].0.text()));
    let mut rank = vec![0; list.len()];
    order.iter().enumerate().for_each(|(place, &number)| rank[number] = place as u32);
    numbers
        .iter_mut()
        .filter(|number| **number < UNKNOWN)
        .for_each(|number| *number = rank[*number as usize]);
    Words { list: order.into_iter().map(|number| list[number].clone()).collect(), numbers }
}
