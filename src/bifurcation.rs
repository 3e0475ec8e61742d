//! Section points against one parameter, as in Fig. 5 of the paper.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::model::{GearPair, REST, Side, State};
use crate::orbit::{self, Class, EventKind, Settings, Status};
use crate::scene::Start;

/// The attractor's section points at one value of the axis.
#[derive(Clone, Debug)]
pub struct Column {
    /// Value of the axis parameter.
    pub value: f64,
    /// What the motion is.
    pub class: Class,
    /// How the integration ended.
    pub status: Status,
    /// Every crossing of a wall: contacts and ends of meshing.
    pub points: Vec<SectionPoint>,
}

/// One event seen as a point of the section `|z| = b`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SectionPoint {
    /// The wall.
    pub side: Side,
    /// What happened there.
    pub kind: EventKind,
    /// Time since the last phase 0, in `[0, T)`.
    pub t_mod_period: f64,
    /// State just before the event.
    pub before: State,
    /// State just after the event.
    pub after: State,
}

/// Integrates every cell; `progress` is told how many columns are done so far.
///
/// Columns that start from one state are independent and run in parallel; columns that
/// follow the attractor run one after the other, the first of them from rest.
pub fn run(
    cells: &[(f64, GearPair)],
    start: Start,
    settings: &Settings,
    progress: &(dyn Fn(usize) + Sync),
) -> Vec<Column> {
    match start {
        Start::Rest => side_by_side(cells, REST, settings, progress),
        Start::State(state) => side_by_side(cells, state, settings, progress),
        Start::Up => follow(cells.iter(), settings, progress),
        Start::Down => {
            let mut columns = follow(cells.iter().rev(), settings, progress);
            columns.reverse();
            columns
        }
    }
}

fn side_by_side(
    cells: &[(f64, GearPair)],
    start: State,
    settings: &Settings,
    progress: &(dyn Fn(usize) + Sync),
) -> Vec<Column> {
    let done = AtomicUsize::new(0);
    cells
        .par_iter()
        .map(|(value, pair)| {
            let column = column(*value, pair, start, settings).0;
            progress(done.fetch_add(1, Ordering::Relaxed) + 1);
            column
        })
        .collect()
}

fn follow<'a>(
    cells: impl Iterator<Item = &'a (f64, GearPair)>,
    settings: &Settings,
    progress: &(dyn Fn(usize) + Sync),
) -> Vec<Column> {
    let mut start = REST;
    cells
        .enumerate()
        .map(|(i, (value, pair))| {
            let (column, end) = column(*value, pair, start, settings);
            start = end;
            progress(i + 1);
            column
        })
        .collect()
}

/// One column, and a state on its attractor to start the next one from.
fn column(value: f64, pair: &GearPair, start: State, settings: &Settings) -> (Column, State) {
    let orbit = orbit::analyse_over(pair, start, settings, settings.observed_periods);
    let end = if orbit.class == Class::Failed { REST } else { orbit.strobe };
    let points = orbit
        .events
        .iter()
        .map(|event| SectionPoint {
            side: event.side,
            kind: event.kind,
            t_mod_period: event.t_mod_period,
            before: event.before,
            after: event.after,
        })
        .collect();
    (Column { value, class: orbit.class, status: orbit.status, points }, end)
}
