//! Standard errors of exponents: they equal the scatter of estimates from many starts.

use crate::common::gpu::{all_records, map, open};
use rattlemap::gpu::Precision;
use rattlemap::map::engine::{Cpu, Engine};
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Purpose, Scene};
use rattlemap::record::Record;
use rattlemap::record::classify::classify;
use rattlemap_dynamics::orbit::Class;

/// Starts of a bilinear oscillator whose vibrations decay over tens of periods, so that periods are correlated.
fn plan(zeta: f64) -> Plan {
    let axes = ["x", "v"].map(|name| format!("[[axis]]\nstart = '{name}'\nmin = -1\nmax = 1\ncount = 15\n"));
    let parameters = format!("[parameters]\nomega = 4.1493\nk = 10\nzeta = {zeta}\n");
    let text = format!("model = 'bilinear'\n{parameters}{}", axes.concat());
    Plan::new(&Scene::parse(&text, "s", &[], Purpose::Map).unwrap())
}

/// Compares the scatter of the exponents of chaotic cells with their stated errors. Blocks without a measured correlation
/// give ratios of 1.3 and more.
fn assert_calibrated(records: impl Fn(&Plan) -> Vec<Record>) {
    let [mut scatter, mut stated, mut count] = [0.0; 3];
    for zeta in [0.0062, 0.009, 0.0132] {
        let plan = plan(zeta);
        let chaotic = |record: &Record| classify(record) == Class::Chaotic;
        let chaotic: Vec<Record> = records(&plan).into_iter().filter(chaotic).collect();
        let mean = chaotic.iter().map(|record| record.lyapunov).sum::<f64>() / chaotic.len() as f64;
        scatter += chaotic.iter().map(|record| (record.lyapunov - mean).powi(2)).sum::<f64>();
        stated += chaotic.iter().map(|record| record.lyapunov_error.powi(2)).sum::<f64>();
        count += chaotic.len() as f64;
    }
    // A ratio of standard deviations scatters by this much; the stated errors scatter as much again.
    let sampling = 2.0 / (2.0 * count).sqrt();
    let ratio = (scatter / stated).sqrt();
    assert!(count > 300.0 && (ratio - 1.0).abs() < 3.0 * sampling, "{ratio} +- {sampling} of {count} cells");
}

#[test]
fn stated_errors_of_the_reference_equal_the_scatter() {
    assert_calibrated(|plan| all_records(plan, &mut Engine::Cpu(Cpu::new(plan))));
}

#[test]
#[ignore = "takes minutes; scripts/test.sh --all"]
fn stated_errors_of_lanes_equal_the_scatter() {
    for precision in Precision::ALL {
        assert_calibrated(|plan| map(plan, &mut open(precision)));
    }
}
