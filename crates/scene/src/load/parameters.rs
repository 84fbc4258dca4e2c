//! `$name` parameters: `<default>` in the file, and the definitions of the caller, which win.

use std::collections::BTreeMap;
use std::ops::Bound;

use super::document::Place;
use super::names;
use crate::SceneError;

/// A default may contain other parameters; without a bound each could double the length of the one before.
const MAX_VALUE_LENGTH: usize = 1 << 16;
/// All values together, so that many elements with long values cannot fill the memory.
const MAX_TOTAL_LENGTH: usize = 1 << 26;

/// Longer names are refused, so that looking one up is cheap whatever the names are.
const MAX_NAME_LENGTH: usize = 64;
/// What a substitution counts at least, against [`MAX_TOTAL_LENGTH`].
const COST_OF_SUBSTITUTION: usize = 16;

#[derive(Debug)]
struct Parameter {
    value: String,
    from_caller: bool,
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
    /// The definitions of the caller; the last of several with one name wins.
    pub(super) fn new(defines: &[(String, String)]) -> Result<Self, SceneError> {
        let mut by_name = BTreeMap::new();
        for (name, value) in defines {
            if name.is_empty() || name.len() > MAX_NAME_LENGTH || name.contains(['$', '\\']) {
                return Err(SceneError::Define {
                    name: name.clone(),
                    message: "this is not a name".to_owned(),
                    help: format!("a name has 1 to {MAX_NAME_LENGTH} bytes, without $ and \\; write name=value"),
                });
            }
            by_name.insert(name.clone(), Parameter { value: value.clone(), from_caller: true, used: false });
        }
        Ok(Self { by_name, total: 0 })
    }

    /// `<default name= value=>`; does nothing if the name is defined already.
    pub(super) fn default(&mut self, name: &str, value: &str, at: &Place) -> Result<(), SceneError> {
        if name.is_empty() {
            return Err(at.error("<default> with an empty name", ""));
        }
        if name.len() > MAX_NAME_LENGTH {
            return Err(at.error(format!("a parameter's name has more than {MAX_NAME_LENGTH} bytes"), ""));
        }
        self.by_name.entry(name.to_owned()).or_insert_with(|| Parameter {
            value: value.to_owned(),
            from_caller: false,
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
            let Some(length) = self.longest_name(after) else {
                let end = after.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(after.len());
                let known: Vec<&str> = self.by_name.keys().map(String::as_str).collect();
                let wanted = &after[..end];
                return Err(at.error(
                    format!("the parameter \"${wanted}\" is not defined"),
                    format!(
                        "put <default name=\"{wanted}\" value=\"…\"/> before its use, or define it when you load the scene; {}",
                        names::suggest_defined(wanted, &known)
                    ),
                ));
            };
            let (name, after) = after.split_at(length);
            if let Some(parameter) = self.by_name.get_mut(name) {
                parameter.used = true;
                out.push_str(&parameter.value);
                self.total += parameter.value.len() + COST_OF_SUBSTITUTION;
            }
            rest = after;
            if out.len() > MAX_VALUE_LENGTH || self.total > MAX_TOTAL_LENGTH {
                return Err(
                    at.error("the value is too long, or all values together are, after the parameters are put in", "")
                );
            }
        }
        out.push_str(rest);
        Ok(out)
    }

    /// The length of the longest name with which `text` begins. In alphabetical order all names that `text` begins with stand before it, the
    /// longest last; in between are only names that leave the text where they differ from it.
    fn longest_name(&self, text: &str) -> Option<usize> {
        let mut text = text;
        loop {
            let (name, _) = self.by_name.range::<str, _>((Bound::Unbounded, Bound::Included(text))).next_back()?;
            if text.starts_with(name.as_str()) {
                return Some(name.len());
            }
            let common = name.chars().zip(text.chars()).take_while(|(a, b)| a == b).map(|(a, _)| a.len_utf8()).sum();
            text = &text[..common];
        }
    }

    /// An error if the scene ignored a definition of the caller.
    pub(super) fn check_all_used(&self) -> Result<(), SceneError> {
        let Some((name, _)) = self.by_name.iter().find(|(_, p)| p.from_caller && !p.used) else { return Ok(()) };
        let used: Vec<&str> = self.by_name.iter().filter(|(_, p)| p.used).map(|(n, _)| n.as_str()).collect();
        Err(SceneError::Define {
            name: name.clone(),
            message: format!("the scene does not use ${name}"),
            help: names::suggest_defined(name, &used),
        })
    }
}
