//! Spectra of the gaps and their velocities, by a discrete Fourier transform of samples of the exact flow.
//!
//! A periodic motion is transformed over exactly one cycle. Its lines lie at multiples of the forcing frequency divided by the
//! number of periods, without leakage. For any other motion the mean is subtracted, and squares are averaged over Hann windows
//! that overlap by half (P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70).

use std::f64::consts::TAU;

use rattlemap_dynamics::model::{GapRow, Model, ModelError, Oscillator};
use rattlemap_dynamics::orbit::{Class, Orbit, trace};
use rustfft::FftPlanner;
use rustfft::num_complex::Complex64;

/// Forcing periods per window, and number of windows.
const WINDOW: u32 = 128;
const WINDOWS: u32 = 7;

/// Largest numbers of samples of a cycle and of all windows.
const CYCLE_SAMPLES: usize = 1 << 20;
const WINDOW_SAMPLES: usize = 1 << 19;

/// Returns the samples per forcing period that figures need: 400, or 20 for each oscillation of the teeth in meshing, each
/// oscillation of the highest harmonic and each stage if that is more.
pub fn samples_per_period(oscillator: &Oscillator) -> usize {
    let ringing = |(i, gap): (usize, &GapRow)| {
        let stiffest = gap.walls.iter().flatten().flat_map(|wall| &wall.springs);
        let stiffest = stiffest.map(|spring| spring.stiffness).fold(0.0, f64::max);
        (stiffest * oscillator.mobility(i)).sqrt() / oscillator.omega
    };
    let rates = oscillator.gaps.iter().enumerate().map(ringing);
    let forced = [f64::from(oscillator.highest_order()), oscillator.schedule.len() as f64];
    (20.0 * rates.chain(forced).fold(0.0, f64::max)).clamp(400.0, 50_000.0) as usize
}

/// Amplitudes at one frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Frequency in multiples of the forcing frequency.
    pub(crate) frequency: f64,
    /// Amplitudes of each gap and of its velocity; at frequency 0 the absolute value of the mean.
    pub(crate) amplitudes: Vec<[f64; 2]>,
}

/// A spectrum.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum {
    /// Lines in order of frequency.
    pub(crate) lines: Vec<Line>,
    /// Forcing periods of the cycle; none if windows were used.
    pub(crate) cycle: Option<u32>,
}

impl Spectrum {
    /// Returns the spectrum of an orbit, or none if the motion cannot be followed for the required time.
    ///
    /// # Errors
    /// [`ModelError`] if the model is not valid.
    pub fn of(model: &dyn Model, orbit: &Orbit) -> Result<Option<Spectrum>, ModelError> {
        let oscillator = model.oscillator()?;
        let cycle = matches!(orbit.class, Class::Periodic { .. }).then_some(orbit.cycle_periods);
        // Velocity jumps have high harmonics, which cause aliasing, so a cycle needs dense samples.
        let (periods, dense, most) = match cycle {
            Some(periods) => (periods, 8, CYCLE_SAMPLES),
            None => (WINDOW * (WINDOWS + 1) / 2, 2, WINDOW_SAMPLES),
        };
        let wanted = samples_per_period(&oscillator);
        let largest = (most / periods as usize).next_power_of_two() / 2;
        let per_period = (dense * wanted).next_power_of_two().min(largest.max(4));
        let samples = trace(model, orbit.strobe, orbit.strobe_meshing, periods, per_period)?;
        let count = periods as usize * per_period;
        if samples.len() <= count {
            return Ok(None);
        }
        // The last sample belongs to the next period.
        let values = |gap, velocity| -> Vec<f64> {
            let samples = samples[..count].iter();
            samples.map(|sample| oscillator.gap_value(gap, &sample.state, velocity)).collect()
        };
        let span = cycle.unwrap_or(WINDOW);
        let frequency = |k: usize| k as f64 / f64::from(span);
        let of_gap = |gap| -> Vec<[f64; 2]> {
            let z = values(gap, 0);
            match cycle {
                // The gap is continuous, and the derivative of its series is the series of the velocity. Samples of the velocity
                // would locate jumps only to within their spacing.
                Some(_) => {
                    let lines = amplitudes(&[&z], |_| 1.0).into_iter().enumerate();
                    lines.map(|(k, z)| [z, z * frequency(k) * oscillator.omega]).collect()
                }
                None => {
                    let w = through_windows(&values(gap, 1));
                    through_windows(&z).into_iter().zip(w).map(<[f64; 2]>::from).collect()
                }
            }
        };
        let gaps: Vec<Vec<[f64; 2]>> = (0..oscillator.gaps.len()).map(of_gap).collect();
        let line =
            |k: usize| Line { frequency: frequency(k), amplitudes: gaps.iter().map(|gap| gap[k]).collect() };
        let last = (wanted / 10).min(per_period / 4) * span as usize;
        let lines = (0..=last).map(line).collect();
        Ok(Some(Spectrum { lines, cycle }))
    }

    /// Describes the method.
    pub(crate) fn method(&self) -> String {
        match self.cycle {
            Some(1) => "Fourier series over the cycle, one forcing period".to_owned(),
            Some(periods) => format!("Fourier series over the cycle, {periods} forcing periods"),
            None => format!(
                "mean square over {WINDOWS} Hann windows of {WINDOW} forcing periods that overlap by half"
            ),
        }
    }
}

/// Returns the amplitudes of a signal over windows. The mean is treated separately, because a window would spread it into the
/// first line.
fn through_windows(signal: &[f64]) -> Vec<f64> {
    let mean = signal.iter().sum::<f64>() / signal.len() as f64;
    let swings: Vec<f64> = signal.iter().map(|value| value - mean).collect();
    let mut lines = amplitudes(&windows(&swings), hann);
    lines[0] = mean.abs();
    lines
}

/// Splits a signal into windows that overlap by half.
fn windows(signal: &[f64]) -> Vec<&[f64]> {
    let half = signal.len() / (WINDOWS as usize + 1);
    (0..WINDOWS as usize).map(|nth| &signal[nth * half..(nth + 2) * half]).collect()
}

/// Returns the Hann window at a share of its length.
pub(crate) fn hann(share: f64) -> f64 {
    0.5 - 0.5 * (TAU * share).cos()
}

/// Returns root mean square amplitudes over parts of equal length, from frequency 0 to half the sampling frequency. A harmonic
/// motion of amplitude 1 at one of these frequencies gives 1.
pub(crate) fn amplitudes(parts: &[&[f64]], window: impl Fn(f64) -> f64) -> Vec<f64> {
    let count = parts[0].len();
    let weights: Vec<f64> = (0..count).map(|i| window(i as f64 / count as f64)).collect();
    let whole: f64 = weights.iter().sum();
    let transform = FftPlanner::new().plan_fft_forward(count);
    let mut squares = vec![0.0; count / 2 + 1];
    for part in parts {
        let weighted = part.iter().zip(&weights).map(|(value, weight)| Complex64::from(value * weight));
        let mut values: Vec<Complex64> = weighted.collect();
        transform.process(&mut values);
        squares.iter_mut().zip(values).for_each(|(square, value)| *square += value.norm_sqr());
    }
    let scaled = squares.iter().enumerate().map(|(k, square)| {
        // All other lines also represent negative frequencies.
        let signs = if k == 0 || 2 * k == count { 1.0 } else { 2.0 };
        signs * (square / parts.len() as f64).sqrt() / whole
    });
    scaled.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rattlemap_dynamics::model::{Drive, GearPair, REST};
    use rattlemap_dynamics::orbit::{Settings, analyse};

    fn spectrum(pair: &GearPair) -> (Orbit, Spectrum) {
        let orbit = analyse(pair, REST, &Settings::default()).unwrap();
        let spectrum = Spectrum::of(pair, &orbit).unwrap().unwrap();
        (orbit, spectrum)
    }

    /// Gear 1 alone has the amplitude F / |k1 - m1 omega^2 + i r1 omega|.
    #[test]
    fn motion_without_contact_is_one_line() {
        let pair = GearPair { force: 5.0, omega: 3.0, ..GearPair::paper(0.5) };
        let (orbit, spectrum) = spectrum(&pair);
        assert!(orbit.events.is_empty() && spectrum.cycle == Some(1));
        let omega = pair.omega;
        let size = pair.force / (pair.k1 - pair.m1 * omega * omega).hypot(pair.r1 * omega);
        for line in &spectrum.lines {
            let expected = if line.frequency == 1.0 { [size, size * omega] } else { [0.0; 2] };
            for (found, expected) in line.amplitudes[0].into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-12 * size * omega, "{line:?}, not {expected}");
            }
        }
        assert_eq!(spectrum.lines.len(), 41);
    }

    #[test]
    fn samples_resolve_the_highest_harmonic_and_each_stage() {
        let plain = GearPair { k: 1.0, ..GearPair::paper(0.5) }.oscillator().unwrap();
        let mut high = plain.clone();
        high.drives.push(Drive { order: 64, ..plain.drives[0].clone() });
        let schedule = Oscillator::repeated(&[0.0, 0.5], 40).unwrap();
        let stages = vec![plain.stages[0].clone(); 2];
        let staged = Oscillator { stages, schedule, ..plain.clone() };
        assert_eq!([plain, high, staged].map(|o| samples_per_period(&o)), [400, 64 * 20, 80 * 20]);
    }

    /// Parseval's theorem.
    #[test]
    fn the_mean_square_is_the_sum_over_all_lines() {
        let signal: Vec<f64> = (0..96_u32).map(|i| f64::from(i * i * 7919 % 101) - 37.0).collect();
        let mean = signal.iter().map(|x| x * x).sum::<f64>() / signal.len() as f64;
        let lines = amplitudes(&[&signal], |_| 1.0);
        let ends = lines[0] * lines[0] + lines[48] * lines[48];
        let sum = ends + lines[1..48].iter().map(|a| 0.5 * a * a).sum::<f64>();
        assert!((sum / mean - 1.0).abs() < 1e-14, "{sum} {mean}");
        // A Hann window's mean square over its squared mean is 3/2.
        let noise: Vec<f64> =
            (0..1 << 16).map(|i: u64| ((i * i * 2_654_435_761) % 65_537) as f64 - 32_768.0).collect();
        let mean = noise.iter().map(|x| x * x).sum::<f64>() / noise.len() as f64;
        let sum: f64 = amplitudes(&windows(&noise), hann).iter().map(|a| 0.5 * a * a).sum();
        assert!((sum / mean - 1.5).abs() < 0.02, "{}", sum / mean);
    }

    #[test]
    fn a_line_has_its_amplitude_under_windows_too() {
        let signal: Vec<f64> =
            (0..4096).map(|i| 3.0 + 0.7 * (TAU * 10.0 * f64::from(i) / 1024.0).sin()).collect();
        let lines = through_windows(&signal);
        assert!((lines[0] - 3.0).abs() < 1e-12 && (lines[10] - 0.7).abs() < 1e-12, "{:?}", &lines[..12]);
        // The neighbours of the line have half its height, and the mean has no neighbours.
        assert!(lines[1..9].iter().chain(&lines[12..]).all(|a| *a < 1e-12), "{:?}", &lines[..14]);
    }

    /// Samples of the velocity locate its jumps only to within their spacing, which explains the tolerance.
    #[test]
    fn velocity_amplitudes_agree_with_samples_of_the_velocity() {
        let pair = GearPair::paper(0.0997);
        let (orbit, spectrum) = spectrum(&pair);
        assert!(!orbit.events.is_empty());
        let (oscillator, count) = (pair.oscillator().unwrap(), 1 << 16);
        let samples = trace(&pair, orbit.strobe, orbit.strobe_meshing, 1, count).unwrap();
        let velocities: Vec<f64> =
            samples[..count].iter().map(|sample| oscillator.gap_value(0, &sample.state, 1)).collect();
        let largest = spectrum.lines.iter().map(|line| line.amplitudes[0][1]).fold(0.0, f64::max);
        for (line, sampled) in spectrum.lines.iter().zip(amplitudes(&[&velocities], |_| 1.0)) {
            assert!((line.amplitudes[0][1] - sampled).abs() < 2e-4 * largest, "{line:?} {sampled}");
        }
    }

    #[test]
    fn chaos_has_power_between_multiples_of_the_forcing_frequency() {
        let (orbit, spectrum) = spectrum(&GearPair::paper(0.65));
        assert_eq!((orbit.class, spectrum.cycle), (Class::Chaotic, None));
        assert_eq!(spectrum.lines[1].frequency, 1.0 / 128.0);
        let [mean, next] = [0, 1].map(|k| spectrum.lines[k].amplitudes[0][0]);
        assert!(next < 0.1 * mean, "the mean spread into the first line: {mean} {next}");
        assert!(spectrum.lines[64..128].iter().all(|line| line.amplitudes[0][0] > 1e-4));
    }
}
