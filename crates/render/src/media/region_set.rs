//! Sets of regions: what a path carries to know its medium.
//!
//! *Idea.* Nearly all scenes have few regions, and a set is copied several times an event: so it is a bit for each of the innermost 64, and a list of the
//! others, which as a rule is empty and owns nothing.

/// So many of the innermost regions have a bit.
const BITS: u32 = u64::BITS;

/// The regions that a point is inside of. They are numbered from the innermost to the outermost.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct RegionSet {
    inner: u64,
    /// Those without a bit, in order.
    others: Vec<u32>,
}

impl Clone for RegionSet {
    #[inline]
    fn clone(&self) -> Self {
        let others = if self.others.is_empty() { Vec::new() } else { self.others.clone() };
        Self { inner: self.inner, others }
    }
}

impl FromIterator<u32> for RegionSet {
    fn from_iter<T: IntoIterator<Item = u32>>(regions: T) -> Self {
        let mut set = Self::default();
        regions.into_iter().for_each(|region| set.set(region, true));
        set
    }
}

impl RegionSet {
    /// Puts a region into the set, or takes it out.
    #[inline]
    pub(super) fn set(&mut self, region: u32, inside: bool) {
        if region < BITS {
            self.inner = self.inner & !(1 << region) | u64::from(inside) << region;
            return;
        }
        match (self.others.binary_search(&region), inside) {
            (Err(place), true) => self.others.insert(place, region),
            (Ok(place), false) => drop(self.others.remove(place)),
            _ => {}
        }
    }

    /// True outside of all regions.
    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.inner == 0 && self.others.is_empty()
    }

    #[inline]
    pub(super) fn contains(&self, region: u32) -> bool {
        if region < BITS { self.inner >> region & 1 == 1 } else { self.others.contains(&region) }
    }

    #[inline]
    pub(super) fn innermost(&self) -> Option<u32> {
        if self.inner == 0 { self.others.first().copied() } else { Some(self.inner.trailing_zeros()) }
    }

    pub(super) fn outermost(&self) -> Option<u32> {
        self.others.last().copied().or_else(|| self.inner.checked_ilog2())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::Sampler;

    /// The same as a set of the standard library, on both sides of the border between bits and list.
    #[test]
    fn sets_are_sets() {
        for i in 0..200 {
            let random = &mut Sampler::new(4, i, 0, 0);
            let (mut set, mut twin) = (RegionSet::default(), BTreeSet::new());
            let numbers = [0, 1, 30, 62, 63, 64, 65, 127, 128, 1000];
            for _ in 0..40 {
                let (region, inside) = (numbers[(random.next_1d() * 10.0) as usize], random.next_1d() < 0.5);
                set.set(region, inside);
                if inside {
                    twin.insert(region)
                } else {
                    twin.remove(&region)
                };
                assert_eq!(set.is_empty(), twin.is_empty());
                assert_eq!(set.innermost(), twin.first().copied());
                assert_eq!(set.outermost(), twin.last().copied());
                assert!(numbers.iter().all(|n| set.contains(*n) == twin.contains(n)), "{twin:?}");
                assert_eq!(set, twin.iter().rev().copied().collect());
                assert_eq!(set.clone(), set);
            }
        }
    }
}
