//! The memory of the tree: in huge pages where the system has them.
//!
//! Memory that is fresh from the system costs a page fault for each page at its first touch, some microseconds in a virtual machine. With
//! pages of 4 KiB that was a quarter of the time of building a large tree. Each query that misses the cache also waits for the
//! translation of its address. So the system is asked for huge pages, of 2 MiB on most machines; it may refuse, which
//! costs time and nothing else.

use std::ops::{Deref, DerefMut};

use bytemuck::Pod;
use rayon::prelude::*;

/// From so many bytes on the memory is mapped by itself.
#[cfg(unix)]
const LARGE: usize = 1 << 22;

/// A slice of plain values that does not grow.
pub(super) enum Table<T> {
    Small(Vec<T>),
    /// A whole number of values, in bytes. The map starts with a page, so that they are aligned.
    #[cfg(unix)]
    Large(memmap2::MmapMut),
}

impl<T: Pod + Send + Sync> Table<T> {
    /// So many values, each a function of its place; in parallel.
    pub(super) fn new(len: usize, value: impl Fn(usize) -> T + Send + Sync) -> Self {
        let mut table = Self::zeroed(len);
        table.par_iter_mut().enumerate().for_each(|(i, place)| *place = value(i));
        table
    }

    /// So many values of zero bytes.
    pub(super) fn zeroed(len: usize) -> Self {
        #[cfg(unix)]
        if len >= LARGE / size_of::<T>()
            && let Some(bytes) = len.checked_mul(size_of::<T>())
            && let Ok(memory) = memmap2::MmapMut::map_anon(bytes)
        {
            #[cfg(target_os = "linux")]
            {
                // Without huge pages it works as well.
                let _refused = memory.advise(memmap2::Advice::HugePage);
            }
            return Self::Large(memory);
        }
        Self::Small(vec![T::zeroed(); len])
    }
}

impl<T: Pod> Deref for Table<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        match self {
            Self::Small(values) => values,
            #[cfg(unix)]
            Self::Large(memory) => bytemuck::cast_slice(memory),
        }
    }
}

impl<T: Pod> DerefMut for Table<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [T] {
        match self {
            Self::Small(values) => values,
            #[cfg(unix)]
            Self::Large(memory) => bytemuck::cast_slice_mut(memory),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Below the size from which on memory is mapped, at it and above, with values that do not divide a page.
    #[test]
    fn values_are_where_they_belong() {
        let value = |i: usize| [0, 1, 2, 3, 4].map(|k: u32| k + 7 * u32::try_from(i).unwrap_or(0));
        let large = (1 << 22) / size_of::<[u32; 5]>();
        for len in [0, 1, 100, large - 1, large, large + 1] {
            let table = Table::new(len, value);
            assert_eq!(table.len(), len);
            assert!(table.iter().enumerate().all(|(i, &found)| found == value(i)));
        }
    }
}
