//! Bifurcation diagrams: section points and class of the motion against one parameter, as in Fig. 5 of the paper.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::map::scene::Start;
use crate::record::measures::{self, MEASURES, Measured};
use rattlemap_dynamics::model::{MOST_COORDINATES, Model, ModelError, Oscillator, REST, Side, State};
use rattlemap_dynamics::named;
use rattlemap_dynamics::orbit::{self, Class, EventKind, Orbit, Quantities, Settings, Status};
use rattlemap_dynamics::word::Word;

/// The attractor at one value of the axis, with its section points.
#[derive(Clone, Debug)]
pub struct Column {
    /// Value of the axis parameter.
    pub value: f64,
    /// Direction in which the attractor was followed, in a diagram with both; none in a diagram with one pass.
    pub direction: Option<Direction>,
    /// Class of the motion.
    pub class: Class,
    /// End of the integration.
    pub status: Status,
    /// Largest Lyapunov exponent per unit time; NaN if the integration failed.
    pub lyapunov: f64,
    /// Standard error of the exponent; none for periodic motion, whose exponent is not an average.
    pub lyapunov_error: Option<f64>,
    /// Impacts per forcing period, without starts of meshing; NaN if the integration failed.
    pub impacts_per_period: f64,
    /// Fraction of the time spent meshing; NaN if the integration failed.
    pub mesh_fraction: f64,
    /// Impacts per unit time; NaN if the integration failed.
    pub impact_rate: f64,
    /// Measured quantities, by their places in a record.
    pub measures: [Option<f64>; MEASURES],
    /// Last state at phase 0; none if the integration failed.
    pub state: Option<State>,
    /// Whether a periodic orbit is its own mirror image.
    pub symmetric: Option<bool>,
    /// The word of a periodic orbit.
    pub word: Option<Word>,
    /// Number of integrated forcing periods.
    pub periods_run: u64,
    /// All crossings of walls: contacts and ends of meshing.
    pub points: Vec<SectionPoint>,
    /// States at phase 0 of the shown periods, if walls [fix](fixed) a displacement; else empty.
    pub strobes: Vec<State>,
}

impl Column {
    /// Returns the pattern of a periodic orbit's word.
    pub fn pattern(&self) -> Option<Word> {
        self.word.as_ref().map(Word::pattern)
    }

    /// Returns the time of a cycle without a force; none of other motion.
    pub fn cycle_time(&self) -> Option<f64> {
        let measure = measures::all().find(|measure| measure.group.name == "cycle_time")?;
        self.measures[measure.place]
    }
}

named! {
    /// Direction in which an attractor is followed.
    pub enum Direction {
        /// From the first value to the last.
        Up = "up",
        /// From the last value to the first.
        Down = "down",
    }
}

/// One event as a point of the section `|z| = b`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SectionPoint {
    /// Index of the gap.
    pub gap: usize,
    /// The wall.
    pub side: Side,
    /// Kind of the event.
    pub kind: EventKind,
    /// Time since the last phase 0, in `[0, T)`.
    pub t_mod_period: f64,
    /// State just before the event.
    pub before: State,
    /// State just after the event.
    pub after: State,
}

/// Returns the index of the displacement that has one value at all crossings of a wall, because the only gap depends on this
/// displacement only, in every cell. None if the gap depends on several displacements, with several gaps, or without cells.
///
/// Section points of such a model differ only in velocity and phase, so its displacement is shown at phase 0.
pub fn fixed(cells: &[(f64, Box<dyn Model>)]) -> Option<usize> {
    let is_alone = |oscillator: &Oscillator, i: usize| {
        let mut others = oscillator.gap_row(0).into_iter().enumerate().filter(|(j, _)| *j != i);
        oscillator.gaps.len() == 1 && others.all(|(_, factor)| factor == 0.0)
    };
    let fixes = |i: usize| {
        cells.iter().all(|(_, model)| model.oscillator().is_ok_and(|oscillator| is_alone(&oscillator, i)))
    };
    (0..MOST_COORDINATES).find(|&i| !cells.is_empty() && fixes(i))
}

/// Returns the number of columns of a diagram.
pub fn column_count(cells: usize, start: Start) -> usize {
    if start == Start::Both { 2 * cells } else { cells }
}

/// Integrates every cell and calls `progress` with the number of finished columns. Returns none if `halt` was raised
/// before the last column ended.
///
/// Columns that start from one state are independent and run in parallel. Columns that follow the attractor run one
/// after the other, the first of them from rest. With [`Start::Both`] there are two columns per cell, those followed
/// upwards first; the two passes run in parallel. Columns are in the order of their cells.
///
/// # Errors
/// [`ModelError`] of a cell without motion, before any is integrated.
pub fn run_until(
    cells: &[(f64, Box<dyn Model>)],
    start: Start,
    settings: &Settings,
    progress: &(dyn Fn(usize) + Sync),
    halt: &AtomicBool,
) -> Result<Option<Vec<Column>>, ModelError> {
    cells.iter().try_for_each(|(_, model)| model.oscillator().map(|_| ()))?;
    let has_strobes = fixed(cells).is_some();
    let run = Run { cells, settings, progress, done: AtomicUsize::new(0), halt, has_strobes };
    match start {
        Start::Rest => run.side_by_side(REST),
        Start::State(state) => run.side_by_side(state),
        Start::Up => run.follow(Direction::Up),
        Start::Down => run.follow(Direction::Down),
        Start::Both => {
            let (up, down) = rayon::join(|| run.follow(Direction::Up), || run.follow(Direction::Down));
            let marked = |columns: Vec<Column>, direction| {
                columns.into_iter().map(move |column| Column { direction: Some(direction), ..column })
            };
            let both = up?.zip(down?);
            Ok(both
                .map(|(up, down)| marked(up, Direction::Up).chain(marked(down, Direction::Down)).collect()))
        }
    }
}

/// Data shared by all columns.
struct Run<'a> {
    cells: &'a [(f64, Box<dyn Model>)],
    settings: &'a Settings,
    progress: &'a (dyn Fn(usize) + Sync),
    done: AtomicUsize,
    halt: &'a AtomicBool,
    has_strobes: bool,
}

impl Run<'_> {
    fn side_by_side(&self, start: State) -> Result<Option<Vec<Column>>, ModelError> {
        let column = |(value, model): &(f64, Box<dyn Model>)| {
            Ok(self.column(*value, &**model, start)?.map(|(column, _)| column))
        };
        self.cells.par_iter().map(column).collect()
    }

    fn follow(&self, direction: Direction) -> Result<Option<Vec<Column>>, ModelError> {
        let cells: Box<dyn Iterator<Item = _>> = match direction {
            Direction::Up => Box::new(self.cells.iter()),
            Direction::Down => Box::new(self.cells.iter().rev()),
        };
        let mut start = REST;
        let column = |(value, model): &(f64, Box<dyn Model>)| {
            let Some((column, end)) = self.column(*value, &**model, start)? else { return Ok(None) };
            start = end;
            Ok(Some(column))
        };
        let mut columns = cells.map(column).collect::<Result<Option<Vec<Column>>, ModelError>>()?;
        if let (Direction::Down, Some(columns)) = (direction, &mut columns) {
            columns.reverse();
        }
        Ok(columns)
    }

    /// Computes one column, and a state on its attractor from which the next column can start; none after `halt` is
    /// raised.
    fn column(
        &self,
        value: f64,
        model: &dyn Model,
        start: State,
    ) -> Result<Option<(Column, State)>, ModelError> {
        let shown = self.settings.observed_periods;
        let (longest, report) = (orbit::LONGEST_WINDOW, &|_, _| ());
        let Some(orbit) =
            orbit::analyse_until(model, start, self.settings, longest, shown, self.halt, report)?
        else {
            return Ok(None);
        };
        let end = if orbit.class == Class::Failed { REST } else { orbit.strobe };
        let strobes = if self.has_strobes { strobes(model, &orbit)? } else { Vec::new() };
        (self.progress)(self.done.fetch_add(1, Ordering::Relaxed) + 1);
        Ok(Some((Column { strobes, ..Column::of(value, orbit) }, end)))
    }
}

/// Returns the states of an orbit at phase 0, one for each shown period.
fn strobes(model: &dyn Model, orbit: &Orbit) -> Result<Vec<State>, ModelError> {
    let Some(later) = orbit.cycle_periods.checked_sub(1) else { return Ok(Vec::new()) };
    let mut states = vec![orbit.strobe];
    let trace = orbit::trace(model, orbit.strobe, orbit.strobe_meshing, later, 1)?;
    states.extend(trace.iter().skip(1).map(|sample| sample.state));
    Ok(states)
}

#[cfg(test)]
impl Column {
    /// Builds a column without points for tests.
    pub(crate) fn plain(value: f64, class: Class) -> Column {
        Column {
            value,
            direction: None,
            class,
            status: Status::Ok,
            lyapunov: 0.0,
            lyapunov_error: None,
            impacts_per_period: 0.0,
            mesh_fraction: 0.0,
            impact_rate: 0.0,
            measures: [None; MEASURES],
            state: None,
            symmetric: None,
            word: None,
            periods_run: 0,
            points: Vec::new(),
            strobes: Vec::new(),
        }
    }
}

impl Column {
    /// Builds the column of a cycle on a branch, with its multipliers.
    pub(crate) fn on_branch(
        value: f64,
        (period, forcing_period, cycle_time): (u32, f64, Option<f64>),
        word: Word,
        state: State,
        quantities: Option<&Quantities>,
        multipliers: &[[f64; 2]],
    ) -> Column {
        let multiplier = multipliers.first().map(|[re, im]| [re.hypot(*im), im.atan2(*re)]);
        let impacts =
            quantities.map_or(f64::NAN, |found| found.approaches[2].count as f64 / f64::from(period));
        Column {
            value,
            direction: None,
            class: Class::Periodic { period },
            status: Status::Ok,
            lyapunov: f64::NAN,
            lyapunov_error: None,
            impacts_per_period: impacts,
            mesh_fraction: f64::NAN,
            impact_rate: impacts / forcing_period,
            measures: Measured { quantities, multiplier, cycle_time }.numbers(),
            state: Some(state),
            symmetric: None,
            word: Some(word),
            periods_run: 0,
            points: Vec::new(),
            strobes: Vec::new(),
        }
    }

    fn of(value: f64, orbit: Orbit) -> Column {
        let point = |event: &orbit::Event| SectionPoint {
            gap: event.gap,
            side: event.side,
            kind: event.kind,
            t_mod_period: event.t_mod_period,
            before: event.before,
            after: event.after,
        };
        let is_periodic = matches!(orbit.class, Class::Periodic { .. });
        Column {
            value,
            direction: None,
            class: orbit.class,
            status: orbit.status,
            lyapunov: orbit.lyapunov,
            lyapunov_error: orbit.lyapunov_error,
            impacts_per_period: orbit.impacts_per_period,
            mesh_fraction: orbit.mesh_fraction,
            impact_rate: orbit.impacts_per_period / orbit.forcing_period,
            measures: Measured::from(&orbit).numbers(),
            state: (orbit.class != Class::Failed).then_some(orbit.strobe),
            symmetric: orbit.symmetric,
            periods_run: orbit.periods_run,
            points: orbit.events.iter().map(point).collect(),
            strobes: Vec::new(),
            word: is_periodic.then_some(orbit.word),
        }
    }
}
