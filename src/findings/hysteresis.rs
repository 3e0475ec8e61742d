//! Hysteresis: values at which the two passes of a diagram differ.

use serde::Serialize;

use crate::findings::compare::{Compared, Comparison, Kind, TOLERANCE, Values, words_differ};
use crate::map::bifurcation::{Column, Direction};
use crate::record::measures;

/// Values of the axis at which the motion depends on the direction in which the attractor was followed. Manifests have its fields.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hysteresis {
    /// Number of values of the axis.
    pub columns: usize,
    /// Number of values at which class or period differ.
    pub differing: usize,
    /// First and last value of each range of neighbouring values at which class or period differ.
    pub ranges: Vec<[f64; 2]>,
    /// Number of values at which only the patterns differ, for example if one direction leads to contact-free motion
    /// and the other to rattling. The patterns of an orbit and of its mirror image count as equal.
    pub by_pattern: usize,
    /// First and last value of each range of neighbouring values at which only the patterns differ.
    pub pattern_ranges: Vec<[f64; 2]>,
    /// Number of values at which only quantities differ, by more than [`TOLERANCE`]: measured quantities, impacts, the mesh fraction
    /// and the largest speed at a wall.
    pub by_quantity: usize,
    /// First and last value of each range of neighbouring values at which only quantities differ.
    pub quantity_ranges: Vec<[f64; 2]>,
}

/// Compares the two passes of a diagram; none if it has one pass.
pub fn hysteresis(columns: &[Column]) -> Option<Hysteresis> {
    let pass = |direction| columns.iter().filter(move |column| column.direction == Some(direction));
    let [up, down] = Direction::ALL.map(pass);
    let pairs: Vec<[&Column; 2]> = up.zip(down).map(|(up, down)| [up, down]).collect();
    let kind = |[up, down]: &[&Column; 2]| {
        // Patterns are compared, because words also count the bounces before meshing.
        let other_pattern =
            up.pattern().zip(down.pattern()).is_some_and(|(up, down)| words_differ(&up, &down));
        Kind::of(up.class, down.class).or(other_pattern.then_some(Kind::Pattern))
    };
    let mut compared = Comparison { kinds: pairs.iter().map(kind).collect(), ..Comparison::default() };
    let measured = measures::all().map(|measure| Compared {
        dimension: measure.dimension(),
        is_odd: measure.is_odd(),
        ..Compared::plain("")
    });
    let all = [(); AVERAGES].map(|()| Compared::plain("")).into_iter().chain(measured);
    let values = Values { quantities: all.collect(), of: &|nth| pairs[nth].map(quantities) };
    compared.take_quantities(&values, TOLERANCE, |nth| pairs[nth].map(|column| column.class));
    let [mut differing, mut by_pattern, mut by_quantity] = [(); 3].map(|()| Runs::default());
    for ([up, _], kind) in pairs.iter().zip(&compared.kinds) {
        differing.take(up.value, kind.is_some_and(Kind::is_decisive));
        by_pattern.take(up.value, *kind == Some(Kind::Pattern));
        by_quantity.take(up.value, *kind == Some(Kind::Quantity));
    }
    (differing.total > 0).then_some(Hysteresis {
        columns: differing.total,
        differing: differing.count,
        ranges: differing.ranges,
        by_pattern: by_pattern.count,
        pattern_ranges: by_pattern.ranges,
        by_quantity: by_quantity.count,
        quantity_ranges: by_quantity.ranges,
    })
}

/// Number of quantities in front of the measured ones.
const AVERAGES: usize = 3;

/// Returns the quantities of a column.
fn quantities(column: &Column) -> Vec<Option<f64>> {
    let speeds = column.points.iter().flat_map(|point| point.before.iter().skip(1).step_by(2));
    let fastest = speeds.fold(0.0, |fastest: f64, speed| fastest.max(speed.abs()));
    let averages: [f64; AVERAGES] = [column.impacts_per_period, column.mesh_fraction, fastest];
    let measured = measures::all().map(|measure| column.measures[measure.place]);
    averages
        .map(Some)
        .into_iter()
        .chain(measured)
        .map(|value| value.filter(|value| value.is_finite()))
        .collect()
}

/// Values at which a condition holds, as ranges of neighbours.
#[derive(Default)]
struct Runs {
    total: usize,
    count: usize,
    ranges: Vec<[f64; 2]>,
    /// Whether the condition holds at the preceding value.
    is_within: bool,
}

impl Runs {
    fn take(&mut self, value: f64, holds: bool) {
        match self.ranges.last_mut() {
            Some(range) if holds && self.is_within => range[1] = value,
            _ if holds => self.ranges.push([value; 2]),
            _ => {}
        }
        self.total += 1;
        self.count += usize::from(holds);
        self.is_within = holds;
    }
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
        // Impacts on both sides against meshing; an orbit against its mirror image; words that differ in bounces only.
        let cycles: [(usize, &[u8]); 4] = [(0, b"36"), (7, b"14"), (4, b"1355546"), (11, b"462213")];
        for (i, word) in cycles {
            spell(i, word);
        }
        let ranges = vec![[1.0, 2.0], [5.0, 5.0]];
        (both[3].mesh_fraction, both[10].mesh_fraction) = (0.5, 0.6);
        (both[4].mesh_fraction, both[11].mesh_fraction) = (0.5, 0.6);
        let expected = Hysteresis {
            columns: 7,
            differing: 3,
            ranges,
            by_pattern: 1,
            pattern_ranges: vec![[0.0, 0.0]],
            by_quantity: 1,
            quantity_ranges: vec![[4.0, 4.0]],
        };
        assert_eq!(hysteresis(&both), Some(expected));
        assert_eq!(hysteresis(&[column(None, 0.0, one)]), None);
    }
}
