//! `scale`: shards of a large map, written and merged.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use rattlemap::cli::failure::Failure;
use rattlemap::cli::note;
use rattlemap::store::record_file::RECORDS;
use rattlemap_bench::scale::{self, Ask, Size, Taken};
use serde::Serialize;

use crate::arguments::Scale;

/// Cells along each axis of the map that is integrated.
const SMALL: u32 = 192;

pub(crate) fn run(ask: &Scale) -> Result<(), Failure> {
    let quick = ask.run.quick;
    let measured = Ask {
        counts: if quick { [50, 40] } else { [ask.columns, ask.rows] },
        small: if quick { 5 } else { SMALL },
        shards: if quick { 3 } else { ask.shards },
        all: ask.all,
    };
    let dir = ask.run.out("scale");
    let cells: u64 = measured.counts.iter().map(|&count| u64::from(count)).product();
    let outer = rattlemap::store::folder::Folder::open(&dir, ask.run.force)?;
    let (shards, mut taken) = scale::write_shards(measured, &dir).context("the shards")?;
    let (mut rounds, out) = (Vec::new(), dir.join("map"));
    let mut files = Vec::new();
    for _ in 0..ask.rounds {
        let (phases, names) = scale::merge(&shards, &out).context("the merge")?;
        rounds.push(phases);
        files = names;
    }
    taken.extend(medians(&rounds));
    let size = |file: String, bytes: u64| Size { file, bytes, per_cell: bytes as f64 / cells as f64 };
    let bytes = |path: &Path| path.metadata().map_or(0, |data| data.len());
    let of_shards = shards.iter().map(|shard| bytes(&shard.join(RECORDS))).sum();
    let mut sizes = vec![size(format!("{RECORDS} of {} shards", shards.len()), of_shards)];
    sizes.extend(files.iter().map(|name| size(name.clone(), bytes(&out.join(name)))));
    sizes.push(size(RECORDS.to_owned(), bytes(&out.join(RECORDS))));
    write(&outer.path().join("scale.csv"), &taken)?;
    write(&outer.path().join("files.csv"), &sizes)?;
    if !ask.run.quiet {
        for Taken { phase, seconds, processor_seconds, peak_bytes } in &taken {
            let peak = peak_bytes.map_or(String::new(), |bytes| format!("{:>9.1} MB", bytes as f64 / 1e6));
            note(format_args!(
                "{phase:<24} {seconds:>8.2} s, on processors {processor_seconds:>8.2} s {peak}"
            ));
        }
        for Size { file, bytes, per_cell } in &sizes {
            note(format_args!("{file:<24} {:>8.1} MB {per_cell:>7.2} bytes per cell", *bytes as f64 / 1e6));
        }
    }
    Ok(())
}

/// By phase the round of the median time on processors, with the largest memory of all rounds.
fn medians(rounds: &[Vec<Taken>]) -> Vec<Taken> {
    let mut by_phase: BTreeMap<usize, Vec<&Taken>> = BTreeMap::new();
    for round in rounds {
        round.iter().enumerate().for_each(|(nth, taken)| by_phase.entry(nth).or_default().push(taken));
    }
    let median = |mut all: Vec<&Taken>| {
        all.sort_by(|a, b| a.processor_seconds.total_cmp(&b.processor_seconds));
        let peak_bytes = all.iter().filter_map(|taken| taken.peak_bytes).max();
        Taken { peak_bytes, ..all[all.len() / 2].clone() }
    };
    by_phase.into_values().map(median).collect()
}

fn write<T: Serialize>(path: &Path, rows: &[T]) -> Result<(), Failure> {
    let written = csv::Writer::from_path(path).and_then(|mut table| {
        rows.iter().try_for_each(|row| table.serialize(row))?;
        Ok(table.flush()?)
    });
    Ok(written.with_context(|| format!("{}", path.display()))?)
}
