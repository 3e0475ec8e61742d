//! `words.csv`: the texts of the words and patterns that `cells.npy` has by their row.

use std::collections::HashMap;
use std::path::Path;

use crate::record::Spelling;
use crate::show::error::WriteError;
use crate::show::words::{Spelled, Words};

/// Rows of the table, and which of them a cell's word and pattern have. Row 0 is that of cells without one.
#[derive(Clone, Debug)]
pub(crate) struct Rows<'s> {
    /// From row 1 on: words, then patterns that are no words, the most frequent first.
    list: Vec<&'s Spelling>,
    word: Option<Column<'s>>,
    pattern: Option<Column<'s>>,
}

#[derive(Clone, Debug)]
struct Column<'s> {
    words: &'s Words,
    /// Row of each of them.
    rows: Vec<u32>,
}

impl<'s> Rows<'s> {
    pub(crate) fn new(spelled: &'s Spelled) -> Rows<'s> {
        let (mut list, mut known) = (Vec::new(), HashMap::new());
        let mut column = |words: &'s Words| {
            let row = |(spelling, _): &'s (Spelling, usize)| {
                *known.entry(spelling).or_insert_with(|| {
                    list.push(spelling);
                    list.len() as u32
                })
            };
            Column { words, rows: words.list.iter().map(row).collect() }
        };
        let word = spelled.words.as_ref().map(&mut column);
        let pattern = spelled.patterns.as_ref().map(&mut column);
        Rows { list, word, pattern }
    }

    /// The row of the word of the cell `id`.
    pub(crate) fn word(&self, id: usize) -> u32 {
        self.word.as_ref().map_or(0, |column| column.row(id))
    }

    /// That of its pattern.
    pub(crate) fn pattern(&self, id: usize) -> u32 {
        self.pattern.as_ref().map_or(0, |column| column.row(id))
    }

    /// The texts by row.
    pub(crate) fn texts(&self) -> Vec<String> {
        let spelled = self.list.iter().map(|spelling| spelling.in_table());
        std::iter::once(String::new()).chain(spelled).collect()
    }

    /// Writes the table to `path`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(crate) fn write(&self, path: &Path) -> Result<(), WriteError> {
        let mut table = csv::Writer::from_path(path)?;
        table.write_record(["row", "text"])?;
        table.write_record(["0", ""])?;
        for (row, spelling) in self.list.iter().enumerate() {
            table.write_record([(row + 1).to_string(), spelling.in_table()])?;
        }
        Ok(table.flush()?)
    }
}

impl Column<'_> {
    fn row(&self, id: usize) -> u32 {
        self.rows.get(self.words.numbers[id] as usize).copied().unwrap_or(0)
    }
}
