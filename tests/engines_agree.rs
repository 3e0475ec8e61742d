//! The same cells on the reference and on the lanes, in both precisions.

use rattlemap::flow::Flow;
use rattlemap::gpu::{AdapterChoice, Gpu, Lane, LaneSettings, Precision};
use rattlemap::model::{GearPair, State};
use rattlemap::record::Record;
use rattlemap::reference::Trajectory;
use rayon::prelude::*;

fn pair(e: f64, omega: f64) -> GearPair {
    GearPair { omega, ..GearPair::paper(e) }
}

/// One record per pair, from rest.
fn lanes(precision: Precision, pairs: &[GearPair], settings: &LaneSettings) -> Vec<Record> {
    let mut gpu = pollster::block_on(Gpu::open(precision, &AdapterChoice::default())).unwrap();
    let flows: Vec<_> = pairs.iter().map(|pair| pair.oscillator().unwrap()).collect();
    let laws: Vec<_> = pairs.iter().map(GearPair::law).collect();
    let lanes: Vec<_> = (0..pairs.len() as u32).map(|i| Lane { flow: i, law: i, start: [0.0; 4] }).collect();
    pollster::block_on(gpu.run(&flows, &laws, &lanes, settings)).unwrap()
}

/// Strobe states of the reference after `periods` and one more.
fn reference(pair: &GearPair, periods: u32) -> [State; 2] {
    let flow = Flow::new(&pair.oscillator().unwrap());
    let mut trajectory = Trajectory::new(&flow, pair.law(), [0.0; 4]);
    for _ in 0..periods {
        trajectory.advance_period(&mut ()).unwrap();
    }
    let at = trajectory.state();
    trajectory.advance_period(&mut ()).unwrap();
    [at, trajectory.state()]
}

fn apart(a: &State, b: &State) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn measure() {
    let periods: u32 = std::env::var("P").map_or(200, |p| p.parse().unwrap());
    let pairs: Vec<GearPair> = (0..22)
        .flat_map(|j| (0..22).map(move |i| pair(f64::from(i) / 21.0, 1.0 + 11.0 * f64::from(j) / 21.0)))
        .collect();
    let truth: Vec<_> = pairs.par_iter().map(|pair| reference(pair, periods)).collect();
    for precision in Precision::ALL {
        let start = std::time::Instant::now();
        let records = lanes(precision, &pairs, &LaneSettings { periods, ..LaneSettings::default() });
        let took = start.elapsed();
        let mut errors: Vec<(f64, usize)> = (0..pairs.len())
            .filter(|&i| apart(&truth[i][0], &truth[i][1]) < 1e-9 || periods < 20)
            .map(|i| (apart(&truth[i][0], &records[i].strobe), i))
            .collect();
        errors.sort_by(|a, b| a.0.total_cmp(&b.0));
        let n = errors.len();
        println!(
            "{precision:?}: {took:?}, {n} cells, median {:.2e}, 99% {:.2e}",
            errors[n / 2].0,
            errors[n * 99 / 100].0
        );
        for (error, i) in errors.iter().rev().take(12) {
            println!(
                "   {error:.2e} e {:.4} omega {:.4} status {} impacts {:.2} mesh {:.3} {:?} {:?}",
                pairs[*i].e,
                pairs[*i].omega,
                records[*i].status,
                records[*i].impacts_per_period,
                records[*i].mesh_fraction,
                truth[*i][0],
                records[*i].strobe
            );
        }
        let odd = records.iter().filter(|r| r.status != 0).count();
        println!("   statuses other than ok: {odd}");
    }
}
