//! Mapping words: the cyclic sequence of flights.

/// A cyclic mapping word in canonical rotation, symbols `b'1'..=b'6'`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Default)]
pub struct Word(Vec<u8>);

impl Word {
    /// The symbols in time order.
    pub fn time_order(&self) -> String {
        todo!()
    }

    /// The composition as the paper prints it.
    pub fn paper_notation(&self) -> String {
        todo!()
    }
}
