//! Lanes whose cycle has an event at phase 0 run a second time, from their last state, and compare states at a phase far
//! from events.

use rayon::prelude::*;

use crate::gpu::{Gpu, GpuError, Lane, LaneSettings, has_sine, rules};
use crate::record::Record;
use crate::record::classify::{classify, status};
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Law, Oscillator};
use rattlemap_dynamics::orbit::{Class, Section, Status};
use rattlemap_dynamics::reference::Allowance;

/// Largest number of lanes that run a second time together.
const BATCH: usize = 4096;

/// Distance from phase 0 within which the strobe is taken after an event, in units of [`rules::on_strobe`]: lanes round
/// at every step.
const STROBE_TOLERANCES: f64 = 16.0;

/// Runs the lanes of these records a second time if an event lies at phase 0, and replaces the records whose period the
/// second run confirms. `of` returns oscillator and law of a record's number.
///
/// # Errors
/// [`GpuError`] if the device fails or is halted. Then the records of such lanes must not be used.
pub(crate) async fn compare_at_sections(
    gpu: &mut Gpu,
    records: &mut [(u32, Record)],
    of: impl Fn(u32) -> (Oscillator, Law) + Sync,
    settings: &LaneSettings,
) -> Result<(), GpuError> {
    let section = |(place, (number, record)): (usize, &(u32, Record))| {
        let Class::Periodic { period } = classify(record) else { return None };
        let (oscillator, law) = is_on_strobe(record).then(|| of(*number))?;
        let flow = Flow::new(&oscillator);
        let section = Section::of(&flow, law, record.strobe, period, Allowance::UNLIMITED)?;
        Some((place, section, law))
    };
    let sections: Vec<_> = records.par_iter().enumerate().filter_map(section).collect();
    // A shader that adds a sine to the force may round differently, so these lanes run apart from the others.
    let (with_sine, others): (Vec<_>, Vec<_>) =
        sections.into_iter().partition(|(_, section, _)| has_sine(&section.flow.oscillator));
    let tolerance = STROBE_TOLERANCES * rules::on_strobe(gpu.precision());
    for batch in others.chunks(BATCH).chain(with_sine.chunks(BATCH)) {
        let flows: Vec<_> = batch.iter().map(|(_, section, _)| section.flow.oscillator).collect();
        let laws: Vec<_> = batch.iter().map(|(_, _, law)| *law).collect();
        let lane = |(i, (_, section, _)): (usize, &(usize, Section, Law))| Lane {
            flow: i as u32,
            law: i as u32,
            start: section.start,
        };
        let lanes: Vec<_> = batch.iter().enumerate().map(lane).collect();
        let settings = LaneSettings { sine: settings.sine || flows.iter().any(has_sine), ..*settings };
        let again = gpu.run(&flows, &laws, &lanes, &settings).await?;
        for ((place, section, law), mut second) in batch.iter().zip(again) {
            let strobe = section.strobe(*law, second.strobe, tolerance);
            let (true, Some((strobe, _))) = (matches!(classify(&second), Class::Periodic { .. }), strobe)
            else {
                continue;
            };
            second.turn_harmonics(|phase| section.harmonic_phase(phase));
            let first = &mut records[*place].1;
            *first = Record { strobe, periods_run: first.periods_run, ..second };
        }
    }
    Ok(())
}

/// Whether an event of the record's cycle lies at phase 0.
pub(crate) fn is_on_strobe(record: &Record) -> bool {
    status(record) == Status::StrobeOnEvent
}
