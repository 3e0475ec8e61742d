//! The Taylor series of the propagator `exp(G h)`.

use super::columns::Columns;

/// Terms of the Taylor table: the remainder is below `1.6^23 / 23! < 2e-18`.
pub(super) const PROPAGATOR_ORDER: usize = 22;

/// Largest `|G| h` for which the Taylor table is used. A larger one loses digits by cancellation. A smaller one needs
/// more steps: from 0.8 to 1.6, steps per period fall by a third and instructions by 7 %.
pub(crate) const RADIUS: f64 = 1.6;

/// Returns the terms `(G unit)^(n+1) / (n+1)!` of the propagator, minus the identity.
pub(super) fn taylor_table(generator: &Columns, unit: f64) -> Vec<Columns> {
    let mut table = vec![generator.scaled(unit)];
    for n in 2..=PROPAGATOR_ORDER {
        table.push(table[n - 2].times(generator).scaled(unit / n as f64));
    }
    table
}

/// Returns the propagator, minus the identity, of a time of `u <= 1` Taylor steps.
pub(super) fn partial_sum(table: &[Columns], u: f64) -> Columns {
    // The first omitted term is below 1e-17.
    let terms = match u {
        u if u < 0.02 => 8,
        u if u < 0.15 => 12,
        u if u < 0.5 => 17,
        _ => PROPAGATOR_ORDER,
    };
    Columns::horner(&table[..terms], u)
}
