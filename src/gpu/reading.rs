//! Conversion of a lane's results to a record.

use super::constants::Constants;
use super::layout::{
    Finding, Reading, SPELLED_PATTERN, SPELLED_PATTERN_LENGTH, SPELLED_WORD, SPELLED_WORD_LENGTH,
    symbols_per_number,
};
use super::measured;
use crate::record::classify::mark_tied;
use crate::record::{Record, SymbolCode, joined, measures, valid};
use rattlemap_dynamics::orbit::Quantities;
use rattlemap_dynamics::word::Word;

/// Natural logarithm of the growth per period below which all multipliers of a cycle count as zero. WGSL has no infinity.
const SUPERSTABLE_BELOW: f64 = -1e6;

/// Results of a lane that has ended.
#[derive(Clone, Debug)]
pub struct LaneResult {
    pub(super) number: u32,
    pub(super) flow: u32,
    pub(super) reading: Reading,
    pub(super) finding: Finding,
    pub(super) measured: Option<Box<[f64]>>,
}

impl LaneResult {
    /// Returns the number that the caller gave the lane.
    pub fn number(&self) -> u32 {
        self.number
    }

    /// Returns the index of its flow.
    pub fn flow(&self) -> u32 {
        self.flow
    }

    /// Returns the quantities that were measured along the motion.
    pub fn quantities(&self, constants: &[Option<Constants>]) -> Option<Quantities> {
        measured::quantities(constants[self.flow as usize].as_ref()?, self.measured.as_deref()?)
    }

    /// Returns modulus and argument of the largest multiplier of a cycle.
    pub fn multiplier(&self, constants: &[Option<Constants>]) -> Option<[f64; 2]> {
        let (constants, measured) = (constants[self.flow as usize].as_ref()?, self.measured.as_deref()?);
        let is_cycle = self.finding.valid & valid::LYAPUNOV != 0 && self.finding.period > 0;
        is_cycle.then(|| measured::multiplier(constants, measured))
    }

    /// Returns its record. `constants` belong to the tables with which the lane ran. A million records take most of a second: convert them
    /// on all cores.
    pub fn record(&self, constants: &[Option<Constants>]) -> Record {
        let mut record = record(constants[self.flow as usize].as_ref(), &self.reading, &self.finding);
        if self.measured.is_some() {
            let (quantities, multiplier) = (self.quantities(constants), self.multiplier(constants));
            record.set_measures(&measures::Measured {
                quantities: quantities.as_ref(),
                multiplier,
                cycle_time: None,
            });
        }
        record
    }
}

/// Returns the record of a lane. `None` for its constants means that the lane was refused before it started.
fn record(constants: Option<&Constants>, reading: &Reading, finding: &Finding) -> Record {
    let status = finding.status;
    let Some(constants) = constants else { return Record { status, ..Record::default() } };
    let mut record = Record {
        period: finding.period,
        periods_run: finding.periods_run,
        status,
        symmetric: finding.symmetric,
        valid: finding.valid,
        mesh_fraction: reading.mesh_fraction,
        ..Record::default()
    };
    if finding.valid & valid::TIED != 0 {
        mark_tied(&mut record);
    }
    if finding.valid & (valid::OPEN | valid::NEAR_STROBE) == 0 {
        record.valid &= !valid::TIED;
    }
    let is_valid = |bits: u32| finding.valid & bits != 0;
    if is_valid(valid::STROBE) {
        record.strobe = constants.strobe(&reading.strobe).into();
    }
    if is_valid(valid::IMPACTS) {
        record.impacts_per_period = f64::from(finding.impacts) / f64::from(finding.counted);
    }
    if is_valid(valid::LYAPUNOV) {
        let period = constants.period;
        (record.lyapunov, record.lyapunov_error) = (reading.growth / period, reading.growth_error / period);
        if reading.growth < SUPERSTABLE_BELOW {
            record.lyapunov = f64::NEG_INFINITY;
        }
    }
    if is_valid(valid::WORD) {
        match spelled(&finding.spelling, SPELLED_WORD, SPELLED_WORD_LENGTH, constants.gaps()) {
            Ok(word) => record.set_word(&word),
            Err(hashed) => (record.word_length, record.word_hash) = hashed,
        }
    }
    if is_valid(valid::PATTERN) {
        match spelled(&finding.spelling, SPELLED_PATTERN, SPELLED_PATTERN_LENGTH, constants.gaps()) {
            Ok(pattern) => record.set_pattern(&pattern),
            Err(hashed) => (record.pattern_length, record.pattern_hash) = hashed,
        }
    }
    record
}

/// Returns the word that is stored at these places of a spelling. If the word is too long to be stored, returns its length and hash as an
/// error.
fn spelled(spelling: &[u32], symbols: usize, length: usize, gaps: usize) -> Result<Word, (u32, u64)> {
    let code = SymbolCode::of_gaps(gaps);
    let symbol = |i: usize| {
        let per_number = symbols_per_number(code.bits);
        let (number, bit) = (i / per_number, code.bits * (i % per_number));
        b'0' + (spelling[symbols + number] >> bit) as u8 % (1 << code.bits)
    };
    let count = spelling[length] as usize;
    if count > code.most {
        return Err((spelling[length], joined([spelling[length + 1], spelling[length + 2]])));
    }
    Ok(Word::cyclic(&(0..count).map(symbol).collect::<Vec<_>>()))
}
