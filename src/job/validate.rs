//! Validates a finished map: computes a sample of its cells again and compares them.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use crate::gpu::{AdapterChoice, Gpu, Precision, describe, is_hardware};
use crate::job::check::CheckedFolder;
use crate::job::error::JobError;
use crate::job::finished::{self, LoadedMap};
use crate::job::observer::Observer;
use crate::job::processor;
use crate::map::plan::Plan;
use crate::map::scene::Scene;
use crate::show::cells::Survey;
use crate::show::validation::Validated;
use crate::store::finished_map::{FinishedMap, StoredManifest};
use crate::store::folder::Folder;
use crate::store::map::{self, MANIFEST, VALIDATION};
use crate::store::record_file::Identity;
use crate::validate::{self, Field, Judge, Kind, Lanes, Sample, Subject, Validation, Value};

/// Largest number of cells that the message of a failed validation names; [`VALIDATION`] lists all.
const NAMED_CELLS: usize = 8;

/// A finished map whose sample is to be computed again.
pub struct ValidateJob {
    folder: Folder,
    map: FinishedMap,
    scene: Scene,
    loaded: LoadedMap,
    survey: Survey,
    precision: Precision,
    sample: Sample,
    checked: CheckedFolder,
    /// Chaotic runs to follow, the number of chaotic runs, and the further periods.
    chaos: (Vec<u32>, usize, u32),
    /// This machine's processor.
    processor: String,
}

/// Cells of the sample that were computed again as lanes.
pub struct SampleLanes {
    lanes: Lanes,
    /// Why the map's own device did not run its lanes again.
    not_own: Option<String>,
}

impl ValidateJob {
    /// Locks the folder, reads the map, and draws a sample of its cells with a seed, and chaotic cells that are followed for
    /// `chaos_periods` further periods; none if that is 0. Damaged and unknown files are reported to the observer.
    ///
    /// # Errors
    /// [`JobError`] if the folder is not that of a finished map of this version, or the map cannot be read.
    pub fn open(
        dir: &Path,
        samples: usize,
        seed: u64,
        chaos_periods: u32,
        observer: &dyn Observer,
    ) -> Result<ValidateJob, JobError> {
        finished::require_folder(dir)?;
        // The lock comes first: another run must not replace the map between reading and writing.
        let folder = Folder::open(dir, true)?;
        folder.prepare(map::names())?;
        let map = FinishedMap::open_own(dir)?;
        let checked = CheckedFolder::of(dir, "map", &map.manifest().files)?;
        for finding in checked.findings() {
            let text = format!("{}: {finding}", dir.display());
            if finding.is_lost() { observer.warn(&text) } else { observer.note(&text) }
        }
        let scene = finished::scene(&map)?;
        let mut loaded = LoadedMap::read(&map, &scene, observer)?;
        let precision = precision(map.manifest())?;
        let survey = loaded.survey();
        let sample = validate::sample(&loaded.plan, &loaded.stored.records, samples, seed);
        let followed = if chaos_periods > 0 { samples } else { 0 };
        let (ids, runs) = validate::draw_chaos(&loaded.stored.records, followed, seed);
        let chaos = (ids, runs, chaos_periods);
        let processor = processor::described();
        Ok(ValidateJob { folder, map, scene, loaded, survey, precision, sample, chaos, checked, processor })
    }

    /// The locked folder.
    pub fn folder(&self) -> &Folder {
        &self.folder
    }

    /// Number of cells in the sample.
    pub fn sample_count(&self) -> usize {
        self.sample.ids().len()
    }

    /// Number of chaotic cells that are followed.
    pub fn followed_count(&self) -> usize {
        self.chaos.0.len()
    }

    fn subject(&self) -> Subject<'_> {
        Subject {
            plan: &self.loaded.plan,
            records: &self.loaded.stored.records,
            precision: self.precision,
            is_lane: self.map.manifest().engine == "gpu",
        }
    }

    /// Computes the sample's lanes again: on the device that made the map, else on the best adapter. They also run in f64 with
    /// [`Judge::Lanes`] if an adapter has it, and never with [`Judge::Independent`]; by default if a lane computed the map or the adapter is
    /// hardware. The observer is told what begins. `halt` has no effect while a driver compiles.
    ///
    /// # Errors
    /// [`JobError::Failed`] if a device fails.
    pub fn run_lanes(
        &self,
        judge: Option<Judge>,
        observer: &dyn Observer,
        halt: &Arc<AtomicBool>,
    ) -> Result<SampleLanes, JobError> {
        let subject = self.subject();
        let open =
            |precision: Precision, choice: &AdapterChoice| pollster::block_on(Gpu::open(precision, choice));
        let (own, any) = (AdapterChoice::named(&self.map.manifest().device), AdapterChoice::default());
        let (mut gpu, not_own) = match subject.is_lane.then(|| open(subject.precision, &own)) {
            None => (None, None),
            Some(Ok(gpu)) => (Some(gpu), None),
            Some(Err(why)) => match open(subject.precision, &any) {
                Ok(gpu) => (Some(gpu), Some(why.to_string())),
                Err(_) => (None, Some(why.to_string())),
            },
        };
        let is_double = subject.is_lane && subject.precision == Precision::F64;
        let mut double = match is_double {
            true => None,
            // The ODE solver is the second judge then.
            false if subject.plan.needs_reference() => None,
            // Lanes in f64 show which differences of lanes are rounding.
            false if judge == Some(Judge::Independent) && !subject.is_lane => None,
            // A software driver takes minutes to compile shaders, longer than the solver needs for a sample.
            false => {
                let is_quick = |gpu: &Gpu| judge.is_some() || subject.is_lane || is_hardware(gpu.adapter());
                open(Precision::F64, &own).or_else(|_| open(Precision::F64, &any)).ok().filter(is_quick)
            }
        };
        if judge == Some(Judge::Lanes) && double.is_none() && !is_double {
            let why = match subject.plan.needs_reference() {
                true => "lanes cannot compute this model",
                false => "no graphics adapter computes in f64",
            };
            return Err(JobError::Usage(format!("--judge lanes: {why}; use --judge solver")));
        }
        for gpu in gpu.iter().chain(&double) {
            let wait = match is_hardware(gpu.adapter()) {
                true => "",
                false => "; its driver may compile shaders for minutes, which Ctrl-C does not interrupt",
            };
            observer.note(&format!(
                "lanes in {} run on {}{wait}",
                gpu.precision().name(),
                describe(gpu.adapter())
            ));
        }
        gpu.iter_mut().chain(&mut double).for_each(|gpu| gpu.stop_on(halt));
        let lanes =
            pollster::block_on(Lanes::run(&subject, &self.sample, gpu.as_mut(), double.as_mut(), &|phase| {
                observer.note(phase)
            }));
        let lanes = lanes
            .map_err(|error| JobError::Failed(format!("cannot compute the sample's lanes again: {error}")))?;
        Ok(SampleLanes { lanes, not_own })
    }

    /// Replays the sample without early stops, compares it with the map, and follows chaotic cells. `report` receives the number
    /// of cells that are done, up to [`ValidateJob::sample_count`] and [`ValidateJob::followed_count`] together. Returns none if `halt` was raised before the last one.
    pub fn replay(
        &self,
        lanes: &SampleLanes,
        report: &(impl Fn(usize) + Sync),
        halt: &AtomicBool,
    ) -> Option<Validation> {
        let (basins, subject) = (self.survey.basins(), self.subject());
        let StoredManifest { sources, target, .. } = self.map.manifest();
        let is_exact =
            !subject.is_lane && sources == Identity::own_sources() && target == Identity::own_target();
        let validation =
            validate::replay_until(&subject, basins, is_exact, &self.sample, &lanes.lanes, report, halt)?;
        let (ids, runs, periods) = &self.chaos;
        let done = Mutex::new(self.sample_count());
        let one_more = || {
            let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
            *done += 1;
            report(*done);
        };
        let follow = || validate::follow_chaos(&subject, (ids, *runs), *periods, &one_more, halt);
        let chaos_ends = (*periods > 0).then(follow);
        (!halt.load(Ordering::Relaxed)).then_some(Validation { chaos_ends, ..validation })
    }

    /// Returns the validation with the devices that took part.
    pub fn validated<'a>(&'a self, lanes: &'a SampleLanes, validation: &'a Validation) -> Validated<'a> {
        let manifest = self.map.manifest();
        Validated {
            validation,
            made: manifest.provenance(),
            processors: [&manifest.processor, &self.processor],
            own_lanes: lanes.lanes.device.as_deref(),
            not_own: lanes.not_own.as_deref(),
            double_lanes: lanes.lanes.double_device.as_deref(),
        }
    }

    /// Writes [`VALIDATION`] and its section of the report. Returns the files' names.
    ///
    /// # Errors
    /// [`JobError::Output`] if a file cannot be written.
    pub fn write(&self, validated: &Validated<'_>, elapsed: Duration) -> Result<Vec<&'static str>, JobError> {
        let cells = self.loaded.cells(&self.scene, &self.survey);
        Ok(map::write_validation(&self.folder, &cells, validated, elapsed)?)
    }

    /// Checks that the map is valid, and that no file of the folder is damaged or missing, except the `written` ones.
    ///
    /// # Errors
    /// [`JobError::Failed`].
    pub fn require_valid(&self, validation: &Validation, written: &[&str]) -> Result<(), JobError> {
        verdict(self.folder.path(), &self.loaded.plan, validation)?;
        self.checked.require_good(written, false)
    }
}

fn precision(manifest: &StoredManifest) -> Result<Precision, JobError> {
    match (manifest.engine.as_str(), manifest.precision.as_str()) {
        ("cpu" | "gpu", "f64") => Ok(Precision::F64),
        ("gpu", "f32") => Ok(Precision::F32),
        (engine, precision) => {
            Err(JobError::Usage(format!("{MANIFEST}: no engine `{engine}` computes in `{precision}`")))
        }
    }
}

fn verdict(dir: &Path, plan: &Plan, validation: &Validation) -> Result<(), JobError> {
    let faults = validation.faults();
    if faults.is_empty() {
        return Ok(());
    }
    let unexplained = validation.mismatches.iter().filter(|mismatch| mismatch.kind == Kind::Unexplained);
    let mut ids: Vec<u32> =
        unexplained.map(|mismatch| mismatch.id).chain(validation.not_finite.clone()).collect();
    ids.sort_unstable();
    ids.dedup();
    let more = if ids.len() > NAMED_CELLS { ", ..." } else { "" };
    let name = |id: u32| {
        let [i, j] = plan.indices(id);
        if plan.is_list() { i.to_string() } else { format!("({i}, {j})") }
    };
    let named: Vec<String> = ids.into_iter().take(NAMED_CELLS).map(name).collect();
    let cells = match named.is_empty() {
        true => String::new(),
        false => format!("; all such cells: {}{more}", named.join(" ")),
    };
    Err(JobError::Failed(format!(
        "do not trust this map: {}{cells}; {} lists them, each with the command that replays it{}",
        faults.join("; "),
        dir.join(VALIDATION).display(),
        remedy(plan, validation)
    )))
}

/// Returns what may mend the map, by the classes and statuses of its wrong cells.
fn remedy(plan: &Plan, validation: &Validation) -> String {
    let unexplained = validation.mismatches.iter().filter(|mismatch| mismatch.kind == Kind::Unexplained);
    let differences = unexplained.flat_map(|mismatch| &mismatch.differences);
    let told = differences.filter(|difference| [Field::CLASS, Field::STATUS].contains(&difference.field));
    let told: Vec<&Value> = told.map(|difference| &difference.record).collect();
    let is = |value: &str| told.iter().any(|told| **told == Value::Text(value.to_owned()));
    let budget = plan.budget();
    let mut remedies = Vec::new();
    if budget.early_stop && (is("chaotic") || is("quasi-periodic")) {
        remedies.push("`integration.early_stop = false` if motion without a period was decided too early");
    }
    if is("chaotic") && budget.confirm_chaos == 0 {
        remedies
            .push("`integration.confirm_chaos = 6000` if chaos that ends late was taken for lasting chaos");
    }
    if ["too_stiff", "cap_events"].into_iter().any(is) {
        remedies.push(
            "a larger mesh_speed, or softer springs, if cells end with the status too_stiff or cap_events",
        );
    }
    if remedies.is_empty() { String::new() } else { format!(". Try {}", remedies.join(", or ")) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::scene::Purpose;
    use crate::record::{Record, valid};

    /// All cells of the map are filled, so none can be replayed.
    #[test]
    fn a_validation_without_replayed_cells_fails() {
        let axis = |name: &str| format!("[[axis]]\nparameter = '{name}'\nmin = 0.5\nmax = 1\ncount = 2\n");
        let text = ["e", "omega"].map(axis).concat();
        let plan = Plan::new(&Scene::parse(&text, "s", &[], Purpose::Map).unwrap());
        let records = vec![Record { valid: valid::FILLED, ..Record::default() }; 4];
        let subject = Subject { plan: &plan, records: &records, precision: Precision::F64, is_lane: true };
        let sample = validate::sample(&plan, &records, 4, 1);
        let validation = validate::replay(&subject, &sample, &Lanes::default(), &|_| {});
        let error = verdict(Path::new("o"), &plan, &validation).unwrap_err();
        assert!(
            !error.is_usage()
                && error.to_string().starts_with("do not trust this map: none of 4 cells was compared"),
            "{error}"
        );
    }
}
