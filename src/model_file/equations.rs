//! Writes the equations of motion of a model.

use rattlemap_dynamics::model::{Contact, Side};

use super::definition::Definition;
use super::entry::Staged;
use crate::text::expression::Expression;

/// An entry as a coefficient in an equation.
pub(crate) trait Coefficient {
    /// Returns the number, if the entry is one.
    fn number(&self) -> Option<f64>;
    /// Returns the entry as written; a number in its shortest form.
    fn text(&self) -> String;
}

impl Coefficient for Expression {
    fn number(&self) -> Option<f64> {
        self.as_number()
    }

    fn text(&self) -> String {
        self.as_number().map_or_else(|| Expression::text(self).to_owned(), |number| number.to_string())
    }
}

/// The values of all stages are written as `[first | second]`.
impl Coefficient for Staged {
    fn number(&self) -> Option<f64> {
        let numbers: Option<Vec<f64>> = self.values().iter().map(Expression::as_number).collect();
        let numbers = numbers?;
        numbers.iter().all(|number| *number == numbers[0]).then_some(numbers[0])
    }

    fn text(&self) -> String {
        match (self.values(), self.number()) {
            (_, Some(number)) => number.to_string(),
            ([single], None) => text(single),
            (values, None) => format!("[{}]", values.iter().map(text).collect::<Vec<_>>().join(" | ")),
        }
    }
}

/// Returns the equations as lines: free motion, then contact with each wall. `z` and `w` name the gap and its velocity.
pub(super) fn lines(definition: &Definition, [z, w]: [&str; 2]) -> Vec<String> {
    let motion = &definition.motion;
    let mut lines = vec![
        format!("gap   {}", row(&motion.gap, &motion.coordinates, z)),
        format!("rate  {}", row(&motion.gap, &motion.velocities, w)),
    ];
    lines.extend(stages(definition));
    lines.push(format!("free, {}", between(definition, z)));
    lines.extend(equations(definition, None).map(|line| format!("    {line}")));
    for side in Side::BOTH {
        let Some(wall) = definition.wall(side) else { continue };
        let name = name(side);
        match (wall.contact(), &wall.spring) {
            (Contact::Impact | Contact::Elastic, Some(spring)) => {
                let elastic = product(&spring.stiffness, &format!("({})", minus(z, &wall.at)));
                let force = sum([elastic, product(&spring.damping, w)]);
                lines.push(format!("behind the {name} wall, with N = {force}"));
                lines.extend(equations(definition, Some("N")).map(|line| format!("    {line}")));
            }
            _ => lines
                .push(format!("on the {name} wall: {z} stays {}, as long as it is pressed", text(&wall.at))),
        }
    }
    lines
}

/// Returns a line that explains the stages, if there are any.
fn stages(definition: &Definition) -> Option<String> {
    let motion = &definition.motion;
    let begins = motion.stages.iter().enumerate().map(|(i, phase)| format!("{} from {}", i + 1, text(phase)));
    let whole = match motion.repeat {
        1 => "a period".to_owned(),
        repeat => format!("1/{repeat} of a period"),
    };
    let list = begins.collect::<Vec<_>>().join(", ");
    (!motion.stages.is_empty())
        .then(|| format!("stages of {whole}: {list}; [a | b] is a in the first stage, b in the second"))
}

/// Returns the name of a side.
pub(super) fn name(side: Side) -> &'static str {
    match side {
        Side::Right => "right",
        Side::Left => "left",
    }
}

fn row(entries: &[impl Coefficient], names: &[String], result: &str) -> String {
    format!("{result} = {}", sum(entries.iter().zip(names).map(|(entry, name)| product(entry, name))))
}

/// Returns the range of the gap in free motion.
fn between(definition: &Definition, z: &str) -> String {
    let at = |side| definition.wall(side).map(|wall| text(&wall.at));
    match (at(Side::Left), at(Side::Right)) {
        (Some(left), Some(right)) => format!("{left} < {z} < {right}"),
        (None, Some(right)) => format!("{z} < {right}"),
        (Some(left), None) => format!("{z} > {left}"),
        (None, None) => "everywhere".to_owned(),
    }
}

/// Returns one equation per coordinate, with an optional force along the gap row.
fn equations<'d>(definition: &'d Definition, force: Option<&'d str>) -> impl Iterator<Item = String> + 'd {
    let motion = &definition.motion;
    let rate = |suffix: &str| -> Vec<String> {
        motion.coordinates.iter().map(|name| format!("{name}{suffix}")).collect()
    };
    let [accelerations, rates, displacements] = ["''", "'", ""].map(rate);
    (0..motion.degrees()).map(move |i| {
        let along = force.and_then(|force| product(&motion.gap[i], force));
        let left = [
            terms(&motion.mass[i], &accelerations),
            terms(&motion.damping[i], &rates),
            terms(&motion.stiffness[i], &displacements),
            vec![along],
        ];
        let phase = product(&motion.frequency, "t").unwrap_or_else(|| "0".to_owned());
        let harmonics = motion.harmonics.iter().flat_map(|harmonic| {
            let order = if harmonic.order == 1 { String::new() } else { format!("{} ", harmonic.order) };
            [(&harmonic.cos, "cos"), (&harmonic.sin, "sin")]
                .map(|(factors, wave)| product(&factors[i], &format!("{wave}({order}{phase})")))
        });
        let right = harmonics.chain([constant(&motion.load[i])]);
        format!("{} = {}", sum(left.into_iter().flatten()), sum(right))
    })
}

fn terms(entries: &[impl Coefficient], names: &[String]) -> Vec<Option<String>> {
    entries.iter().zip(names).map(|(entry, name)| product(entry, name)).collect()
}

/// Joins terms with their signs; `0` without terms.
fn sum(terms: impl IntoIterator<Item = Option<String>>) -> String {
    let mut sum = String::new();
    for term in terms.into_iter().flatten() {
        match (sum.is_empty(), term.strip_prefix('-')) {
            (true, _) => sum = term,
            (false, Some(positive)) => sum += &format!(" - {positive}"),
            (false, None) => sum += &format!(" + {term}"),
        }
    }
    if sum.is_empty() { "0".to_owned() } else { sum }
}

/// Returns `coefficient name`; none if the coefficient is 0.
fn product(coefficient: &impl Coefficient, name: &str) -> Option<String> {
    match coefficient.number() {
        Some(0.0) => None,
        Some(1.0) => Some(name.to_owned()),
        Some(-1.0) => Some(format!("-{name}")),
        _ => Some(format!("{} {name}", factor(coefficient))),
    }
}

fn constant(load: &impl Coefficient) -> Option<String> {
    (load.number() != Some(0.0)).then(|| text(load))
}

/// Returns `name - entry`.
fn minus(name: &str, entry: &Expression) -> String {
    let entry_text = text(entry);
    match entry_text.strip_prefix('-').filter(|positive| is_product(positive)) {
        _ if entry.as_number() == Some(0.0) => name.to_owned(),
        Some(positive) => format!("{name} + {positive}"),
        None => format!("{name} - {}", factor(entry)),
    }
}

/// Returns an entry as a factor, in parentheses if it is a sum.
pub(crate) fn factor(entry: &impl Coefficient) -> String {
    let text = text(entry);
    match is_product(text.strip_prefix('-').unwrap_or(&text)) {
        true => text,
        false => format!("({text})"),
    }
}

/// Whether a text has no sum outside of parentheses and brackets. The sign of an exponent looks like a sum, which only adds
/// parentheses.
fn is_product(text: &str) -> bool {
    let mut depth = 0;
    text.chars().all(|c| {
        match c {
            '(' | '[' => depth += 1,
            ')' | ']' => depth -= 1,
            _ => {}
        }
        depth > 0 || !matches!(c, '+' | '-')
    })
}

fn text(entry: &impl Coefficient) -> String {
    entry.text()
}
