//! Names of files in messages.

use std::fmt;
use std::path::Path;

/// The path for a message: line breaks, control characters and marks that turn the direction of writing are escaped. The name of a file that
/// came from somebody else must not be able to forge a line of output or to steer a terminal.
#[must_use]
pub fn shown(path: &Path) -> impl fmt::Display {
    let mut out = String::new();
    for c in path.to_string_lossy().chars() {
        let steers = c.is_control()
            || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{61c}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}');
        if steers { out.extend(c.escape_default()) } else { out.push(c) }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{check_distinct, read_image};

    #[test]
    fn names_neither_forge_lines_nor_steer_a_terminal() {
        assert_eq!(shown(Path::new("Straße/東.exr")).to_string(), "Straße/東.exr");
        let hostile = Path::new("a\nerror: b\x1b[31m\u{202e}.exr");
        let escaped = "a\\nerror: b\\u{1b}[31m\\u{202e}.exr";
        assert_eq!(shown(hostile).to_string(), escaped);
        let folder = tempfile::tempdir().unwrap();
        let unreadable = read_image(&folder.path().join(hostile)).unwrap_err().to_string();
        assert!(unreadable.ends_with(escaped), "{unreadable}");
        let twice = check_distinct(&[("-o", hostile), ("--stats", hostile)], &[]).unwrap_err().to_string();
        assert!(twice.contains(escaped) && !twice.contains('\n'), "{twice}");
    }
}
