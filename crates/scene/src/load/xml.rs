//! A first pass over the text of a scene file, before the XML parser sees it.
//!
//! It makes comments legal that other programs write, leaves out what follows the scene, and refuses what would take the parser more than linear time: the parser compares each
//! attribute of an element with the others, and looks for each namespace in all that are open. A scene needs few of the former and none of the
//! latter.

use std::borrow::Cow;

/// Elements nest at most this deep; the deepest legal path is scene/sensor/film/rfilter/float.
pub(super) const MAX_ELEMENT_DEPTH: usize = 32;
/// An element has at most this many attributes; no legal one has more than five.
const MAX_ATTRIBUTES: usize = 16;

/// What is wrong, and at which byte.
#[derive(Debug)]
pub(super) struct Refusal {
    pub(super) offset: usize,
    pub(super) message: String,
}

/// The text for the parser.
#[derive(Debug)]
pub(super) struct Prepared<'a> {
    /// Every byte is where it was.
    pub(super) text: Cow<'a, str>,
    /// Where something begins that is behind the root element, and so not in `text`.
    pub(super) behind: Option<usize>,
}

/// Makes the text for the parser. `most_elements` bounds the elements. Whatever is not well formed ends the pass: the parser will stop at the same
/// place, and has the better message.
pub(super) fn prepare(text: &str, most_elements: usize) -> Result<Prepared<'_>, Refusal> {
    let bytes = text.as_bytes();
    let mut dashes = Vec::new();
    let (mut at, mut depth, mut elements) = (0, 0_usize, 0);
    // The end of the root element, and the first thing behind it that XML does not allow there.
    let (mut root_end, mut behind) = (None, None);
    let mut is_whole = true;
    while let Some(start) = find(bytes, at, b"<") {
        let is_beside = matches!(&bytes[start + 1..], [b'!', b'-', b'-', ..] | [b'?', ..]);
        if root_end.is_some() && behind.is_none() {
            behind = first_text(&text[at..start]).map(|offset| at + offset).or((!is_beside).then_some(start));
        }
        let end = match &bytes[start + 1..] {
            [b'!', b'-', b'-', ..] => {
                let end = find(bytes, start + 4, b"-->");
                // XML has no -- inside a comment, and no - at its end.
                let inside = &bytes[start + 4..end.unwrap_or(start + 4)];
                if inside.last() == Some(&b'-') || inside.windows(2).any(|pair| pair == b"--") {
                    dashes.push(start + 4..start + 4 + inside.len());
                }
                end.map(|end| end + 3)
            }
            [b'!', b'[', ..] => find(bytes, start, b"]]>").map(|end| end + 3),
            [b'?', ..] => find(bytes, start, b"?>").map(|end| end + 2),
            [b'/', ..] => {
                is_whole &= depth > 0;
                depth = depth.saturating_sub(1);
                find(bytes, start, b">").map(|end| end + 1)
            }
            // A document type; the parser refuses it.
            [b'!', ..] => None,
            _ => {
                elements += 1;
                if elements > most_elements {
                    return refuse(start, format!("the scene has more than {most_elements} elements"));
                }
                depth += 1;
                if depth > MAX_ELEMENT_DEPTH + 1 {
                    return refuse(start, format!("elements nest more than {MAX_ELEMENT_DEPTH} deep"));
                }
                let end = start_tag(bytes, start)?;
                depth -= usize::from(end.is_some_and(|end| bytes[..end].ends_with(b"/>")));
                end
            }
        };
        let Some(end) = end else {
            is_whole = false;
            break;
        };
        at = end;
        if depth == 0 && elements > 0 {
            root_end.get_or_insert(end);
        }
    }
    if root_end.is_some() && behind.is_none() {
        behind = first_text(&text[at..]).map(|offset| at + offset);
    }
    // A root element that ends too soon leaves end tags over: not to be passed over in silence.
    if !is_whole || depth > 0 {
        behind = None;
    }
    let text = &text[..root_end.filter(|_| behind.is_some()).unwrap_or(text.len())];
    dashes.retain(|comment: &std::ops::Range<usize>| comment.end <= text.len());
    if dashes.is_empty() {
        return Ok(Prepared { text: Cow::Borrowed(text), behind });
    }
    let mut out = text.to_owned();
    for comment in dashes {
        let without = text[comment.clone()].replace('-', ".");
        out.replace_range(comment, &without);
    }
    Ok(Prepared { text: Cow::Owned(out), behind })
}

/// Where the text begins, if there is more than white space.
pub(super) fn first_text(text: &str) -> Option<usize> {
    let trimmed = text.trim_start();
    (!trimmed.is_empty()).then_some(text.len() - trimmed.len())
}

/// The end of the tag that begins at `start`; `None` if it is not well formed.
fn start_tag(bytes: &[u8], start: usize) -> Result<Option<usize>, Refusal> {
    let is_space = |b: &u8| b.is_ascii_whitespace();
    let name_length = |at: usize| {
        bytes[at..]
            .iter()
            .take_while(|b| !is_space(b) && !matches!(b, b'=' | b'>' | b'/' | b'<' | b'"' | b'\''))
            .count()
    };
    let no_namespace = |at: usize, length: usize| {
        let name = &bytes[at..at + length];
        if name.contains(&b':') || name == b"xmlns" {
            return Err(Refusal { offset: at, message: "XML namespaces are not supported".to_owned() });
        }
        Ok(())
    };
    let mut at = start + 1;
    let length = name_length(at);
    no_namespace(at, length)?;
    at += length;
    for attributes in 0.. {
        at += bytes[at..].iter().take_while(|b| is_space(b)).count();
        match bytes.get(at) {
            Some(b'>') => return Ok(Some(at + 1)),
            Some(b'/') => return Ok((bytes.get(at + 1) == Some(&b'>')).then_some(at + 2)),
            _ => {}
        }
        let length = name_length(at);
        if length == 0 {
            return Ok(None);
        }
        if attributes == MAX_ATTRIBUTES {
            let message = format!("an element with more than {MAX_ATTRIBUTES} attributes");
            return Err(Refusal { offset: at, message });
        }
        no_namespace(at, length)?;
        at += length;
        at += bytes[at..].iter().take_while(|b| is_space(b)).count();
        if bytes.get(at) != Some(&b'=') {
            return Ok(None);
        }
        at += 1;
        at += bytes[at..].iter().take_while(|b| is_space(b)).count();
        let Some(quote @ (b'"' | b'\'')) = bytes.get(at) else { return Ok(None) };
        let Some(end) = find(bytes, at + 1, &[*quote]) else { return Ok(None) };
        at = end + 1;
    }
    Ok(None)
}

fn refuse<T>(offset: usize, message: String) -> Result<T, Refusal> {
    Err(Refusal { offset, message })
}

/// Where `wanted` is, from `at` on.
fn find(bytes: &[u8], at: usize, wanted: &[u8]) -> Option<usize> {
    let first = *wanted.first()?;
    let mut at = at;
    loop {
        at += bytes.get(at..)?.iter().position(|&b| b == first)?;
        if bytes[at..].starts_with(wanted) {
            return Some(at);
        }
        at += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_become_legal_and_all_else_stays() {
        let text = "<!-- a -- b --><a x='--'><!--é---><!-- -ok --></a>";
        assert_eq!(prepare(text, 9).unwrap().text, "<!-- a .. b --><a x='--'><!--é.--><!-- -ok --></a>");
        for same in ["<a><!-- b --></a>", "<a><![CDATA[<!-- -- -->]]></a>", "<?x <b> ?><a y=\"<!-- -- -->\"/>"] {
            assert!(matches!(prepare(same, 9).unwrap().text, Cow::Borrowed(text) if text == same));
        }
    }

    #[test]
    fn limits_are_found_at_their_place() {
        let offset = |text: &str| prepare(text, 100).expect_err("it must be refused").offset;
        assert_eq!(offset("<a xmlns='b'/>"), 3);
        assert_eq!(offset("<a xmlns:c='b'/>"), 3);
        assert_eq!(offset("<b:a/>"), 1);
        assert_eq!(offset(&"<a/>".repeat(101)), 400);
        assert_eq!(offset(&"<a>".repeat(50)), 99);
        let many: String = (0..20).map(|i| format!(" a{i}=''")).collect();
        assert_eq!(offset(&format!("<a{many}/>")), 2 + 10 * 6 + 6 * 7 + 1);
    }

    #[test]
    fn what_is_not_well_formed_is_left_to_the_parser() {
        for text in [
            "<",
            "<a",
            "<a b",
            "<a b=",
            "<a b='",
            "<a /x>",
            "<!-- ",
            "<![CDATA[",
            "<?",
            "</",
            "<!DOCTYPE a>",
            "<a b c/>",
            "",
            "x",
        ] {
            assert_eq!(prepare(text, 9).unwrap().text, text);
        }
    }

    #[test]
    fn what_is_behind_the_root_is_left_out_if_it_is_well_formed() {
        for root in ["<a/>", "<a><b>é</b></a>", "<!-- -- --><a></a>"] {
            for behind in ["é", "<b/>", "<![CDATA[x]]>", "<a><b/></a> text", "x <!-- -- -->"] {
                let text = format!("{root} <!-- b --><?c d?>\n{behind}\n");
                let prepared = prepare(&text, 9).unwrap();
                assert_eq!(prepared.text, root.replace(" -- ", " .. "));
                assert_eq!(prepared.behind, Some(text.rfind(behind).unwrap()));
            }
            // As XML has it, or not well formed: for the parser.
            for behind in ["", "\n", "<!-- b --> <?c d?>", "</a>", "<b>", "x <", "<b/></b>", "<!DOCTYPE a>"] {
                let text = format!("{root}{behind}").replace(" -- ", " .. ");
                let prepared = prepare(&text, 9).unwrap();
                assert_eq!((prepared.text.as_ref(), prepared.behind), (text.as_str(), None));
            }
        }
    }
}
