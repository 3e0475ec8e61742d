//! Names of attractors over a map: an attractor of one cell and its continuation in the next cell have one name.

use std::collections::HashMap;

use super::{Attractor, CellShares, Kind};

/// An attractor of a map.
#[derive(Clone, Debug, PartialEq)]
pub struct Name {
    /// Its kind.
    pub kind: Kind,
    /// Period of a cycle, in forcing periods; else 0.
    pub period: u32,
    /// Word of a cycle, as in tables.
    pub word: String,
    /// Number of cells that have it.
    pub cells: usize,
    /// Its mean share in all cells of the map.
    pub share: f64,
}

/// What the attractors of a name have in common.
type Key<'a> = (Kind, u32, &'a str);

/// The attractors of a map, the one with the largest mean share first.
#[derive(Clone, Debug, Default)]
pub struct Names {
    /// The attractors.
    pub list: Vec<Name>,
    /// For each cell of the map, in order of number, the place in the list of each of its attractors.
    pub of_cells: Vec<Vec<usize>>,
}

impl Names {
    /// Names the attractors of all cells of a map with `columns` columns. `cells` are in the order of their numbers.
    ///
    /// Cycles with one period and one word have one name. If a cell has several of them, each gets the name of the nearest one in the cell
    /// to the left or below. Motion without contact is one attractor, and so are chaos and quasi-periodic motion.
    pub fn of(cells: &[CellShares], columns: usize) -> Names {
        let mut keys: Vec<Key<'_>> = Vec::new();
        let mut with_key: HashMap<Key<'_>, Vec<usize>> = HashMap::new();
        let mut of_cells: Vec<Vec<usize>> = Vec::with_capacity(cells.len());
        for (place, cell) in cells.iter().enumerate() {
            let left = (place % columns > 0).then(|| place - 1);
            let below = place.checked_sub(columns);
            let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
            for (i, own) in cell.attractors.iter().enumerate() {
                for neighbour in [left, below].into_iter().flatten() {
                    for (other, name) in cells[neighbour].attractors.iter().zip(&of_cells[neighbour]) {
                        if key(own) == key(other) {
                            pairs.push((distance(own, other), i, *name));
                        }
                    }
                }
            }
            pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
            let mut own: Vec<Option<usize>> = vec![None; cell.attractors.len()];
            for (_, i, name) in pairs {
                if own[i].is_none() && !own.contains(&Some(name)) {
                    own[i] = Some(name);
                }
            }
            for i in 0..own.len() {
                let key = key(&cell.attractors[i]);
                let known = with_key.entry(key).or_default();
                // A name of an attractor elsewhere, or a new one.
                let free = known.iter().copied().find(|name| !own.contains(&Some(*name)));
                own[i] = own[i].or(free).or_else(|| {
                    keys.push(key);
                    known.push(keys.len() - 1);
                    Some(keys.len() - 1)
                });
            }
            of_cells.push(own.into_iter().flatten().collect());
        }
        let mut list: Vec<Name> = keys
            .into_iter()
            .map(|(kind, period, word)| Name { kind, period, word: word.to_owned(), cells: 0, share: 0.0 })
            .collect();
        for (cell, names) in cells.iter().zip(&of_cells) {
            for (attractor, name) in cell.attractors.iter().zip(names) {
                list[*name].cells += 1;
                list[*name].share += cell.share(&attractor.starts).mean / cells.len() as f64;
            }
        }
        let mut order: Vec<usize> = (0..list.len()).collect();
        order.sort_by(|&a, &b| list[b].share.total_cmp(&list[a].share).then(a.cmp(&b)));
        let mut place = vec![0; order.len()];
        order.iter().enumerate().for_each(|(new, old)| place[*old] = new);
        of_cells.iter_mut().flatten().for_each(|name| *name = place[*name]);
        let list = order.iter().map(|old| list[*old].clone()).collect();
        Names { list, of_cells }
    }
}

impl Name {
    /// Describes the attractor in words.
    pub fn text(&self) -> String {
        let word = self.word.strip_prefix('w').filter(|word| !word.is_empty());
        match (self.kind, word) {
            (Kind::Free, _) => "no contact".to_owned(),
            (Kind::Chaos, _) => "chaos".to_owned(),
            (Kind::Torus, _) => "quasi-periodic".to_owned(),
            (Kind::Cycle, Some(word)) => format!("period {}, word {word}", self.period),
            (Kind::Cycle, None) => format!("period {}, no events", self.period),
        }
    }
}

fn key(attractor: &Attractor) -> Key<'_> {
    match attractor.kind {
        // Motion without contact has no other name, whatever its gap is.
        Kind::Free => (Kind::Free, attractor.period, ""),
        kind => (kind, attractor.period, &attractor.word),
    }
}

/// Returns the largest difference of the states of two attractors, relative to the largest components.
fn distance(a: &Attractor, b: &Attractor) -> f64 {
    let size = |first: usize| {
        let all = a.strobe.iter().skip(first).step_by(2).chain(b.strobe.iter().skip(first).step_by(2));
        all.fold(f64::MIN_POSITIVE, |most, x| most.max(x.abs()))
    };
    let sizes = [size(0), size(1)];
    let apart = a.strobe.iter().zip(&b.strobe).enumerate();
    apart.map(|(i, (a, b))| (a - b).abs() / sizes[i % 2]).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(attractors: &[(Kind, &str, f64, u32)]) -> CellShares {
        let of = |&(kind, word, x, starts): &(Kind, &str, f64, u32)| Attractor {
            kind,
            period: u32::from(kind <= Kind::Cycle),
            word: word.to_owned(),
            strobe: vec![x, 0.0],
            starts: [starts; 8],
            periods: 1,
            numbers: Vec::new(),
        };
        CellShares { cell: 0, count: 80, attractors: attractors.iter().map(of).collect(), undecided: [0; 8] }
    }

    #[test]
    fn attractors_keep_their_names_from_cell_to_cell() {
        use Kind::{Chaos, Cycle, Free};
        // Two cycles with one word change the order of their shares; another motion begins, and ends.
        let cells = [
            cell(&[(Cycle, "w36", 1.0, 7), (Cycle, "w36", -1.0, 3)]),
            cell(&[(Cycle, "w36", -1.1, 6), (Cycle, "w36", 0.9, 4)]),
            cell(&[(Free, "w", 0.1, 5), (Cycle, "w36", -1.2, 5)]),
            cell(&[(Chaos, "", 0.0, 10)]),
            cell(&[(Cycle, "w36", 0.8, 10)]),
            cell(&[(Free, "w", 0.2, 10)]),
        ];
        let names = Names::of(&cells, 3);
        let texts: Vec<String> = names.list.iter().map(Name::text).collect();
        let place = |text: &str| texts.iter().position(|other| other == text).unwrap();
        let [first, second] = [names.of_cells[0][0], names.of_cells[0][1]];
        assert_eq!(names.of_cells[1], [second, first]);
        assert_eq!(names.of_cells[2], [place("no contact"), second]);
        assert_eq!((names.of_cells[3][0], names.of_cells[5][0]), (place("chaos"), place("no contact")));
        assert_eq!(names.of_cells[4], [first]);
        assert_eq!(names.list.len(), 4);
        assert!((names.list[first].share - (0.7 + 0.4 + 1.0) / 6.0).abs() < 1e-12, "{:?}", names.list);
    }
}
