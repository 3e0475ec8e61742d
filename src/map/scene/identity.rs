//! The identity of a scene: everything that a cell's record depends on.

use super::{Axis, Quantity, Scale, Scene, Start, Steps, list, models};
use crate::model_file::FileModel;
use rattlemap_dynamics::model::{Model, Parameter};

/// Largest number of axis values that are listed; longer axes are identified by a hash.
const MOST_LISTED_VALUES: usize = 32;

impl Scene {
    /// Returns names and values of everything that records depend on, in a fixed order: axes, parameters, integration,
    /// start and quantities. The title and the kinds of files are left out.
    pub fn identity(&self) -> Vec<(String, String)> {
        let mut list = Vec::new();
        let mut add = |name: String, value: String| list.push((name, value));
        let model = self.base();
        if model.name() != models::DEFAULT {
            add("model".into(), model.name().to_owned());
        }
        // The file of the default model is part of the hash of the sources.
        let hashed = model
            .downcast_ref()
            .filter(|file: &&FileModel| !(file.name() == models::DEFAULT && file.is_built_in()));
        if let Some(file) = hashed {
            add("model.hash".into(), list::hash(&[&file.definition().text], std::iter::empty()));
        }
        for (i, axis) in self.axes().iter().enumerate() {
            let what = if axis.target().is_start() { "start" } else { "parameter" };
            add(format!("axis.{i}.{what}"), axis.parameter().name.to_string());
            if axis.scale() == Scale::Values {
                add(format!("axis.{i}.values"), values(axis));
                continue;
            }
            add(format!("axis.{i}.min"), format!("{:?}", axis.min()));
            add(format!("axis.{i}.max"), format!("{:?}", axis.max()));
            add(format!("axis.{i}.count"), axis.count().to_string());
            if axis.scale() == Scale::Log {
                add(format!("axis.{i}.scale"), "log".to_owned());
            }
        }
        if let Some(list) = self.list() {
            let names: Vec<&str> = list.parameters().map(|parameter| &*parameter.name).collect();
            add("cells.columns".into(), names.join(" "));
            add("cells.rows".into(), list.len().to_string());
            add("cells.hash".into(), list.hash().to_owned());
        }
        for (parameter, expression) in self.derived() {
            add(format!("derived.{}", parameter.name), expression.to_owned());
        }
        for (Parameter { name, .. }, value) in self.fixed() {
            add(format!("parameters.{name}"), format!("{value:?}"));
        }
        let integration = self.integration();
        let steps = match integration.steps_per_period {
            Steps::Auto => "auto".to_owned(),
            Steps::PerPeriod(steps) => steps.to_string(),
        };
        add("integration.steps_per_period".into(), steps);
        add("integration.transient_periods".into(), integration.transient_periods.to_string());
        add("integration.observed_periods".into(), integration.observed_periods.to_string());
        add("integration.early_stop".into(), integration.early_stop.to_string());
        add("integration.undecided_periods".into(), integration.undecided_periods.to_string());
        add("integration.confirm_chaos".into(), integration.confirm_chaos.to_string());
        add("integration.max_period".into(), integration.max_period.to_string());
        let start = match self.start() {
            Start::State(state) => format!("state {:?}", &state[..2 * self.coordinates().max(2)]),
            start => start.policy().to_owned(),
        };
        add("start".into(), start);
        if model.start_phase() != 0.0 {
            add("start.phase".into(), format!("{:?}", model.start_phase()));
        }
        if let Some(draw) = self.draw() {
            add("start.count".into(), draw.count.to_string());
            add("start.seed".into(), draw.seed.to_string());
        }
        if let Some(sample) = self.sample() {
            let (name, states) = sample.spread.parts();
            let numbers = states.map(|state| format!("{:?}", &state[..2 * self.coordinates()]));
            add("start.sample".into(), format!("{name} {} {}", numbers[0], numbers[1]));
            add("start.count".into(), sample.count.to_string());
            add("start.seed".into(), sample.seed.to_string());
            add("start.width".into(), format!("{:?}", sample.width));
        }
        if let Some(refine) = self.refine() {
            add("refine.minimum_grid".into(), refine.minimum_grid.to_string());
            add("refine.rounds".into(), refine.rounds.map_or("all".to_owned(), |n| n.to_string()));
            add("refine.word".into(), refine.word.to_string());
            add("refine.max_error".into(), format!("{:?}", refine.max_error));
            add("refine.audit".into(), refine.audit.map_or("default".to_owned(), |n| n.to_string()));
        }
        let mut quantities = self.outputs().quantities.clone();
        quantities.sort_unstable();
        let names: Vec<&str> = quantities.into_iter().map(Quantity::name).collect();
        add("outputs.quantities".into(), format!("[{}]", names.join(", ")));
        list
    }
}

/// Lists the values of an axis, or their number and hash.
fn values(axis: &Axis) -> String {
    if axis.count() > MOST_LISTED_VALUES {
        return format!("{} with the hash {}", axis.count(), list::hash(&[], axis.values()));
    }
    axis.values().map(|value| format!("{value:?}")).collect::<Vec<_>>().join(" ")
}
