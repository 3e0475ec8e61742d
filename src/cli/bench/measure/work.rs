//! How much arithmetic is a lane-period? Instructions of the text times counted loop iterations.
//!
//! Scan steps and root iterations are all executed, so `at_least` counts them alone; `at_most` adds
//! careful passes with all their branches, of which a pass takes some. Divided by an adapter's
//! peak, which counts a fused multiply-add as two, that is the share of its arithmetic in use.

use super::instructions::{Instructions, instructions};
use super::{Bench, counting};
use crate::gpu::{Gpu, GpuError, LaneSettings, Variant, is_hardware};
use crate::map::plan::Plan;
use crate::validate::run_lanes;

/// Forcing periods over which iterations are counted.
const PERIODS: u32 = 100;

/// Loops that are counted, by the name of their function in the shader.
const COUNTED: [&str; 3] = ["scan", "careful", "root"];

/// Work per lane-period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Work {
    /// Iterations per lane-period: scan steps, careful passes, root iterations.
    pub iterations: [f64; 3],
    /// Arithmetic instructions of the text.
    pub instructions: Instructions,
}

impl Work {
    /// Operations per lane-period that are surely done.
    pub fn at_least(&self) -> f64 {
        let [scan, _, root] = self.iterations;
        scan * self.instructions.scan as f64 + root * self.instructions.root as f64
    }

    /// Operations per lane-period if careful passes took all their branches.
    pub fn at_most(&self) -> f64 {
        self.at_least() + self.iterations[1] * self.instructions.careful as f64
    }
}

/// Counts on the scene with `side` x `side` cells, each weighted by the periods that it takes
/// on the map; none on the CPU. Compiles other forms of the lane: for the end of a series.
///
/// # Errors
/// A [`GpuError`].
pub fn work(bench: &mut Bench<'_>, side: u32) -> Result<Option<Work>, GpuError> {
    match bench.last() {
        Some((_, _, Some(device))) => count(device, side).map(Some),
        _ => Ok(None),
    }
}

fn count(device: &mut Gpu, side: u32) -> Result<Work, GpuError> {
    let scene = super::scene(side);
    let plan = Plan::new(&scene);
    let ids = plan.order();
    let undecided_periods = plan.budget().undecided_periods;
    let settings = LaneSettings { undecided_periods, kinds: false, ..LaneSettings::default() };
    let weights = pollster::block_on(run_lanes(device, &plan, &[], &ids, &settings))?;
    let weights: Vec<f64> = weights.iter().map(|record| f64::from(record.periods_run)).collect();
    let settings = LaneSettings { exponent: true, kinds: false, ..LaneSettings::only(PERIODS) };
    let mut iterations = [0.0; 3];
    for (mean, function) in iterations.iter_mut().zip(COUNTED) {
        device.rewrite_shaders(counting(function));
        let counted = pollster::block_on(run_lanes(device, &plan, &[], &ids, &settings))?;
        let weighted =
            counted.iter().zip(&weights).map(|(record, weight)| record.impacts_per_period * weight);
        *mean = weighted.sum::<f64>() / weights.iter().sum::<f64>();
    }
    device.rewrite_shaders(|source| source);
    let keep = !is_hardware(device.adapter());
    let variant = Variant { keep, kinds: false, ..Variant::of(device.precision()) };
    Ok(Work { iterations, instructions: instructions(&variant.source()) })
}
