//! Flipped bits, cut ends and kills, at random. `RATTLEMAP_TORTURE=N` in the environment sets the number of each kind.

use std::fmt::Debug;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::time::Duration;

use rattlemap::map::random::Random;
use rattlemap::record::{Record, valid};
use rattlemap::store::record_file::{Damage, Identity, Order, RecordFile};
use rattlemap_dynamics::model::MOST_COORDINATES;

use super::*;

/// Returns the number of attacks of a kind.
fn count(default: usize) -> usize {
    let asked = std::env::var("RATTLEMAP_TORTURE");
    asked.map_or(default, |n| n.parse().expect("RATTLEMAP_TORTURE is a number of attacks"))
}

/// Prints the result of the attacks in a line that scripts read.
fn report(kind: &str, count: usize, faults: &[String]) {
    println!("torture: {kind} {count}, faults {}", faults.len());
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// A generator with another seed each time. The message of a fault contains its numbers.
fn random() -> Random {
    Random::new(interrupts::moment() << 20 ^ u64::from(std::process::id()))
}

/// A file with records of arbitrary bits.
struct Victim {
    path: PathBuf,
    identity: Identity,
    cells: Vec<(u32, Record)>,
    good: Vec<u8>,
}

const BATCH: usize = 40;

impl Victim {
    fn new(folder: &TempDir) -> Victim {
        let path = folder.path().join("records.bin");
        let identity = Identity::new("cpu", "f64", "any", vec![("axis.0.count".into(), "many".into())])
            .of_coordinates(MOST_COORDINATES);
        let mut random = Random::new(3);
        let mut cell = |id: u32| {
            let mut bits = || match random.below(3) {
                0 => 0,
                1 => f64::NAN.to_bits(),
                _ => random.bits(),
            };
            let bytes: Vec<u8> = (0..Record::BYTES / 8).flat_map(|_| bits().to_le_bytes()).collect();
            let mut record = Record::from_bytes(&bytes);
            record.valid &= !valid::FILLED;
            (id * 577 % 1009, record)
        };
        let cells: Vec<_> = (0..1009).map(&mut cell).collect();
        let mut file = RecordFile::create(&path, &identity).unwrap();
        cells.chunks(BATCH).for_each(|batch| file.append(batch).unwrap());
        let good = fs::read(&path).unwrap();
        Victim { path, identity, cells, good }
    }

    /// Number of bytes of the header, without which nothing can be read.
    fn header(&self) -> usize {
        16 + u32::from_le_bytes(self.good[8..12].try_into().unwrap()) as usize
    }

    /// Compares records bit for bit; NaN would differ otherwise.
    fn is_same(a: &[(u32, Record)], b: &[(u32, Record)]) -> bool {
        let same = |(a, b): (&(u32, Record), &(u32, Record))| a.0 == b.0 && a.1.to_bytes() == b.1.to_bytes();
        a.len() == b.len() && a.iter().zip(b).all(same)
    }

    /// Resumes a file of these bytes, adds the missing records and reads all. Returns the number of resumed records.
    fn resume(&self, bytes: &[u8], order: Order) -> Result<(usize, Option<Damage>), String> {
        fs::write(&self.path, bytes).unwrap();
        let text = |what: &dyn Debug| format!("{what:?}");
        let (mut resumed, mut all) = (Vec::new(), Vec::new());
        let take = |batch: &[(u32, Record)]| {
            resumed.extend_from_slice(batch);
            true
        };
        let mut file =
            RecordFile::resume(&self.path, &self.identity, order, take).map_err(|error| error.to_string())?;
        let (count, damage) = (resumed.len(), file.damage().cloned());
        let is_there = |id: u32| resumed.iter().any(|cell| cell.0 == id);
        let missing: Vec<_> = self.cells.iter().filter(|(id, _)| !is_there(*id)).cloned().collect();
        if !missing.is_empty() {
            file.append(&missing).map_err(|error| text(&error))?;
        }
        let take = |batch: &[(u32, Record)]| {
            all.extend_from_slice(batch);
            true
        };
        let extent =
            RecordFile::read(&self.path, &self.identity, order, take).map_err(|error| text(&error))?;
        all.sort_by_key(|cell| cell.0);
        let mut expected = self.cells.clone();
        expected.sort_by_key(|cell| cell.0);
        match extent.damage {
            None if Victim::is_same(&all, &expected) => Ok((count, damage)),
            damage => Err(format!("{} cells in the end, {damage:?}", all.len())),
        }
    }

    /// Resumes a file of these bytes; a panic counts as a fault.
    fn survives(&self, bytes: &[u8], order: Order) -> Result<(usize, Option<Damage>), String> {
        catch_unwind(AssertUnwindSafe(|| self.resume(bytes, order)))
            .unwrap_or_else(|_| Err("a panic".to_owned()))
    }
}

#[test]
fn records_are_read_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let victim = Victim::new(&folder);
    assert_eq!(victim.resume(&victim.good, Order::Sequential), Ok((1009, None)));
}

#[test]
fn flipped_bits_damage_only_their_batch() {
    let folder = tempfile::tempdir().unwrap();
    let (victim, mut random, attacks) = (Victim::new(&folder), random(), count(300));
    let mut faults = Vec::new();
    for nth in 0..attacks {
        let mut bad = victim.good.clone();
        let flips = 1 + nth % 2;
        let first = victim.header();
        let places: Vec<usize> =
            (0..flips).map(|_| 8 * first + random.below(8 * (bad.len() - first))).collect();
        places.iter().for_each(|&bit| bad[bit / 8] ^= 1 << (bit % 8));
        match victim.survives(&bad, Order::Any) {
            Ok((kept, damage))
                if kept + flips * BATCH >= 1009 && (damage.is_some() || bad == victim.good) => {}
            other => faults.push(format!("bits {places:?}: {other:?}")),
        }
        if let (0, Err(fault)) = (nth % 5, victim.survives(&bad, Order::Sequential)) {
            faults.push(format!("bits {places:?}, in order: {fault}"));
        }
    }
    report("corruptions", attacks, &faults);
}

#[test]
fn a_file_may_end_anywhere() {
    let folder = tempfile::tempdir().unwrap();
    let (victim, mut random, attacks) = (Victim::new(&folder), random(), count(50));
    let head = victim.header();
    let anywhere = (0..attacks).map(|_| random.below(victim.good.len()));
    let mut faults = Vec::new();
    for length in (0..=head).step_by(if attacks > 50 { 1 } else { 31 }).chain(anywhere) {
        if let Err(fault) = victim.survives(&victim.good[..length], Order::Any) {
            faults.push(format!("cut to {length} bytes: {fault}"));
        }
    }
    report("cuts", attacks, &faults);
}

/// Runs are killed at random times, most of them in the first milliseconds.
#[cfg(unix)]
#[test]
fn killed_runs_can_be_resumed_whenever_it_was() {
    let folder = folder();
    let arguments = "--engine cpu --set axis.0.count=8 --set integration.early_stop=false";
    map(&folder, &format!("{arguments} --quiet --out whole")).success();
    let expected = records::bytes(&folder.path().join("whole"));
    let (mut random, attacks) = (random(), count(6));
    let mut faults = Vec::new();
    for nth in 0..attacks {
        let run = begin(&folder, &format!("map s.toml --out cut {arguments}"));
        let delay = Duration::from_micros(random.below(if nth % 3 == 2 { 1_000_000 } else { 40_000 }) as u64);
        std::thread::sleep(delay);
        stop(run, "-KILL");
        let resume = format!("map s.toml --out cut --resume --quiet {arguments}");
        let resumed = command(&folder, &resume).output().unwrap();
        if !resumed.status.success() {
            faults.push(format!("{delay:?}: {}", String::from_utf8_lossy(&resumed.stderr)));
        } else if records::bytes(&folder.path().join("cut")) != expected {
            faults.push(format!("{delay:?}: other bytes"));
        }
        fs::remove_dir_all(folder.path().join("cut")).ok();
    }
    report("kills", attacks, &faults);
}
