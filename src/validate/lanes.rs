//! Computes the lanes of a sample again on a device.

use std::collections::HashMap;

use rayon::prelude::*;

use super::Subject;
use super::sample::Sample;
use super::states::HORIZON;
use crate::gpu::{self, Features, Gpu, GpuError, LaneSettings};
use crate::map::engine::{Completion, Ended, lane_settings, renumbered};
use crate::map::plan::{Cell, Plan};
use crate::record::{Record, Records, valid};
use rattlemap_dynamics::model::State;
use rattlemap_dynamics::orbit::{Budget, Status};

/// Results of lanes that were computed again; empty without a device.
#[derive(Clone, Debug, Default)]
pub struct Lanes {
    /// The device that computed the map's lanes again. Only for maps that lanes computed.
    pub device: Option<String>,
    /// The device that computed lanes in double precision for comparison.
    pub double_device: Option<String>,
    /// Records with the map's settings, by run. Only for maps that lanes computed.
    again: HashMap<u32, Record>,
    /// Records without early stops, by run. Only if there are lanes in double precision to compare with.
    whole: HashMap<u32, Record>,
    /// Records in double precision without early stops, by run. Records in single precision and of the reference are compared with them.
    double: HashMap<u32, Record>,
    /// States after [`HORIZON`] periods by run; none for a lane that failed.
    states: Vec<(u32, Option<State>)>,
}

impl Lanes {
    /// Computes the lanes of a sample again. `single` is a device in the map's precision; none for a map of the reference. `double` is a
    /// device in f64, if the adapter supports it. `phase` receives what begins.
    ///
    /// # Errors
    /// [`GpuError`] if a device fails.
    pub async fn run(
        subject: &Subject<'_>,
        sample: &Sample,
        single: Option<&mut Gpu>,
        double: Option<&mut Gpu>,
        phase: &dyn Fn(&str),
    ) -> Result<Lanes, GpuError> {
        let Subject { plan, records, .. } = *subject;
        let ids = sample.ids();
        let own = lane_settings(plan);
        let whole = LaneSettings { early_stop: false, ..own };
        let brief = LaneSettings { steps_per_period: whole.steps_per_period, ..LaneSettings::only(HORIZON) };
        let mut lanes = Lanes::default();
        if let Some(gpu) = single {
            lanes.device = Some(gpu::describe(gpu.adapter()));
            let as_in_map = LaneSettings { hands_over: Completion::hands_over(plan.budget()), ..own };
            phase(&format!("running {} lanes again, as in the map", ids.len()));
            let again = run_lanes(gpu, plan, records, &ids, &as_in_map).await?;
            lanes.again = ids.iter().copied().zip(again).collect();
            if double.is_some() {
                phase(&format!("running the same {} lanes without early stops", ids.len()));
                let records = run_lanes(gpu, plan, records, &ids, &whole).await?;
                lanes.whole = ids.iter().copied().zip(records).collect();
            }
            lanes.states = states(gpu, subject, &sample.states, &brief).await?;
        }
        if let Some(gpu) = double {
            lanes.double_device = Some(gpu::describe(gpu.adapter()));
            let by_reference = |id: &u32| records.record(*id as usize).valid & valid::BY_REFERENCE != 0;
            let (finished, others): (Vec<u32>, Vec<u32>) = ids.iter().copied().partition(by_reference);
            // The lane of a cell that the reference finished was undecided after the usual periods.
            let budget = all_periods(plan.budget());
            let periods = budget.periods();
            let longer =
                LaneSettings { periods, transient_periods: budget.settings.transient_periods, ..whole };
            phase(&format!("running {} lanes in f64", ids.len()));
            for (ids, settings) in [(others, &whole), (finished, &longer)] {
                let records = run_lanes(gpu, plan, records, &ids, settings).await?;
                lanes.double.extend(ids.into_iter().zip(records));
            }
            if lanes.states.is_empty() {
                lanes.states = states(gpu, subject, &sample.states, &brief).await?;
            }
        }
        Ok(lanes)
    }

    pub(super) fn again(&self, id: u32) -> Option<&Record> {
        self.again.get(&id)
    }

    pub(super) fn whole(&self, id: u32) -> Option<&Record> {
        self.whole.get(&id)
    }

    /// Returns the record of a lane in double precision, unless the reference has finished it.
    pub(super) fn double(&self, id: u32) -> Option<&Record> {
        self.double.get(&id).filter(|record| record.valid & valid::BY_REFERENCE == 0)
    }

    pub(super) fn states(&self) -> &[(u32, Option<State>)] {
        &self.states
    }

    /// Whether there are lanes in double precision.
    pub(super) fn has_double(&self) -> bool {
        !self.double.is_empty()
    }
}

async fn states(
    gpu: &mut Gpu,
    subject: &Subject<'_>,
    ids: &[u32],
    settings: &LaneSettings,
) -> Result<Vec<(u32, Option<State>)>, GpuError> {
    let records = run_lanes(gpu, subject.plan, subject.records, ids, settings).await?;
    let state = |record: &Record| (record.status == Status::Ok.code()).then_some(record.strobe());
    Ok(ids.iter().copied().zip(records.iter().map(state)).collect())
}

/// Computes runs of a plan on lanes and returns one record per id. `records` are as for [`Plan::start`].
///
/// # Errors
/// [`GpuError`] if the device fails.
pub async fn run_lanes(
    gpu: &mut Gpu,
    plan: &Plan,
    records: &dyn Records,
    ids: &[u32],
    settings: &LaneSettings,
) -> Result<Vec<Record>, GpuError> {
    if ids.is_empty() {
        return Ok(Vec::new());
    }
    let started = |&id: &u32| Cell { start: plan.start(id, records), ..plan.cell(id) };
    let cells: Vec<_> = ids.iter().rev().map(started).collect();
    let (flows, laws, lanes) = renumbered(&cells);
    let flows: Vec<_> = flows.iter().map(|&flow| plan.form(flow)).collect();
    let laws: Vec<_> = laws.iter().map(|&law| plan.law(law)).collect();
    let settings = &LaneSettings {
        features: flows.iter().map(Features::of).fold(settings.features, Features::and),
        ..*settings
    };
    let records = gpu.run(&flows, &laws, &lanes, settings).await?;
    let completion = Completion::of(plan, settings.early_stop, gpu.halt());
    let completed = (0..lanes.len()).into_par_iter().zip(records).map(|(i, record)| {
        let lane = &lanes[i];
        let (form, law) = (flows[lane.flow as usize].clone(), laws[lane.law as usize]);
        completion.completed(Ended { record, form, law })
    });
    completed.collect::<Option<Vec<_>>>().ok_or(GpuError::Halted)
}

/// Returns the budget of a cell that stays undecided, as one span.
pub(super) fn all_periods(budget: &Budget) -> Budget {
    let mut all = *budget;
    all.settings.transient_periods =
        budget.settings.transient_periods.saturating_add(budget.undecided_periods);
    all.undecided_periods = 0;
    all
}
