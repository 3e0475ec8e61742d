//! Index of the words and patterns of a map.

use std::cmp::Reverse;
use std::collections::HashMap;

use crate::map::scene::Quantity;
use crate::record::classify::classify;
use crate::record::{Record, Spelling, valid};
use crate::show::cells::Cells;
use rattlemap_dynamics::orbit::Class;

/// Number of a chaotic or quasi-periodic cell, of an undecided one, and of one whose computation failed.
pub(crate) const APERIODIC: u32 = u32::MAX;
pub(crate) const UNDECIDED: u32 = u32::MAX - 2;
pub(crate) const FAILED: u32 = u32::MAX - 3;
/// Number of a periodic cell whose word is not known: it was filled between cells of different words, or its motion had not
/// converged.
pub(crate) const UNKNOWN: u32 = u32::MAX - 1;

/// Every word (or every pattern) of a map, and the word of each cell.
#[derive(Clone, Debug)]
pub struct WordIndex {
    /// Words by number, the most frequent first, with the number of their cells.
    pub(crate) list: Vec<(Spelling, usize)>,
    /// Number of each cell's word, by id; one of the constants above if it has none.
    pub(crate) numbers: Vec<u32>,
}

/// Words and patterns of a map, if the scene requests them.
#[derive(Clone, Debug)]
pub struct MapWords {
    pub(crate) words: Option<WordIndex>,
    pub(crate) patterns: Option<WordIndex>,
}

/// Collects the words and the patterns of a map.
pub fn read(cells: &Cells<'_>) -> MapWords {
    let (words, patterns) = rayon::join(
        || cells.has(Quantity::Word).then(|| WordIndex::read(cells, &WORD)),
        || cells.has(Quantity::Pattern).then(|| WordIndex::read(cells, &PATTERN)),
    );
    MapWords { words, patterns }
}

/// A packed word with hash and length. It is faster to read than a spelling.
type PackedWord = ([u64; 4], u64, u32);

/// Access to the word or to the pattern of a record.
struct WordField {
    bit: u32,
    packed: fn(&Record) -> PackedWord,
    spelling: fn(&Record) -> Option<Spelling>,
}

const WORD: WordField = WordField {
    bit: valid::WORD,
    packed: |record| (record.word, record.word_hash, record.word_length),
    spelling: Record::spelling,
};

const PATTERN: WordField = WordField {
    bit: valid::PATTERN,
    packed: |record| (record.pattern, record.pattern_hash, record.pattern_length),
    spelling: Record::pattern,
};

impl WordIndex {
    fn read(cells: &Cells<'_>, field: &WordField) -> WordIndex {
        let mut by_packed: HashMap<PackedWord, u32> = HashMap::new();
        let mut by_spelling: HashMap<Spelling, u32> = HashMap::new();
        let mut list: Vec<(Spelling, usize)> = Vec::new();
        let mut numbers = Vec::with_capacity(cells.count());
        for id in 0..cells.count() {
            let record = &cells.record(id);
            let number = match by_packed.get(&(field.packed)(record)) {
                _ if record.valid & field.bit == 0 => None,
                Some(&number) => Some(number),
                None => (field.spelling)(record).map(|spelling| {
                    // Different packed words may be rotations of one word.
                    let number = *by_spelling.entry(spelling.clone()).or_insert_with(|| {
                        list.push((spelling, 0));
                        list.len() as u32 - 1
                    });
                    by_packed.insert((field.packed)(record), number);
                    number
                }),
            };
            numbers.push(number.unwrap_or_else(|| match classify(record) {
                Class::Periodic { .. } => UNKNOWN,
                Class::Undecided => UNDECIDED,
                Class::Failed => FAILED,
                _ => APERIODIC,
            }));
            number.into_iter().for_each(|number| list[number as usize].1 += 1);
        }
        sorted(&list, numbers)
    }

    /// Returns the words as text, by number.
    pub(crate) fn spellings(&self) -> Vec<String> {
        self.list.iter().map(|(spelling, _)| spelling.text()).collect()
    }
}

/// Sorts words by decreasing frequency and equally frequent words by text.
fn sorted(list: &[(Spelling, usize)], mut numbers: Vec<u32>) -> WordIndex {
    let mut order: Vec<usize> = (0..list.len()).collect();
    order.sort_by_cached_key(|&number| (Reverse(list[number].1), list[number].0.text()));
    let mut rank = vec![0; list.len()];
    order.iter().enumerate().for_each(|(place, &number)| rank[number] = place as u32);
    let known = numbers.iter_mut().filter(|number| **number < FAILED);
    known.for_each(|number| *number = rank[*number as usize]);
    WordIndex { list: order.into_iter().map(|number| list[number].clone()).collect(), numbers }
}
