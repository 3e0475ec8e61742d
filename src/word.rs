//! Mapping words: the cyclic sequence of flights.

/// A cyclic mapping word in canonical rotation, symbols `b'1'..=b'6'`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Default)]
pub struct Word(Vec<u8>);
