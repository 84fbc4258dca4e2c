//! The memory of a light buffer: texels, lists, records and squares one after the other, in huge pages where the system has them, as for fields.
//!
//! A look-up touches each of the three at a place that has nothing to do with the last one's. With pages of 4 KiB most of these also wait for the
//! translation of an address.
//!
//! A square stands for 4 × 4 texels: before its depth all of them are lit, beyond it all are occluded. A point in space is seldom between the two, and squares
//! stay in the first caches, where texels of a large buffer do not.

use vdf_distfield::Bytes;

use super::{
    Entry, Tag, Texel,
    frame::NEVER,
    place,
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
    squares: usize,
    end: usize,
}

/// The same, to look things up in: bytes, which may start anywhere, so that nothing has to be asked but whether a number is within all.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pairs: &'a [[u8; size_of::<Pair>()]],
    lines: &'a [[u8; size_of::<Numbers>()]],
    words: &'a [[u8; size_of::<u32>()]],
    /// Texels, which are in front of the entries; pairs, lines and words in front of each of the others.
    entries: usize,
    records: usize,
    squares: usize,
}

/// The same, to be filled.
pub(super) struct ViewMut<'a> {
    texels: &'a mut [Pair],
    entries: &'a mut [Pair],
    records: &'a mut [Numbers],
}

impl Tables {
    /// For so many of each, which are all zero. The first texels are those of faces, and of none, which have squares.
    pub(super) fn zeroed(texels_of_faces: usize, texels: usize, entries: usize, records: usize) -> Self {
        let entries_at = texels * size_of::<Pair>();
        // Each record in a cache line of its own.
        let records_at = (entries_at + entries * size_of::<Pair>()).next_multiple_of(size_of::<Numbers>());
        let squares_at = records_at + records * size_of::<Numbers>();
        let end = squares_at + texels_of_faces / (place::SQUARE * place::SQUARE) as usize * size_of::<u32>();
        Self { bytes: Bytes::zeroed(end), entries: entries_at, records: records_at, squares: squares_at, end }
    }

    pub(super) const fn bytes(&self) -> usize {
        self.end
    }

    #[inline(always)]
    pub(super) fn view(&self) -> View<'_> {
        let ((pairs, _), (lines, _), (words, _)) =
            (self.bytes.as_chunks(), self.bytes.as_chunks(), self.bytes.as_chunks());
        View {
            pairs,
            lines,
            words,
            entries: self.entries / size_of::<Pair>(),
            records: self.records / size_of::<Numbers>(),
            squares: self.squares / size_of::<u32>(),
        }
    }

    /// Fills the squares from the texels.
    pub(super) fn fill_squares(&mut self) {
        let (front, squares) = self.bytes[..self.end].split_at_mut(self.squares);
        let squares: &mut [u32] = bytemuck::cast_slice_mut(squares);
        let texels: &[Pair] = bytemuck::cast_slice(&front[..self.entries]);
        for (square, texels) in squares.iter_mut().zip(texels.chunks((place::SQUARE * place::SQUARE) as usize)) {
            let depths = texels.iter().map(|texel| Texel::of(*texel).depths());
            let [lit, occluded] = depths.fold([NEVER, 0], |[l, o], [lit, occluded]| [l.min(lit), o.max(occluded)]);
            *square = Texel::new(lit, occluded, Tag::NOTHING).depths;
        }
    }

    pub(super) fn view_mut(&mut self) -> ViewMut<'_> {
        let (texels, rest) = self.bytes[..self.end].split_at_mut(self.entries);
        let (entries, rest) = rest.split_at_mut(self.records - self.entries);
        let (records, _) = rest.split_at_mut(self.squares - self.records);
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

    /// The depths of the square of a texel of a face, or of none.
    #[inline(always)]
    pub(super) fn square(&self, texel: u32) -> u32 {
        bytemuck::cast(self.words[self.squares + place::square(texel) as usize])
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
