//! Reading a lane's last state as a record.

use nalgebra::Matrix4;

use super::LaneSettings;
use super::batch::exponent_block;
use super::constants::Constants;
use super::layout::{MODE_PRESSED, Motion, STAGE_DONE, Tally};
use crate::orbit::Status;
use crate::record::{Record, WORD_SYMBOLS, valid};

/// Recurrence distance, in quarter octaves below 1, from which a period counts as reached.
const SETTLED: u32 = 52;

/// Symbols that the shader keeps in one number.
const SYMBOLS_PER_NUMBER: usize = 10;

/// Symbols that are hashed together.
const STRETCH: usize = 8;

/// The record of a lane that was refused before it started.
pub(super) fn refused(tally: &Tally) -> Record {
    Record { status: tally.status, ..Record::default() }
}

/// The record of a lane that has ended.
pub(super) fn record(
    constants: &Constants,
    motion: &Motion,
    tally: &Tally,
    settings: &LaneSettings,
) -> Record {
    let mut q = motion.q;
    if tally.mode >= MODE_PRESSED {
        q[0] += constants.flow.walls[((tally.mode - 1) & 1) as usize];
    }
    let mut record = Record {
        strobe: constants.to_state(q),
        periods_run: tally.period,
        status: status(tally).code(),
        valid: valid::STROBE,
        ..Record::default()
    };
    if tally.status != Status::Ok.code() {
        return record;
    }
    averages(&mut record, constants, motion, tally);
    if settings.max_period > 0 {
        record.valid |= valid::PERIOD;
        record.period = cycle(tally).unwrap_or(0);
    }
    if record.period > 0 {
        read_cycle(&mut record, constants, motion, tally, settings);
    } else if settings.exponent && tally.blocks > 1 {
        let (mean, error) = exponent(motion, tally, settings);
        let period = constants.flow.h * f64::from(constants.steps);
        (record.lyapunov, record.lyapunov_error) = (mean / period, error / period);
        record.valid |= valid::LYAPUNOV;
    }
    record
}

/// The period of the cycle that the lane has read, if it came to that.
fn cycle(tally: &Tally) -> Option<u32> {
    (tally.stage == STAGE_DONE && tally.has_read != 0).then_some(tally.candidate)
}

fn status(tally: &Tally) -> Status {
    let ended = Status::from_code(tally.status).unwrap_or(Status::NonFinite);
    let Some(period) = cycle(tally) else { return ended };
    let lag = (period - 1) as usize;
    let distance = (tally.last_distances[lag / 4] >> (8 * (lag % 4))) & 255;
    match ended {
        Status::Ok if tally.grazes > 0 => Status::NearGrazing,
        Status::Ok if tally.on_strobe > 0 => Status::StrobeOnEvent,
        Status::Ok if distance < SETTLED => Status::Slow,
        other => other,
    }
}

fn averages(record: &mut Record, constants: &Constants, motion: &Motion, tally: &Tally) {
    let periods = f64::from((tally.period - tally.counted_from).max(1));
    let [_, right, left] = constants.flow.domains;
    let meshing = f64::from(tally.mesh_whole)
        + motion.mesh_part
        + f64::from(tally.mesh_right) * right.share
        + f64::from(tally.mesh_left) * left.share;
    record.impacts_per_period = f64::from(tally.impacts) / periods;
    record.mesh_fraction = meshing / (periods * f64::from(constants.steps));
    record.valid |= valid::IMPACTS | valid::MESH;
}

fn read_cycle(
    record: &mut Record,
    constants: &Constants,
    motion: &Motion,
    tally: &Tally,
    settings: &LaneSettings,
) {
    if constants.mirror_symmetric {
        record.symmetric = tally.symmetric;
        record.valid |= valid::SYMMETRIC;
    }
    if settings.exponent {
        // The tangent vectors started as the unit vectors: they are the monodromy's columns.
        let monodromy = Matrix4::from_column_slice(&motion.tangents);
        let largest = monodromy.complex_eigenvalues().iter().map(|mu| mu.norm()).fold(1e-300, f64::max);
        let period = constants.flow.h * f64::from(constants.steps);
        record.lyapunov = largest.ln() / (f64::from(record.period) * period);
        record.valid |= valid::LYAPUNOV;
    }
    record.word_length = tally.word_length;
    let symbols: Vec<u8> = (0..(tally.word_length as usize).min(WORD_SYMBOLS))
        .map(|i| ((tally.word[i / SYMBOLS_PER_NUMBER] >> (3 * (i % SYMBOLS_PER_NUMBER))) & 7) as u8)
        .collect();
    record.word_hash = if tally.word_length as usize <= WORD_SYMBOLS {
        record.spell(&symbols);
        hash(&symbols)
    } else {
        close_hash(tally, &symbols)
    };
    record.valid |= valid::WORD;
}

/// Mean growth per period of the tangent vector, natural logarithm, and its standard error
/// from the means of blocks.
fn exponent(motion: &Motion, tally: &Tally, settings: &LaneSettings) -> (f64, f64) {
    let (blocks, length) = (f64::from(tally.blocks), f64::from(exponent_block(settings)));
    let mean = motion.growth_sum / blocks;
    let variance = (motion.growth_squares / blocks - mean * mean).max(0.0) * blocks / (blocks - 1.0);
    let unit = std::f64::consts::LN_2 / length;
    (unit * mean, unit * (variance / blocks).sqrt())
}

/// Rotation-invariant hash of a cyclic word: the sum over all stretches of eight symbols.
fn hash(symbols: &[u8]) -> u64 {
    let symbol = |i: usize| u32::from(symbols[i % symbols.len()]);
    let stretch = |i: usize| (i..i + STRETCH).fold(0, |code, j| (code << 3) | symbol(j));
    joined((0..symbols.len()).map(stretch).fold([0, 0], add))
}

/// The hash of a long word: the shader has summed all stretches but those across its end.
fn close_hash(tally: &Tally, first: &[u8]) -> u64 {
    let mut recent = tally.recent;
    let across = first[..STRETCH - 1].iter().fold([tally.hash_low, tally.hash_high], |sum, &symbol| {
        recent = ((recent << 3) | u32::from(symbol)) & 0xff_ffff;
        add(sum, recent)
    });
    joined(across)
}

fn joined([low, high]: [u32; 2]) -> u64 {
    (u64::from(high) << 32) | u64::from(low)
}

fn add([low, high]: [u32; 2], code: u32) -> [u32; 2] {
    [low.wrapping_add(mix(code)), high.wrapping_add(mix(code ^ 0x5bd1_e995))]
}

/// The shader's `mix_bits`.
fn mix(mut h: u32) -> u32 {
    h = (h ^ (h >> 16)).wrapping_mul(0x7feb_352d);
    h = (h ^ (h >> 15)).wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_does_not_care_where_the_cycle_starts() {
        let word: Vec<u8> = (0..90u32).map(|i| 1 + (i * i % 13 % 6) as u8).collect();
        let expected = hash(&word);
        for start in [1, 17, 89] {
            let mut rotated = word.clone();
            rotated.rotate_left(start);
            assert_eq!(hash(&rotated), expected);
        }
        let mut other = word;
        other.swap(3, 4);
        assert_ne!(hash(&other), expected);
    }

    #[test]
    fn a_long_word_closed_from_the_shaders_sums_hashes_as_a_whole() {
        let word: Vec<u8> = (0..90u32).map(|i| 1 + (i * 7 % 11 % 6) as u8).collect();
        let mut tally = Tally::default();
        for (n, &symbol) in word.iter().enumerate() {
            tally.recent = ((tally.recent << 3) | u32::from(symbol)) & 0xff_ffff;
            if n >= STRETCH - 1 {
                [tally.hash_low, tally.hash_high] = add([tally.hash_low, tally.hash_high], tally.recent);
            }
        }
        assert_eq!(close_hash(&tally, &word[..WORD_SYMBOLS]), hash(&word));
    }
}
