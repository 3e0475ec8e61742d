//! `words.csv`: the words and patterns that `cells.npy` refers to by row.

use std::collections::HashMap;
use std::io::Write;

use crate::record::Spelling;
use crate::show::error::WriteError;
use crate::show::words::{MapWords, WordIndex};

/// Rows of the table, and the rows of each cell's word and pattern. Row 0 is for cells without one.
#[derive(Clone, Debug)]
pub struct WordRows<'s> {
    /// Texts by row: none, words, then patterns that are not also words, the most frequent first.
    texts: Vec<String>,
    word: Option<IndexRows<'s>>,
    pattern: Option<IndexRows<'s>>,
}

#[derive(Clone, Debug)]
struct IndexRows<'s> {
    index: &'s WordIndex,
    /// Row of each word.
    rows: Vec<u32>,
}

impl<'s> WordRows<'s> {
    /// Assigns rows to the words and patterns of a map.
    pub fn new(words: &'s MapWords) -> WordRows<'s> {
        let (mut texts, mut known) = (vec![String::new()], HashMap::new());
        let mut rows = |index: &'s WordIndex| {
            let row = |(spelling, _): &'s (Spelling, usize)| {
                *known.entry(spelling).or_insert_with(|| {
                    texts.push(spelling.in_table());
                    texts.len() as u32 - 1
                })
            };
            IndexRows { index, rows: index.list.iter().map(row).collect() }
        };
        let word = words.words.as_ref().map(&mut rows);
        let pattern = words.patterns.as_ref().map(&mut rows);
        WordRows { texts, word, pattern }
    }

    /// Returns the row of the word of the cell `id`.
    pub(crate) fn word(&self, id: usize) -> u32 {
        self.word.as_ref().map_or(0, |rows| rows.row(id))
    }

    /// Returns the row of the pattern of the cell `id`.
    pub(crate) fn pattern(&self, id: usize) -> u32 {
        self.pattern.as_ref().map_or(0, |rows| rows.row(id))
    }

    /// Returns the texts by row.
    pub fn texts(&self) -> &[String] {
        &self.texts
    }

    /// Writes the table.
    pub fn write(&self, out: impl Write) -> Result<(), WriteError> {
        let mut table = csv::Writer::from_writer(out);
        table.write_record(["row", "text"])?;
        for (row, text) in self.texts.iter().enumerate() {
            table.write_record([&row.to_string(), text])?;
        }
        Ok(table.flush()?)
    }
}

impl IndexRows<'_> {
    fn row(&self, id: usize) -> u32 {
        self.rows.get(self.index.numbers[id] as usize).copied().unwrap_or(0)
    }
}
