//! The memory of a light buffer: texels, lists and records one after the other, in huge pages where the system has them, as for fields.
//!
//! A look-up touches each of the three at a place that has nothing to do with the last one's. With pages of 4 KiB most of these also wait for the
//! translation of an address.

use vdf_distfield::Bytes;

use super::{
    Entry, Texel,
    record::{Numbers, Record},
};

/// A texel, or an entry of a list.
type Pair = [u32; 2];

/// All texels, entries and records.
#[derive(Clone, Debug)]
pub(super) struct Tables {
    bytes: Bytes,
    /// Where entries and records start, in bytes.
    entries: usize,
    records: usize,
    end: usize,
}

/// The same, to look things up in: bytes, which may start anywhere, so that nothing has to be asked but whether a number is within all.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pairs: &'a [[u8; size_of::<Pair>()]],
    lines: &'a [[u8; size_of::<Numbers>()]],
    /// Texels, which are in front of the entries; pairs and lines in front of the records.
    entries: usize,
    records: usize,
}

/// The same, to be filled.
pub(super) struct ViewMut<'a> {
    texels: &'a mut [Pair],
    entries: &'a mut [Pair],
    records: &'a mut [Numbers],
}

impl Tables {
    /// For so many of each, which are all zero.
    pub(super) fn zeroed(texels: usize, entries: usize, records: usize) -> Self {
        let entries_at = texels * size_of::<Pair>();
        // Each record in a cache line of its own.
        let records_at = (entries_at + entries * size_of::<Pair>()).next_multiple_of(size_of::<Numbers>());
        let end = records_at + records * size_of::<Numbers>();
        Self { bytes: Bytes::zeroed(end), entries: entries_at, records: records_at, end }
    }

    pub(super) const fn bytes(&self) -> usize {
        self.end
    }

    #[inline(always)]
    pub(super) fn view(&self) -> View<'_> {
        let ((pairs, _), (lines, _)) = (self.bytes.as_chunks(), self.bytes.as_chunks());
        View { pairs, lines, entries: self.entries / size_of::<Pair>(), records: self.records / size_of::<Numbers>() }
    }

    pub(super) fn view_mut(&mut self) -> ViewMut<'_> {
        let (texels, rest) = self.bytes[..self.end].split_at_mut(self.entries);
        let (entries, records) = rest.split_at_mut(self.records - self.entries);
        ViewMut {
            texels: bytemuck::cast_slice_mut(texels),
            entries: bytemuck::cast_slice_mut(entries),
            records: bytemuck::cast_slice_mut(records),
        }
    }
}

impl PartialEq for Tables {
    fn eq(&self, other: &Self) -> bool {
        (self.entries, self.records, &self.bytes[..]) == (other.entries, other.records, &other.bytes[..])
    }
}

impl View<'_> {
    #[inline(always)]
    pub(super) fn texel(&self, number: u32) -> Texel {
        Texel::of(bytemuck::cast(self.pairs[number as usize]))
    }

    #[inline(always)]
    pub(super) fn entry(&self, number: u32) -> Entry {
        Entry::of(bytemuck::cast(self.pairs[self.entries + number as usize]))
    }

    #[inline(always)]
    pub(super) fn record(&self, number: u32) -> Record<'_> {
        Record(&self.lines[self.records + number as usize])
    }

    #[cfg(test)]
    pub(super) fn texels(&self) -> impl Iterator<Item = Texel> {
        self.pairs[..self.entries].iter().map(|pair| Texel::of(bytemuck::cast(*pair)))
    }

    #[cfg(test)]
    pub(super) fn entries(&self) -> impl Iterator<Item = Entry> {
        let end = self.records * size_of::<Numbers>() / size_of::<Pair>();
        self.pairs[self.entries..end].iter().map(|pair| Entry::of(bytemuck::cast(*pair)))
    }
}

impl ViewMut<'_> {
    /// Puts texels, one after the other from this one on.
    pub(super) fn put_texels(&mut self, first: usize, texels: impl ExactSizeIterator<Item = Texel>) {
        let end = first + texels.len();
        for (to, texel) in self.texels[first..end].iter_mut().zip(texels) {
            *to = texel.pair();
        }
    }

    /// Puts entries, in the same way.
    pub(super) fn put_entries(&mut self, first: usize, entries: impl ExactSizeIterator<Item = Entry>) {
        let end = first + entries.len();
        for (to, entry) in self.entries[first..end].iter_mut().zip(entries) {
            *to = entry.pair();
        }
    }

    pub(super) const fn records(&mut self) -> &mut [Numbers] {
        self.records
    }
}
