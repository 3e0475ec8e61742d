//! Completes the records of lanes. A lane with an event at phase 0 runs again from its last state, and its states are compared
//! at a phase far from events. The processor measures the motions of machines.

use rayon::prelude::*;

use crate::gpu::{Features, Gpu, GpuError, Lane, LaneSettings, rules};
use crate::record::classify::{classify, status};
use crate::record::{Record, valid};
use rattlemap_dynamics::model::{Form, Law};
use rattlemap_dynamics::motion::Allowance;
use rattlemap_dynamics::motion::Flow;
use rattlemap_dynamics::orbit::{Class, Section, Status, quantities_after};

/// Largest number of lanes that run a second time together.
const BATCH: usize = 4096;

/// The strobe is the state after an event that is so near to phase 0, in units of [`rules::on_strobe`]. Lanes round
/// at every step.
const STROBE_TOLERANCES: f64 = 16.0;

/// The second run of a lane.
struct SecondRun {
    /// Place of its record.
    place: usize,
    section: Section,
    law: Law,
    /// Features that its shader must have.
    features: Features,
}

/// Runs the lanes of these records a second time if an event lies at phase 0, and replaces the records for which
/// `replaces` holds. `of` returns oscillator and law of a record's number.
///
/// # Errors
/// [`GpuError`] if the device fails or is halted. Then the records of such lanes must not be used.
pub(crate) async fn compare_at_sections(
    gpu: &mut Gpu,
    records: &mut [(u32, Record)],
    of: impl Fn(u32) -> (Form, Law) + Sync,
    settings: &LaneSettings,
) -> Result<(), GpuError> {
    let section = |(place, (number, record)): (usize, &(u32, Record))| {
        let (oscillator, law) = is_on_strobe(record).then(|| of(*number))?;
        let period = if record.period > 0 { record.period } else { 2 };
        let flow = Flow::new(&oscillator);
        let section = Section::of(&flow, law, record.strobe(), period, Allowance::UNLIMITED)?;
        let features = settings.features.and(Features::of(section.flow.form()));
        Some(SecondRun { place, section, law, features })
    };
    let mut runs: Vec<_> = records.par_iter().enumerate().filter_map(section).collect();
    // A shader that adds a sine to the force may round differently, so these lanes run apart from the others.
    runs.sort_by_key(|run| run.features.sine);
    let tolerance = STROBE_TOLERANCES * rules::on_strobe(gpu.precision());
    // A lane that begins at rest on its cycle may find no recurrence that contracts: then the whole budget decides.
    for early_stop in [settings.early_stop, false] {
        let mut open = Vec::new();
        for batch in runs.chunk_by(|a, b| a.features == b.features).flat_map(|alike| alike.chunks(BATCH)) {
            let flows: Vec<_> = batch.iter().map(|run| run.section.flow.form()).collect();
            let laws: Vec<_> = batch.iter().map(|run| run.law).collect();
            let lanes = (0..).zip(batch).map(|(i, run)| Lane { flow: i, law: i, start: run.section.start });
            let settings = LaneSettings { features: batch[0].features, early_stop, ..*settings };
            let seconds = gpu.run(&flows, &laws, &lanes.collect::<Vec<_>>(), &settings).await?;
            for (run, mut second) in batch.iter().zip(seconds) {
                let first = &mut records[run.place].1;
                let strobe = run.section.strobe(run.law, second.strobe(), tolerance);
                let (Class::Periodic { .. }, Some((strobe, _))) = (classify(&second), strobe) else {
                    open.push(run.place);
                    continue;
                };
                if replaces(&second, first) {
                    second.turn_harmonics(|phase| run.section.harmonic_phase(phase));
                    *first = Record { strobe: strobe.into(), periods_run: first.periods_run, ..second };
                }
            }
        }
        runs.retain(|run| settings.early_stop && open.contains(&run.place));
    }
    records.iter_mut().for_each(|(_, record)| record.valid &= !valid::NEAR_STROBE);
    Ok(())
}

/// Measures the motions in which lanes of machines end, on the processor, if the settings ask for it. `of` returns oscillator and law of
/// a record's number.
pub(crate) fn measure_machines(
    records: &mut [(u32, Record)],
    of: impl Fn(u32) -> (Form, Law) + Sync,
    settings: &LaneSettings,
) {
    let (Some(measures), Some(_)) = (settings.measures, settings.features.machine) else { return };
    let allowance = Allowance { events: settings.most_events.into(), ..Allowance::UNLIMITED };
    records.par_iter_mut().for_each(|(number, record)| {
        let Some(strobe) = record.state().filter(|_| !status(record).is_failure()) else { return };
        let (oscillator, law) = of(*number);
        let periods = [record.period, measures.periods];
        let quantities = quantities_after(&Flow::new(&oscillator), law, strobe, periods, allowance);
        record.set_quantities(quantities.as_ref());
    });
}

/// Whether an event at phase 0 makes the record uncertain.
pub(crate) fn is_on_strobe(record: &Record) -> bool {
    status(record) == Status::StrobeOnEvent && record.period > 0 || record.valid & valid::NEAR_STROBE != 0
}

/// Whether a second record with a cycle replaces the first. A first one that only has `NEAR_STROBE` may be right.
fn replaces(second: &Record, first: &Record) -> bool {
    let is_shorter = first.period > second.period && first.period.is_multiple_of(second.period);
    first.period == 0 || is_shorter || status(first) == Status::StrobeOnEvent
}
