//! A cycle that solves its equations, and its derivatives by a parameter, as JSON and as text.

use std::f64::consts::TAU;

use serde_json::{Map, Value, json};

use crate::map::branches::measured;
use crate::map::scene::Quantity;
use crate::record::measures::Dimension;
use crate::show::numbers::Number;
use crate::show::orbit_json::components;
use crate::show::orbit_summary::{complex, without_shifts};
use rattlemap_dynamics::cycle::{Cycle, CycleError, Derivatives, Slope};
use rattlemap_dynamics::model::{Model, ModelError};
use rattlemap_dynamics::number::significant;

/// A cycle that solves its equations.
#[derive(Clone, Debug)]
pub struct Refined {
    cycle: Cycle,
    /// The name of a parameter, the derivatives of the cycle by it, and the quantities that they include.
    derivatives: Option<(String, Derivatives, Vec<Number>)>,
}

impl Refined {
    /// Computes the derivatives of a cycle by the parameter with this name, or none.
    ///
    /// # Errors
    /// [`CycleError`] if there is no such parameter, or the cycle has no derivatives.
    pub fn new(model: &dyn Model, cycle: Cycle, by: Option<&str>) -> Result<Refined, CycleError> {
        let quantities = [&[Quantity::Impacts, Quantity::Mesh][..], &Quantity::measured()].concat();
        let numbers = Number::of(model, &quantities);
        let measure = |model: &dyn Model, cycle: &Cycle| -> Vec<Option<f64>> {
            let of_cycle = (cycle.periods, &cycle.word, cycle.solution.state(), &cycle.multipliers[..]);
            let column = measured(model, 0.0, of_cycle).ok();
            numbers.iter().map(|number| number.of_column(column.as_ref()?)).collect()
        };
        let derivatives = match by {
            None => None,
            Some(name) => {
                // Numbers without a unit have nothing in common.
                let is_like = |a: &Number, b: &Number| {
                    a.dimension != Dimension::None
                        && (a.dimension, &a.unit, a.component.is_some())
                            == (b.dimension, &b.unit, b.component.is_some())
                };
                let kind = |(i, number): (usize, &Number)| {
                    numbers.iter().position(|other| is_like(number, other)).unwrap_or(i)
                };
                let kinds: Vec<usize> = numbers.iter().enumerate().map(kind).collect();
                let here = measure(model, &cycle);
                // Angles pass from pi to -pi.
                let values = |model: &dyn Model, cycle: &Cycle| -> Vec<Option<f64>> {
                    let nearest = |((value, here), number): ((Option<f64>, &Option<f64>), &Number)| {
                        let turns = (value? - (*here)?) / TAU;
                        let whole = if number.dimension == Dimension::Angle { turns.round() } else { 0.0 };
                        Some(value? - TAU * whole)
                    };
                    measure(model, cycle).into_iter().zip(&here).zip(&numbers).map(nearest).collect()
                };
                let found = cycle.derivatives(
                    model,
                    model.index(name).map_err(ModelError::from)?,
                    (&values, &kinds),
                )?;
                Some((name.to_owned(), found, numbers))
            }
        };
        Ok(Refined { cycle, derivatives })
    }

    /// Returns the object `refined` of `orbit --json`. A derivative that does not exist is null, and `reasons` says why.
    pub fn object(&self, model: &dyn Model) -> Value {
        let cycle = &self.cycle;
        let mut object = json!({
            "period": cycle.periods,
            "word": cycle.word.time_order(),
            "stable": cycle.is_stable(),
            "floquet": cycle.multipliers,
            "strobe": components(model, &cycle.solution.state()),
            "event_times": cycle.event_times(),
        });
        if let Some((by, found, numbers)) = &self.derivatives {
            let (mut quantities, mut reasons) = (Map::new(), Map::new());
            for (number, slope) in numbers.iter().zip(&found.numbers) {
                let reason = slope.and_then(|slope| slope.err()).map(|kink| kink.to_string().into());
                reasons.extend(reason.map(|reason| (number.name.clone(), reason)));
                quantities.insert(number.name.clone(), slope.and_then(|slope| slope.ok()).into());
            }
            let kink = found.multipliers.iter().flatten().find_map(|slope| slope.err());
            reasons.extend(kink.map(|kink| ("floquet".to_owned(), kink.to_string().into())));
            object["derivatives"] = json!({
                "by": by,
                "strobe": found.state,
                "event_times": found.event_times,
                "floquet": found.multipliers.iter().map(|pair| pair.map(Slope::ok)).collect::<Vec<_>>(),
                "quantities": quantities,
                "reasons": reasons,
            });
        }
        object
    }

    /// Describes the cycle.
    pub fn summary(&self, model: &dyn Model) -> String {
        let cycle = &self.cycle;
        let kind = if cycle.is_stable() { "stable" } else { "unstable" };
        let word = if cycle.word.is_empty() { "no events".to_owned() } else { cycle.word.time_order() };
        let multipliers: Vec<String> = cycle.multipliers.iter().copied().map(complex).collect();
        let names = || model.state_names().into_iter();
        let listed = |values: &[f64]| -> String {
            let texts: Vec<String> =
                names().zip(values).map(|(name, value)| format!("{name}={value:?}")).collect();
            texts.join(" ")
        };
        let times = |times: &[f64]| times.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(" ");
        let mut facts = vec![
            ("refined cycle".to_owned(), format!("period {}, {kind}", cycle.periods)),
            ("word, in time".to_owned(), word),
            ("Floquet multipliers".to_owned(), multipliers.join(", ") + &without_shifts(model)),
            ("strobe".to_owned(), listed(&cycle.solution.state())),
            ("events at t / T".to_owned(), times(&cycle.event_times())),
        ];
        if let Some((by, found, numbers)) = &self.derivatives {
            facts.push((format!("derivatives by {by}"), String::new()));
            facts.push(("strobe".to_owned(), listed(&found.state)));
            facts.push(("events at t / T".to_owned(), times(&found.event_times)));
            let of_multiplier = |pair: &[Slope; 2]| match *pair {
                [Ok(re), Ok(im)] => complex([re, im]),
                _ => "none".to_owned(),
            };
            let list: Vec<String> = found.multipliers.iter().map(of_multiplier).collect();
            facts.push(("Floquet multipliers".to_owned(), list.join(", ")));
            for (number, slope) in numbers.iter().zip(&found.numbers) {
                let text = slope.map(|slope| slope.map_or_else(|kink| kink.to_string(), significant));
                facts.extend(text.map(|text| (number.name.clone(), text)));
            }
        }
        let lines = facts.iter().map(|(label, value)| format!("{label:<21} {value}\n"));
        ["\n".to_owned()].into_iter().chain(lines).collect()
    }
}
