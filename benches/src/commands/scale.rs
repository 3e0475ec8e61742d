//! `scale`: writes and merges shards of a large map.

use std::path::Path;

use anyhow::Context;
use rattlemap::cli::failure::Failure;
use rattlemap::cli::note;
use rattlemap::store::record_file::RECORDS;
use rattlemap_bench::phase::Cost;
use rattlemap_bench::scale::{self, FileSize, Sizes};
use rattlemap_bench::write_rows;

use crate::arguments::Scale;

/// Number of cells along each axis of the map that is integrated.
const SMALL: u32 = 192;

pub(crate) fn run(arguments: &Scale) -> Result<(), Failure> {
    let quick = arguments.run.quick;
    let sizes = Sizes {
        counts: if quick { [50, 40] } else { [arguments.columns, arguments.rows] },
        small: if quick { 5 } else { SMALL },
        shards: if quick { 3 } else { arguments.shards },
        all: arguments.all,
    };
    let dir = arguments.run.out("scale");
    let cells: u64 = sizes.counts.iter().map(|&count| u64::from(count)).product();
    let outer = rattlemap::store::folder::Folder::open(&dir, arguments.run.force)?;
    let (shards, mut costs) = scale::write_shards(sizes, &dir).context("the shards")?;
    let (mut rounds, out) = (Vec::new(), dir.join("map"));
    let mut names = Vec::new();
    for _ in 0..arguments.rounds {
        let (phases, merged) = scale::merge(&shards, &out).context("the merge")?;
        rounds.push(phases);
        names = merged;
    }
    costs.extend(medians(&rounds));
    let size = |file: String, bytes: u64| FileSize { file, bytes, per_cell: bytes as f64 / cells as f64 };
    let bytes = |path: &Path| path.metadata().map_or(0, |data| data.len());
    let of_shards = shards.iter().map(|shard| bytes(&shard.join(RECORDS))).sum();
    let mut files = vec![size(format!("{RECORDS} of {} shards", shards.len()), of_shards)];
    files.extend(names.iter().map(|name| size(name.clone(), bytes(&out.join(name)))));
    files.push(size(RECORDS.to_owned(), bytes(&out.join(RECORDS))));
    outer.replace("scale.csv", |out| write_rows(out, &costs))?;
    outer.replace("files.csv", |out| write_rows(out, &files))?;
    if !arguments.run.quiet {
        for Cost { phase, seconds, processor_seconds, peak_bytes, .. } in &costs {
            let peak = peak_bytes.map_or(String::new(), |bytes| format!("{:>9.1} MB", bytes as f64 / 1e6));
            note(format_args!(
                "{phase:<24} {seconds:>8.2} s, processor time {processor_seconds:>8.2} s {peak}"
            ));
        }
        for FileSize { file, bytes, per_cell } in &files {
            note(format_args!("{file:<24} {:>8.1} MB {per_cell:>7.2} bytes per cell", *bytes as f64 / 1e6));
        }
    }
    Ok(())
}

/// Returns for each phase the cost of the round with the median processor time, and the largest memory of all rounds.
fn medians(rounds: &[Vec<Cost>]) -> Vec<Cost> {
    let median = |phase: usize| {
        let mut all: Vec<&Cost> = rounds.iter().map(|round| &round[phase]).collect();
        all.sort_by(|a, b| a.processor_seconds.total_cmp(&b.processor_seconds));
        let peak_bytes = all.iter().filter_map(|cost| cost.peak_bytes).max();
        Cost { peak_bytes, ..all[all.len() / 2].clone() }
    };
    (0..rounds[0].len()).map(median).collect()
}
