//! Access to the records of all runs by number, and a compact container of many records.

use std::collections::HashMap;
use std::fmt::Debug;
use std::hash::Hash;

use bytemuck::Pod;

use super::Record;
use super::measures::MEASURES;
use rattlemap_dynamics::model::MOST_COORDINATES;

/// Records by number, in any container.
pub trait Records: Debug + Sync {
    /// Returns the number of records.
    fn count(&self) -> usize;

    /// Returns the record with a number below [`Records::count`].
    ///
    /// # Panics
    /// If there is no such record.
    fn record(&self, id: usize) -> Record;

    /// Returns the record with this number, if there is one.
    fn get(&self, id: usize) -> Option<Record> {
        (id < self.count()).then(|| self.record(id))
    }
}

/// Records by number that can be replaced.
pub trait RecordsMut: Records {
    /// Replaces the record with a number below [`Records::count`].
    ///
    /// # Panics
    /// If there is no such record.
    fn put(&mut self, id: usize, record: &Record);
}

impl dyn Records + '_ {
    /// Returns all records by number.
    pub fn iter(&self) -> impl Iterator<Item = Record> + '_ {
        (0..self.count()).map(|id| self.record(id))
    }
}

impl<R: AsRef<[Record]> + Debug + Sync + ?Sized> Records for R {
    fn count(&self) -> usize {
        self.as_ref().len()
    }

    fn record(&self, id: usize) -> Record {
        self.as_ref()[id].clone()
    }
}

impl<R: AsRef<[Record]> + AsMut<[Record]> + Debug + Sync + ?Sized> RecordsMut for R {
    fn put(&mut self, id: usize, record: &Record) {
        self.as_mut()[id].clone_from(record);
    }
}

/// A fixed number of records, stored by column.
///
/// A column that is zero in all records takes no memory, and equal words are stored once. A map of classes and
/// exponents takes 24 bytes per run; a [`Record`] takes 408. Records come back to the bit, but for strobe states,
/// which are stored on request only.
#[derive(Clone, Debug)]
pub struct RecordStore {
    count: usize,
    with_strobes: bool,
    numbers: [Column<f64>; 4],
    measures: [Column<f64>; MEASURES],
    /// Displacement and velocity of each coordinate.
    strobe: [Column<[f64; 2]>; MOST_COORDINATES],
    periods_run: Column<u32>,
    /// Period, status, symmetry and validity: few combinations occur.
    flags: Distinct<[u32; 4]>,
    word: Distinct<([u64; 4], u64, u32)>,
    pattern: Distinct<([u64; 4], u64, u32)>,
}

impl Default for RecordStore {
    fn default() -> Self {
        RecordStore::new(0, false)
    }
}

impl RecordStore {
    /// Creates `count` empty records, with room for strobe states on request.
    pub fn new(count: usize, with_strobes: bool) -> RecordStore {
        RecordStore {
            count,
            with_strobes,
            numbers: Default::default(),
            measures: std::array::from_fn(|_| Column::default()),
            strobe: Default::default(),
            periods_run: Column::default(),
            flags: Distinct::default(),
            word: Distinct::default(),
            pattern: Distinct::default(),
        }
    }

    /// Replaces the records with these numbers.
    ///
    /// # Panics
    /// If there is no such record.
    pub fn put_all(&mut self, batch: &[(u32, Record)]) {
        batch.iter().for_each(|(id, record)| self.put(*id as usize, record));
    }

    /// Returns the bytes of memory of the columns, without the lists of words.
    pub fn bytes(&self) -> usize {
        let small = [&self.periods_run, &self.flags.places, &self.word.places, &self.pattern.places];
        self.numbers.iter().chain(&self.measures).map(Column::bytes).sum::<usize>()
            + small.iter().map(|column| column.bytes()).sum::<usize>()
            + self.strobe.iter().map(Column::bytes).sum::<usize>()
    }
}

impl Records for RecordStore {
    fn count(&self) -> usize {
        self.count
    }

    fn record(&self, id: usize) -> Record {
        assert!(id < self.count, "record {id} of {}", self.count);
        let [lyapunov, lyapunov_error, impacts_per_period, mesh_fraction] =
            self.numbers.each_ref().map(|column| column.get(id));
        let [period, status, symmetric, valid] = self.flags.get(id);
        let (word, word_hash, word_length) = self.word.get(id);
        let (pattern, pattern_hash, pattern_length) = self.pattern.get(id);
        Record {
            lyapunov,
            lyapunov_error,
            impacts_per_period,
            mesh_fraction,
            strobe: self.strobe.iter().flat_map(|column| column.get(id)).collect(),
            word,
            word_hash,
            word_length,
            period,
            periods_run: self.periods_run.get(id),
            status,
            symmetric,
            valid,
            pattern,
            pattern_hash,
            pattern_length,
            measures: self.measures.iter().map(|column| column.get(id)).collect(),
        }
    }
}

impl RecordsMut for RecordStore {
    // A store without strobe states drops them.
    fn put(&mut self, id: usize, record: &Record) {
        let count = self.count;
        assert!(id < count, "record {id} of {count}");
        let &Record { lyapunov, lyapunov_error, impacts_per_period, mesh_fraction, .. } = record;
        let numbers = [lyapunov, lyapunov_error, impacts_per_period, mesh_fraction];
        self.numbers.iter_mut().zip(numbers).for_each(|(column, number)| column.put(count, id, number));
        self.measures
            .iter_mut()
            .zip(record.measures.iter())
            .for_each(|(column, number)| column.put(count, id, number));
        if self.with_strobes {
            self.strobe
                .iter_mut()
                .zip(record.strobe().as_chunks::<2>().0)
                .for_each(|(column, pair)| column.put(count, id, *pair));
        }
        self.periods_run.put(count, id, record.periods_run);
        let &Record { period, status, symmetric, valid, .. } = record;
        self.flags.put(count, id, [period, status, symmetric, valid]);
        self.word.put(count, id, (record.word, record.word_hash, record.word_length));
        self.pattern.put(count, id, (record.pattern, record.pattern_hash, record.pattern_length));
    }
}

/// One value for every record. It is empty while all bits of all values are zero.
#[derive(Clone, Debug)]
struct Column<T>(Vec<T>);

impl<T> Default for Column<T> {
    fn default() -> Self {
        Column(Vec::new())
    }
}

impl<T: Pod> Column<T> {
    fn put(&mut self, count: usize, id: usize, value: T) {
        if self.0.is_empty() {
            // A comparison of bits, because minus zero equals zero.
            if bytemuck::bytes_of(&value).iter().all(|byte| *byte == 0) {
                return;
            }
            self.0 = vec![T::zeroed(); count];
        }
        self.0[id] = value;
    }

    fn get(&self, id: usize) -> T {
        self.0.get(id).copied().unwrap_or_else(T::zeroed)
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.0)
    }
}

/// One value for every record, where many records have the same value.
#[derive(Clone, Debug, Default)]
struct Distinct<T> {
    /// Each record's value by its place in `values`, from 1 on; 0 is the default value.
    places: Column<u32>,
    values: Vec<T>,
    known: HashMap<T, u32>,
}

impl<T: Copy + Default + Eq + Hash> Distinct<T> {
    fn put(&mut self, count: usize, id: usize, value: T) {
        let place = if value == T::default() {
            0
        } else {
            *self.known.entry(value).or_insert_with(|| {
                self.values.push(value);
                self.values.len() as u32
            })
        };
        self.places.put(count, id, place);
    }

    fn get(&self, id: usize) -> T {
        (self.places.get(id) as usize).checked_sub(1).map_or(T::default(), |place| self.values[place])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::valid;
    use proptest::prelude::*;
    use rattlemap_dynamics::word::Word;

    /// Records of any bits; some are empty, some share their words.
    fn records() -> impl Strategy<Value = Vec<Record>> {
        let bytes = prop::collection::vec(any::<u8>(), Record::BYTES);
        let any_bits = bytes.prop_map(|bytes| Record::from_bytes(&bytes));
        let with_words = ("[0-7]{0,70}", "[0-7]{0,2}").prop_map(|(word, pattern)| {
            let mut record = Record::default();
            record.set_word(&Word::cyclic(word.as_bytes()));
            record.set_pattern(&Word::cyclic(pattern.as_bytes()));
            record
        });
        prop::collection::vec(prop_oneof![Just(Record::default()), any_bits, with_words], 1..40)
    }

    proptest! {
        #[test]
        fn records_come_back_to_the_bit(list in records(), with_strobes: bool) {
            let mut store = RecordStore::new(list.len(), with_strobes);
            // Another record is replaced in each place.
            for record_list in [list.iter().rev().collect::<Vec<_>>(), list.iter().collect()] {
                record_list.into_iter().enumerate().for_each(|(id, record)| store.put(id, record));
            }
            prop_assert_eq!(store.count(), list.len());
            for (id, mut expected) in list.into_iter().enumerate() {
                if !with_strobes {
                    expected.strobe = Default::default();
                }
                prop_assert_eq!(store.record(id).to_bytes(), expected.to_bytes());
            }
        }
    }

    /// Maps of 10^9 cells depend on these sizes.
    #[test]
    fn a_run_takes_the_bytes_of_its_quantities() {
        let count = 1000;
        let per_run = |record: &Record, with_strobes: bool| {
            let mut store = RecordStore::new(count, with_strobes);
            (0..count).for_each(|id| store.put(id, record));
            store.bytes() / count
        };
        let mut by_default = Record {
            lyapunov: 0.1,
            lyapunov_error: 0.01,
            strobe: [1.0; 4].into(),
            period: 3,
            periods_run: 500,
            valid: valid::PERIOD | valid::LYAPUNOV | valid::STROBE,
            ..Record::default()
        };
        assert_eq!((per_run(&by_default, false), per_run(&by_default, true)), (24, 56));
        let mut all =
            Record { impacts_per_period: 2.0, mesh_fraction: 0.5, symmetric: 1, ..by_default.clone() };
        all.set_word(&Word::cyclic(b"13552"));
        all.set_pattern(&Word::cyclic(b"1352"));
        assert_eq!((per_run(&all, false), per_run(&all, true)), (48, 80));
        (by_default.measures[0], by_default.measures[5]) = (1.0, 2.0);
        assert_eq!(per_run(&by_default, false), 24 + 2 * 8);
    }
}
