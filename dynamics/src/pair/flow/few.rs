//! A list that is empty for most models.

use std::ops::{Deref, DerefMut};

/// A list of the size of a pointer, without heap memory if it is empty. So a matrix that has none of these items occupies no
/// further cache line.
#[derive(Clone, Debug)]
pub(crate) struct Few<T>(Option<Box<Items<T>>>);

#[derive(Clone, Debug)]
struct Items<T>(Vec<T>);

impl<T> Few<T> {
    pub(crate) const NONE: Few<T> = Few(None);

    #[inline(always)]
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_none()
    }

    /// Returns the bytes on the heap.
    pub(crate) fn heap_bytes(&self) -> usize {
        size_of_val::<[T]>(self)
    }
}

impl<T> Deref for Few<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        self.0.as_ref().map_or(&[], |items| &items.0)
    }
}

impl<T> DerefMut for Few<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        self.0.as_mut().map_or(&mut [], |items| &mut items.0)
    }
}

impl<T> FromIterator<T> for Few<T> {
    fn from_iter<I: IntoIterator<Item = T>>(items: I) -> Few<T> {
        let items: Vec<T> = items.into_iter().collect();
        Few((!items.is_empty()).then(|| Box::new(Items(items))))
    }
}
