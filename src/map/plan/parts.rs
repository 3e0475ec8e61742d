//! The distinct flows and contact laws of a plan, and the cells that share them. Pure.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use crate::map::scene::{Points, Target};
use rattlemap_dynamics::model::Parameter;

/// The distinct flows, or the distinct laws, of all cells, numbered from 0.
#[derive(Clone, Debug)]
pub(crate) enum Parts {
    /// One part for each value of the axes marked in `along`.
    Grid { counts: [usize; 2], along: [bool; 2] },
    /// For each cell of a list its part, and for each part its first cell.
    List { of: Arc<[u32]>, first: Arc<[u32]> },
}

impl Parts {
    /// Finds the flows. Cells share one if all parameters of the oscillator are equal.
    pub(crate) fn flows(points: &Points) -> Parts {
        Parts::new(points, |parameter| parameter.shapes.oscillator())
    }

    /// Finds the contact laws. Cells share one if all parameters of the law are equal.
    pub(crate) fn laws(points: &Points) -> Parts {
        Parts::new(points, |parameter| parameter.shapes.law())
    }

    fn new(points: &Points, is_shaped: fn(&Parameter) -> bool) -> Parts {
        // A component of the start affects neither flow nor law.
        let shapes = |target: Target| target.parameter().is_some_and(|index| points.shapes(index, is_shaped));
        let shapes: Vec<bool> = points.targets().map(shapes).collect();
        let Some(list) = points.list() else {
            let along = [0, 1].map(|i| shapes.get(i).copied().unwrap_or(false));
            return Parts::Grid { counts: points.counts(), along };
        };
        let (mut of, mut first) = (Vec::with_capacity(list.len()), Vec::new());
        let mut known: HashMap<Vec<u64>, u32> = HashMap::new();
        for cell in 0..list.len() {
            let values = list.row(cell).iter().zip(&shapes).filter(|(_, shapes)| **shapes);
            // Bits are compared: 0 and -0 give two parts, which is harmless.
            of.push(match known.entry(values.map(|(value, _)| value.to_bits()).collect()) {
                Entry::Occupied(part) => *part.get(),
                Entry::Vacant(part) => {
                    first.push(cell as u32);
                    *part.insert(first.len() as u32 - 1)
                }
            });
        }
        Parts::List { of: of.into(), first: first.into() }
    }

    /// Returns the number of parts.
    pub(crate) fn count(&self) -> usize {
        match self {
            Parts::Grid { counts, along } => {
                counts.iter().zip(along).map(|(&count, &along)| if along { count } else { 1 }).product()
            }
            Parts::List { first, .. } => first.len(),
        }
    }

    /// Returns the part of a cell.
    pub(crate) fn of(&self, cell: usize) -> u32 {
        match self {
            Parts::Grid { counts: [columns, _], along } => match along {
                [true, true] => cell as u32,
                [true, false] => (cell % columns) as u32,
                [false, true] => (cell / columns) as u32,
                [false, false] => 0,
            },
            Parts::List { of, .. } => of[cell],
        }
    }

    /// Returns the first cell with a part.
    pub(crate) fn cell(&self, part: u32) -> usize {
        let part = part as usize;
        match self {
            Parts::Grid { counts: [columns, _], along } => match along {
                [true, _] => part,
                [false, _] => part * columns,
            },
            Parts::List { first, .. } => first[part] as usize,
        }
    }
}
