//! Text of a file inside a message: short, on one line, and unable to pass for something else.

/// More of a text is not shown.
const MOST_SHOWN: usize = 60;

/// More of a message is not shown.
const MOST_OF_A_MESSAGE: usize = 1000;

/// A message or a name for a person: escaped, and shortened if it is absurdly long.
pub(crate) fn shown(message: &(impl std::fmt::Display + ?Sized)) -> String {
    let message = message.to_string();
    let mut chars = message.chars();
    let head: String = chars.by_ref().take(MOST_OF_A_MESSAGE).collect();
    let more = if chars.next().is_some() { "…" } else { "" };
    escaped(&head) + more
}

/// The text in quotation marks, shortened. Line breaks, control characters and marks that turn the direction of writing are escaped: a name in
/// a file must not be able to forge a line of output or to steer a terminal.
pub(crate) fn quoted(text: &str) -> String {
    let text = text.trim();
    let mut shown: String = text.chars().take(MOST_SHOWN).collect();
    if shown.len() < text.len() {
        shown.push('…');
    }
    format!("\"{}\"", escaped(&shown))
}

/// The text with every character escaped that is not printed as itself.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        let steers = c.is_control()
            || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{61c}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}');
        if steers { out.extend(c.escape_default()) } else { out.push(c) }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_steers_a_terminal_is_escaped_and_what_is_printed_is_not() {
        assert_eq!(escaped("Straße 東 \"x\""), "Straße 東 \"x\"");
        assert_eq!(escaped("a\nerror: b\x1b[31m\u{202e}"), "a\\nerror: b\\u{1b}[31m\\u{202e}");
        assert_eq!(quoted(&"x".repeat(100)).chars().count(), MOST_SHOWN + 3);
    }
}
