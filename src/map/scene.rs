//! A scene: the definition of a map or a bifurcation diagram, read from TOML or [built](Scene::builder) in Rust.
//!
//! Reading is pure: it needs only the text and the name that messages use for it. It finds every error, with its place
//! and its remedy, so that a scene that was read cannot fail later. `--set` arguments are applied before anything is
//! checked, so the same checks apply to values of any origin.

mod along;
mod axis;
mod builder;
mod derived;
mod figure;
mod identity;
mod keys;
mod limits;
mod list;
mod models;
mod overrides;
mod parameters;
mod points;
mod settings;
mod start;
#[cfg(test)]
mod tests;

pub use crate::text::error::{Fault, Place, Problem, SceneError};
pub use along::Along;
pub use axis::{Axis, Scale, Target};
pub use builder::{SceneBuilder, quoted as toml};
pub(crate) use derived::Rule;
pub use figure::{DiagramStyle, FigureStyle, MapLine, SECTION};
pub(crate) use figure::{LayerScale, place};
pub use keys::{KEYS, Key, KeyDefault, Takes};
pub(crate) use limits::MAX_PERIODS;
pub use limits::{MAX_COUNT, REPLICATES};
pub use list::{CompanionFile, FileText, FindFile, List};
pub(crate) use points::Points;
pub use settings::{Continuous, DEFAULT_AUDIT, Format, Integration, Outputs, Quantity, Refine, Steps};
pub use start::{Draw, Sample, Spread, Start};

use crate::model_file::{FileModel, MODEL_FILE, subjects};
use crate::text::document::{self, Node};
use crate::text::error;
use crate::text::section::{self, Section};
use derived::Derived;
use figure::Figure;
use parameters::ParameterSources;
use rattlemap_dynamics::model::{Model, ModelError, Parameter, ParameterError};
use rattlemap_dynamics::orbit;

/// Keys outside of any table, and the names of the tables.
#[rustfmt::skip]
const TOP_LEVEL: [&str; 11] = [
    "title", "model", "parameters", "derived", "axis", "cells", "integration", "start", "refine", "outputs", "figure",
];

/// Purpose for which a scene is read. It decides the number of axes and the kinds of output files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A map over two axes or a list of cells.
    Map,
    /// A bifurcation diagram over one axis.
    Bifurcation,
}

impl Purpose {
    /// Returns the command's name and the number of axes that it needs.
    fn needs(self) -> (&'static str, usize) {
        match self {
            Purpose::Map => ("map", 2),
            Purpose::Bifurcation => ("bifurcation", 1),
        }
    }

    /// Returns a scene of this program for the purpose, as an example in messages.
    #[cfg(feature = "job")]
    pub(crate) fn example(self) -> &'static str {
        match self {
            Purpose::Map => "scenes/e_omega.toml",
            Purpose::Bifurcation => "scenes/paper_fig5.toml",
        }
    }
}

/// A scene without errors.
#[derive(Clone, Debug)]
pub struct Scene {
    text: String,
    settings: String,
    title: String,
    points: Points,
    integration: Integration,
    start: Start,
    draw: Option<Draw>,
    sample: Option<Sample>,
    refine: Option<Refine>,
    outputs: Outputs,
    figure: Figure,
}

impl Scene {
    /// Reads a scene that names no other files.
    ///
    /// Messages call the text `name`, usually the file's path as the user gave it. `sets` are `NAME=VALUE` arguments;
    /// each overrides the text and earlier arguments.
    ///
    /// # Errors
    /// [`SceneError`] for the first error.
    pub fn parse(text: &str, name: &str, sets: &[String], purpose: Purpose) -> Result<Scene, SceneError> {
        let find: FindFile<'_> = &|_, _| Err("names a file, and no files are read here".to_owned());
        Scene::parse_with_files(text, name, sets, purpose, None, find)
    }

    /// Reads a scene that may name a model file or a table of cells, which `find` returns.
    ///
    /// With `along`, a bifurcation diagram runs along one of several axes. Settings in the text that only maps have
    /// (`[refine]`, further starts, some kinds of files) are then ignored.
    ///
    /// # Errors
    /// [`SceneError`] for the first error, in the text, in one of the files, or in `along`.
    pub fn parse_with_files(
        text: &str,
        name: &str,
        sets: &[String],
        purpose: Purpose,
        along: Option<&Along>,
        find: FindFile<'_>,
    ) -> Result<Scene, SceneError> {
        Scene::parse_document(text, document::read(text, name)?, sets, purpose, along, find)
    }

    /// Reads a scene whose text a program has generated. Errors name no lines, because the user has not seen the text.
    ///
    /// # Errors
    /// As for [`Scene::parse_with_files`].
    pub fn parse_generated(
        text: &str,
        sets: &[String],
        purpose: Purpose,
        along: Option<&Along>,
        find: FindFile<'_>,
    ) -> Result<Scene, SceneError> {
        let document = document::read(text, "scene")?.placed(Place::Builder);
        Scene::parse_document(text, document, sets, purpose, along, find)
    }

    fn parse_document(
        text: &str,
        mut document: Node,
        sets: &[String],
        purpose: Purpose,
        along: Option<&Along>,
        find: FindFile<'_>,
    ) -> Result<Scene, SceneError> {
        refuse_model(&document)?;
        for set in sets {
            overrides::apply(&mut document, set)?;
        }
        let model = models::read(&Section::open(&document, "", &TOP_LEVEL)?, find)?;
        if purpose == Purpose::Bifurcation {
            along::reduce(&mut document, &model, along)?;
        }
        Scene::read(text.to_owned(), &document, &model, purpose, find)
    }

    /// Begins a scene without a file: see [`SceneBuilder`].
    pub fn builder(model: impl Model) -> SceneBuilder {
        SceneBuilder::new(Box::new(model))
    }

    /// Reads the tree of a scene with its model.
    fn read(
        text: String,
        document: &Node,
        model: &dyn Model,
        purpose: Purpose,
        find: FindFile<'_>,
    ) -> Result<Scene, SceneError> {
        let root = Section::open(document, "", &TOP_LEVEL)?;
        let (command, axis_count) = purpose.needs();
        let list = list::read(&root, model, purpose, find)?;
        let axes = match list {
            Some(_) => Vec::new(),
            None => axis::read(&root, model, axis_count, command)?,
        };
        if purpose == Purpose::Bifurcation {
            axis::refuse_starts(&root, &axes, command)?;
        }
        let is_swept = |index: usize| {
            let target = Target::Parameter(index);
            let is_column = |list: &List| list.targets().any(|column| column == target);
            axes.iter().any(|axis| axis.target() == target) || list.as_ref().is_some_and(is_column)
        };
        let derived = derived::read(&root, model, is_swept)?;
        let sources = ParameterSources { axes: &axes, list: list.as_ref(), derived: &derived };
        let mut base = parameters::read(&root, model, sources)?;
        start::read_phase(&root.section("start", &keys::names("start"))?, &mut *base)?;
        let title = root.get("title").map(|title| settings::read_title(&title)).transpose()?;
        let is_list = list.is_some();
        let points = Points::new(base, axes, list, derived);
        let outputs = settings::read_outputs(&root, purpose, is_list)?;
        let scene = Scene {
            text,
            settings: settings_of(document, model),
            title: title.unwrap_or_else(|| default_title(model, &points)),
            integration: settings::read_integration(&root)?,
            start: start::read(&root, model, purpose)?,
            draw: start::read_draw(&root, purpose)?,
            sample: start::read_sample(&root, points.base(), purpose)?,
            refine: settings::read_refine(&root, purpose)?,
            figure: figure::read(&root, &points, &outputs.quantities)?,
            outputs,
            points,
        };
        start::check(&root, &scene)?;
        if is_list {
            list::check(&root, scene.start.follows())?;
        }
        scene.check_columns(&root)?;
        scene.check_corners(&root)?;
        Ok(scene)
    }

    /// Refuses a measured quantity whose column has the name of a swept parameter.
    fn check_columns(&self, root: &Section<'_>) -> Result<(), SceneError> {
        let names = subjects(self.base());
        let mut columns = self.outputs.quantities.iter().flat_map(|quantity| quantity.columns(&names));
        let twice = columns.find(|name| self.swept().any(|parameter| parameter.name == **name));
        let outputs = root.section("outputs", &keys::names("outputs"))?;
        match (twice, outputs.get("quantities")) {
            (Some(name), Some(field)) => Err(field.conflict(format!(
                "it has the column `{name}`, which is the name of a swept parameter; rename the parameter in the model file"
            ))),
            _ => Ok(()),
        }
    }

    /// Refuses a scene whose model has no motion in a cell at a corner of the plane. The other cells are checked by
    /// [`Plan::check`](crate::map::plan::Plan::check) after the size of the map.
    fn check_corners(&self, root: &Section<'_>) -> Result<(), SceneError> {
        let [columns, rows] = self.points.counts();
        for cell in [0, columns - 1, columns * (rows - 1), columns * rows - 1] {
            let model = self.points.model(cell);
            let oscillator = model.oscillator();
            if let (Ok(oscillator), Some(sample)) = (&oscillator, &self.sample) {
                let section = root.section("start", &keys::names("start"))?;
                start::check_box(&section, &sample.spread, oscillator, &self.points.named(cell))?;
            }
            if let Err(error) = oscillator {
                let named = self.points.named(cell);
                // If the value is derived, the error belongs to its expression.
                let derives = match &error {
                    ModelError::Parameter(ParameterError::OutOfRange { name, .. }) => self.rule(name),
                    _ => None,
                };
                let table = root.section_among("derived", &axis::names(&*model), "")?;
                return Err(match derives.and_then(|rule| table.get(&rule.parameter().name)) {
                    Some(field) => field.no_motion(&named, &error),
                    None => root.no_motion(&named, &error),
                });
            }
        }
        Ok(())
    }

    /// Returns the rule that derives a parameter.
    fn rule(&self, name: &str) -> Option<&derived::Rule> {
        self.points.derived().rules().iter().find(|rule| rule.parameter().name == name)
    }

    /// Returns the scene's text without the `--set` arguments. For a scene that was built, this is generated TOML.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the scene as TOML without its axes, with the `--set` arguments applied. A model from a file is named
    /// `model.toml`, as in the folder of a map.
    pub fn settings(&self) -> &str {
        &self.settings
    }

    /// Returns the heading of figures and reports.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// Returns the axes. The first runs along the columns of a map. Empty for a list of cells.
    pub fn axes(&self) -> &[Axis] {
        self.points.axes()
    }

    /// Returns the list of cells, if the scene has one instead of axes.
    pub fn list(&self) -> Option<&List> {
        self.points.list()
    }

    pub(crate) fn points(&self) -> &Points {
        &self.points
    }

    /// Returns the number of the model's coordinates.
    pub fn coordinates(&self) -> usize {
        self.base().state_names().len() / 2
    }

    /// Returns the model in the first cell.
    pub fn base(&self) -> &dyn Model {
        self.points.base()
    }

    /// Returns the parameters and components of the start that axes or columns sweep. Derived parameters are not
    /// included.
    pub fn swept(&self) -> impl Iterator<Item = &Parameter> {
        self.points.swept()
    }

    /// Whether cells differ in their starts.
    pub fn sweeps_start(&self) -> bool {
        self.points.sweeps_start()
    }

    /// Whether this is a map of basins: at least one axis sweeps a component of the start.
    pub fn is_basin(&self) -> bool {
        self.list().is_none() && self.sweeps_start()
    }

    /// Returns the derived parameters with their expressions, ordered so that each needs only earlier ones.
    pub fn derived(&self) -> impl Iterator<Item = (&Parameter, &str)> {
        self.points.derived().rules().iter().map(|rule| (rule.parameter(), rule.text()))
    }

    /// Returns the parameters that are neither swept nor derived, with their values.
    pub fn fixed(&self) -> impl Iterator<Item = (&Parameter, f64)> {
        let base = self.base();
        let all = base.parameters().iter().enumerate();
        let is_swept = |index| self.points.targets().any(|target| target == Target::Parameter(index));
        let fixed = all.filter(move |&(index, _)| !is_swept(index) && !self.points.derived().has(index));
        fixed.map(|(index, parameter)| (parameter, base.value(index)))
    }

    /// Returns how long each cell is integrated.
    pub fn integration(&self) -> &Integration {
        &self.integration
    }

    /// Returns the settings of the integration in the form that the orbit analysis needs.
    pub fn orbit_settings(&self) -> orbit::Settings {
        (&self.integration).into()
    }

    /// Returns the states in which cells start.
    pub fn start(&self) -> Start {
        self.start
    }

    /// Returns the random starts of each cell; none if each cell has one start.
    pub fn draw(&self) -> Option<Draw> {
        self.draw
    }

    /// Returns the starts of a map of shares; none for other maps.
    pub fn sample(&self) -> Option<&Sample> {
        self.sample.as_ref()
    }

    /// Returns the settings of an adaptive map; none if every cell is integrated.
    pub fn refine(&self) -> Option<Refine> {
        self.refine
    }

    /// Returns the quantities and files of the map.
    pub fn outputs(&self) -> &Outputs {
        &self.outputs
    }

    /// Returns the appearance of the figures.
    pub fn figure_style(&self) -> &FigureStyle {
        &self.figure.style
    }

    /// Returns the panels of figures of diagrams.
    pub fn diagram_style(&self) -> &DiagramStyle {
        &self.figure.diagram
    }

    /// Returns the index of the gap whose contact the class map shows, if the scene names one of several.
    pub(crate) fn contact_gap(&self) -> Option<usize> {
        self.figure.gap
    }

    /// Returns the scale of the colours of a layer.
    pub(crate) fn layer_scale(&self, layer: &str) -> LayerScale {
        self.figure.scales.iter().find(|(name, _)| name == layer).map_or((None, None), |(_, scale)| *scale)
    }

    /// Returns the layers that have contours, by name, and the numbers of the contours.
    pub fn contours(&self) -> &[(String, Vec<f64>)] {
        &self.figure.contours
    }

    /// Returns the lines that figures of maps show.
    pub fn lines(&self) -> &[MapLine] {
        &self.figure.lines
    }

    /// Returns the number of cells.
    pub fn cell_count(&self) -> u64 {
        self.points.counts().iter().map(|&count| count as u64).product()
    }

    /// Returns the number of runs: one per cell and start.
    pub fn run_count(&self) -> u64 {
        self.cell_count().saturating_mul(self.draw.map_or(1, |draw| u64::from(draw.count)))
    }

    /// Returns the names of a derived parameter and of an axis on which it depends, if there are any.
    pub fn derived_along_axes(&self) -> Option<(&str, &str)> {
        let axes = || self.axes().iter().filter_map(|axis| Some((axis.target().parameter()?, axis)));
        self.points.derived().rules().iter().find_map(|rule| {
            let (_, axis) = axes().find(|(index, _)| rule.follows(*index))?;
            Some((&*rule.parameter().name, &*axis.parameter().name))
        })
    }

    /// Returns the model of a cell, given its index on each axis, or its place in the list.
    ///
    /// # Panics
    /// If the number of indices is not that of the axes (1 for a list).
    pub fn cell(&self, indices: &[usize]) -> Box<dyn Model> {
        assert_eq!(indices.len(), self.axes().len().max(1), "one index per axis");
        let [columns, _] = self.points.counts();
        self.points.model(indices[0] + columns * indices.get(1).unwrap_or(&0))
    }

    /// Returns the axis value and the model of every cell of a scene with one axis, in order.
    ///
    /// # Panics
    /// If the scene does not have exactly one axis.
    pub fn line(&self) -> Vec<(f64, Box<dyn Model>)> {
        let [axis] = self.axes() else { panic!("a line has one axis") };
        axis.values().enumerate().map(|(i, value)| (value, self.points.model(i))).collect()
    }
}

/// Sets parameters and the start phase of a model by `NAME=VALUE` arguments.
///
/// # Errors
/// [`SceneError`] for an unknown parameter, a value out of its range, any other setting, or values for which the
/// model has no motion.
pub fn single_cell(model: &dyn Model, sets: &[String]) -> Result<Box<dyn Model>, SceneError> {
    let values = model.parameters().iter().enumerate();
    let values = values.map(|(index, parameter)| format!("{} = {:?}\n", parameter.name, model.value(index)));
    let defaults = format!("[parameters]\n{}", values.collect::<String>());
    let mut document = document::read(&defaults, "defaults")?;
    for set in sets {
        overrides::apply(&mut document, set)?;
    }
    let root = Section::open(&document, "", &["parameters", "start"])?;
    let sources = ParameterSources { axes: &[], list: None, derived: &Derived::default() };
    let mut cell = parameters::read(&root, model, sources)?;
    start::read_phase(&root.section("start", &["phase"])?, &mut *cell)?;
    cell.oscillator().map_err(|error| {
        // The defaults have a motion, so the error is in the arguments.
        let error = root.no_motion("", &error);
        match sets {
            [] => error,
            _ => SceneError { place: Place::Set { argument: sets.join(" --set ").into() }, ..error },
        }
    })?;
    Ok(cell)
}

/// Refuses the text of a model.
fn refuse_model(document: &Node) -> Result<(), SceneError> {
    let motion = Section::open_any(document, "").and_then(|root| root.get("motion"));
    motion.map_or(Ok(()), |motion| {
        Err(motion.misplaced(
            "this file is a model, but a scene is needed: write one with model = \"FILE\" and [[axis]] tables; \
             `rattlemap models FILE` describes the model, `rattlemap orbit --model FILE` computes one motion",
        ))
    })
}

/// Writes the tree of a scene as TOML without its axes and its list of files, which a later command may extend.
fn settings_of(document: &Node, model: &dyn Model) -> String {
    let Some(toml::Value::Table(mut fields)) = document.to_toml() else { return String::new() };
    fields.remove("axis");
    if let Some(toml::Value::Table(outputs)) = fields.get_mut("outputs") {
        outputs.remove("files");
        if outputs.is_empty() {
            fields.remove("outputs");
        }
    }
    if model.downcast_ref().is_some_and(|file: &FileModel| !file.is_built_in()) {
        fields.insert("model".to_owned(), MODEL_FILE.into());
    }
    // A table of TOML values can always be written.
    toml::to_string(&fields).unwrap_or_default()
}

fn default_title(model: &dyn Model, points: &Points) -> String {
    match points.list() {
        Some(list) => format!("{}: the cells of {}", model.title(), list.file()),
        None => {
            let names: Vec<&str> = points.swept().map(|parameter| &*parameter.meaning).collect();
            format!("{}: {}", model.title(), names.join(" x "))
        }
    }
}
