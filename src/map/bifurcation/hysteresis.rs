//! Where do the two passes of a diagram disagree?

use super::{Column, Direction};
use crate::map::compare::{Kind, words_differ};

/// Columns in which the motion depends on the way that the attractor was followed.
#[derive(Clone, Debug, PartialEq)]
pub struct Hysteresis {
    /// Values of the axis.
    pub columns: usize,
    /// Those at which class or period differ.
    pub differing: usize,
    /// Runs of neighbouring values at which they do: the first and the last value of each.
    pub ranges: Vec<[f64; 2]>,
    /// Values at which class and period are the same and the words alone differ. Those of an orbit and its mirror
    /// image are one.
    pub by_word: usize,
}

/// Compares the two passes of a diagram by class and period; none if it shows one alone.
pub fn hysteresis(columns: &[Column]) -> Option<Hysteresis> {
    let pass = |direction| columns.iter().filter(move |column| column.direction == Some(direction));
    let [up, down] = Direction::BOTH.map(pass);
    let mut found = Hysteresis { columns: 0, differing: 0, ranges: Vec::new(), by_word: 0 };
    let mut is_within = false;
    for (up, down) in up.zip(down) {
        found.columns += 1;
        let differs = Kind::of(up.class, down.class).is_some();
        if differs {
            found.differing += 1;
            match found.ranges.last_mut() {
                Some(range) if is_within => range[1] = up.value,
                _ => found.ranges.push([up.value; 2]),
            }
        } else if up.word.as_ref().zip(down.word.as_ref()).is_some_and(|(up, down)| words_differ(up, down)) {
            found.by_word += 1;
        }
        is_within = differs;
    }
    (found.columns > 0).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::orbit::Class;
    use rattlemap_dynamics::word::Word;

    fn column(direction: Option<Direction>, value: f64, class: Class) -> Column {
        Column { direction, ..Column::plain(value, class) }
    }

    #[test]
    fn differing_neighbours_are_one_range() {
        let [one, two] = [1, 2].map(|period| Class::Periodic { period });
        let up = [one, one, two, Class::Chaotic, one, Class::Chaotic, Class::Undecided];
        let down = [one, two, one, Class::Chaotic, one, one, Class::Undecided];
        let pass = |direction, classes: [Class; 7]| {
            let numbered = classes.into_iter().enumerate();
            numbered.map(|(i, class)| column(Some(direction), i as f64, class)).collect::<Vec<_>>()
        };
        let mut both = [pass(Direction::Up, up), pass(Direction::Down, down)].concat();
        let mut spell = |i: usize, word: &[u8]| both[i].word = Some(Word::cyclic(word));
        // An impact on either side against meshing; an orbit against its mirror image.
        for (i, word) in [(0, b"36"), (7, b"14"), (4, b"22"), (11, b"55")] {
            spell(i, word);
        }
        let ranges = vec![[1.0, 2.0], [5.0, 5.0]];
        let expected = Hysteresis { columns: 7, differing: 3, ranges, by_word: 1 };
        assert_eq!(hysteresis(&both), Some(expected));
        assert_eq!(hysteresis(&[column(None, 0.0, one)]), None);
    }
}
