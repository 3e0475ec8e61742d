//! Reading a lane's last state as a record.

use nalgebra::Matrix4;

use super::LaneSettings;
use super::batch::exponent_block;
use super::constants::Constants;
use super::layout::{MODE_PRESSED, Motion, STAGE_DONE, STAGE_RUNNING, Tally};
use crate::orbit::Status;
use crate::record::{HASH_WINDOW, Record, WORD_SYMBOLS, add_window, joined, valid};
use crate::word::Word;

/// A lane has settled on its cycle once it is this close to it, relative to the motion.
const SETTLED: f64 = 5e-4;

/// Symbols that the shader keeps in one number.
const SYMBOLS_PER_NUMBER: usize = 10;

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
        status: status(motion, tally, settings).code(),
        valid: valid::STROBE,
        ..Record::default()
    };
    if tally.status != Status::Ok.code() {
        return record;
    }
    averages(&mut record, constants, motion, tally);
    if settings.max_period > 0 {
        record.valid |= valid::PERIOD;
        record.period = cycle(motion, tally, settings).unwrap_or(0);
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

/// Whether the lane has read a cycle.
fn has_read(tally: &Tally) -> bool {
    tally.stage == STAGE_DONE && tally.has_read != 0
}

/// Largest modulus of the multipliers of the cycle that was read.
fn spectral_radius(motion: &Motion) -> f64 {
    // The tangent vectors started as the unit vectors: they are the monodromy's columns.
    let monodromy = Matrix4::from_column_slice(&motion.tangents);
    monodromy.complex_eigenvalues().iter().map(|mu| mu.norm()).fold(1e-300, f64::max)
}

/// The period of the cycle that the lane has read, if it came to that and attracts. Without
/// exponents recurrence alone must do.
fn cycle(motion: &Motion, tally: &Tally, settings: &LaneSettings) -> Option<u32> {
    let attracts = !settings.exponent || spectral_radius(motion) < 1.0;
    (has_read(tally) && attracts).then_some(tally.candidate)
}

/// Sends a lane on that has read a cycle which does not attract, if it has periods left:
/// chaos lingers at such cycles. True if it has been.
pub(super) fn send_on(motion: &mut Motion, tally: &mut Tally, settings: &LaneSettings) -> bool {
    let over = tally.status != Status::Ok.code() || tally.period >= settings.periods;
    if over || !has_read(tally) || cycle(motion, tally, settings).is_some() {
        return false;
    }
    // The exponent starts anew, but for what it has collected; recurrence from scratch.
    motion.tangents = [0.0; 16];
    motion.tangents[..4].fill(0.5);
    tally.stage = STAGE_RUNNING;
    (tally.has_read, tally.tangent_count) = (0, 1);
    (tally.window, tally.candidate, tally.streak, tally.known_lags, tally.settled) = (0, 0, 0, 0, 0);
    tally.last_distances = [0; 16];
    true
}

/// Whether the lane has come so near to its cycle that its symmetry shows.
fn has_settled(motion: &Motion, tally: &Tally, settings: &LaneSettings) -> bool {
    let lag = tally.candidate.saturating_sub(1) as usize;
    let octaves = f64::from((tally.last_distances[lag / 4] >> (8 * (lag % 4))) & 255) / 4.0;
    // Strobes `d` apart that shrink by `mu` per cycle are `d / (1 - mu)` away from their limit.
    let mu = if settings.exponent { spectral_radius(motion) } else { 0.0 };
    tally.settled != 0 && (-octaves).exp2() < SETTLED * (1.0 - mu)
}

fn status(motion: &Motion, tally: &Tally, settings: &LaneSettings) -> Status {
    let ended = Status::from_code(tally.status).unwrap_or(Status::NonFinite);
    if !has_read(tally) {
        return ended;
    }
    match ended {
        Status::Ok if tally.grazes > 0 => Status::NearGrazing,
        Status::Ok if tally.on_strobe > 0 => Status::StrobeOnEvent,
        Status::Ok if !has_settled(motion, tally, settings) => Status::Slow,
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
    // On a slow approach a lost symmetry cannot be told from one not reached yet.
    if constants.mirror_symmetric && has_settled(motion, tally, settings) {
        record.symmetric = tally.symmetric;
        record.valid |= valid::SYMMETRIC;
    }
    if settings.exponent {
        let period = constants.flow.h * f64::from(constants.steps);
        record.lyapunov = spectral_radius(motion).ln() / (f64::from(record.period) * period);
        record.valid |= valid::LYAPUNOV;
    }
    record.word_length = tally.word_length;
    let symbols: Vec<u8> = (0..(tally.word_length as usize).min(WORD_SYMBOLS))
        .map(|i| b'0' + ((tally.word[i / SYMBOLS_PER_NUMBER] >> (3 * (i % SYMBOLS_PER_NUMBER))) & 7) as u8)
        .collect();
    if tally.word_length as usize <= WORD_SYMBOLS {
        record.set_word(&Word::cyclic(&symbols));
    } else {
        record.word_hash = close_hash(tally, &symbols);
        record.valid |= valid::WORD;
    }
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

/// The hash of a long word: the shader has summed all stretches but those across its end.
fn close_hash(tally: &Tally, first: &[u8]) -> u64 {
    let mut recent = tally.recent;
    let across = first[..HASH_WINDOW - 1].iter().fold([tally.hash_low, tally.hash_high], |sum, &symbol| {
        recent = ((recent << 3) | u32::from(symbol - b'0')) & 0xff_ffff;
        add_window(sum, recent)
    });
    joined(across)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::word_hash;

    #[test]
    fn a_long_word_closed_from_the_shaders_sums_hashes_as_a_whole() {
        let word: Vec<u8> = (0..90u32).map(|i| b'1' + (i * 7 % 11 % 6) as u8).collect();
        let mut tally = Tally::default();
        for (n, &symbol) in word.iter().enumerate() {
            tally.recent = ((tally.recent << 3) | u32::from(symbol - b'0')) & 0xff_ffff;
            if n >= HASH_WINDOW - 1 {
                [tally.hash_low, tally.hash_high] =
                    add_window([tally.hash_low, tally.hash_high], tally.recent);
            }
        }
        assert_eq!(close_hash(&tally, &word[..WORD_SYMBOLS]), word_hash(&word));
    }
}
