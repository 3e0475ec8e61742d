//! Records of all runs, by the run's number: as they are, or column by column in a fraction of the memory.

use std::collections::HashMap;
use std::fmt::Debug;

use bytemuck::Zeroable;

use super::Record;

/// Records by number, however they are kept.
pub trait Records: Debug + Sync {
    /// How many there are.
    fn count(&self) -> usize;

    /// The record with this number, below [`Records::count`].
    ///
    /// # Panics
    /// If there is none.
    fn record(&self, id: usize) -> Record;
}

impl<R: AsRef<[Record]> + Debug + Sync + ?Sized> Records for R {
    fn count(&self) -> usize {
        self.as_ref().len()
    }

    fn record(&self, id: usize) -> Record {
        self.as_ref()[id]
    }
}

/// Records by column. A column in which no record has anything takes no memory, a word takes as much as its number: a
/// map of class and exponent has 24 bytes per run where a [`Record`] has 176.
///
/// What is put in comes out to the bit, but for strobe states, which are kept where they are wanted.
#[derive(Clone, Debug)]
pub struct RecordStore {
    heads: Vec<Head>,
    periods_run: Column<u32>,
    lyapunov: Column<f64>,
    lyapunov_error: Column<f64>,
    impacts_per_period: Column<f64>,
    mesh_fraction: Column<f64>,
    /// None where they are not wanted.
    strobe: Option<Column<[f64; 4]>>,
    word: Column<u32>,
    pattern: Column<u32>,
    spelled: Spelled,
    /// Records that have numbers which the columns have no room for.
    odd: HashMap<usize, Record>,
}

/// What is small in every record of an engine.
#[derive(Clone, Copy, Debug, Default)]
struct Head {
    /// Validity bits; above them whether the orbit is symmetric, and whether the record is an odd one.
    bits: u16,
    period: u8,
    status: u8,
}

const SYMMETRIC: u16 = 1 << 14;
const ODD: u16 = 1 << 15;

impl RecordStore {
    /// As many empty records, with room for strobe states if those are wanted.
    pub fn new(count: usize, with_strobes: bool) -> RecordStore {
        RecordStore {
            heads: vec![Head::default(); count],
            periods_run: Column::default(),
            lyapunov: Column::default(),
            lyapunov_error: Column::default(),
            impacts_per_period: Column::default(),
            mesh_fraction: Column::default(),
            strobe: with_strobes.then(Column::default),
            word: Column::default(),
            pattern: Column::default(),
            spelled: Spelled::default(),
            odd: HashMap::new(),
        }
    }

    /// Puts a record in the place of the one with this number.
    ///
    /// # Panics
    /// If there is none.
    pub fn put(&mut self, id: usize, record: &Record) {
        let count = self.heads.len();
        if self.heads[id].bits & ODD != 0 {
            self.odd.remove(&id);
        }
        let kept = Record { strobe: if self.strobe.is_some() { record.strobe } else { [0.0; 4] }, ..*record };
        let Some(head) = Head::of(&kept) else {
            self.heads[id] = Head { bits: ODD, ..Head::default() };
            self.odd.insert(id, kept);
            return;
        };
        self.heads[id] = head;
        self.periods_run.put(count, id, kept.periods_run);
        self.lyapunov.put(count, id, kept.lyapunov);
        self.lyapunov_error.put(count, id, kept.lyapunov_error);
        self.impacts_per_period.put(count, id, kept.impacts_per_period);
        self.mesh_fraction.put(count, id, kept.mesh_fraction);
        if let Some(strobe) = &mut self.strobe {
            strobe.put(count, id, kept.strobe);
        }
        let word = self.spelled.number((kept.word, kept.word_hash, kept.word_length));
        self.word.put(count, id, word);
        let pattern = self.spelled.number((kept.pattern, kept.pattern_hash, kept.pattern_length));
        self.pattern.put(count, id, pattern);
    }

    /// Bytes of memory that it takes, words aside.
    pub fn bytes(&self) -> usize {
        let numbers = [&self.lyapunov, &self.lyapunov_error, &self.impacts_per_period, &self.mesh_fraction];
        let small = [&self.periods_run, &self.word, &self.pattern];
        size_of_val(&*self.heads)
            + numbers.iter().map(|column| column.bytes()).sum::<usize>()
            + small.iter().map(|column| column.bytes()).sum::<usize>()
            + self.strobe.as_ref().map_or(0, Column::bytes)
            + self.odd.len() * size_of::<(usize, Record)>()
    }
}

impl Records for RecordStore {
    fn count(&self) -> usize {
        self.heads.len()
    }

    fn record(&self, id: usize) -> Record {
        let head = self.heads[id];
        if head.bits & ODD != 0 {
            return self.odd[&id];
        }
        let (word, word_hash, word_length) = self.spelled.of(self.word.get(id));
        let (pattern, pattern_hash, pattern_length) = self.spelled.of(self.pattern.get(id));
        Record {
            lyapunov: self.lyapunov.get(id),
            lyapunov_error: self.lyapunov_error.get(id),
            impacts_per_period: self.impacts_per_period.get(id),
            mesh_fraction: self.mesh_fraction.get(id),
            strobe: self.strobe.as_ref().map_or([0.0; 4], |column| column.get(id)),
            word,
            word_hash,
            word_length,
            period: head.period.into(),
            periods_run: self.periods_run.get(id),
            status: head.status.into(),
            symmetric: u32::from(head.bits & SYMMETRIC != 0),
            valid: (head.bits & !SYMMETRIC).into(),
            pattern,
            pattern_hash,
            pattern_length,
            reserved: 0,
        }
    }
}

impl Head {
    /// None of a record that has more than fits.
    fn of(record: &Record) -> Option<Head> {
        let bits = u16::try_from(record.valid).ok().filter(|bits| *bits < SYMMETRIC)?;
        let symmetric = match record.symmetric {
            0 => 0,
            1 => SYMMETRIC,
            _ => return None,
        };
        let (period, status) = (record.period.try_into().ok()?, record.status.try_into().ok()?);
        (record.reserved == 0).then_some(Head { bits: bits | symmetric, period, status })
    }
}

/// A number of every record; nothing until one is not zero.
#[derive(Clone, Debug)]
struct Column<T>(Vec<T>);

impl<T> Default for Column<T> {
    fn default() -> Self {
        Column(Vec::new())
    }
}

impl<T: bytemuck::Pod> Column<T> {
    fn put(&mut self, count: usize, id: usize, value: T) {
        if self.0.is_empty() {
            // Minus zero is none.
            if bytemuck::bytes_of(&value).iter().all(|byte| *byte == 0) {
                return;
            }
            self.0 = vec![T::zeroed(); count];
        }
        self.0[id] = value;
    }

    fn get(&self, id: usize) -> T {
        self.0.get(id).copied().unwrap_or_else(Zeroable::zeroed)
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.0)
    }
}

/// A word or a pattern as a record has it: symbols, hash, length.
type Packed = ([u64; 4], u64, u32);

/// Words and patterns by number, from 1 on; 0 is nothing.
#[derive(Clone, Debug, Default)]
struct Spelled {
    list: Vec<Packed>,
    numbers: HashMap<Packed, u32>,
}

impl Spelled {
    fn number(&mut self, packed: Packed) -> u32 {
        if packed == Packed::default() {
            return 0;
        }
        *self.numbers.entry(packed).or_insert_with(|| {
            self.list.push(packed);
            self.list.len() as u32
        })
    }

    fn of(&self, number: u32) -> Packed {
        (number as usize).checked_sub(1).map_or(Packed::default(), |place| self.list[place])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::valid;
    use proptest::prelude::*;
    use rattlemap_dynamics::word::Word;

    /// Every tenth bit pattern is one that no engine writes.
    fn records() -> impl Strategy<Value = Vec<Record>> {
        let number = || any::<u64>().prop_map(f64::from_bits);
        let numbers = (number(), number(), number(), number(), [number(), number(), number(), number()]);
        let small = (0u32..300, any::<u32>(), 0u32..300, 0u32..3, 0u32..1 << 17);
        let word = || "[1-6]{0,70}";
        let one =
            (numbers, small, word(), word(), 0u32..20).prop_map(|(numbers, small, word, pattern, odd)| {
                let (lyapunov, lyapunov_error, impacts_per_period, mesh_fraction, strobe) = numbers;
                let (period, periods_run, status, symmetric, bits) = small;
                let mut record = Record {
                    lyapunov,
                    lyapunov_error,
                    impacts_per_period,
                    mesh_fraction,
                    strobe,
                    period,
                    periods_run,
                    status,
                    symmetric,
                    reserved: u32::from(odd == 0),
                    ..Record::default()
                };
                record.set_word(&Word::cyclic(word.as_bytes()));
                record.set_pattern(&Word::cyclic(pattern.as_bytes()));
                record.valid = bits;
                record
            });
        let nothing = Just(Record::default());
        prop::collection::vec(prop_oneof![1 => nothing, 3 => one], 1..40)
    }

    proptest! {
        #[test]
        fn what_is_put_in_comes_out_to_the_bit(list in records(), with_strobes: bool) {
            let mut store = RecordStore::new(list.len(), with_strobes);
            // Each place has another record first.
            for (id, record) in list.iter().rev().enumerate() {
                store.put(id, record);
            }
            for (id, record) in list.iter().enumerate() {
                store.put(id, record);
            }
            prop_assert_eq!(store.count(), list.len());
            for (id, &record) in list.iter().enumerate() {
                let strobe = if with_strobes { record.strobe } else { [0.0; 4] };
                let (kept, expected) = (store.record(id), Record { strobe, ..record });
                prop_assert_eq!(bytemuck::bytes_of(&kept), bytemuck::bytes_of(&expected));
            }
        }
    }

    /// What a map of 10^9 cells needs hangs on it.
    #[test]
    fn a_run_takes_the_bytes_of_what_was_asked_for() {
        let count = 1000;
        let per_run = |record: &Record, with_strobes: bool| {
            let mut store = RecordStore::new(count, with_strobes);
            (0..count).for_each(|id| store.put(id, record));
            store.bytes() / count
        };
        let by_default = Record {
            lyapunov: 0.1,
            lyapunov_error: 0.01,
            strobe: [1.0; 4],
            period: 3,
            periods_run: 500,
            valid: valid::PERIOD | valid::LYAPUNOV | valid::STROBE,
            ..Record::default()
        };
        assert_eq!((per_run(&by_default, false), per_run(&by_default, true)), (24, 56));
        let mut all = Record { impacts_per_period: 2.0, mesh_fraction: 0.5, symmetric: 1, ..by_default };
        all.set_word(&Word::cyclic(b"13552"));
        all.set_pattern(&Word::cyclic(b"1352"));
        assert_eq!((per_run(&all, false), per_run(&all, true)), (48, 80));
    }
}
