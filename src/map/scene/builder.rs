//! A scene built in Rust. It is written as TOML and then read like a file, so the same checks, errors and manifests
//! apply.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::RangeInclusive;

use super::document;
use super::error::Place;
use super::list::FileText;
use super::settings::{Format, Integration, Quantity, Refine, Steps};
use super::{Draw, Purpose, Scene, SceneError, Start};
use rattlemap_dynamics::model::Model;

/// Builds a scene step by step; [`SceneBuilder::build`] checks it. Anything that is not set has the default of scene
/// files.
#[derive(Clone, Debug)]
#[must_use]
pub struct SceneBuilder {
    model: Box<dyn Model>,
    /// Values as TOML, by table and key. A later value replaces an earlier one.
    fields: BTreeMap<(&'static str, String), String>,
    /// Fields of each axis, as TOML.
    axes: Vec<String>,
    /// Names of swept parameters.
    swept: Vec<String>,
    /// A list of cells as CSV.
    cells: Option<String>,
}

impl SceneBuilder {
    /// Begins a scene whose cells have the model's values, except for swept parameters.
    pub(super) fn new(model: Box<dyn Model>) -> SceneBuilder {
        SceneBuilder { model, fields: BTreeMap::new(), axes: Vec::new(), swept: Vec::new(), cells: None }
    }

    fn set(&mut self, table: &'static str, key: &str, value: impl ToString) {
        self.fields.insert((table, key.to_owned()), value.to_string());
    }

    fn with(mut self, table: &'static str, key: &str, value: impl ToString) -> SceneBuilder {
        self.set(table, key, value);
        self
    }

    /// Sets the heading of figures and reports.
    pub fn title(self, title: &str) -> SceneBuilder {
        self.with("", "title", quoted(title))
    }

    /// Sets a parameter that no axis sweeps.
    pub fn parameter(self, name: &str, value: f64) -> SceneBuilder {
        self.with("parameters", name, number(value))
    }

    /// Derives a parameter from others: `derived("k2", "0.5*k1")`.
    pub fn derived(self, name: &str, expression: &str) -> SceneBuilder {
        self.with("derived", name, quoted(expression))
    }

    /// Sweeps a parameter over `count` values with equal differences, both ends included. The first axis runs along
    /// columns.
    pub fn axis(self, parameter: &str, range: RangeInclusive<f64>, count: u32) -> SceneBuilder {
        self.sweep(parameter, range_lines(&range, count))
    }

    /// Sweeps a parameter over `count` values with equal ratios, both ends included.
    pub fn log_axis(self, parameter: &str, range: RangeInclusive<f64>, count: u32) -> SceneBuilder {
        self.sweep(parameter, range_lines(&range, count) + "\nscale = \"log\"")
    }

    /// Sweeps a parameter over increasing values.
    pub fn values_axis(self, parameter: &str, values: &[f64]) -> SceneBuilder {
        self.sweep(parameter, format!("values = {}", list(values.iter().map(|&value| number(value)))))
    }

    fn sweep(mut self, parameter: &str, lines: String) -> SceneBuilder {
        self.swept.push(parameter.to_owned());
        self.axes.push(format!("parameter = {}\n{lines}", quoted(parameter)));
        self
    }

    /// Sweeps a component of the start, given by one of the model's state names. The map then shows basins.
    pub fn start_axis(mut self, component: &str, range: RangeInclusive<f64>, count: u32) -> SceneBuilder {
        self.axes.push(format!("start = {}\n{}", quoted(component), range_lines(&range, count)));
        self
    }

    /// Lists the cells instead of axes. Each row has the values of these parameters or components of the start.
    pub fn cells<const N: usize>(mut self, parameters: [&str; N], rows: &[[f64; N]]) -> SceneBuilder {
        self.swept.extend(parameters.map(str::to_owned));
        let rows = rows.iter().map(|row| row.map(number).join(","));
        let lines: Vec<String> = std::iter::once(parameters.join(",")).chain(rows).collect();
        self.cells = Some(lines.join("\n"));
        self.with("cells", "file", quoted("cells.csv"))
    }

    /// Sets how long each cell is integrated.
    pub fn integration(mut self, integration: Integration) -> SceneBuilder {
        match integration.steps_per_period {
            Steps::Auto => self.set("integration", "steps_per_period", quoted("auto")),
            Steps::PerPeriod(steps) => self.set("integration", "steps_per_period", steps),
        }
        self.set("integration", "transient_periods", integration.transient_periods);
        self.set("integration", "observed_periods", integration.observed_periods);
        self.set("integration", "early_stop", integration.early_stop);
        self.set("integration", "undecided_periods", integration.undecided_periods);
        self.set("integration", "confirm_chaos", integration.confirm_chaos);
        self.with("integration", "max_period", integration.max_period)
    }

    /// Sets the states in which cells start; at rest by default.
    pub fn start(mut self, start: Start) -> SceneBuilder {
        self.fields.remove(&("start", "state".to_owned()));
        if let Start::State(state) = start {
            // A nonzero component beyond those of the model is written, so that reading the scene refuses it.
            let count = self.model.state_names().len();
            let has_more = state[count..].iter().any(|&x| x != 0.0);
            let written = if has_more { &state[..] } else { &state[..count] };
            self.set("start", "state", list(written.iter().map(|&x| number(x))));
        }
        self.with("start", "policy", quoted(start.policy()))
    }

    /// Sets the phase of the forcing, in radians, at which cells start. The model must be a
    /// [`FileModel`](crate::model_file::FileModel).
    pub fn start_phase(self, phase: f64) -> SceneBuilder {
        self.with("start", "phase", number(phase))
    }

    /// Adds random starts to each cell.
    pub fn draw(self, draw: Draw) -> SceneBuilder {
        self.with("start", "count", draw.count).with("start", "seed", draw.seed)
    }

    /// Makes the map adaptive.
    pub fn refine(mut self, refine: Refine) -> SceneBuilder {
        self.set("refine", "minimum_grid", refine.minimum_grid);
        self.set("refine", "max_error", number(refine.max_error));
        self.set("refine", "word", refine.word);
        self.set("refine", "continuous", quoted(refine.continuous.name()));
        for (key, value) in [("rounds", refine.rounds), ("audit", refine.audit)] {
            self.fields.remove(&("refine", key.to_owned()));
            value.iter().for_each(|value| self.set("refine", key, value));
        }
        self
    }

    /// Sets the quantities that are computed; class and Lyapunov exponent by default.
    pub fn quantities(self, quantities: &[Quantity]) -> SceneBuilder {
        self.with("outputs", "quantities", list(quantities.iter().map(|quantity| quoted(quantity.name()))))
    }

    /// Sets the kinds of files that are written.
    pub fn files(self, files: &[Format]) -> SceneBuilder {
        self.with("outputs", "files", list(files.iter().map(|format| quoted(format.name()))))
    }

    /// Builds the scene of a map.
    ///
    /// # Errors
    /// [`SceneError`] for the first error.
    pub fn build(self) -> Result<Scene, SceneError> {
        self.build_for(Purpose::Map)
    }

    /// Builds a scene for this purpose.
    ///
    /// # Errors
    /// [`SceneError`] for the first error.
    pub fn build_for(self, purpose: Purpose) -> Result<Scene, SceneError> {
        let text = self.text();
        let document = document::read(&text, "scene")?.placed(Place::Builder);
        let cells = self.cells.clone().unwrap_or_default();
        let find = |_, _: &str| Ok(FileText { name: "cells".to_owned(), text: cells.clone() });
        Scene::read(text, &document, &*self.model, purpose, &find)
    }

    /// Writes the scene as TOML. The model's values are added to the parameters that were set.
    fn text(&self) -> String {
        let mut all = self.clone();
        all.set("", "model", quoted(&super::models::named(&*self.model)));
        let phase = self.model.start_phase();
        if phase != 0.0 && !self.fields.contains_key(&("start", "phase".to_owned())) {
            all.set("start", "phase", number(phase));
        }
        for (index, parameter) in self.model.parameters().iter().enumerate() {
            let (name, value) = (&*parameter.name, self.model.value(index));
            let has = |table| self.fields.contains_key(&(table, name.to_owned()));
            let is_set = has("parameters") || has("derived") || self.swept.iter().any(|swept| swept == name);
            if !is_set && parameter.default != Some(value) {
                all.set("parameters", name, number(value));
            }
        }
        let mut text = String::new();
        let mut table = "";
        for ((next, key), value) in &all.fields {
            if *next != table {
                text += &format!("\n[{next}]\n");
                table = next;
            }
            let is_bare = key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
            text += &format!("{} = {value}\n", if is_bare { key.clone() } else { quoted(key) });
        }
        all.axes.iter().for_each(|axis| text += &format!("\n[[axis]]\n{axis}\n"));
        text
    }
}

fn range_lines(range: &RangeInclusive<f64>, count: u32) -> String {
    format!("min = {}\nmax = {}\ncount = {count}", number(*range.start()), number(*range.end()))
}

/// Writes a TOML list.
fn list(items: impl Iterator<Item = String>) -> String {
    format!("[{}]", items.collect::<Vec<_>>().join(", "))
}

/// Quotes a TOML string or key.
pub fn quoted(text: &str) -> String {
    let mut quoted = String::from('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if c.is_control() => {
                // Writing to a String cannot fail.
                let _ = write!(quoted, "\\u{:04X}", u32::from(c));
            }
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

/// Writes a number in TOML as the shortest decimal that reads back as the same number.
fn number(x: f64) -> String {
    if x.is_nan() { "nan".to_owned() } else { format!("{x:?}") }
}
