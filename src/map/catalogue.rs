//! The cycles of one oscillator, as records show them one after the other.
//!
//! A record that lies within [`NEAR`] of a known cycle is on it. From any other Newton's method finds the cycle that it was
//! on its way to; cycles as near to each other as that are one. So what is told the same does not depend on which
//! record came first.

use rayon::prelude::*;

use crate::map::cycle::{SAME, Seen, distance};
use crate::record::classify::classify;
use crate::record::{Record, Records};
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Law, NonImpacting, State};
use rattlemap_dynamics::orbit::Class;

/// States this close, relative to the motion's size, lie on one cycle without a question: lanes in single precision
/// are nearer to theirs where they have settled.
const NEAR: f64 = 1e-4;

/// A refined cycle that comes back to itself within this is one of fewer periods.
const CLOSED: f64 = 1e-6;

/// Records that are compared with the same catalogue, at first: few, since what they show has to be found.
const FIRST_BLOCK: usize = 16;
/// And at most.
const LARGEST_BLOCK: usize = 1 << 16;

/// What a record shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Found {
    /// The cycle at this place of the catalogue.
    Cycle(u32),
    /// A cycle of so many periods that Newton's method does not find.
    Unresolved(u32),
    Chaos,
    Undecided,
    Failed,
}

/// A cycle, and what distances to it are relative to.
#[derive(Clone, Debug)]
pub(crate) struct Cycle {
    pub(crate) seen: Seen,
    pub(crate) units: [f64; 2],
}

/// The cycles that are known.
#[derive(Clone, Debug)]
pub(crate) struct Catalogue {
    contact_free: Option<NonImpacting>,
    cycles: Vec<Cycle>,
    /// Strobe states with the cycle that each is on, by the first displacement.
    points: Vec<(State, u32)>,
    /// The largest unit of displacement.
    reach: f64,
    /// The contact-free one.
    free: Option<u32>,
}

impl Catalogue {
    /// None yet of an oscillator.
    pub(crate) fn of(flow: &Flow) -> Catalogue {
        // Beside a degree of freedom at rest it is one of many motions.
        let contact_free = flow.non_impacting().filter(|free| free.resting().is_none()).cloned();
        Catalogue { contact_free, cycles: Vec::new(), points: Vec::new(), reach: 0.0, free: None }
    }

    pub(crate) fn cycles(&self) -> &[Cycle] {
        &self.cycles
    }

    /// What so many records show, one after the other, by their place; they may show cycles that were not known.
    pub(crate) fn learn(
        &mut self,
        flow: &Flow,
        law: Law,
        count: usize,
        record: impl Fn(usize) -> Record + Sync,
    ) -> Vec<Found> {
        let mut all = Vec::with_capacity(count);
        let mut size = if self.cycles.is_empty() { FIRST_BLOCK } else { LARGEST_BLOCK };
        while all.len() < count {
            let block = all.len()..count.min(all.len() + size);
            size = (2 * size).min(LARGEST_BLOCK);
            let known = &*self;
            let look = |nth: usize| {
                let record = &record(nth);
                let new = |period| (period, known.refined(flow, law, record, period));
                known.look(record).map_err(new)
            };
            let looked: Vec<_> = block.into_par_iter().map(look).collect();
            all.extend(looked.into_iter().map(|looked| match looked {
                Ok(found) => found,
                Err((_, Some(seen))) => Found::Cycle(self.add(flow, seen)),
                Err((period, None)) => Found::Unresolved(period),
            }));
        }
        all
    }

    /// What a record shows as far as it is known; else its period.
    fn look(&self, record: &Record) -> Result<Found, u32> {
        match classify(record) {
            Class::Failed => Ok(Found::Failed),
            Class::Undecided => Ok(Found::Undecided),
            Class::Chaotic => Ok(Found::Chaos),
            Class::Periodic { .. } if !record.strobe.iter().all(|x| x.is_finite()) => Ok(Found::Undecided),
            Class::Periodic { period } => {
                let free = self.free.filter(|_| self.is_contact_free(&record.strobe));
                free.or_else(|| self.within(NEAR, &record.strobe, period)).map(Found::Cycle).ok_or(period)
            }
        }
    }

    /// The cycle that comes nearest to a state, if it comes within `bar` of it.
    fn within(&self, bar: f64, state: &State, period: u32) -> Option<u32> {
        let reach = bar * self.reach;
        let from = self.points.partition_point(|(point, _)| point[0] < state[0] - reach);
        let near = self.points[from..].iter().take_while(|(point, _)| point[0] <= state[0] + reach);
        let related = near.filter(|(_, nth)| self.cycles[*nth as usize].seen.is_related(period));
        let apart =
            related.map(|(point, nth)| (distance(self.cycles[*nth as usize].units, point, state), *nth));
        let nearest = apart.filter(|(apart, _)| *apart < bar).min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.map(|(_, nth)| nth)
    }

    /// The cycle that a state of a slow approach belongs to.
    pub(crate) fn nearest(&self, state: &State, period: u32) -> Option<u32> {
        self.free.filter(|_| self.is_contact_free(state)).or_else(|| self.within(SAME, state, period))
    }

    /// The cycle that a record was on its way to, in as few periods as it closes in.
    fn refined(&self, flow: &Flow, law: Law, record: &Record, period: u32) -> Option<Seen> {
        if self.is_contact_free(&record.strobe) {
            let steady = self.contact_free.as_ref()?.steady();
            return Some(Seen::through(flow, law, steady, 1));
        }
        let seen = Seen::refined(flow, law, record.strobe, period)?;
        let units = seen.units(flow);
        let closes = |turn: &u32| {
            let later = seen.points.get(*turn as usize);
            period.is_multiple_of(*turn)
                && later.is_some_and(|later| distance(units, &seen.points[0], later) < CLOSED)
        };
        let turn = (1..period).find(closes).unwrap_or(period);
        let short = |mut states: Vec<State>| {
            states.truncate(turn as usize);
            states
        };
        Some(Seen { period: turn, points: short(seen.points), halves: short(seen.halves), ..seen })
    }

    /// Whether a state certainly leads to contact-free motion.
    fn is_contact_free(&self, state: &State) -> bool {
        self.contact_free.as_ref().is_some_and(|free| free.is_certain(*state))
    }

    /// The place of a cycle, which may be known.
    fn add(&mut self, flow: &Flow, seen: Seen) -> u32 {
        if let Some(known) = self.place(flow, &seen) {
            return known;
        }
        let (nth, units) = (self.cycles.len() as u32, seen.units(flow));
        self.reach = self.reach.max(units[0]);
        self.points.extend(seen.points.iter().map(|point| (*point, nth)));
        self.points.sort_by(|(a, _), (b, _)| a[0].total_cmp(&b[0]));
        if seen.is_non_impacting {
            self.free.get_or_insert(nth);
        }
        self.cycles.push(Cycle { seen, units });
        nth
    }

    fn place(&self, flow: &Flow, seen: &Seen) -> Option<u32> {
        if let Some(free) = self.free.filter(|_| seen.is_non_impacting) {
            return Some(free);
        }
        // One that has an event at phase 0 has two states there.
        let halves = || {
            let units = seen.units(flow);
            let half = seen.halves.first()?;
            let meets = |cycle: &Cycle| {
                let is_met = |other: &State| distance(units, other, half) < NEAR;
                cycle.seen.is_related(seen.period) && cycle.seen.halves.iter().any(is_met)
            };
            self.cycles.iter().position(meets).map(|nth| nth as u32)
        };
        self.within(NEAR, &seen.points[0], seen.period).or_else(halves)
    }
}

/// What every one of these records shows, and the cycles that they are on.
pub(crate) fn learn(
    flow: &Flow,
    law: Law,
    records: &(impl Records + ?Sized),
    ids: &[usize],
) -> (Catalogue, Vec<Found>) {
    let mut catalogue = Catalogue::of(flow);
    let mut all = catalogue.learn(flow, law, ids.len(), |nth| records.record(ids[nth]));
    // What is left takes the nearest cycle, or is one of its own.
    for (found, &id) in all.iter_mut().zip(ids) {
        if let Found::Unresolved(period) = *found {
            let state = records.record(id).strobe;
            let known = catalogue.nearest(&state, period);
            *found = Found::Cycle(match known {
                Some(nth) => nth,
                None => catalogue.add(flow, Seen::through(flow, law, state, period)),
            });
        }
    }
    (catalogue, all)
}
