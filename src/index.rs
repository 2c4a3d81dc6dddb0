//! Indices that know what they index.
//!
//! [`define_id!`](crate::define_id) makes an index type; [`IndexVec`] is a vector that only that type can index. An id of
//! one kind of thing cannot be used for another, and no bare `usize` crosses a public interface.

use serde::{Deserialize, Serialize};
use std::{
    fmt,
    marker::PhantomData,
    ops::{Index, IndexMut},
};

/// An index type made by [`define_id!`](crate::define_id).
pub trait Id: Copy + Eq + Ord + fmt::Debug {
    /// The id of the `index`-th thing.
    ///
    /// # Panics
    /// If there are more than 2³² things.
    fn from_index(index: usize) -> Self;

    /// The position in its [`IndexVec`].
    fn index(self) -> usize;
}

/// Defines an index type: `define_id!(/// A node of the film complex. NodeId);`
#[macro_export]
macro_rules! define_id {
    ($(#[$meta:meta])* $name:ident) => {
        $(#[$meta])*
        #[derive(
            Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
        )]
        #[serde(transparent)]
        pub struct $name(u32);

        impl std::fmt::Display for $name {
            /// Its number, as in tables.
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.0.fmt(f)
            }
        }

        impl $crate::index::Id for $name {
            fn from_index(index: usize) -> Self {
                Self($crate::index::checked_u32(index))
            }

            fn index(self) -> usize {
                self.0 as usize
            }
        }
    };
}

/// `index` as a `u32`.
///
/// # Panics
/// If it does not fit: no collection here holds 2³² things.
#[must_use]
#[doc(hidden)]
pub fn checked_u32(index: usize) -> u32 {
    match u32::try_from(index) {
        Ok(value) => value,
        Err(_) => panic!("index {index} does not fit in 32 bits"),
    }
}

/// A vector that is indexed by `I` alone.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct IndexVec<I, T> {
    items: Vec<T>,
    #[serde(skip)]
    id: PhantomData<fn() -> I>,
}

impl<I: Id, T> IndexVec<I, T> {
    /// An empty vector.
    #[must_use]
    pub const fn new() -> Self {
        Self { items: Vec::new(), id: PhantomData }
    }

    /// `count` copies of `item`.
    #[must_use]
    pub fn from_elem(item: T, count: usize) -> Self
    where
        T: Clone,
    {
        vec![item; count].into()
    }

    /// Adds `item` and gives its id.
    pub fn push(&mut self, item: T) -> I {
        let id = I::from_index(self.items.len());
        self.items.push(item);
        id
    }

    /// Adds all items of another vector behind those of this one.
    pub fn extend(&mut self, other: Self) {
        self.items.extend(other.items);
    }

    /// The number of items.
    #[must_use]
    pub fn len(&self) -> usize {
        self.items.len()
    }

    /// Whether there are no items.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// The item of `id`, if there is one.
    #[must_use]
    pub fn get(&self, id: I) -> Option<&T> {
        self.items.get(id.index())
    }

    /// All ids in order.
    pub fn ids(&self) -> impl ExactSizeIterator<Item = I> + DoubleEndedIterator + use<I, T> {
        (0..self.items.len()).map(I::from_index)
    }

    /// All items in order.
    pub fn iter(&self) -> std::slice::Iter<'_, T> {
        self.items.iter()
    }

    /// All items in order, to be changed.
    pub fn iter_mut(&mut self) -> std::slice::IterMut<'_, T> {
        self.items.iter_mut()
    }

    /// All ids with their items, in order.
    pub fn enumerated(&self) -> impl ExactSizeIterator<Item = (I, &T)> + DoubleEndedIterator {
        self.items.iter().enumerate().map(|(index, item)| (I::from_index(index), item))
    }

    /// The items as a slice.
    #[must_use]
    pub fn as_slice(&self) -> &[T] {
        &self.items
    }

    /// The items as a slice, to be changed.
    pub fn as_mut_slice(&mut self) -> &mut [T] {
        &mut self.items
    }

    /// The items as a plain vector.
    #[must_use]
    pub fn into_vec(self) -> Vec<T> {
        self.items
    }
}

impl<I: Id, T> Default for IndexVec<I, T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<I, T> From<Vec<T>> for IndexVec<I, T> {
    fn from(items: Vec<T>) -> Self {
        Self { items, id: PhantomData }
    }
}

impl<I: Id, T> FromIterator<T> for IndexVec<I, T> {
    fn from_iter<S: IntoIterator<Item = T>>(items: S) -> Self {
        items.into_iter().collect::<Vec<_>>().into()
    }
}

impl<'a, I: Id, T> IntoIterator for &'a IndexVec<I, T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.items.iter()
    }
}

impl<I: Id, T> Index<I> for IndexVec<I, T> {
    type Output = T;

    fn index(&self, id: I) -> &T {
        &self.items[id.index()]
    }
}

impl<I: Id, T> IndexMut<I> for IndexVec<I, T> {
    fn index_mut(&mut self, id: I) -> &mut T {
        &mut self.items[id.index()]
    }
}

impl<I, T: fmt::Debug> fmt::Debug for IndexVec<I, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.items.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    define_id!(
        /// A thing under test.
        #[expect(unreachable_pub, reason = "the macro makes public types; this one stays in the test")]
        ThingId
    );

    #[test]
    fn ids_come_back_as_they_were_given() {
        let mut things: IndexVec<ThingId, &str> = IndexVec::new();
        let (a, b) = (things.push("a"), things.push("b"));
        assert_eq!((things[a], things[b]), ("a", "b"));
        assert_eq!(things.ids().collect::<Vec<_>>(), [a, b]);
        assert_eq!(things.get(ThingId::from_index(2)), None);
    }

    #[test]
    fn json_is_a_plain_list() -> Result<(), serde_json::Error> {
        let things: IndexVec<ThingId, i32> = vec![3, 4].into();
        let text = serde_json::to_string(&things)?;
        assert_eq!(text, "[3,4]");
        assert_eq!(serde_json::from_str::<IndexVec<ThingId, i32>>(&text)?, things);
        Ok(())
    }
}
