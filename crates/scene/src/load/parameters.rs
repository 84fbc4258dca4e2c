//! `$name` parameters: `<default>` in the file, `-D name=value` on the command line, which wins.

use std::collections::BTreeMap;

use super::document::Place;
use super::names;
use crate::SceneError;

/// A default may contain other parameters; without a bound each could double the length of the one before.
const MAX_VALUE_LENGTH: usize = 1 << 16;
/// All values together, so that many elements with long values cannot fill the memory.
const MAX_TOTAL_LENGTH: usize = 1 << 26;

#[derive(Debug)]
struct Parameter {
    value: String,
    from_command_line: bool,
    used: bool,
}

/// The parameters that are known so far.
#[derive(Debug, Default)]
pub(super) struct Parameters {
    by_name: BTreeMap<String, Parameter>,
    /// Bytes that were put in so far.
    total: usize,
}

impl Parameters {
    /// The definitions of the command line; the last of several with one name wins.
    pub(super) fn new(defines: &[(String, String)]) -> Result<Self, SceneError> {
        let mut by_name = BTreeMap::new();
        for (name, value) in defines {
            if name.is_empty() || name.contains(['$', '\\']) {
                return Err(SceneError::Define {
                    name: name.clone(),
                    message: "this is not a name".to_owned(),
                    help: "write -D name=value".to_owned(),
                });
            }
            by_name.insert(name.clone(), Parameter { value: value.clone(), from_command_line: true, used: false });
        }
        Ok(Self { by_name, total: 0 })
    }

    /// `<default name= value=>`; does nothing if the name is defined already.
    pub(super) fn default(&mut self, name: &str, value: &str, at: &Place) -> Result<(), SceneError> {
        if name.is_empty() {
            return Err(at.error("<default> with an empty name", ""));
        }
        self.by_name.entry(name.to_owned()).or_insert_with(|| Parameter {
            value: value.to_owned(),
            from_command_line: false,
            used: false,
        });
        Ok(())
    }

    /// Replaces each `$name`, the longest name that fits, and each `\$` by a plain `$`.
    pub(super) fn substitute(&mut self, text: &str, at: &Place) -> Result<String, SceneError> {
        let mut out = String::with_capacity(text.len());
        let mut rest = text;
        while let Some(position) = rest.find('$') {
            let (before, after) = (&rest[..position], &rest[position + 1..]);
            if let Some(before) = before.strip_suffix('\\') {
                out.push_str(before);
                out.push('$');
                rest = after;
                continue;
            }
            out.push_str(before);
            let best = self
                .by_name
                .iter_mut()
                .filter(|(name, _)| after.starts_with(name.as_str()))
                .max_by_key(|(n, _)| n.len());
            let Some((name, parameter)) = best else {
                let end = after.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(after.len());
                let known: Vec<&str> = self.by_name.keys().map(String::as_str).collect();
                let wanted = &after[..end];
                return Err(at.error(
                    format!("the parameter \"${wanted}\" is not defined"),
                    format!(
                        "put <default name=\"{wanted}\" value=\"…\"/> before its use, or give -D {wanted}=…; {}",
                        names::suggest(wanted, &known)
                    ),
                ));
            };
            parameter.used = true;
            out.push_str(&parameter.value);
            self.total += parameter.value.len();
            rest = &after[name.len()..];
            if out.len() > MAX_VALUE_LENGTH || self.total > MAX_TOTAL_LENGTH {
                return Err(
                    at.error("the value is too long, or all values together are, after the parameters are put in", "")
                );
            }
        }
        out.push_str(rest);
        Ok(out)
    }

    /// An error if the scene ignored a definition of the command line.
    pub(super) fn check_all_used(&self) -> Result<(), SceneError> {
        let Some((name, _)) = self.by_name.iter().find(|(_, p)| p.from_command_line && !p.used) else { return Ok(()) };
        let used: Vec<&str> = self.by_name.iter().filter(|(_, p)| p.used).map(|(n, _)| n.as_str()).collect();
        Err(SceneError::Define {
            name: name.clone(),
            message: format!("the scene does not use ${name}"),
            help: names::suggest(name, &used),
        })
    }
}
