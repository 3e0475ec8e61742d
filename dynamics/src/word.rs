//! Mapping words: the cyclic sequence of flights, equations (18) to (23) of the paper.
//!
//! Each flight has one symbol. Dry friction adds two symbols for changes of sliding. All symbols are in order of time:
//!
//! | flight or event | symbol |
//! | --- | --- |
//! | free, right to right | `2` |
//! | free, right to left | `3` |
//! | free, left to left | `5` |
//! | free, left to right | `6` |
//! | meshing on the right | `1` |
//! | meshing on the left | `4` |
//! | sticking ends | `7` |
//! | sliding reverses without sticking | `0` |

use std::fmt;
use std::str::FromStr;

use crate::model::MOST_GAPS;

/// Marks a symbol `b'0'..=b'7'` with its gap, for oscillators with several gaps. The gap's letter is then written before it, as in `b3`.
pub fn of_gap(symbol: u8, gap: usize) -> u8 {
    symbol + 8 * (gap as u8 + 1)
}

/// Writes a symbol, with the letter of its gap if it has one.
fn written(symbol: u8) -> String {
    match (symbol - b'0') / 8 {
        0 => char::from(symbol).to_string(),
        gap => format!("{}{}", char::from(b'a' + gap - 1), (symbol - b'0') % 8),
    }
}

/// A cyclic word, stored in its lexicographically smallest rotation.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Default)]
pub struct Word(Vec<u8>);

impl Word {
    /// Builds the cyclic word of a sequence of symbols, `b'0'..=b'7'` or [`of_gap`], in time order.
    pub fn cyclic(symbols: &[u8]) -> Word {
        let mut canonical = symbols.to_vec();
        canonical.rotate_left(smallest_rotation(symbols));
        Word(canonical)
    }

    /// Returns the symbols in time order, in the smallest rotation.
    pub fn symbols(&self) -> &[u8] {
        &self.0
    }

    /// Returns the number of symbols in the cycle.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether the cycle has no symbol.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the word of the mirror image `(y, t) -> (-y, t + T/2)`, which swaps 1-4, 2-5 and 3-6.
    /// It leaves 0 and 7 as they are.
    pub fn mirrored(&self) -> Word {
        let image = |&symbol: &u8| match (symbol - b'0') % 8 {
            1..=3 => symbol + 3,
            4..=6 => symbol - 3,
            _ => symbol,
        };
        Word::cyclic(&self.0.iter().map(image).collect::<Vec<_>>())
    }

    /// Returns the word with each run of one symbol reduced to one: `13554622` gives `135462`.
    ///
    /// The number of impacts before meshing depends on the parameter `mesh_speed`. The pattern hardly does.
    pub fn pattern(&self) -> Word {
        let mut symbols = self.0.clone();
        // In the smallest rotation no run continues from the end to the start, unless the word is one run.
        symbols.dedup();
        Word::cyclic(&symbols)
    }

    /// Returns the symbols in time order, such as `2356`.
    pub fn time_order(&self) -> String {
        self.0.iter().map(|&symbol| written(symbol)).collect()
    }

    /// Returns the composition of maps as the paper prints it: last flight first, repeated ones as powers. `2356` is
    /// `P_{6532}`, and `13554622` is `P_{1 2^2 6 4 5^2 3}`.
    ///
    /// A cycle with meshing on the right ends with it, as in the paper.
    pub fn paper_notation(&self) -> String {
        let mut order = self.0.clone();
        if order.first() == Some(&b'1') {
            order.rotate_left(1);
        }
        order.reverse();
        let runs: Vec<(String, usize)> =
            order.chunk_by(|a, b| a == b).map(|run| (written(run[0]), run.len())).collect();
        let powers = runs.iter().any(|&(_, count)| count > 1);
        let parts: Vec<String> = runs
            .into_iter()
            .map(|(symbol, count)| if count > 1 { format!("{symbol}^{count}") } else { symbol })
            .collect();
        format!("P_{{{}}}", parts.join(if powers { " " } else { "" }))
    }
}

/// A text that is no word.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is no word: it needs digits from 0 to 7, or digits with the letters of their gaps, such as 135462 or a2b3"
)]
pub struct WordError(String);

impl FromStr for Word {
    type Err = WordError;

    /// Reads the symbols of a word from any place of its cycle. Tables write a `w` before them.
    fn from_str(text: &str) -> Result<Word, WordError> {
        let (mut symbols, mut gap) = (Vec::new(), None);
        for byte in text.strip_prefix('w').unwrap_or(text).bytes() {
            match byte {
                b'0'..=b'7' => symbols.push(gap.take().map_or(byte, |gap| of_gap(byte, gap))),
                b'a'..=b'z' if gap.is_none() && usize::from(byte - b'a') < MOST_GAPS => {
                    gap = Some(usize::from(byte - b'a'));
                }
                _ => return Err(WordError(text.to_owned())),
            }
        }
        if gap.is_some() { Err(WordError(text.to_owned())) } else { Ok(Word::cyclic(&symbols)) }
    }
}

impl fmt::Display for Word {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.time_order())
    }
}

/// Returns the start of the lexicographically smallest rotation, by comparing two candidates.
fn smallest_rotation(s: &[u8]) -> usize {
    let n = s.len();
    let (mut i, mut j, mut k) = (0, 1, 0);
    while i < n && j < n && k < n {
        let (a, b) = (s[(i + k) % n], s[(j + k) % n]);
        match a.cmp(&b) {
            std::cmp::Ordering::Equal => k += 1,
            order => {
                if order.is_gt() {
                    i += k + 1;
                } else {
                    j += k + 1;
                }
                if i == j {
                    j += 1;
                }
                k = 0;
            }
        }
    }
    i.min(j)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read_from_any_place_of_their_cycle() {
        for (text, canonical) in [("135462", "135462"), ("w462135", "135462"), ("b3a2", "a2b3"), ("w", "")] {
            assert_eq!(text.parse::<Word>().unwrap().time_order(), canonical);
        }
        for text in ["138", "a", "2a", "ab3", "z2", "1 2"] {
            assert!(text.parse::<Word>().is_err(), "{text}");
        }
    }

    #[test]
    fn paper_notation_is_that_of_the_paper() {
        assert_eq!(Word::cyclic(b"35546221").paper_notation(), "P_{1 2^2 6 4 5^2 3}");
        assert_eq!(Word::cyclic(b"5623").paper_notation(), "P_{6532}");
        assert_eq!(Word::cyclic(b"63").paper_notation(), "P_{63}");
        assert_eq!(Word::cyclic(b"63").time_order(), "36");
        assert_eq!(Word::cyclic(b"").time_order(), "");
    }

    #[test]
    fn words_are_stored_in_their_smallest_rotation() {
        for word in [&b"2356"[..], b"61213454", b"3636", b"222222", b"5", b"61213455", b"121121112"] {
            let rotations = (0..word.len()).map(|r| {
                let mut w = word.to_vec();
                w.rotate_left(r);
                w
            });
            let smallest = rotations.clone().min().unwrap();
            for rotated in rotations {
                assert_eq!(Word::cyclic(&rotated).symbols(), smallest);
            }
        }
    }

    #[test]
    fn a_pattern_does_not_depend_on_where_the_cycle_starts() {
        let cases = [
            ("13554622", "135462"),
            ("11312", "1213"),
            ("12", "12"),
            ("222222", "2"),
            ("5", "5"),
            ("", ""),
            ("00", "0"),
            ("0770", "07"),
        ];
        for (symbols, pattern) in cases {
            for start in 0..symbols.len().max(1) {
                let mut rotated = symbols.as_bytes().to_vec();
                rotated.rotate_left(start);
                assert_eq!(Word::cyclic(&rotated).pattern().time_order(), pattern, "{symbols} from {start}");
            }
        }
    }

    #[test]
    fn the_mirror_image_swaps_walls() {
        assert_eq!(Word::cyclic(b"12345").mirrored(), Word::cyclic(b"45612"));
        assert_eq!(Word::cyclic(b"36").mirrored(), Word::cyclic(b"36"));
        assert_eq!(Word::cyclic(b"07127").mirrored(), Word::cyclic(b"07457"));
    }
}
