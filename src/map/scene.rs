//! What is asked: a scene, read from TOML or [built](Scene::builder) in Rust, and checked whole.
//!
//! Parsing is pure: it takes the text and the name that messages give it. Whatever is
//! wrong is found here, with its place and its remedy; what parsing returns cannot fail
//! later. `--set` arguments are applied before anything is checked, so a value is judged
//! the same way wherever it came from.

mod along;
mod axis;
mod builder;
mod document;
mod error;
mod identity;
mod keys;
mod overrides;
mod section;
mod settings;
mod start;
#[cfg(test)]
mod tests;

pub use along::Along;
pub use axis::{Axis, MAX_COUNT};
pub use builder::SceneBuilder;
pub use error::{Place, Problem, SceneError};
pub use keys::{KEYS, Key, KeyDefault, Takes};
pub use settings::{AUDIT, Continuous, Format, Integration, Outputs, Quantity, Refine, Steps};
pub use start::{Draw, Start};

use document::Node;
use rattlemap_dynamics::flow::Flow;
use rattlemap_dynamics::model::{GearPair, Model, Parameter};
use rattlemap_dynamics::orbit;
use section::Section;

/// What stands outside of any table, and the tables.
const TOP_LEVEL: [&str; 8] =
    ["title", "model", "parameters", "axis", "integration", "start", "refine", "outputs"];

/// The model of scenes that name none.
const DEFAULT_MODEL: &str = "gear-pair";

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
    base: Box<dyn Model>,
    axes: Vec<Axis>,
    integration: Integration,
    start: Start,
    draw: Option<Draw>,
    refine: Option<Refine>,
    outputs: Outputs,
}

impl Scene {
    /// Reads a scene from its text.
    ///
    /// `name` is what messages call the text, usually the file's path as the user gave it;
    /// `sets` are `NAME=VALUE` arguments, later ones winning over earlier ones and all of
    /// them over the text.
    ///
    /// # Errors
    /// [`SceneError`] for the first thing that is wrong.
    pub fn parse(text: &str, name: &str, sets: &[String], purpose: Purpose) -> Result<Scene, SceneError> {
        Scene::parse_along(text, name, sets, purpose, None)
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
    ) -> Result<Scene, SceneError> {
        let mut document = document::read(text, name)?;
        for set in sets {
            overrides::apply(&mut document, set)?;
        }
        if let Some(model) = Section::open(&document, "", &TOP_LEVEL)?.get("model") {
            model.choice(&[(DEFAULT_MODEL, ())])?;
        }
        let model = GearPair::paper(0.0);
        if purpose == Purpose::Bifurcation {
            along::take(&mut document, &model, along)?;
        }
        Scene::read(text.to_owned(), &document, &model, purpose)
    }

    /// A scene without a file: see [`SceneBuilder`].
    pub fn builder(model: impl Model) -> SceneBuilder {
        SceneBuilder::new(Box::new(model))
    }

    /// Reads the tree of a scene whose model is known.
    fn read(text: String, document: &Node, model: &dyn Model, purpose: Purpose) -> Result<Scene, SceneError> {
        let root = Section::open(document, "", &TOP_LEVEL)?;
        let (command, axis_count) = purpose.needs();
        let axes = axis::read(&root, model, axis_count, command)?;
        let title = match root.get("title") {
            Some(title) => settings::read_title(&title)?,
            None => default_title(model, &axes),
        };
        let scene = Scene {
            text,
            title,
            base: axis::read_parameters(&root, model, &axes)?,
            integration: settings::read_integration(&root)?,
            start: start::read(&root, model, purpose)?,
            draw: start::read_draw(&root, purpose)?,
            refine: settings::read_refine(&root, purpose)?,
            outputs: settings::read_outputs(&root, purpose)?,
            axes,
        };
        start::check(&root, scene.start, scene.draw)?;
        scene.check_corners(&root)?;
        Ok(scene)
    }

    /// Refuses a scene whose model has no motion in a cell at a corner. What lies between is looked at
    /// by [`Plan::check`](crate::map::plan::Plan::check), once the size is known to be sane.
    fn check_corners(&self, root: &Section<'_>) -> Result<(), SceneError> {
        for corner in 0..1usize << self.axes.len() {
            let end = |(i, axis): (usize, &Axis)| if corner >> i & 1 == 0 { 0 } else { axis.count() - 1 };
            let indices: Vec<usize> = self.axes.iter().enumerate().map(end).collect();
            let model = self.cell(&indices);
            if let Err(error) = Flow::validate(&*model) {
                return Err(root.no_motion(&self.named(&indices), &error));
            }
        }
        Ok(())
    }

    /// The axes' values in a cell, in words.
    pub(crate) fn named(&self, indices: &[usize]) -> String {
        let value = |(axis, &i): (&Axis, &usize)| format!("{} = {:?}", axis.parameter().name, axis.value(i));
        self.axes.iter().zip(indices).map(value).collect::<Vec<_>>().join(", ")
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

    /// The axes in their order, which is meaning: the first runs along columns.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// The model in the first cell: swept parameters at their `min`.
    pub fn base(&self) -> &dyn Model {
        &*self.base
    }

    /// Whether an axis sweeps a parameter.
    pub fn sweeps(&self, parameter: &Parameter) -> bool {
        self.axes.iter().any(|axis| axis.parameter().name == parameter.name)
    }

    /// Names and values of the parameters that no axis sweeps.
    pub fn fixed(&self) -> impl Iterator<Item = (&str, f64)> {
        let all = self.base.parameters().iter().enumerate();
        let fixed = all.filter(|(_, parameter)| !self.sweeps(parameter));
        fixed.map(|(index, parameter)| (&*parameter.name, self.base.value(index)))
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
        self.axes.iter().map(|axis| axis.count() as u64).product()
    }

    /// How many runs there are: one per cell and start.
    pub fn run_count(&self) -> u64 {
        self.cell_count().saturating_mul(self.draw.map_or(1, |draw| u64::from(draw.count)))
    }

    /// The model in the cell with the given index on each axis.
    ///
    /// # Panics
    /// If there are not as many indices as axes.
    pub fn cell(&self, indices: &[usize]) -> Box<dyn Model> {
        assert_eq!(indices.len(), self.axes.len(), "one index per axis");
        let mut model = self.base.clone();
        self.axes.iter().zip(indices).for_each(|(axis, &i)| axis.set(&mut *model, i));
        model
    }

    /// Axis value and model of every cell of a scene with one axis, in order.
    ///
    /// # Panics
    /// If the scene does not have exactly one axis.
    pub fn line(&self) -> Vec<(f64, Box<dyn Model>)> {
        let count = self.axes[0].count();
        (0..count).map(|i| (self.axes[0].value(i), self.cell(&[i]))).collect()
    }
}

/// One gear pair from `NAME=VALUE` arguments alone: Table 1 with restitution `e` unless set.
///
/// # Errors
/// [`SceneError`] for an unknown parameter, a value out of its range, or a setting that is
/// not a parameter; for a gear pair that has no motion.
pub fn single_cell(e: f64, sets: &[String]) -> Result<Box<dyn Model>, SceneError> {
    let defaults = format!("[parameters]\ne = {e:?}\n");
    let mut document = document::read(&defaults, "defaults")?;
    for set in sets {
        overrides::apply(&mut document, set)?;
    }
    let root = Section::open(&document, "", &["parameters"])?;
    let pair = axis::read_parameters(&root, &GearPair::paper(0.0), &[])?;
    Flow::validate(&*pair).map_err(|error| root.no_motion("", &error))?;
    Ok(pair)
}

fn default_title(model: &dyn Model, axes: &[Axis]) -> String {
    let names: Vec<&str> = axes.iter().map(|axis| &*axis.parameter().meaning).collect();
    format!("{}: {}", model.title(), names.join(" x "))
}
