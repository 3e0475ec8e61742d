//! Reference results of an independent program, `data/cells.csv`.

use rattlemap_dynamics::model::{GearPair, State, state};
use rattlemap_dynamics::orbit::Class;
use rattlemap_dynamics::word::Word;
use serde::Deserialize;

/// Decimals in the table of the values of cycles.
pub(crate) const STROBE_DECIMALS: i32 = 8;
pub(crate) const LYAPUNOV_DECIMALS: i32 = 5;
pub(crate) const MESH_DECIMALS: i32 = 6;

/// One row of the table; empty fields are none.
#[derive(Deserialize)]
pub(crate) struct Row {
    e: f64,
    omega: f64,
    class: Kind,
    period: Option<u32>,
    pub(crate) lyapunov: f64,
    pub(crate) lyapunov_error: Option<f64>,
    pub(crate) impacts_per_period: f64,
    pub(crate) mesh_fraction: f64,
    x1: Option<f64>,
    v1: Option<f64>,
    x2: Option<f64>,
    v2: Option<f64>,
    word: String,
}

#[derive(Clone, Copy, Deserialize, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Periodic,
    Chaotic,
}

impl Row {
    pub(crate) fn pair(&self) -> GearPair {
        super::paper(self.e, self.omega)
    }

    pub(crate) fn is_chaotic(&self) -> bool {
        self.class == Kind::Chaotic
    }

    pub(crate) fn class(&self) -> Class {
        match self.class {
            Kind::Periodic => Class::Periodic { period: self.period.expect("a cycle has a period") },
            Kind::Chaotic => Class::Chaotic,
        }
    }

    /// Returns a state of the cycle, or of its symmetry-conjugate orbit, at phase 0.
    pub(crate) fn strobe(&self) -> Option<State> {
        Some(state(&[self.x1?, self.v1?, self.x2?, self.v2?]))
    }

    /// Returns the word of the cycle; none if it was too long for the table.
    pub(crate) fn word(&self) -> Option<Word> {
        let printed = !self.word.is_empty() || self.impacts_per_period == 0.0;
        (self.class == Kind::Periodic && printed).then(|| Word::cyclic(self.word.as_bytes()))
    }

    pub(crate) fn place(&self) -> String {
        format!("e = {}, omega = {}", self.e, self.omega)
    }
}

/// Returns all 40 rows.
pub(crate) fn rows() -> Vec<Row> {
    let mut reader = csv::Reader::from_reader(include_bytes!("../data/cells.csv").as_slice());
    let rows: Vec<Row> = reader.deserialize().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 40);
    rows
}

/// Whether a number agrees with a printed one to this many decimals.
pub(crate) fn prints(value: f64, printed: f64, decimals: i32) -> bool {
    (value - printed).abs() <= 0.5 * 10f64.powi(-decimals)
}
