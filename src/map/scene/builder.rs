//! A scene built in Rust. It is written as TOML and then read like a file, so the same checks, errors and manifests apply.

use std::fmt::Write;
use std::ops::RangeInclusive;

use super::document;
use super::error::Place;
use super::list::FileText;
use super::settings::{Continuous, Format, Integration, Quantity, Refine, Steps};
use super::{Draw, Purpose, Scene, SceneError, Start};
use rattlemap_dynamics::model::Model;

/// Builds a scene step by step; [`SceneBuilder::build`] checks it. Anything that is not set has the default of scene files.
#[derive(Clone, Debug)]
#[must_use]
pub struct SceneBuilder {
    model: Box<dyn Model>,
    title: Option<String>,
    parameters: Vec<(String, f64)>,
    derived: Vec<(String, String)>,
    /// For each axis the key `parameter` or `start`, the name of the swept quantity, and the other lines of the table.
    axes: Vec<(&'static str, String, String)>,
    /// A list of cells as CSV.
    cells: Option<String>,
    integration: Option<Integration>,
    start: Start,
    draw: Option<Draw>,
    refine: Option<Refine>,
    quantities: Option<Vec<Quantity>>,
    files: Option<Vec<Format>>,
}

impl SceneBuilder {
    /// Begins a scene whose cells have the model's values, except for swept parameters.
    pub(super) fn new(model: Box<dyn Model>) -> SceneBuilder {
        SceneBuilder {
            model,
            title: None,
            parameters: Vec::new(),
            derived: Vec::new(),
            axes: Vec::new(),
            cells: None,
            integration: None,
            start: Start::Rest,
            draw: None,
            refine: None,
            quantities: None,
            files: None,
        }
    }

    /// Sets the heading of figures and reports.
    pub fn title(mut self, title: &str) -> SceneBuilder {
        self.title = Some(title.to_owned());
        self
    }

    /// Sets a parameter that no axis sweeps.
    pub fn parameter(mut self, name: &str, value: f64) -> SceneBuilder {
        self.parameters.push((name.to_owned(), value));
        self
    }

    /// Derives a parameter from others: `derived("k2", "0.5*k1")`.
    pub fn derived(mut self, name: &str, expression: &str) -> SceneBuilder {
        // A later expression replaces an earlier one.
        self.derived.retain(|(derived, _)| derived != name);
        self.derived.push((name.to_owned(), expression.to_owned()));
        self
    }

    /// Sweeps a parameter over `count` values with equal differences, both ends included. The first axis runs along columns.
    pub fn axis(self, parameter: &str, range: RangeInclusive<f64>, count: u32) -> SceneBuilder {
        self.swept(parameter, range_lines(&range, count))
    }

    /// Sweeps a parameter over `count` values with equal ratios, both ends included.
    pub fn log_axis(self, parameter: &str, range: RangeInclusive<f64>, count: u32) -> SceneBuilder {
        self.swept(parameter, range_lines(&range, count) + "\nscale = \"log\"")
    }

    /// Sweeps a parameter over increasing values.
    pub fn values_axis(self, parameter: &str, values: &[f64]) -> SceneBuilder {
        let values: Vec<String> = values.iter().map(|&value| number(value)).collect();
        self.swept(parameter, format!("values = [{}]", values.join(", ")))
    }

    fn swept(mut self, parameter: &str, lines: String) -> SceneBuilder {
        self.axes.push(("parameter", parameter.to_owned(), lines));
        self
    }

    /// Sweeps a component of the start, given by one of the model's state names. The map then shows basins.
    pub fn start_axis(mut self, component: &str, range: RangeInclusive<f64>, count: u32) -> SceneBuilder {
        self.axes.push(("start", component.to_owned(), range_lines(&range, count)));
        self
    }

    /// Lists the cells instead of axes. Each row has the values of these parameters or components of the start.
    pub fn cells<const N: usize>(mut self, parameters: [&str; N], rows: &[[f64; N]]) -> SceneBuilder {
        let row = |row: &[f64; N]| row.map(number).join(",");
        let rows = rows.iter().map(row);
        let lines: Vec<String> = std::iter::once(parameters.join(",")).chain(rows).collect();
        self.cells = Some(lines.join("\n"));
        self
    }

    /// Sets how long each cell is integrated.
    pub fn integration(mut self, integration: Integration) -> SceneBuilder {
        self.integration = Some(integration);
        self
    }

    /// Sets the states in which cells start; at rest by default.
    pub fn start(mut self, start: Start) -> SceneBuilder {
        self.start = start;
        self
    }

    /// Adds random starts to each cell.
    pub fn draw(mut self, draw: Draw) -> SceneBuilder {
        self.draw = Some(draw);
        self
    }

    /// Makes the map adaptive.
    pub fn refine(mut self, refine: Refine) -> SceneBuilder {
        self.refine = Some(refine);
        self
    }

    /// Sets the quantities that are computed; class and Lyapunov exponent by default.
    pub fn quantities(mut self, quantities: &[Quantity]) -> SceneBuilder {
        self.quantities = Some(quantities.to_vec());
        self
    }

    /// Sets the kinds of files that are written.
    pub fn files(mut self, files: &[Format]) -> SceneBuilder {
        self.files = Some(files.to_vec());
        self
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

    /// Writes the scene as TOML.
    fn text(&self) -> String {
        let mut text = String::new();
        let mut line = |line: String| {
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{line}");
        };
        self.title.iter().for_each(|title| line(format!("title = {}", quoted(title))));
        line(format!("model = {}", quoted(&super::models::named(&*self.model))));
        line("\n[parameters]".to_owned());
        let mut parameters = self.parameters.clone();
        for (index, parameter) in self.model.parameters().iter().enumerate() {
            let (name, value) = (&*parameter.name, self.model.value(index));
            let is_set = parameters.iter().any(|(set, _)| set == name)
                || self.axes.iter().any(|(what, set, _)| *what == "parameter" && set == name)
                || self.derived.iter().any(|(set, _)| set == name)
                || self.cells.as_ref().is_some_and(|table| {
                    table.lines().next().is_some_and(|names| names.split(',').any(|column| column == name))
                });
            if !is_set && parameter.default != Some(value) {
                parameters.push((name.to_owned(), value));
            }
        }
        // A later value replaces an earlier one.
        for (i, (name, value)) in parameters.iter().enumerate() {
            if !parameters[i + 1..].iter().any(|(later, _)| later == name) {
                line(format!("{} = {}", quoted(name), number(*value)));
            }
        }
        if !self.derived.is_empty() {
            line("\n[derived]".to_owned());
        }
        for (name, expression) in &self.derived {
            line(format!("{} = {}", quoted(name), quoted(expression)));
        }
        for (what, name, lines) in &self.axes {
            line(format!("\n[[axis]]\n{what} = {}\n{lines}", quoted(name)));
        }
        if self.cells.is_some() {
            line("\n[cells]\nfile = \"cells.csv\"".to_owned());
        }
        self.integration.iter().for_each(|integration| line(integration_table(integration)));
        line(self.start_table());
        self.refine.iter().for_each(|refine| line(refine_table(refine)));
        line("\n[outputs]".to_owned());
        let names = |names: Vec<&str>| names.into_iter().map(quoted).collect::<Vec<_>>().join(", ");
        if let Some(quantities) = &self.quantities {
            let list = names(quantities.iter().map(|quantity| quantity.name()).collect());
            line(format!("quantities = [{list}]"));
        }
        if let Some(files) = &self.files {
            line(format!("files = [{}]", names(files.iter().map(|format| format.name()).collect())));
        }
        text
    }

    fn start_table(&self) -> String {
        let mut table = format!("\n[start]\npolicy = \"{}\"", self.start.policy());
        if let Start::State(state) = self.start {
            // A nonzero component beyond those of the model is written, so that reading the scene refuses it.
            let count = self.model.state_names().len();
            let has_more = state[count..].iter().any(|&x| x != 0.0);
            let written = if has_more { &state[..] } else { &state[..count] };
            let numbers: Vec<String> = written.iter().map(|&x| number(x)).collect();
            table += &format!("\nstate = [{}]", numbers.join(", "));
        }
        if let Some(Draw { count, seed }) = self.draw {
            table += &format!("\ncount = {count}\nseed = {seed}");
        }
        table
    }
}

fn range_lines(range: &RangeInclusive<f64>, count: u32) -> String {
    format!("min = {}\nmax = {}\ncount = {count}", number(*range.start()), number(*range.end()))
}

fn integration_table(integration: &Integration) -> String {
    let Integration {
        steps_per_period,
        transient_periods,
        observed_periods,
        early_stop,
        undecided_periods,
        max_period,
    } = integration;
    let steps = match steps_per_period {
        Steps::Auto => "\"auto\"".to_owned(),
        Steps::PerPeriod(steps) => steps.to_string(),
    };
    format!(
        "\n[integration]\nsteps_per_period = {steps}\ntransient_periods = {transient_periods}\n\
         observed_periods = {observed_periods}\nearly_stop = {early_stop}\n\
         undecided_periods = {undecided_periods}\nmax_period = {max_period}"
    )
}

fn refine_table(refine: &Refine) -> String {
    let Refine { minimum_grid, rounds, max_error, audit, word, continuous } = *refine;
    let continuous = match continuous {
        Continuous::Interpolated => "interpolated",
        Continuous::Empty => "empty",
    };
    let max_error = number(max_error);
    let optional = |name, value: Option<u32>| value.map_or(String::new(), |n| format!("\n{name} = {n}"));
    format!(
        "\n[refine]\nminimum_grid = {minimum_grid}\nmax_error = {max_error}\nword = {word}\n\
         continuous = \"{continuous}\"{}{}",
        optional("rounds", rounds),
        optional("audit", audit)
    )
}

/// Quotes a TOML string or key.
fn quoted(text: &str) -> String {
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
