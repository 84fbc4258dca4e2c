//! Which properties of an element make an attribute, and its name, by the rules of Mitsuba 3.9.1.
//!
//! red, green and blue, or r, g and b, wherever they are, are `color`. Others are of one attribute if they follow each other, have the same prefix before
//! the last `_` and one letter behind it: x, y, z or r, g, b or 0, 1, 2 or 1, 2, 3; one of the first of these letters alone is an attribute of one
//! number. Behind r, g, b the name gets `_color`. *Deviation:* a fourth letter (w, a, 3, 4) is left out, where Mitsuba has no use for the whole attribute.

use super::Property;

/// The properties of one attribute.
#[derive(Debug, PartialEq)]
pub(super) struct Group {
    pub(super) name: String,
    /// Indices, one or three.
    pub(super) properties: Vec<usize>,
}

/// The letters of each channel, in four alphabets.
const LETTERS: [[char; 4]; 4] =
    [['x', 'r', '0', '1'], ['y', 'g', '1', '2'], ['z', 'b', '2', '3'], ['w', 'a', '3', '4']];

/// Names that mean something else.
const RESERVED: [&str; 18] = [
    "x",
    "y",
    "z",
    "nx",
    "ny",
    "nz",
    "u",
    "v",
    "s",
    "t",
    "texture_u",
    "texture_v",
    "r",
    "g",
    "b",
    "a",
    "vertex_index",
    "vertex_indices",
];

pub(super) fn groups(properties: &[Property]) -> Vec<Group> {
    let find = |name: &str| properties.iter().position(|p| p.name == name && p.length.is_none());
    let mut groups = Vec::new();
    for names in [["r", "g", "b"], ["red", "green", "blue"]] {
        if let [Some(r), Some(g), Some(b)] = names.map(find)
            && groups.is_empty()
        {
            groups.push(Group { name: "color".to_owned(), properties: vec![r, g, b] });
        }
    }
    let mut open: Option<Open<'_>> = None;
    for (i, property) in properties.iter().enumerate() {
        if RESERVED.contains(&property.name.as_str()) {
            continue;
        }
        let part = split(property);
        if let (Some(open), Some((prefix, letter))) = (&mut open, part)
            && open.prefix == prefix
        {
            open.take(i, letter);
            continue;
        }
        groups.extend(open.take().and_then(Open::group));
        open = part.and_then(|(prefix, letter)| Open::new(i, prefix, letter));
    }
    groups.extend(open.and_then(Open::group));
    let mut seen = std::collections::HashSet::new();
    groups.retain(|group| seen.insert(group.name.clone()));
    groups
}

/// The prefix and the letter behind it.
fn split(property: &Property) -> Option<(&str, char)> {
    let (prefix, rest) = property.name.rsplit_once('_')?;
    let mut letters = rest.chars();
    let letter = letters.next().filter(|_| property.length.is_none())?;
    letters.next().is_none().then_some((prefix, letter))
}

/// An attribute that more properties may belong to.
struct Open<'a> {
    prefix: &'a str,
    alphabet: usize,
    properties: Vec<usize>,
    /// A letter that does not follow: the attribute is none.
    broken: bool,
}

impl<'a> Open<'a> {
    fn new(property: usize, prefix: &'a str, letter: char) -> Option<Self> {
        let alphabet = LETTERS[0].iter().position(|l| *l == letter)?;
        Some(Self { prefix, alphabet, properties: vec![property], broken: false })
    }

    fn take(&mut self, property: usize, letter: char) {
        match LETTERS.get(self.properties.len()) {
            Some(letters) if letters[self.alphabet] == letter => self.properties.push(property),
            _ => self.broken = true,
        }
    }

    fn group(mut self) -> Option<Group> {
        self.properties.truncate(3);
        let name = format!("{}{}", self.prefix, if self.alphabet == 1 { "_color" } else { "" });
        let is_whole = !self.broken && matches!(self.properties.len(), 1 | 3);
        is_whole.then_some(Group { name, properties: self.properties })
    }
}

#[cfg(test)]
mod tests {
    use super::super::Number;
    use super::*;

    fn named(names: &str) -> Vec<(String, Vec<usize>)> {
        let property = |name: &str| match name.strip_prefix('*') {
            Some(list) => Property { name: list.to_owned(), length: Some(Number::U8), number: Number::I32 },
            None => Property { name: name.to_owned(), length: None, number: Number::F32 },
        };
        let properties: Vec<Property> = names.split_whitespace().map(property).collect();
        groups(&properties).into_iter().map(|g| (g.name, g.properties)).collect()
    }

    /// Names that Mitsuba 3.9.1 gives the attributes of meshes with these properties.
    #[test]
    fn attributes_are_named_as_in_mitsuba() {
        let one = |name: &str, properties: &[usize]| vec![(name.to_owned(), properties.to_vec())];
        assert_eq!(named("x y z red green blue"), one("color", &[3, 4, 5]));
        assert_eq!(named("x y z blue u v red green alpha"), one("color", &[6, 7, 3]));
        assert_eq!(named("x y z r g b a"), one("color", &[3, 4, 5]));
        assert_eq!(named("x y z tint_r tint_g tint_b"), one("tint_color", &[3, 4, 5]));
        assert_eq!(named("x y z way_x way_y way_z"), one("way", &[3, 4, 5]));
        assert_eq!(named("x y z way_0 way_1 way_2"), one("way", &[3, 4, 5]));
        assert_eq!(named("x y z heat_x"), one("heat", &[3]));
        assert_eq!(named("*vertex_indices heat_1 dirt_1"), [one("heat", &[1]), one("dirt", &[2])].concat());
        for nothing in [
            "x y z red green",
            "x y z way_x way_y",
            "x y z way_y",
            "x y z way_x way_z way_y",
            "x y z heat",
            "x y z *way_x",
        ] {
            assert_eq!(named(nothing), [], "{nothing}");
        }
    }
}
