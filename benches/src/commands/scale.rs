//! `scale`: parts of a large map, put together.

use std::time::{Duration, Instant};

use anyhow::Context;
use rattlemap::cli::{Failure, note};
use rattlemap::map::plan::Plan;
use rattlemap::map::scene::{Quantity, Scene, Start};
use rattlemap::map::{self, Processor, effect};
use rattlemap::model::GearPair;
use rattlemap::output::{Cells, Folder, Identity, Order, RecordFile};
use rattlemap::record::Record;
use rattlemap_bench::scale::{Memory, Stretched};

use crate::arguments::Scale;

pub(crate) fn run(ask: &Scale) -> Result<(), Failure> {
    let [columns, rows] = if ask.run.quick { [40, 30] } else { [ask.columns as usize, ask.rows as usize] };
    let side = if ask.run.quick { 4 } else { 96 };
    let scene = |counts: [usize; 2]| {
        let builder = Scene::builder(GearPair::paper(0.5)).start(Start::Rest);
        let builder =
            builder.axis("e", 0.0..=1.0, counts[0] as u32).axis("omega", 1.0..=12.0, counts[1] as u32);
        let builder = if ask.all {
            builder.quantities(&[
                Quantity::Class,
                Quantity::Lyapunov,
                Quantity::Impacts,
                Quantity::Mesh,
                Quantity::Symmetric,
                Quantity::Word,
                Quantity::Pattern,
            ])
        } else {
            builder
        };
        builder.build()
    };
    let small = map::run(&scene([side, side]).map_err(anyhow::Error::from)?, Processor::Cpu)
        .map_err(anyhow::Error::from)?;
    let scene = scene([columns, rows]).map_err(anyhow::Error::from)?;
    let stretched = Stretched::new(&small, [columns, rows]);
    let dir = ask.run.out("scale");
    let folder = Folder::open(&dir, ask.run.force)?;
    let tell = |phase: &str, clock: Instant, memory: Memory| {
        let seconds = clock.elapsed().as_secs_f64();
        note(format_args!(
            "{phase:<12} {seconds:>8.2} s {:>8.1} MB",
            memory.peak().unwrap_or(0) as f64 / 1e6
        ));
    };
    let (clock, memory) = (Instant::now(), Memory::begin());
    let plan = Plan::new(&scene);
    plan.check().map_err(anyhow::Error::from)?;
    tell("plan", clock, memory);
    let (clock, memory) = (Instant::now(), Memory::begin());
    let identity = Identity::new("cpu", "f64", "d", scene.identity());
    let runs = plan.run_count();
    let parts: Vec<_> = (0..ask.shards as usize).map(|n| dir.join(format!("part-{n}.bin"))).collect();
    for (n, path) in parts.iter().enumerate() {
        let places = (runs * n / parts.len())..(runs * (n + 1) / parts.len());
        let mut file = RecordFile::create(path, &identity).context("records")?;
        let ids: Vec<u32> = places.map(|place| plan.run_at(place)).collect();
        for ids in ids.chunks(1 << 17) {
            let batch: Vec<(u32, Record)> = ids.iter().map(|&id| (id, stretched.record(id))).collect();
            file.append(&batch).context("records")?;
        }
    }
    tell("parts", clock, memory);
    let (clock, memory) = (Instant::now(), Memory::begin());
    let mut records = vec![Record::default(); runs];
    for path in &parts {
        let take = |batch: &[(u32, Record)]| {
            batch.iter().for_each(|&(id, record)| records[id as usize] = record);
            true
        };
        RecordFile::read(path, &identity, Order::Any, take).context("records")?;
    }
    tell("read", clock, memory);
    let (clock, memory) = (Instant::now(), Memory::begin());
    let without_effect = effect::without_effect(&plan, &records, 1e-6);
    let without_effect = without_effect.iter().map(|parameter| parameter.name.to_string()).collect();
    tell("effect", clock, memory);
    let (clock, memory) = (Instant::now(), Memory::begin());
    let cells = Cells::new(&scene, &plan, &records);
    let made = rattlemap::output::map::Run {
        sets: &[],
        engine: "cpu",
        precision: "f64",
        device: "d",
        processor: "",
        elapsed: Duration::ZERO,
        opening: Duration::ZERO,
        elapsed_before: Duration::ZERO,
        resumed_cells: 0,
        lane_grid: None,
        refined: None,
        without_effect,
    };
    let files = rattlemap::output::map::write(&folder, &cells, &made)?;
    tell("tables", clock, memory);
    for name in &files {
        let bytes = dir.join(name).metadata().map_or(0, |data| data.len());
        note(format_args!("{name:<20} {:>10.1} MB", bytes as f64 / 1e6));
    }
    let sizes: Vec<u64> = parts.iter().map(|path| path.metadata().map_or(0, |data| data.len())).collect();
    note(format_args!(
        "parts {} to {} bytes, {:.1} per run",
        sizes.iter().min().unwrap_or(&0),
        sizes.iter().max().unwrap_or(&0),
        sizes.iter().sum::<u64>() as f64 / runs as f64
    ));
    Ok(())
}
