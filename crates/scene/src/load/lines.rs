//! Places of byte offsets in one file.

use std::path::Path;
use std::sync::Arc;

use super::document::Place;

/// So many bytes are counted at most to find a column, however long a line is.
const STEP: usize = 256;

/// The lines of a text, and how many characters are before each of its steps.
#[derive(Debug)]
pub(super) struct Lines<'a> {
    text: &'a str,
    pub(super) file: Arc<Path>,
    starts: Vec<usize>,
    /// Characters that begin before byte `i · STEP`.
    characters: Vec<usize>,
}

impl<'a> Lines<'a> {
    /// Cost: linear in the text.
    pub(super) fn new(text: &'a str, file: Arc<Path>) -> Self {
        let starts = std::iter::once(0).chain(text.match_indices('\n').map(|(i, _)| i + 1)).collect();
        let mut total = 0;
        let characters = text
            .as_bytes()
            .chunks(STEP)
            .map(|chunk| {
                let before = total;
                total += count(chunk);
                before
            })
            .collect();
        Self { text, file, starts, characters }
    }

    /// Line and column of a byte.
    pub(super) fn place(&self, offset: usize) -> Place {
        let line = self.starts.partition_point(|&s| s <= offset);
        let start = self.starts.get(line.saturating_sub(1)).copied().unwrap_or(0);
        let column = self.characters_before(offset).saturating_sub(self.characters_before(start)) + 1;
        Place { file: self.file.clone(), line: saturate(line), column: saturate(column) }
    }

    fn characters_before(&self, offset: usize) -> usize {
        let offset = offset.min(self.text.len());
        let step = offset / STEP;
        // The text may end just where a step would begin.
        let Some(&before) = self.characters.get(step) else { return self.text.chars().count() };
        before + count(&self.text.as_bytes()[step * STEP..offset])
    }
}

/// Characters that begin in `bytes`.
fn count(bytes: &[u8]) -> usize {
    bytes.iter().filter(|&&b| b & 0xc0 != 0x80).count()
}

fn saturate(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_counted_in_characters() {
        let text = format!("ab\n{}é東x\n\ny", "ü".repeat(1000));
        let lines = Lines::new(&text, Arc::from(Path::new("f")));
        for (offset, c) in text.char_indices() {
            let before = &text[..offset];
            let line = before.matches('\n').count() + 1;
            let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
            let place = lines.place(offset);
            assert_eq!((place.line as usize, place.column as usize), (line, column), "{c} at {offset}");
        }
        let exact = "x".repeat(STEP);
        assert_eq!(Lines::new(&exact, Arc::from(Path::new("f"))).place(STEP).column as usize, STEP + 1);
    }
}
