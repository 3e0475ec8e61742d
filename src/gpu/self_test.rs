//! Known answers: newly compiled shaders must reproduce them before they are used.

use super::{Constants, Gpu, GpuError, Kernels, Lane, LaneSettings, Pool, Precision};
use crate::record::distance::{apart, farther, is_within};
use rattlemap_dynamics::model::{Form, GearPair, REST, State, state};

/// Forcing periods from rest to the answers.
const PERIODS: u32 = 20;

/// Restitution and frequency of the paper's gear pair, and its state after [`PERIODS`] periods from rest, computed by the reference. The
/// cases are meshing on both sides, impacts, long chatter, and no contact. Drivers that stop long loops or lose double precision fail at
/// least one of them.
const ANSWERS: [(f64, f64, State); 4] = [
    (0.06, 5.6, state(&[-1.1109238855820154, 2.276300122629451, -1.2325975673960383, -2.2388145312446635])),
    (0.605, 5.6, state(&[-1.1845082044663513, 2.232746822969534, -1.1056690234652184, -1.8839235166200696])),
    (0.72, 1.5, state(&[1.3729851646261548, 0.19699760788074183, 0.9393239167902595, -0.11613728074823482])),
    (0.5, 11.5, state(&[-0.21607397150986443, 0.2323746135365504])),
];

/// Computes the known answers with kernels that have just been compiled for these settings.
///
/// # Errors
/// [`GpuError::WrongAnswer`] if the device computes something else; other errors of the device.
pub(super) async fn check(gpu: &Gpu, kernels: Kernels, settings: &LaneSettings) -> Result<(), GpuError> {
    let pairs = ANSWERS.map(|(e, omega, _)| GearPair { omega, ..GearPair::paper(e) });
    let laws = pairs.map(|pair| pair.law());
    let as_machine = settings.features.machine.is_some();
    let constants = pairs.iter().map(|pair| {
        let oscillator = pair.oscillator().ok()?;
        let form = if as_machine { Form::Machine(oscillator) } else { Form::from(&oscillator) };
        let mut constants = Constants::new(form, None)?;
        constants.widen(settings.features);
        Some(constants)
    });
    let constants = constants.collect();
    let lanes = [0, 1, 2, 3].map(|i| (i, Lane { flow: i, law: i, start: REST }));
    let settings = LaneSettings {
        periods: PERIODS,
        transient_periods: 0,
        max_period: 0,
        undecided_periods: 0,
        confirm_chaos: 0,
        steps_per_period: None,
        multiplier: false,
        measures: None,
        batch: None,
        ..*settings
    };
    let tables = gpu.load_constants(constants, &laws).await?;
    let mut pool = Pool::new(gpu, kernels, &settings);
    pool.begin(gpu, &tables, &lanes).await?;
    let bar = match gpu.precision {
        Precision::F32 => 1e-3,
        Precision::F64 => 1e-9,
    };
    let mut ended = Vec::new();
    while pool.under_way() > 0 {
        if gpu.is_halted() {
            return Err(GpuError::Halted);
        }
        ended.extend(pool.advance(gpu, &tables, 0).await?);
    }
    for ended in ended {
        let (e, omega, answer) = ANSWERS[ended.number() as usize];
        let record = ended.record(tables.constants());
        let error = record.strobe().iter().zip(answer).map(|(&a, b)| apart(a, b)).fold(0.0, farther);
        if record.status != 0 || !is_within(error, bar) {
            let adapter = gpu.info.name.clone();
            return Err(GpuError::WrongAnswer { adapter, e, omega, error });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::AdapterChoice;

    #[test]
    #[ignore = "compiles shaders of its own; scripts/test.sh --all"]
    fn a_driver_with_wrong_arithmetic_is_rejected() {
        let mut gpu = pollster::block_on(Gpu::open(Precision::F32, &AdapterChoice::default())).unwrap();
        let settings = LaneSettings::default();
        let run_check = async |gpu: &mut Gpu| {
            let pool = gpu.pool(&settings).await?;
            check(gpu, pool.kernels, &settings).await
        };
        pollster::block_on(run_check(&mut gpu)).unwrap();
        // Makes the forcing's part in a step 1 % too large.
        gpu.rewrite_shaders(|source| source.replace("(m[4] * c +", "(1.01 * m[4] * c +"));
        let error = pollster::block_on(run_check(&mut gpu)).unwrap_err();
        assert!(matches!(error, GpuError::WrongAnswer { .. }), "{error}");
    }
}
