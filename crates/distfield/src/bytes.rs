//! The memory of fields and light buffers: zeroed bytes, in huge pages where the system has them.
//!
//! Memory that is fresh from the system costs a page fault for each page at its first touch. With pages of 4 KiB that
//! took most of the time of building a large field, and each query that misses the cache also waits for the translation
//! of its address. So the system is asked for huge pages, of 2 MiB on most machines; it may refuse, which costs time
//! and nothing else.

use std::{
    alloc::{Layout, handle_alloc_error},
    fmt,
    ops::{Deref, DerefMut},
};

#[cfg(unix)]
type Memory = memmap2::MmapMut;
/// Words, so that what is larger than a byte may be kept in them; and how many bytes.
#[cfg(not(unix))]
type Memory = (Box<[u64]>, usize);

/// Zeroed bytes, in huge pages where the system has them: less time to touch them at first, and less to look things up in them at random. They start
/// at an address that is a multiple of 8.
pub struct Bytes(Memory);

impl Bytes {
    /// This many bytes, which are 0; at least 1. As from a [`Vec`], there is no way back if the system has no more memory.
    #[cfg(unix)]
    #[must_use]
    pub fn zeroed(len: usize) -> Self {
        let Ok(memory) = memmap2::MmapMut::map_anon(len) else {
            handle_alloc_error(Layout::array::<u8>(len).unwrap_or(Layout::new::<u8>()))
        };
        #[cfg(target_os = "linux")]
        {
            // Without huge pages it works as well.
            let _refused = memory.advise(memmap2::Advice::HugePage);
        }
        Self(memory)
    }

    /// This many bytes, which are 0.
    #[cfg(not(unix))]
    #[must_use]
    pub fn zeroed(len: usize) -> Self {
        Self((vec![0; len.div_ceil(8)].into_boxed_slice(), len))
    }
}

impl Deref for Bytes {
    type Target = [u8];

    #[inline]
    #[cfg(unix)]
    fn deref(&self) -> &[u8] {
        &self.0
    }

    #[inline]
    #[cfg(not(unix))]
    fn deref(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.0.0)[..self.0.1]
    }
}

impl DerefMut for Bytes {
    #[inline]
    #[cfg(unix)]
    fn deref_mut(&mut self) -> &mut [u8] {
        &mut self.0
    }

    #[inline]
    #[cfg(not(unix))]
    fn deref_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.0.0)[..self.0.1]
    }
}

impl Clone for Bytes {
    fn clone(&self) -> Self {
        let mut copy = Self::zeroed(self.len());
        copy.copy_from_slice(self);
        copy
    }
}

impl fmt::Debug for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes", self.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_zero_and_copied() {
        for len in [1, 63, 4096, 5 << 20] {
            let mut bytes = Bytes::zeroed(len);
            assert!(bytes.len() == len && bytes.iter().all(|&b| b == 0));
            bytes[len - 1] = 7;
            let copy = bytes.clone();
            bytes[len - 1] = 8;
            assert_eq!((copy.len(), copy[len - 1]), (len, 7));
        }
    }
}
