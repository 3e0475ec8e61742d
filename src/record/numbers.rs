//! A fixed number of numbers of which most records have only the first ones.

use std::ops::{Index, IndexMut};

/// `FIRST + FURTHER` numbers. Those after the first ones take memory only if one of them was set.
#[derive(Clone, Debug)]
pub struct Numbers<const FIRST: usize, const FURTHER: usize> {
    first: [f64; FIRST],
    further: Option<Box<[f64; FURTHER]>>,
}

impl<const FIRST: usize, const FURTHER: usize> Numbers<FIRST, FURTHER> {
    /// Sets a number. A further one that stays zero takes no memory.
    pub fn set(&mut self, place: usize, number: f64) {
        // A comparison of bits, because minus zero equals zero.
        if self[place].to_bits() != number.to_bits() {
            self[place] = number;
        }
    }

    /// Returns all numbers in their order.
    pub fn iter(&self) -> impl Iterator<Item = f64> + '_ {
        self.first.iter().chain(self.further()).copied()
    }

    fn further(&self) -> &[f64; FURTHER] {
        self.further.as_deref().unwrap_or(&[0.0; FURTHER])
    }
}

impl<const FIRST: usize, const FURTHER: usize> Default for Numbers<FIRST, FURTHER> {
    fn default() -> Self {
        Numbers { first: [0.0; FIRST], further: None }
    }
}

impl<const FIRST: usize, const FURTHER: usize> PartialEq for Numbers<FIRST, FURTHER> {
    fn eq(&self, other: &Self) -> bool {
        self.first == other.first && self.further() == other.further()
    }
}

impl<const FIRST: usize, const FURTHER: usize> Index<usize> for Numbers<FIRST, FURTHER> {
    type Output = f64;

    fn index(&self, place: usize) -> &f64 {
        self.first.get(place).unwrap_or_else(|| &self.further()[place - FIRST])
    }
}

impl<const FIRST: usize, const FURTHER: usize> IndexMut<usize> for Numbers<FIRST, FURTHER> {
    fn index_mut(&mut self, place: usize) -> &mut f64 {
        match place.checked_sub(FIRST) {
            None => &mut self.first[place],
            Some(place) => &mut self.further.get_or_insert_with(|| Box::new([0.0; FURTHER]))[place],
        }
    }
}

impl<const FIRST: usize, const FURTHER: usize> FromIterator<f64> for Numbers<FIRST, FURTHER> {
    /// Takes the first numbers. The others are zero.
    fn from_iter<I: IntoIterator<Item = f64>>(numbers: I) -> Self {
        let (mut taken, mut numbers) = (Numbers::default(), numbers.into_iter());
        taken.first.iter_mut().zip(&mut numbers).for_each(|(to, number)| *to = number);
        numbers.enumerate().for_each(|(place, number)| taken.set(FIRST + place, number));
        taken
    }
}

impl<const FIRST: usize, const FURTHER: usize, const COUNT: usize> From<[f64; COUNT]>
    for Numbers<FIRST, FURTHER>
{
    fn from(numbers: [f64; COUNT]) -> Self {
        numbers.into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::record::Record;

    #[test]
    fn only_records_of_larger_models_take_further_memory() {
        assert!(size_of::<Record>() <= 408, "{}", size_of::<Record>());
        let mut record = Record::from_bytes(&Record::default().to_bytes());
        record.clear_measures(|_| true);
        record.measures.set(30, 0.0);
        assert!(record.strobe.further.is_none() && record.measures.further.is_none());
        record.measures.set(30, -0.0);
        assert_eq!((record.measures[30].to_bits(), &record), ((-0.0_f64).to_bits(), &Record::default()));
        record.strobe = (0..16).map(f64::from).collect();
        assert_eq!(record.strobe()[15], 15.0);
        assert_eq!(record.to_bytes().len(), Record::BYTES);
        assert_eq!(Record::from_bytes(&record.to_bytes()), record);
    }
}
