//! The catalogue of cycles of one oscillator, built from records.
//!
//! A record within `SETTLED_TOLERANCE` of a known cycle belongs to it. From any other record, Newton's method finds
//! the cycle that the motion approaches; two cycles within the same tolerance are one. So the result does not depend on
//! the order of the records.

use rayon::prelude::*;

use crate::map::cycle::{CYCLE_TOLERANCE, StrobeCycle, distance};
use crate::record::classify::classify;
use crate::record::{Record, Records};
use rattlemap_dynamics::model::{Law, NonImpacting, State};
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::Class;

/// Relative distance within which a state belongs to a cycle without further search. Settled lanes in single precision
/// are closer to their cycle.
const SETTLED_TOLERANCE: f64 = 1e-4;

/// Relative distance within which a cycle counts as closed after fewer periods.
const CLOSING_TOLERANCE: f64 = 1e-6;

/// Number of records that are first compared with one state of the catalogue. It is small because the first records
/// contain new cycles.
const FIRST_CHUNK: usize = 16;
/// Largest number of records that are compared with one state of the catalogue.
const LARGEST_CHUNK: usize = 1 << 16;

/// Motion that a record shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// The cycle with this index in the catalogue.
    Cycle(u32),
    /// A cycle of this period that Newton's method does not find.
    Unresolved(u32),
    Chaos,
    Torus,
    Undecided,
    Failed,
}

/// A cycle with its units of displacement and velocity.
#[derive(Clone, Debug)]
pub(crate) struct ScaledCycle {
    pub(crate) cycle: StrobeCycle,
    pub(crate) units: [f64; 2],
}

/// Known cycles of one oscillator.
#[derive(Clone, Debug)]
pub(crate) struct Catalogue {
    contact_free: Option<NonImpacting>,
    cycles: Vec<ScaledCycle>,
    /// Strobe states with the index of their cycle, sorted by the first displacement.
    points: Vec<(State, u32)>,
    /// The largest unit of displacement.
    largest_unit: f64,
    /// Index of the contact-free cycle.
    free: Option<u32>,
}

impl Catalogue {
    /// Begins an empty catalogue for an oscillator.
    pub(crate) fn of(flow: &Flow) -> Catalogue {
        // If a degree of freedom is at rest, there are many contact-free motions.
        let contact_free = flow.non_impacting().filter(|free| free.resting().is_none()).cloned();
        Catalogue { contact_free, cycles: Vec::new(), points: Vec::new(), largest_unit: 0.0, free: None }
    }

    pub(crate) fn cycles(&self) -> &[ScaledCycle] {
        &self.cycles
    }

    /// Identifies the motions of `count` records and adds new cycles to the catalogue. `record` returns a record by
    /// index.
    pub(crate) fn learn(
        &mut self,
        flow: &Flow,
        law: Law,
        count: usize,
        record: impl Fn(usize) -> Record + Sync,
    ) -> Vec<Outcome> {
        let mut all = Vec::with_capacity(count);
        let mut size = if self.cycles.is_empty() { FIRST_CHUNK } else { LARGEST_CHUNK };
        while all.len() < count {
            let block = all.len()..count.min(all.len() + size);
            size = (2 * size).min(LARGEST_CHUNK);
            let known = &*self;
            let identify = |nth: usize| {
                let record = &record(nth);
                let new = |period| (period, known.refined(flow, law, record, period));
                known.identify(record).map_err(new)
            };
            let identified: Vec<_> = block.into_par_iter().map(identify).collect();
            all.extend(identified.into_iter().map(|identified| match identified {
                Ok(found) => found,
                Err((_, Some(cycle))) => Outcome::Cycle(self.add(flow, cycle)),
                Err((period, None)) => Outcome::Unresolved(period),
            }));
        }
        all
    }

    /// Identifies the motions of records as [`Catalogue::learn`] does. Records whose cycle Newton's method does not find get the nearest
    /// one, or add their own motion as a cycle.
    pub(crate) fn learn_all(
        &mut self,
        flow: &Flow,
        law: Law,
        count: usize,
        record: impl Fn(usize) -> Record + Sync,
    ) -> Vec<Outcome> {
        let mut all = self.learn(flow, law, count, &record);
        for (nth, found) in all.iter_mut().enumerate() {
            if let Outcome::Unresolved(period) = *found {
                let state = record(nth).strobe();
                *found = Outcome::Cycle(match self.nearest(&state, period) {
                    Some(known) => known,
                    None => self.add(flow, StrobeCycle::through(flow, law, state, period)),
                });
            }
        }
        all
    }

    /// Identifies the motion of a record from known cycles; the error is the period of an unknown cycle.
    fn identify(&self, record: &Record) -> Result<Outcome, u32> {
        match classify(record) {
            Class::Failed => Ok(Outcome::Failed),
            Class::Undecided => Ok(Outcome::Undecided),
            Class::Chaotic => Ok(Outcome::Chaos),
            Class::QuasiPeriodic => Ok(Outcome::Torus),
            Class::Periodic { .. } if !record.strobe().iter().all(|x| x.is_finite()) => {
                Ok(Outcome::Undecided)
            }
            Class::Periodic { period } => {
                let free = self.free.filter(|_| self.is_contact_free(&record.strobe()));
                free.or_else(|| self.within(SETTLED_TOLERANCE, &record.strobe(), period))
                    .map(Outcome::Cycle)
                    .ok_or(period)
            }
        }
    }

    /// Returns the cycle nearest to a state, if its relative distance is below `bar`.
    fn within(&self, bar: f64, state: &State, period: u32) -> Option<u32> {
        let largest_unit = bar * self.largest_unit;
        let from = self.points.partition_point(|(point, _)| point[0] < state[0] - largest_unit);
        let near = self.points[from..].iter().take_while(|(point, _)| point[0] <= state[0] + largest_unit);
        let related = near.filter(|(_, nth)| self.cycles[*nth as usize].cycle.is_related(period));
        let apart =
            related.map(|(point, nth)| (distance(self.cycles[*nth as usize].units, point, state), *nth));
        let nearest = apart.filter(|(apart, _)| *apart < bar).min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.map(|(_, nth)| nth)
    }

    /// Returns the cycle nearest to a state of a slow approach, within [`CYCLE_TOLERANCE`].
    pub(crate) fn nearest(&self, state: &State, period: u32) -> Option<u32> {
        self.free
            .filter(|_| self.is_contact_free(state))
            .or_else(|| self.within(CYCLE_TOLERANCE, state, period))
    }

    /// Returns the cycle that a record approaches, with its smallest period.
    fn refined(&self, flow: &Flow, law: Law, record: &Record, period: u32) -> Option<StrobeCycle> {
        if self.is_contact_free(&record.strobe()) {
            let steady = self.contact_free.as_ref()?.steady();
            return Some(StrobeCycle::through(flow, law, steady, 1));
        }
        let cycle = StrobeCycle::refined(flow, law, record.strobe(), period)?;
        let units = cycle.units(flow);
        let closes = |turn: &u32| {
            let later = cycle.points.get(*turn as usize);
            period.is_multiple_of(*turn)
                && later.is_some_and(|later| distance(units, &cycle.points[0], later) < CLOSING_TOLERANCE)
        };
        let turn = (1..period).find(closes).unwrap_or(period);
        let short = |mut states: Vec<State>| {
            states.truncate(turn as usize);
            states
        };
        Some(StrobeCycle { period: turn, points: short(cycle.points), halves: short(cycle.halves), ..cycle })
    }

    /// Whether a state is certain to lead to contact-free motion.
    fn is_contact_free(&self, state: &State) -> bool {
        self.contact_free.as_ref().is_some_and(|free| free.is_certain(*state))
    }

    /// Returns the index of a cycle, after adding it if it is new.
    fn add(&mut self, flow: &Flow, cycle: StrobeCycle) -> u32 {
        if let Some(known) = self.place(flow, &cycle) {
            return known;
        }
        let (nth, units) = (self.cycles.len() as u32, cycle.units(flow));
        self.largest_unit = self.largest_unit.max(units[0]);
        self.points.extend(cycle.points.iter().map(|point| (*point, nth)));
        self.points.sort_by(|(a, _), (b, _)| a[0].total_cmp(&b[0]));
        if cycle.is_non_impacting {
            self.free.get_or_insert(nth);
        }
        self.cycles.push(ScaledCycle { cycle, units });
        nth
    }

    fn place(&self, flow: &Flow, cycle: &StrobeCycle) -> Option<u32> {
        if let Some(free) = self.free.filter(|_| cycle.is_non_impacting) {
            return Some(free);
        }
        // A cycle with an event at phase 0 has two states there, so states half a period later are compared, too.
        let halves = || {
            let units = cycle.units(flow);
            let half = cycle.halves.first()?;
            let meets = |known: &ScaledCycle| {
                let is_met = |other: &State| distance(units, other, half) < SETTLED_TOLERANCE;
                known.cycle.is_related(cycle.period) && known.cycle.halves.iter().any(is_met)
            };
            self.cycles.iter().position(meets).map(|nth| nth as u32)
        };
        self.within(SETTLED_TOLERANCE, &cycle.points[0], cycle.period).or_else(halves)
    }
}

/// Identifies the motions of the records `ids`, and returns the catalogue of their cycles.
pub(crate) fn learn(
    flow: &Flow,
    law: Law,
    records: &(impl Records + ?Sized),
    ids: &[usize],
) -> (Catalogue, Vec<Outcome>) {
    let mut catalogue = Catalogue::of(flow);
    let all = catalogue.learn_all(flow, law, ids.len(), |nth| records.record(ids[nth]));
    (catalogue, all)
}
