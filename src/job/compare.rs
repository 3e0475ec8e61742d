//! Compares two finished maps of the same cells.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::findings::coexistence;
use crate::findings::compare::{self, Compared, Comparison, Side, Values};
use crate::job::error::JobError;
use crate::job::finished::{self, LoadedMap};
use crate::job::observer::Observer;
use crate::map::engine::Flows;
use crate::map::plan::Plan;
use crate::map::scene::{Points, Quantity, Scene};
use crate::record::classify::classify;
use crate::record::{Records, valid};
use crate::show::cells::{Cells, Survey};
use crate::show::map_pair::{MapPair, MapSide};
use crate::show::numbers::Number;
use crate::store::finished_map::FinishedMap;
use rattlemap_dynamics::orbit::Class;

/// Two finished maps that can be compared.
pub struct CompareJob<'a> {
    dirs: [&'a Path; 2],
    names: [String; 2],
    maps: [FinishedMap; 2],
    scenes: [Scene; 2],
}

impl<'a> CompareJob<'a> {
    /// Reads the manifests and scenes of two folders, and checks that they have classes and the same cells.
    ///
    /// # Errors
    /// [`JobError`] if a folder is not a finished map's, or the maps cannot be compared.
    pub fn open(dirs: [&'a Path; 2]) -> Result<CompareJob<'a>, JobError> {
        let maps = [FinishedMap::open(dirs[0])?, FinishedMap::open(dirs[1])?];
        let scenes = [finished::scene(&maps[0])?, finished::scene(&maps[1])?];
        require_classes(dirs, &scenes)?;
        require_same_cells(dirs, &scenes)?;
        Ok(CompareJob { dirs, names: dirs.map(folder_name), maps, scenes })
    }

    /// Names of the two folders.
    pub fn names(&self) -> &[String; 2] {
        &self.names
    }

    /// The scene of the first map.
    pub fn scene(&self) -> &Scene {
        &self.scenes[0]
    }

    /// Checks that the output folder is not the folder of either map.
    ///
    /// # Errors
    /// [`JobError::Usage`].
    pub fn check_output(&self, out: &Path) -> Result<(), JobError> {
        let Ok(whole) = out.canonicalize() else { return Ok(()) };
        match self.dirs.into_iter().find(|dir| dir.canonicalize().is_ok_and(|dir| dir == whole)) {
            Some(dir) => Err(JobError::Usage(format!(
                "--out {}: this is the folder of {}, one of the compared maps; choose another one",
                out.display(),
                dir.display()
            ))),
            None => Ok(()),
        }
    }

    /// Reads all records and compares them. Quantities differ if their difference exceeds this share of the larger value. Damage that
    /// affects no record is reported to the observer. Returns none if `halt` is raised.
    ///
    /// # Errors
    /// [`JobError`] if the records of a map cannot be read.
    pub fn compare(
        &self,
        tolerance: f64,
        observer: &dyn Observer,
        halt: &AtomicBool,
    ) -> Result<Option<MapComparison<'_>>, JobError> {
        let is_halted = || halt.load(Ordering::Relaxed);
        let go_on = || (!is_halted()).then_some(());
        let read = |i: usize| LoadedMap::read(&self.maps[i], &self.scenes[i], observer);
        let mut loaded = [read(0)?, read(1)?];
        let compared = move || {
            go_on()?;
            let has_starts = loaded.iter().all(|map| map.plan.start_count() > 1);
            let attractors = |plan: &Plan, records: &dyn Records| {
                if has_starts && !is_halted() { coexistence::attractors(plan, records) } else { None }
            };
            let counts = loaded.each_ref().map(|map| attractors(&map.plan, &map.stored.records));
            go_on()?;
            let [a, b] = [0, 1].map(|i| Side {
                records: &loaded[i].stored.records,
                attractors: counts[i].as_deref(),
                has_exponents: self.scenes[i].outputs().quantities.contains(&Quantity::Lyapunov),
            });
            let mut comparison = compare::compare(loaded[0].plan.cell_count(), a, b);
            compare_motions(&mut comparison, &loaded, &self.scenes, &is_halted);
            go_on()?;
            compare_quantities(&mut comparison, &loaded, &self.scenes, tolerance);
            go_on()?;
            let surveys = loaded.each_mut().map(|map| Survey::of_refinement(map.stored.refined.take()));
            Some(MapComparison { job: self, loaded, surveys, comparison })
        };
        Ok(compared())
    }
}

/// Compares the cycles of equal period whose strobe states both maps have, if both maps have the same model and parameters.
fn compare_motions(
    comparison: &mut Comparison,
    loaded: &[LoadedMap; 2],
    scenes: &[Scene; 2],
    is_halted: &(dyn Fn() -> bool + Sync),
) {
    // A motion of another oscillator cannot be compared with a cycle of this one.
    let of_model = |scene: &Scene| {
        let is_own = |name: &str| name.starts_with("parameters.") || name.starts_with("model");
        scene.identity().into_iter().filter(|(name, _)| is_own(name)).collect::<Vec<_>>()
    };
    if of_model(&scenes[0]) != of_model(&scenes[1]) {
        return;
    }
    let plan = &loaded[0].plan;
    let flows = Flows::new(plan);
    comparison.take_motions(|id| {
        let [a, b] = loaded.each_ref().map(|map| map.stored.records.record(id));
        let have_state = a.valid & b.valid & valid::STROBE != 0;
        let is_cycle = matches!(classify(&a), Class::Periodic { .. }) && classify(&a) == classify(&b);
        if !(have_state && is_cycle) || is_halted() {
            return None;
        }
        let cell = plan.cell(id as u32);
        let is_same = a.strobe() == b.strobe();
        let is_one = |flow: &_| coexistence::is_one(flow, plan.law(cell.law), [a, b]);
        Some(is_same || flows.with(cell.flow, is_one))
    });
}

/// Compares the quantities that both maps have. States depend on the strobe of a cycle at which a run ends, and are left out.
fn compare_quantities(
    comparison: &mut Comparison,
    loaded: &[LoadedMap; 2],
    scenes: &[Scene; 2],
    tolerance: f64,
) {
    let cells = [0, 1].map(|i| Cells::new(&scenes[i], &loaded[i].plan, &loaded[i].stored.records));
    let [a, b] = cells.map(|cells| cells.numbers());
    let shared: Vec<[&Number; 2]> = a
        .iter()
        .filter(|number| number.quantity != Quantity::State)
        .filter_map(|number| Some([number, b.iter().find(|other| other.name == number.name)?]))
        .collect();
    let has_mirror_images = loaded[0].plan.model(0).oscillator().is_ok_and(|of| of.mirror_symmetric());
    let averages = ["impacts_per_period", "mesh_fraction"].map(Compared::plain);
    let measured = shared.iter().map(|[number, _]| Compared {
        name: number.name.clone(),
        dimension: number.dimension,
        is_odd: has_mirror_images && number.is_odd(),
    });
    let of = |id| {
        [0, 1].map(|i| {
            let row = cells[i].row(id);
            let averages = [row.impacts_per_period, row.mesh_fraction];
            averages
                .into_iter()
                .chain(shared.iter().map(|pair| pair[i].of_cell(&cells[i], id, &row)))
                .collect()
        })
    };
    let values = Values { quantities: averages.into_iter().chain(measured).collect(), of: &of };
    let classes = |id| loaded.each_ref().map(|map| classify(&map.stored.records.record(id)));
    comparison.take_quantities(&values, tolerance, classes);
}

/// Two finished maps, and the cells in which they differ.
pub struct MapComparison<'a> {
    job: &'a CompareJob<'a>,
    loaded: [LoadedMap; 2],
    surveys: [Survey; 2],
    /// Differences by cell.
    pub comparison: Comparison,
}

impl MapComparison<'_> {
    /// The cells of both maps, for [`MapComparison::pair`].
    pub fn cells(&self) -> [Cells<'_>; 2] {
        [0, 1].map(|i| self.loaded[i].cells(&self.job.scenes[i], &self.surveys[i]))
    }

    /// The comparison, for tables and figures.
    pub fn pair<'a>(&'a self, cells: &'a [Cells<'a>; 2]) -> MapPair<'a> {
        let sides = [0, 1].map(|i| {
            let manifest = self.job.maps[i].manifest();
            MapSide {
                name: &self.job.names[i],
                cells: &cells[i],
                provenance: manifest.provenance(),
                crate_version: &manifest.crate_version,
            }
        });
        MapPair { sides, comparison: &self.comparison }
    }
}

/// Returns the name of a folder, also for paths such as `.`.
fn folder_name(dir: &Path) -> String {
    let whole = dir.canonicalize().unwrap_or_else(|_| dir.to_owned());
    whole.file_name().map_or("map".into(), |name| name.to_string_lossy()).into_owned()
}

fn require_classes(dirs: [&Path; 2], scenes: &[Scene; 2]) -> Result<(), JobError> {
    let has_none = |scene: &Scene| !scene.outputs().quantities.contains(&Quantity::Class);
    match dirs.into_iter().zip(scenes).find(|(_, scene)| has_none(scene)) {
        Some((dir, _)) => Err(JobError::Usage(format!(
            "{}: the map has no classes; compute it again with \"class\" in outputs.quantities",
            dir.display()
        ))),
        None => Ok(()),
    }
}

fn require_same_cells(dirs: [&Path; 2], scenes: &[Scene; 2]) -> Result<(), JobError> {
    let [dir_a, dir_b] = dirs.map(|dir| dir.display());
    if scenes.iter().any(|scene| scene.list().is_some()) {
        let [a, b] = scenes.each_ref().map(Scene::points);
        let names = |points: &Points| points.swept().map(|p| p.name.to_string()).collect::<Vec<_>>();
        let is_same = a.counts() == b.counts()
            && names(a) == names(b)
            && (0..a.counts()[0] * a.counts()[1]).all(|cell| a.values(cell) == b.values(cell));
        return match is_same {
            true => Ok(()),
            false => Err(JobError::Usage(format!(
                "maps of different cells cannot be compared: {dir_a} and {dir_b} have different lists, or one of them has \
                 none; compute one of them again with the cells of the other"
            ))),
        };
    }
    let [a, b] = scenes.each_ref().map(Scene::axes);
    for (number, (a, b)) in a.iter().zip(b).enumerate() {
        let is_same = a.parameter().name == b.parameter().name
            && a.count() == b.count()
            && a.values().zip(b.values()).all(|(a, b)| a == b);
        if !is_same {
            let [a, b] = [a, b].map(|axis| {
                let (name, count) = (&axis.parameter().name, axis.count());
                format!("{name} from {:?} to {:?} in {count} values", axis.min(), axis.max())
            });
            let values = if a == b { ", and the values between differ" } else { "" };
            return Err(JobError::Usage(format!(
                "maps of different grids cannot be compared: axis {number} of {dir_a} is {a}, of {dir_b} {b}{values}; compute \
                 one of them again with the axes of the other"
            )));
        }
    }
    Ok(())
}
