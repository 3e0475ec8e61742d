//! Known answers: a device is asked before it is trusted.

use super::{Gpu, GpuError, Lane, LaneSettings, Precision};
use crate::model::{GearPair, State};

/// Forcing periods from rest to the answers.
const PERIODS: u32 = 20;

/// `(e, omega)` of the paper's pair and its state after [`PERIODS`] from rest, computed by
/// the reference: meshing on both sides, impacts, long chatter, and no contact. Drivers that
/// stop long loops or lose double precision on the way fail at least one of them.
const ANSWERS: [(f64, f64, State); 4] = [
    (0.06, 5.6, [-1.1109238855820154, 2.276300122629451, -1.2325975673960383, -2.2388145312446635]),
    (0.605, 5.6, [-1.1845082044663513, 2.232746822969534, -1.1056690234652184, -1.8839235166200696]),
    (0.72, 1.5, [1.3729851646261548, 0.19699760788074183, 0.9393239167902595, -0.11613728074823482]),
    (0.5, 11.5, [-0.21607397150986443, 0.2323746135365504, 0.0, 0.0]),
];

/// Runs the known answers.
///
/// # Errors
/// [`GpuError::WrongAnswer`] if the device computes something else, and what it refuses.
pub(super) async fn check(gpu: &mut Gpu) -> Result<(), GpuError> {
    let pairs = ANSWERS.map(|(e, omega, _)| GearPair { omega, ..GearPair::paper(e) });
    let flows: Vec<_> = pairs.iter().filter_map(|pair| pair.oscillator().ok()).collect();
    let laws = pairs.map(|pair| pair.law());
    let lanes = [0, 1, 2, 3].map(|i| Lane { flow: i, law: i, start: [0.0; 4] });
    let settings = LaneSettings { periods: PERIODS, max_period: 0, ..LaneSettings::default() };
    let records = gpu.run(&flows, &laws, &lanes, &settings).await?;
    let bar = match gpu.precision {
        Precision::F32 => 1e-3,
        Precision::F64 => 1e-9,
    };
    for (record, (e, omega, answer)) in records.iter().zip(ANSWERS) {
        let error = record.strobe.iter().zip(answer).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if record.status != 0 || error.is_nan() || error > bar {
            let adapter = gpu.info.name.clone();
            return Err(GpuError::WrongAnswer { adapter, e, omega, error });
        }
    }
    Ok(())
}
