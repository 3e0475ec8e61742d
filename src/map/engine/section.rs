//! Lanes whose cycle has an event at phase 0 run a second time, from their last state, and compare states at a phase far
//! from events.

use rayon::prelude::*;

use crate::gpu::{Gpu, GpuError, Lane, LaneSettings, has_sine, rules};
use crate::record::classify::{classify, status};
use crate::record::{Record, valid};
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
        let (oscillator, law) = is_on_strobe(record).then(|| of(*number))?;
        let period = if record.period > 0 { record.period } else { 2 };
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
            if std::env::var("DBG").is_ok() {
                eprintln!(
                    "{:?} start {:?} second {:?} {:?} {} {:?}",
                    records[*place].1.strobe,
                    section.start,
                    second.period,
                    status(&second),
                    second.periods_run,
                    second.strobe
                );
            }
            let first = &mut records[*place].1;
            let strobe = section.strobe(*law, second.strobe, tolerance);
            let Some((strobe, _)) = strobe.filter(|_| replaces(&second, first)) else { continue };
            second.turn_harmonics(|phase| section.harmonic_phase(phase));
            *first = Record { strobe, periods_run: first.periods_run, ..second };
        }
    }
    records.iter_mut().for_each(|(_, record)| record.valid &= !valid::NEAR_STROBE);
    Ok(())
}

/// Whether an event at phase 0 makes the record uncertain.
pub(crate) fn is_on_strobe(record: &Record) -> bool {
    status(record) == Status::StrobeOnEvent && record.period > 0 || record.valid & valid::NEAR_STROBE != 0
}

/// Whether a second run replaces a record. The period of a record with the flag may be right.
fn replaces(second: &Record, first: &Record) -> bool {
    let is_flagged = first.valid & valid::NEAR_STROBE != 0;
    let is_shorter =
        first.period == 0 || first.period > second.period && first.period.is_multiple_of(second.period);
    matches!(classify(second), Class::Periodic { .. })
        && (is_shorter || !is_flagged || status(first) == Status::StrobeOnEvent)
}
