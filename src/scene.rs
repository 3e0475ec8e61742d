//! What is asked: a scene, read from TOML and checked whole.
//!
//! Parsing is pure: it takes the text and the name that messages give it. Whatever is
//! wrong is found here, with its place and its remedy; what parsing returns cannot fail
//! later. `--set` arguments are applied before anything is checked, so a value is judged
//! the same way wherever it came from.

mod axis;
mod document;
mod error;
mod identity;
mod overrides;
mod section;
mod settings;
mod start;
#[cfg(test)]
mod tests;

pub use axis::{Axis, MAX_COUNT};
pub use error::{Place, Problem, SceneError};
pub use settings::{AUDIT, Continuous, Format, Integration, Outputs, Quantity, Refine, Steps};
pub use start::{Draw, Start};

use crate::model::GearPair;
use crate::orbit;
use section::Section;

/// What stands outside of any table, and the tables.
const TOP_LEVEL: [&str; 8] =
    ["title", "model", "parameters", "axis", "integration", "start", "refine", "outputs"];

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
    base: GearPair,
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
        let mut document = document::read(text, name)?;
        for set in sets {
            overrides::apply(&mut document, set)?;
        }
        let root = Section::open(&document, "", &TOP_LEVEL)?;
        if let Some(model) = root.get("model") {
            model.choice(&[("gear-pair", ())])?;
        }
        let (command, axis_count) = purpose.needs();
        let axes = axis::read(&root, axis_count, command)?;
        let title = match root.get("title") {
            Some(title) => title.text()?.to_owned(),
            None => default_title(&axes),
        };
        let scene = Scene {
            text: text.to_owned(),
            title,
            base: axis::read_parameters(&root, &axes)?,
            integration: settings::read_integration(&root)?,
            start: start::read(&root)?,
            draw: start::read_draw(&root, purpose)?,
            refine: settings::read_refine(&root, purpose)?,
            outputs: settings::read_outputs(&root, purpose)?,
            axes,
        };
        start::check(&root, scene.start, scene.draw)?;
        Ok(scene)
    }

    /// The text that was parsed, without the `--set` arguments.
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

    /// The parameters of the first cell: swept ones at their `min`.
    pub fn base(&self) -> GearPair {
        self.base
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

    /// The gear pair of the cell with the given index on each axis.
    ///
    /// # Panics
    /// If there are not as many indices as axes.
    pub fn cell(&self, indices: &[usize]) -> GearPair {
        assert_eq!(indices.len(), self.axes.len(), "one index per axis");
        let mut pair = self.base;
        for (axis, &i) in self.axes.iter().zip(indices) {
            // Cannot fail: both ends of the axis are in the range, and ranges are convex.
            let set = pair.set(axis.parameter().name, axis.value(i));
            debug_assert_eq!(set, Ok(()));
        }
        pair
    }

    /// Axis value and gear pair of every cell of a scene with one axis, in order.
    ///
    /// # Panics
    /// If the scene does not have exactly one axis.
    pub fn line(&self) -> Vec<(f64, GearPair)> {
        let count = self.axes[0].count();
        (0..count).map(|i| (self.axes[0].value(i), self.cell(&[i]))).collect()
    }
}

/// One gear pair from `NAME=VALUE` arguments alone: Table 1 with restitution `e` unless set.
///
/// # Errors
/// [`SceneError`] for an unknown parameter, a value out of its range, or a setting that is
/// not a parameter.
pub fn single_cell(e: f64, sets: &[String]) -> Result<GearPair, SceneError> {
    let defaults = format!("[parameters]\ne = {e:?}\n");
    let mut document = document::read(&defaults, "defaults")?;
    for set in sets {
        overrides::apply(&mut document, set)?;
    }
    let root = Section::open(&document, "", &["parameters"])?;
    axis::read_parameters(&root, &[])
}

fn default_title(axes: &[Axis]) -> String {
    let names: Vec<&str> = axes.iter().map(|axis| axis.parameter().meaning).collect();
    format!("Gear pair: {}", names.join(" x "))
}
