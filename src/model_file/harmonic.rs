//! `[[harmonic]]`: harmonics of the force beside the first.

use rattlemap_dynamics::model::{HIGHEST_ORDER, MOST_HARMONICS};

use super::entry::Names;
use crate::text::document::Value;
use crate::text::error::SceneError;
use crate::text::expression::Expression;
use crate::text::section::Section;

/// Keys of `[[harmonic]]`.
const HARMONIC_KEYS: [&str; 3] = ["order", "cos", "sin"];

/// A harmonic of the force: `cos cos(order frequency t) + sin sin(order frequency t)`.
#[derive(Clone, Debug)]
pub struct HarmonicForce {
    /// Order, 2 or more.
    pub order: u32,
    /// Factors of the cosine, one for each coordinate.
    pub cos: Vec<Expression>,
    /// Factors of the sine.
    pub sin: Vec<Expression>,
}

/// Reads the harmonics of a model with `count` coordinates, in increasing order.
pub(super) fn read(
    root: &Section<'_>,
    names: Names<'_>,
    count: usize,
) -> Result<Vec<HarmonicForce>, SceneError> {
    let Some(field) = root.get("harmonic") else { return Ok(Vec::new()) };
    let tables = format!(
        "at most {MOST_HARMONICS} tables, [[harmonic]], each with order and with cos, sin or both; order 1 is `force` and \
         `force_sin` in [motion]"
    );
    let mut harmonics: Vec<HarmonicForce> = Vec::new();
    for item in &field.list_of(0..=MOST_HARMONICS, "tables", &tables)? {
        let section = Section::open(item.node, &item.path, &HARMONIC_KEYS)?;
        let field = section.require("order", "write order = 2 for twice the frequency")?;
        if let Value::Integer(1) = field.node.value {
            return Err(field.conflict("order 1 is `force` and `force_sin` in [motion]"));
        }
        if let Value::Float(order) = field.node.value
            && (2.0 * order).fract() == 0.0
        {
            return Err(field.conflict(
                "an order is a whole number; for half orders, halve `frequency` and double all orders: order 1, `force`, becomes order 2",
            ));
        }
        let order = field.whole(2..=HIGHEST_ORDER)?;
        if harmonics.iter().any(|other| other.order == order) {
            return Err(field
                .conflict("there is already a harmonic of this order; write its cos and sin in one table"));
        }
        if section.get("cos").is_none() && section.get("sin").is_none() {
            return Err(section
                .missing("cos", "a harmonic needs cos, sin or both, with one entry for each coordinate"));
        }
        let [cos, sin] = ["cos", "sin"].map(|name| names.vector_or_zeros(&section, name, count));
        harmonics.push(HarmonicForce { order, cos: cos?, sin: sin? });
    }
    harmonics.sort_by_key(|harmonic| harmonic.order);
    Ok(harmonics)
}
