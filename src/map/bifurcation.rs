//! Section points against one parameter, as in Fig. 5 of the paper.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::map::scene::Start;
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Model, ModelError, REST, Side, State};
use rattlemap_dynamics::orbit::{self, Class, EventKind, Settings, Status};

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
///
/// # Errors
/// [`ModelError`] of a cell that has no motion, before any is integrated.
pub fn run(
    cells: &[(f64, Box<dyn Model>)],
    start: Start,
    settings: &Settings,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Column>, ModelError> {
    let columns = run_until(cells, start, settings, progress, &AtomicBool::new(false))?;
    // Nobody raises the flag.
    Ok(columns.unwrap_or_default())
}

/// [`run`] until a flag is raised; none if it was before the last column ended.
///
/// # Errors
/// As [`run`].
pub fn run_until(
    cells: &[(f64, Box<dyn Model>)],
    start: Start,
    settings: &Settings,
    progress: &(dyn Fn(usize) + Sync),
    halt: &AtomicBool,
) -> Result<Option<Vec<Column>>, ModelError> {
    cells.iter().try_for_each(|(_, model)| Flow::validate(&**model).map(|_| ()))?;
    match start {
        Start::Rest => side_by_side(cells, REST, settings, progress, halt),
        Start::State(state) => side_by_side(cells, state, settings, progress, halt),
        Start::Up => follow(cells.iter(), settings, progress, halt),
        Start::Down => {
            let columns = follow(cells.iter().rev(), settings, progress, halt)?;
            Ok(columns.map(|columns| columns.into_iter().rev().collect()))
        }
    }
}

fn side_by_side(
    cells: &[(f64, Box<dyn Model>)],
    start: State,
    settings: &Settings,
    progress: &(dyn Fn(usize) + Sync),
    halt: &AtomicBool,
) -> Result<Option<Vec<Column>>, ModelError> {
    let done = AtomicUsize::new(0);
    cells
        .par_iter()
        .map(|(value, model)| {
            let Some((column, _)) = column(*value, &**model, start, settings, halt)? else { return Ok(None) };
            progress(done.fetch_add(1, Ordering::Relaxed) + 1);
            Ok(Some(column))
        })
        .collect()
}

fn follow<'a>(
    cells: impl Iterator<Item = &'a (f64, Box<dyn Model>)>,
    settings: &Settings,
    progress: &(dyn Fn(usize) + Sync),
    halt: &AtomicBool,
) -> Result<Option<Vec<Column>>, ModelError> {
    let mut start = REST;
    cells
        .enumerate()
        .map(|(i, (value, model))| {
            let Some((column, end)) = column(*value, &**model, start, settings, halt)? else {
                return Ok(None);
            };
            start = end;
            progress(i + 1);
            Ok(Some(column))
        })
        .collect()
}

/// One column, and a state on its attractor to start the next one from; none once the flag is raised.
fn column(
    value: f64,
    model: &dyn Model,
    start: State,
    settings: &Settings,
    halt: &AtomicBool,
) -> Result<Option<(Column, State)>, ModelError> {
    let shown = settings.observed_periods;
    let Some(orbit) = orbit::analyse_until(model, start, settings, shown, halt)? else { return Ok(None) };
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
    Ok(Some((Column { value, class: orbit.class, status: orbit.status, points }, end)))
}
