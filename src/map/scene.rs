//! What is asked: a scene, read from TOML or [built](Scene::builder) in Rust, and checked whole.
//!
//! Parsing is pure: it takes the text and the name that messages give it. Whatever is
//! wrong is found here, with its place and its remedy; what parsing returns cannot fail
//! later. `--set` arguments are applied before anything is checked, so a value is judged
//! the same way wherever it came from.

mod along;
mod axis;
mod builder;
mod derived;
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
pub use builder::SceneBuilder;
pub(crate) use derived::Rule;
pub use keys::{KEYS, Key, KeyDefault, Takes};
pub use limits::MAX_COUNT;
pub use list::{CompanionFile, FileText, FindFile, List};
pub(crate) use points::Points;
pub use settings::{Continuous, DEFAULT_AUDIT, Format, Integration, Outputs, Quantity, Refine, Steps};
pub use start::{Draw, Start};

use crate::text::document::{self, Node};
use crate::text::error;
use crate::text::section::{self, Section};
use derived::Derived;
use parameters::ParameterSources;
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{Model, ModelError, Parameter, ParameterError};
use rattlemap_dynamics::orbit;

/// What stands outside of any table, and the tables.
const TOP_LEVEL: [&str; 10] =
    ["title", "model", "parameters", "derived", "axis", "cells", "integration", "start", "refine", "outputs"];

/// What a scene is read for; it decides the number of axes and the files that can be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A map over two axes.
    Map,
    /// Section points over one axis.
    Bifurcation,
}

impl Purpose {
    /// The command's name and the number of axes that it needs.
    fn needs(self) -> (&'static str, usize) {
        match self {
            Purpose::Map => ("map", 2),
            Purpose::Bifurcation => ("bifurcation", 1),
        }
    }
}

/// A checked scene.
#[derive(Clone, Debug)]
pub struct Scene {
    text: String,
    title: String,
    points: Points,
    integration: Integration,
    start: Start,
    draw: Option<Draw>,
    refine: Option<Refine>,
    outputs: Outputs,
}

impl Scene {
    /// Reads a scene from its text, which must do without files sources it.
    ///
    /// `name` is what messages call the text, usually the file's path as the user gave it;
    /// `sets` are `NAME=VALUE` arguments, later ones winning over earlier ones and all of
    /// them over the text.
    ///
    /// # Errors
    /// [`SceneError`] for the first thing that is wrong.
    pub fn parse(text: &str, name: &str, sets: &[String], purpose: Purpose) -> Result<Scene, SceneError> {
        let find: FindFile<'_> = &|_, _| Err("names a file, and no files are read here".to_owned());
        Scene::parse_with_files(text, name, sets, purpose, find)
    }

    /// The same where a list of cells, or the model, may stand in a file of its own, which `find` reads: nothing here
    /// does.
    ///
    /// # Errors
    /// [`SceneError`] for the first thing that is wrong, in the text or in such a file.
    pub fn parse_with_files(
        text: &str,
        name: &str,
        sets: &[String],
        purpose: Purpose,
        find: FindFile<'_>,
    ) -> Result<Scene, SceneError> {
        Scene::parse_along(text, name, sets, purpose, None, find)
    }

    /// The same where a bifurcation diagram may run along one of several axes. Of such a scene, what its text asks of a
    /// map alone is left out: `[refine]`, further starts, files that diagrams have not.
    ///
    /// # Errors
    /// [`SceneError`] for the first thing that is wrong, in the scene or in `along`.
    pub fn parse_along(
        text: &str,
        name: &str,
        sets: &[String],
        purpose: Purpose,
        along: Option<&Along>,
        find: FindFile<'_>,
    ) -> Result<Scene, SceneError> {
        Scene::parse_document(text, document::read(text, name)?, sets, purpose, along, find)
    }

    /// The same of a text that a program has written for somebody: errors do not tell lines that nobody has seen.
    ///
    /// # Errors
    /// As [`Scene::parse_along`].
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
        for set in sets {
            overrides::apply(&mut document, set)?;
        }
        let model = models::read(&Section::open(&document, "", &TOP_LEVEL)?, find)?;
        if purpose == Purpose::Bifurcation {
            along::take(&mut document, &model, along)?;
        }
        Scene::read(text.to_owned(), &document, &model, purpose, find)
    }

    /// A scene without a file: see [`SceneBuilder`].
    pub fn builder(model: impl Model) -> SceneBuilder {
        SceneBuilder::new(Box::new(model))
    }

    /// Reads the tree of a scene whose model is known.
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
        let base = parameters::read(&root, model, sources)?;
        let title = root.get("title").map(|title| settings::read_title(&title)).transpose()?;
        let is_list = list.is_some();
        let points = Points::new(base, axes, list, derived);
        let scene = Scene {
            text,
            title: title.unwrap_or_else(|| default_title(model, &points)),
            integration: settings::read_integration(&root)?,
            start: start::read(&root, model, purpose)?,
            draw: start::read_draw(&root, purpose)?,
            refine: settings::read_refine(&root, purpose)?,
            outputs: settings::read_outputs(&root, purpose, is_list)?,
            points,
        };
        start::check(&root, &scene)?;
        if is_list {
            list::check(&root, scene.start.follows())?;
        }
        scene.check_corners(&root)?;
        Ok(scene)
    }

    /// Refuses a scene whose model has no motion in a cell at a corner. What lies between is looked at
    /// by [`Plan::check`](crate::map::plan::Plan::check), once the size is known to be sane.
    fn check_corners(&self, root: &Section<'_>) -> Result<(), SceneError> {
        let [columns, rows] = self.points.counts();
        for cell in [0, columns - 1, columns * (rows - 1), columns * rows - 1] {
            let model = self.points.model(cell);
            if let Err(error) = Flow::validate(&*model) {
                let named = self.points.named(cell);
                // What derives a value that is out of range is what has to change.
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

    /// What derives a parameter.
    fn rule(&self, name: &str) -> Option<&derived::Rule> {
        self.points.derived().rules().iter().find(|rule| rule.parameter().name == name)
    }

    /// The text that was parsed, without the `--set` arguments; of a scene that was built, the
    /// same in TOML.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The heading of figures and reports.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// The axes in their order, which is meaning: the first runs along columns. None where cells are listed.
    pub fn axes(&self) -> &[Axis] {
        self.points.axes()
    }

    /// The list of cells, where one stands in the place of axes.
    pub fn list(&self) -> Option<&List> {
        self.points.list()
    }

    pub(crate) fn points(&self) -> &Points {
        &self.points
    }

    /// The model in the first cell: swept parameters at the first of their values.
    pub fn base(&self) -> &dyn Model {
        self.points.base()
    }

    /// The parameters, and components of the start, that cells differ in: those of the axes, or the columns of a list.
    /// Derived ones are not among them.
    pub fn swept(&self) -> impl Iterator<Item = &Parameter> {
        self.points.swept()
    }

    /// Whether an axis or a column sets a parameter.
    pub fn sweeps(&self, parameter: &Parameter) -> bool {
        let index = self.base().index(&parameter.name).ok();
        index.is_some_and(|index| self.points.targets().any(|target| target == Target::Parameter(index)))
    }

    /// Whether cells differ in their starts.
    pub fn sweeps_start(&self) -> bool {
        self.points.sweeps_start()
    }

    /// Whether it is a map of basins: an axis sweeps a component of the start.
    pub fn is_basin(&self) -> bool {
        self.list().is_none() && self.sweeps_start()
    }

    /// The parameters that follow others, each with its expression, in an order in which they can be computed.
    pub fn derived(&self) -> impl Iterator<Item = (&Parameter, &str)> {
        self.points.derived().rules().iter().map(|rule| (rule.parameter(), rule.text()))
    }

    /// Names and values of the parameters that are the same in every cell by being set so: neither swept nor derived.
    pub fn fixed(&self) -> impl Iterator<Item = (&str, f64)> {
        let base = self.base();
        let all = base.parameters().iter().enumerate();
        let is_swept = |index| self.points.targets().any(|target| target == Target::Parameter(index));
        let fixed = all.filter(move |&(index, _)| !is_swept(index) && !self.points.derived().has(index));
        fixed.map(|(index, parameter)| (&*parameter.name, base.value(index)))
    }

    /// How long each cell is integrated, and what for.
    pub fn integration(&self) -> &Integration {
        &self.integration
    }

    /// The same as the orbit analysis takes it.
    pub fn orbit_settings(&self) -> orbit::Settings {
        (&self.integration).into()
    }

    /// Where cells start.
    pub fn start(&self) -> Start {
        self.start
    }

    /// How many more starts each cell has; none where there is one alone.
    pub fn draw(&self) -> Option<Draw> {
        self.draw
    }

    /// Bounds of an adaptive map; none where every cell is integrated.
    pub fn refine(&self) -> Option<Refine> {
        self.refine
    }

    /// What is computed and written.
    pub fn outputs(&self) -> &Outputs {
        &self.outputs
    }

    /// How many cells there are.
    pub fn cell_count(&self) -> u64 {
        self.points.counts().iter().map(|&count| count as u64).product()
    }

    /// How many runs there are: one per cell and start.
    pub fn run_count(&self) -> u64 {
        self.cell_count().saturating_mul(self.draw.map_or(1, |draw| u64::from(draw.count)))
    }

    /// The model in the cell with the given index on each axis; with the place in a list that stands for axes.
    ///
    /// # Panics
    /// If there are not as many indices as axes.
    pub fn cell(&self, indices: &[usize]) -> Box<dyn Model> {
        assert_eq!(indices.len(), self.axes().len().max(1), "one index per axis");
        let [columns, _] = self.points.counts();
        self.points.model(indices[0] + columns * indices.get(1).unwrap_or(&0))
    }

    /// Axis value and model of every cell of a scene with one axis, in order.
    ///
    /// # Panics
    /// If the scene does not have exactly one axis.
    pub fn line(&self) -> Vec<(f64, Box<dyn Model>)> {
        let [axis] = self.axes() else { panic!("a line has one axis") };
        axis.values().enumerate().map(|(i, value)| (value, self.points.model(i))).collect()
    }
}

/// One cell of a model from `NAME=VALUE` arguments alone: its own values unless set.
///
/// # Errors
/// [`SceneError`] for an unknown parameter, a value out of its range, or a setting that is
/// not a parameter; for a model that has no motion.
pub fn single_cell(model: &dyn Model, sets: &[String]) -> Result<Box<dyn Model>, SceneError> {
    let values = model.parameters().iter().enumerate();
    let values = values.map(|(index, parameter)| format!("{} = {:?}\n", parameter.name, model.value(index)));
    let defaults = format!("[parameters]\n{}", values.collect::<String>());
    let mut document = document::read(&defaults, "defaults")?;
    for set in sets {
        overrides::apply(&mut document, set)?;
    }
    let root = Section::open(&document, "", &["parameters"])?;
    let sources = ParameterSources { axes: &[], list: None, derived: &Derived::default() };
    let cell = parameters::read(&root, model, sources)?;
    Flow::validate(&*cell).map_err(|error| {
        // Defaults are fine: it is what was set that has to change.
        let error = root.no_motion("", &error);
        match sets {
            [] => error,
            _ => SceneError { place: Place::Set { argument: sets.join(" --set ").into() }, ..error },
        }
    })?;
    Ok(cell)
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
