//! What makes two scenes the same to a computer: everything that a cell's record depends on.

use super::{Axis, Scale, Scene, Start, Steps, list, models};
use crate::model_file::FileModel;
use rattlemap_dynamics::model::Model;

/// Values that are told one by one.
const MOST_LISTED_VALUES: usize = 32;

impl Scene {
    /// Names and values of all that records depend on, in a fixed order: axes, parameters,
    /// integration, start and quantities. Title and kinds of file are left out.
    pub fn identity(&self) -> Vec<(String, String)> {
        let mut list = Vec::new();
        let mut tell = |name: String, value: String| list.push((name, value));
        let model = self.base();
        if model.name() != models::DEFAULT {
            tell("model".into(), model.name().to_owned());
        }
        // The default one is among the sources whose hash is told beside this.
        let told = model
            .downcast_ref()
            .filter(|file: &&FileModel| !(file.name() == models::DEFAULT && file.is_built_in()));
        if let Some(file) = told {
            tell("model.hash".into(), list::hash(&[&file.definition().text], std::iter::empty()));
        }
        for (i, axis) in self.axes().iter().enumerate() {
            let what = if axis.target().is_start() { "start" } else { "parameter" };
            tell(format!("axis.{i}.{what}"), axis.parameter().name.to_string());
            if axis.scale() == Scale::Values {
                tell(format!("axis.{i}.values"), values(axis));
                continue;
            }
            tell(format!("axis.{i}.min"), format!("{:?}", axis.min()));
            tell(format!("axis.{i}.max"), format!("{:?}", axis.max()));
            tell(format!("axis.{i}.count"), axis.count().to_string());
            if axis.scale() == Scale::Log {
                tell(format!("axis.{i}.scale"), "log".to_owned());
            }
        }
        if let Some(list) = self.list() {
            let names: Vec<&str> = list.parameters().map(|parameter| &*parameter.name).collect();
            tell("cells.columns".into(), names.join(" "));
            tell("cells.rows".into(), list.len().to_string());
            tell("cells.hash".into(), list.hash().to_owned());
        }
        for (parameter, expression) in self.derived() {
            tell(format!("derived.{}", parameter.name), expression.to_owned());
        }
        for (name, value) in self.fixed() {
            tell(format!("parameters.{name}"), format!("{value:?}"));
        }
        let integration = self.integration();
        let steps = match integration.steps_per_period {
            Steps::Auto => "auto".to_owned(),
            Steps::PerPeriod(steps) => steps.to_string(),
        };
        tell("integration.steps_per_period".into(), steps);
        tell("integration.transient_periods".into(), integration.transient_periods.to_string());
        tell("integration.observed_periods".into(), integration.observed_periods.to_string());
        tell("integration.early_stop".into(), integration.early_stop.to_string());
        tell("integration.undecided_periods".into(), integration.undecided_periods.to_string());
        tell("integration.max_period".into(), integration.max_period.to_string());
        let start = match self.start() {
            Start::State(state) => format!("state {state:?}"),
            start => start.policy().to_owned(),
        };
        tell("start".into(), start);
        if let Some(draw) = self.draw() {
            tell("start.count".into(), draw.count.to_string());
            tell("start.seed".into(), draw.seed.to_string());
        }
        if let Some(refine) = self.refine() {
            tell("refine.minimum_grid".into(), refine.minimum_grid.to_string());
            tell("refine.rounds".into(), refine.rounds.map_or("all".to_owned(), |n| n.to_string()));
            tell("refine.word".into(), refine.word.to_string());
            tell("refine.max_error".into(), format!("{:?}", refine.max_error));
            tell("refine.audit".into(), refine.audit.map_or("default".to_owned(), |n| n.to_string()));
        }
        let mut quantities = self.outputs().quantities.clone();
        quantities.sort_unstable();
        tell("outputs.quantities".into(), format!("{quantities:?}").to_lowercase());
        list
    }
}

/// The values of an axis, or what stands for them where they are many.
fn values(axis: &Axis) -> String {
    if axis.count() > MOST_LISTED_VALUES {
        return format!("{} with the hash {}", axis.count(), list::hash(&[], axis.values()));
    }
    axis.values().map(|value| format!("{value:?}")).collect::<Vec<_>>().join(" ")
}
