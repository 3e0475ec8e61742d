//! `[derived]`: parameters that are computed from others.

use super::axis::{meanings, names};
use super::error::SceneError;
use super::section::{Field, Section};
use crate::text::expression::Expression;
use rattlemap_dynamics::model::{Model, Parameter};

/// Derived parameters, ordered so that each needs only earlier ones.
#[derive(Clone, Debug, Default)]
pub(crate) struct Derived(Vec<Rule>);

/// A derived parameter and its expression.
#[derive(Clone, Debug)]
pub(crate) struct Rule {
    parameter: Parameter,
    /// Index of the parameter in the model's table.
    index: usize,
    expression: Expression,
    /// Indices of the parameters that are not derived and on which this one depends, directly or through other rules.
    roots: Vec<usize>,
}

impl Rule {
    /// Returns the parameter.
    pub(crate) fn parameter(&self) -> &Parameter {
        &self.parameter
    }

    /// Returns the parameter's index in the model's table.
    pub(crate) fn index(&self) -> usize {
        self.index
    }

    /// Returns the expression as written.
    pub(crate) fn text(&self) -> &str {
        self.expression.text()
    }

    /// Whether the derived parameter depends on the parameter `index`, directly or through other rules.
    pub(crate) fn follows(&self, index: usize) -> bool {
        self.roots.contains(&index)
    }
}

impl Derived {
    /// Returns the rules, ordered so that each needs only earlier ones.
    pub(crate) fn rules(&self) -> &[Rule] {
        &self.0
    }

    /// Whether the parameter `index` is derived.
    pub(crate) fn has(&self, index: usize) -> bool {
        self.0.iter().any(|rule| rule.index == index)
    }

    /// Computes the derived parameters of `model`. Their values may be outside their ranges.
    pub(crate) fn apply(&self, model: &mut dyn Model) {
        for rule in &self.0 {
            let value = rule.expression.evaluate(&|index| model.value(index));
            model.assign(rule.index, value);
        }
    }
}

/// Reads `[derived]`. `is_swept(index)` says whether an axis or a column sets a parameter.
pub(super) fn read(
    root: &Section<'_>,
    model: &dyn Model,
    is_swept: impl Fn(usize) -> bool,
) -> Result<Derived, SceneError> {
    let names = names(model);
    let section = root.section_among("derived", &names, &meanings(model))?;
    let parameters = root.section_among("parameters", &names, &meanings(model))?;
    let mut left = Vec::new();
    for (name, field) in section.fields() {
        let Some(index) = names.iter().position(|known| *known == name) else { continue };
        if is_swept(index) {
            return Err(field.conflict("it is also swept; remove it here, or sweep another parameter"));
        }
        // An expression in an argument overrides a value in the text. A value in an argument does not override an
        // expression in the text, which would be lost silently.
        if let Some(value) = parameters.get(name)
            && (value.is_argument() || !field.is_argument())
        {
            return Err(value.conflict(format!("`{}` derives it; remove one of the two", field.path)));
        }
        let expression = field.expression(&names, &meanings(model), "\"0.5*k1\"")?;
        let parameter = model.parameters()[index].clone();
        left.push((field, Rule { parameter, index, expression, roots: Vec::new() }));
    }
    in_order(left)
}

/// Orders rules so that each needs only earlier ones, and finds their roots.
fn in_order(mut left: Vec<(Field<'_>, Rule)>) -> Result<Derived, SceneError> {
    let mut ordered: Vec<Rule> = Vec::new();
    while !left.is_empty() {
        let is_open = |index: &usize| left.iter().any(|(_, rule)| rule.index == *index);
        let Some(next) = left.iter().position(|(_, rule)| !rule.expression.uses().iter().any(is_open)) else {
            return Err(circle(&left));
        };
        let (_, mut rule) = left.remove(next);
        for &index in rule.expression.uses() {
            match ordered.iter().find(|before| before.index == index) {
                Some(before) => rule.roots.extend(&before.roots),
                None => rule.roots.push(index),
            }
        }
        ordered.push(rule);
    }
    Ok(Derived(ordered))
}

/// Builds the error for rules that depend on each other in a circle.
fn circle(left: &[(Field<'_>, Rule)]) -> SceneError {
    // Each rule depends on another of them, so following the dependencies leads into the circle.
    let next = |at: usize| {
        let uses = left[at].1.expression.uses();
        left.iter().position(|(_, rule)| uses.contains(&rule.index)).unwrap_or(at)
    };
    let mut path = vec![0];
    let begin = loop {
        let at = next(path[path.len() - 1]);
        if let Some(begin) = path.iter().position(|&before| before == at) {
            break begin;
        }
        path.push(at);
    };
    let round = path[begin..].iter().chain([&path[begin]]);
    let named: Vec<&str> = round.map(|&at| &*left[at].1.parameter.name).collect();
    left[path[begin]].0.conflict(format!(
        "it depends on itself: {}; derive one of them from other parameters",
        named.join(" <- ")
    ))
}
