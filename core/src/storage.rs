//! Layer 0a: storage whose size nobody knows beforehand.
//!
//! Who knows the bound owns the memory. Where nobody does (cache records, beams),
//! a [`List`] takes either a slice lent by the host or, with feature `alloc`, a growing `Vec`. What takes several lists lays
//! them out by itself in one lent slice of [`Chunk`]s.

use bytemuck::{Pod, Zeroable};

/// A sequence in lent memory, or in a growing `Vec` with feature `alloc`.
///
/// ```
/// # use fogbow::storage::{Full, List};
/// let mut slots = [0u32; 2];
/// let mut list = List::from(&mut slots[..]);
/// assert_eq!((list.push(7), list.push(8), list.push(9)), (Ok(()), Ok(()), Err(Full)));
/// assert_eq!(list.as_slice(), [7, 8]);
/// ```
#[derive(Debug)]
pub struct List<'s, T>(Storage<'s, T>);

#[derive(Debug)]
enum Storage<'s, T> {
    Lent {
        slots: &'s mut [T],
        used: usize,
    },
    #[cfg(feature = "alloc")]
    Grown(alloc::vec::Vec<T>),
}

/// 64 bytes of lent memory, aligned for everything that the library keeps in it.
///
/// ```
/// # use fogbow::storage::Chunk;
/// let memory = [Chunk::default(); 4];
/// assert_eq!((size_of_val(&memory), align_of::<Chunk>()), (256, 64));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct Chunk([u8; 64]);

impl Default for Chunk {
    fn default() -> Self {
        Self([0; 64])
    }
}

/// Chunks that so many elements take.
pub(crate) const fn chunks_for<T>(count: usize) -> usize {
    (count * size_of::<T>()).div_ceil(size_of::<Chunk>())
}

/// Takes room for so many elements from the front of `memory`; for as many as there is room.
pub(crate) fn carve<'s, T: Pod>(memory: &mut &'s mut [Chunk], count: usize) -> &'s mut [T] {
    const { assert!(align_of::<T>() <= align_of::<Chunk>()) };
    let all = core::mem::take(memory);
    let (taken, rest) = all.split_at_mut(chunks_for::<T>(count).min(all.len()));
    *memory = rest;
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(taken);
    let count = count.min(bytes.len() / size_of::<T>());
    bytemuck::cast_slice_mut(&mut bytes[..count * size_of::<T>()])
}

/// The most of something that fit, of which `n` take `needed(n)` chunks, each at least one.
pub(crate) fn most_within(chunks: usize, needed: impl Fn(usize) -> usize) -> usize {
    let (mut fit, mut too_many) = (0, chunks + 1);
    while too_many - fit > 1 {
        let middle = fit + (too_many - fit) / 2;
        *(if needed(middle) <= chunks { &mut fit } else { &mut too_many }) = middle;
    }
    fit
}

/// A lent slice has no room left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Full;

impl core::fmt::Display for Full {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("the lent storage is full")
    }
}

impl core::error::Error for Full {}

impl<T: Copy> List<'_, T> {
    /// Appends one element.
    ///
    /// # Errors
    /// [`Full`] when a lent slice has no room left; a `Vec` grows.
    pub fn push(&mut self, value: T) -> Result<(), Full> {
        match &mut self.0 {
            Storage::Lent { slots, used } => {
                *slots.get_mut(*used).ok_or(Full)? = value;
                *used += 1;
            }
            #[cfg(feature = "alloc")]
            Storage::Grown(vec) => vec.push(value),
        }
        Ok(())
    }

    /// How many more elements fit; a `Vec` has no end.
    ///
    /// ```
    /// # use fogbow::storage::List;
    /// let mut slots = [0.0; 3];
    /// let mut list = List::from(&mut slots[..]);
    /// assert_eq!((list.push(1.0), list.room()), (Ok(()), 2));
    /// ```
    #[must_use]
    pub fn room(&self) -> usize {
        match &self.0 {
            Storage::Lent { slots, used } => slots.len() - used,
            #[cfg(feature = "alloc")]
            Storage::Grown(_) => usize::MAX,
        }
    }

    /// The elements so far.
    #[must_use]
    pub fn as_slice(&self) -> &[T] {
        match &self.0 {
            Storage::Lent { slots, used } => &slots[..*used],
            #[cfg(feature = "alloc")]
            Storage::Grown(vec) => vec,
        }
    }

    /// The elements so far, to change in place.
    ///
    /// ```
    /// # use fogbow::storage::List;
    /// let mut slots = [0u32; 4];
    /// let mut list = List::from(&mut slots[..]);
    /// list.push(1).unwrap();
    /// list.as_mut_slice()[0] += 6;
    /// assert_eq!(list.as_slice(), [7]);   // what was lent but is not used does not show
    /// ```
    #[must_use]
    pub fn as_mut_slice(&mut self) -> &mut [T] {
        match &mut self.0 {
            Storage::Lent { slots, used } => &mut slots[..*used],
            #[cfg(feature = "alloc")]
            Storage::Grown(vec) => vec,
        }
    }

    /// Number of elements so far.
    ///
    /// ```
    /// # use fogbow::storage::List;
    /// let mut slots = [0u32; 2];
    /// let mut list = List::from(&mut slots[..]);
    /// assert!(list.is_empty());
    /// list.push(7).unwrap();
    /// assert_eq!(list.len(), 1);
    /// ```
    #[must_use]
    pub fn len(&self) -> usize {
        self.as_slice().len()
    }

    /// Whether there is no element.
    ///
    /// ```
    /// # use fogbow::storage::List;
    /// let mut slots = [0u32; 2];
    /// let mut list = List::from(&mut slots[..]);
    /// assert!(list.is_empty());   // what a lent slice held counts for nothing
    /// list.push(7).unwrap();
    /// assert!(!list.is_empty());
    /// ```
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.as_slice().is_empty()
    }

    /// Appends elements in order, all or none.
    ///
    /// ```
    /// # use fogbow::storage::{Full, List};
    /// let mut slots = [0u32; 2];
    /// let mut list = List::from(&mut slots[..]);
    /// assert_eq!(list.extend_from_slice(&[1, 2, 3]), Err(Full));
    /// assert!(list.is_empty());
    /// assert_eq!(list.extend_from_slice(&[1, 2]), Ok(()));
    /// ```
    ///
    /// # Errors
    /// [`Full`] when a lent slice has no room for all.
    pub fn extend_from_slice(&mut self, values: &[T]) -> Result<(), Full> {
        match &mut self.0 {
            Storage::Lent { slots, used } => {
                slots.get_mut(*used..*used + values.len()).ok_or(Full)?.copy_from_slice(values);
                *used += values.len();
            }
            #[cfg(feature = "alloc")]
            Storage::Grown(vec) => vec.extend_from_slice(values),
        }
        Ok(())
    }

    /// Keeps the first `count` elements, or all if there are fewer.
    ///
    /// ```
    /// # use fogbow::storage::List;
    /// let mut slots = [0u32; 2];
    /// let mut list = List::from(&mut slots[..]);
    /// list.extend_from_slice(&[1, 2]).unwrap();
    /// list.truncate(1);
    /// assert_eq!(list.as_slice(), [1]);
    /// ```
    pub fn truncate(&mut self, count: usize) {
        match &mut self.0 {
            Storage::Lent { used, .. } => *used = count.min(*used),
            #[cfg(feature = "alloc")]
            Storage::Grown(vec) => vec.truncate(count),
        }
    }

    /// Exactly `count` elements, all of them `value`.
    ///
    /// ```
    /// # use fogbow::storage::{Full, List};
    /// let mut slots = [0u32; 2];
    /// let mut list = List::from(&mut slots[..]);
    /// assert_eq!(list.reset(3, 7), Err(Full));
    /// assert_eq!(list.reset(2, 7), Ok(()));
    /// assert_eq!(list.as_slice(), [7, 7]);
    /// ```
    ///
    /// # Errors
    /// [`Full`] when a lent slice has no room for all, or the system no memory; the list is empty then.
    pub fn reset(&mut self, count: usize, value: T) -> Result<(), Full> {
        self.clear();
        match &mut self.0 {
            Storage::Lent { slots, used } => {
                slots.get_mut(..count).ok_or(Full)?.fill(value);
                *used = count;
            }
            #[cfg(feature = "alloc")]
            Storage::Grown(vec) => {
                vec.try_reserve_exact(count).map_err(|_| Full)?;
                vec.resize(count, value);
            }
        }
        Ok(())
    }

    /// Forgets all elements and keeps the memory.
    ///
    /// ```
    /// # use fogbow::storage::List;
    /// let mut slots = [0u32; 1];
    /// let mut list = List::from(&mut slots[..]);
    /// list.push(7).unwrap();
    /// list.clear();
    /// assert!(list.as_slice().is_empty() && list.push(8).is_ok());
    /// ```
    pub fn clear(&mut self) {
        match &mut self.0 {
            Storage::Lent { used, .. } => *used = 0,
            #[cfg(feature = "alloc")]
            Storage::Grown(vec) => vec.clear(),
        }
    }
}

impl<'s, T> List<'s, T> {
    /// What a lent slice holds already, as its elements.
    pub(crate) fn holding(slots: &'s mut [T]) -> Self {
        let used = slots.len();
        Self(Storage::Lent { slots, used })
    }
}

impl<'s, T> From<&'s mut [T]> for List<'s, T> {
    fn from(slots: &'s mut [T]) -> Self {
        Self(Storage::Lent { slots, used: 0 })
    }
}

#[cfg(feature = "alloc")]
impl<T: Copy> List<'_, T> {
    /// The elements as a `Vec` of their own: the memory itself if it grew, a copy if it was lent.
    ///
    /// ```
    /// # use fogbow::storage::List;
    /// assert_eq!(List::from(vec![1, 2]).into_vec(), [1, 2]);
    /// ```
    #[must_use]
    pub fn into_vec(self) -> alloc::vec::Vec<T> {
        match self.0 {
            Storage::Lent { slots, used } => slots[..used].to_vec(),
            Storage::Grown(vec) => vec,
        }
    }
}

#[cfg(feature = "alloc")]
impl<T> Default for List<'_, T> {
    /// Nothing, in memory that grows.
    fn default() -> Self {
        Self(Storage::Grown(alloc::vec::Vec::new()))
    }
}

#[cfg(feature = "alloc")]
impl<T> From<alloc::vec::Vec<T>> for List<'_, T> {
    fn from(vec: alloc::vec::Vec<T>) -> Self {
        Self(Storage::Grown(vec))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_are_divided_as_they_are_counted() {
        let mut memory = [Chunk::default(); 5];
        let mut rest = &mut memory[..];
        let floats: &mut [f32] = carve(&mut rest, 17);
        assert_eq!((floats.len(), chunks_for::<f32>(17)), (17, 2));
        let triples: &mut [[u64; 3]] = carve(&mut rest, 100);
        // 192 bytes are left.
        assert_eq!((triples.len(), chunks_for::<[u64; 3]>(100)), (8, 38));
        assert!(rest.is_empty() && carve::<u8>(&mut rest, 1).is_empty());
    }

    #[test]
    fn as_many_fit_as_their_sizes_say() {
        let needed = |n| if n == 0 { 0 } else { 3 * n + 2 };
        for chunks in 0..100 {
            let most = most_within(chunks, needed);
            assert!(needed(most) <= chunks && needed(most + 1) > chunks, "{chunks}: {most}");
        }
    }
}
