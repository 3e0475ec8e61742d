//! The fields of a record as rows of numbers, for files and messages.

use super::Record;
use super::measures::{FURTHER, GROUPS, MEASURES, OF_DRIFTS, OF_GAPS, OF_SIGNALS, places_before};
use rattlemap_dynamics::model::STATE;

/// A field of a record, or the measured quantities of a group.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Name of the column in files.
    pub name: &'static str,
    /// Number of numbers.
    pub count: usize,
    /// Bytes of each number.
    pub width: usize,
    /// Place of the first number in an array of the record.
    first: usize,
    get: fn(&Record, usize) -> u64,
    set: fn(&mut Record, usize, u64),
}

impl Field {
    /// Returns the bits of a number.
    pub fn get(&self, record: &Record, nth: usize) -> u64 {
        (self.get)(record, self.first + nth)
    }

    /// Sets the bits of a number that is zero.
    pub fn set(&self, record: &mut Record, nth: usize, bits: u64) {
        // Without this condition every record would hold the numbers of the largest models.
        if bits != 0 {
            (self.set)(record, self.first + nth, bits);
        }
    }
}

/// The bits of a number.
trait Bits {
    fn bits(&self) -> u64;
    fn set_bits(&mut self, bits: u64);
}

macro_rules! bits {
    ($($type:ty, |$number:ident| $bits:expr, |$from:ident| $of:expr;)*) => {
        $(impl Bits for $type {
            fn bits(&self) -> u64 {
                let $number = *self;
                $bits
            }

            fn set_bits(&mut self, $from: u64) {
                *self = $of;
            }
        })*
    };
}

bits! {
    f64, |number| number.to_bits(), |bits| f64::from_bits(bits);
    u64, |number| number, |bits| bits;
    u32, |number| number.into(), |bits| bits as u32;
}

macro_rules! field {
    ($name:expr, $count:expr, $width:expr, |$record:ident, $nth:pat_param| $number:expr) => {
        Field {
            name: $name,
            count: $count,
            width: $width,
            first: 0,
            get: |$record, $nth| $number.bits(),
            set: |$record, $nth, bits| $number.set_bits(bits),
        }
    };
}

/// Fields without measured quantities.
const BEFORE: [Field; 16] = [
    field!("lyapunov", 1, 8, |record, _| record.lyapunov),
    field!("lyapunov_error", 1, 8, |record, _| record.lyapunov_error),
    field!("impacts_per_period", 1, 8, |record, _| record.impacts_per_period),
    field!("mesh_fraction", 1, 8, |record, _| record.mesh_fraction),
    field!("strobe", STATE, 8, |record, nth| record.strobe[nth]),
    field!("word", 4, 8, |record, nth| record.word[nth]),
    field!("word_hash", 1, 8, |record, _| record.word_hash),
    field!("word_length", 1, 4, |record, _| record.word_length),
    field!("period", 1, 4, |record, _| record.period),
    field!("periods_run", 1, 4, |record, _| record.periods_run),
    field!("status", 1, 4, |record, _| record.status),
    field!("symmetric", 1, 4, |record, _| record.symmetric),
    field!("valid", 1, 4, |record, _| record.valid),
    field!("pattern", 4, 8, |record, nth| record.pattern[nth]),
    field!("pattern_hash", 1, 8, |record, _| record.pattern_hash),
    // Four bytes follow that are zero.
    Field {
        get: |record, nth| if nth == 0 { record.pattern_length.into() } else { 0 },
        ..field!("pattern_length", 2, 4, |record, _| record.pattern_length)
    },
];

/// Place of the strobe state in [`FIELDS`].
pub const STROBE: usize = 4;

/// Number of groups with a field of their own.
const GROUP_FIELDS: usize = 12;

/// Place of the time of a cycle in the last field.
const CYCLE_TIME: usize = 1 + OF_DRIFTS + (MEASURES - OF_DRIFTS) / 2 - OF_SIGNALS;

/// All fields in the order of files. The last but two has the measured quantities of displacements and gaps that oscillators of at most
/// two coordinates with one gap do not have, the next one those of each of several gaps. The last one has the only number of the last
/// group but one, those of signals, drifts, the time of a cycle, and the errors of drifts.
pub const FIELDS: [Field; BEFORE.len() + GROUP_FIELDS + 3] = {
    let further =
        field!("further_displacements_and_gaps", OF_GAPS - FURTHER, 8, |record, nth| record.measures[nth]);
    let mut fields = [Field { first: FURTHER, ..further }; BEFORE.len() + GROUP_FIELDS + 3];
    let mut i = fields.len() - 1;
    // Not a block, which would be a copy of the number.
    fields[i] = field!(
        "release_energy_signals_drifts_cycle_time_and_errors_of_drifts",
        2 + MEASURES - OF_SIGNALS,
        8,
        |record, nth| record.measures[match nth {
            0 => places_before(GROUP_FIELDS),
            CYCLE_TIME => places_before(GROUP_FIELDS + 1),
            nth => OF_SIGNALS + nth - if nth < CYCLE_TIME { 1 } else { 2 },
        }]
    );
    i -= 1;
    fields[i] = Field { name: "each_of_six_gaps", first: OF_GAPS, count: OF_SIGNALS - OF_GAPS, ..further };
    i = 0;
    while i < fields.len() - 3 {
        fields[i] = match i.checked_sub(BEFORE.len()) {
            None => BEFORE[i],
            Some(group) => {
                let (first, count) = (places_before(group), GROUPS[group].places());
                Field { name: GROUPS[group].name, first, count, ..further }
            }
        };
        i += 1;
    }
    fields
};

impl Record {
    /// Number of bytes in messages to and from pages.
    pub const BYTES: usize = 1520;

    /// Returns the bytes of all fields, little-endian.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(Record::BYTES);
        for (field, nth) in numbers() {
            bytes.extend(&field.get(self, nth).to_le_bytes()[..field.width]);
        }
        bytes
    }

    /// Returns the record with these bytes.
    ///
    /// # Panics
    /// If there are fewer than [`Record::BYTES`].
    pub fn from_bytes(mut bytes: &[u8]) -> Record {
        let mut record = Record::default();
        for (field, nth) in numbers() {
            let (number, rest) = bytes.split_at(field.width);
            let bits = number.iter().rev().fold(0, |bits, &byte| bits << 8 | u64::from(byte));
            field.set(&mut record, nth, bits);
            bytes = rest;
        }
        record
    }
}

fn numbers() -> impl Iterator<Item = (&'static Field, usize)> {
    FIELDS.iter().flat_map(|field| (0..field.count).map(move |nth| (field, nth)))
}
