//! Where a report's figures come from: machine, program, command.

use std::{env, ffi::OsString};

use serde::Serialize;
use sysinfo::{CpuRefreshKind, RefreshKind, System};

use super::bench::processors;

/// What one has to know to repeat a measurement.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Provenance {
    /// The command line, where there was one; see [`Provenance::set_command`].
    pub command: Option<String>,
    /// Seed of the renders.
    pub seed: u64,
    /// Version of this program.
    pub version: &'static str,
    /// The commit that it was built from, if it was built in a repository.
    pub commit: Option<&'static str>,
    /// Profile of the build: times of `debug` say little.
    pub profile: &'static str,
    /// The compiler.
    pub rustc: &'static str,
    /// Model of the processor.
    pub cpu: String,
    /// Logical processors that the program may use.
    pub cores: usize,
    /// The operating system.
    pub os: String,
}

impl Provenance {
    /// This program on this machine.
    #[must_use]
    pub fn here(seed: u64) -> Self {
        let refresh = RefreshKind::nothing().with_cpu(CpuRefreshKind::nothing());
        let system = System::new_with_specifics(refresh).ok();
        let brand = system.as_ref().and_then(|s| s.cpus().first()).map(|c| c.brand().trim().to_owned());
        let cpu = brand.filter(|brand| !brand.is_empty());
        Self {
            command: None,
            seed,
            version: env!("CARGO_PKG_VERSION"),
            commit: option_env!("VDF_COMMIT"),
            profile: option_env!("VDF_PROFILE").unwrap_or("unknown"),
            rustc: option_env!("VDF_RUSTC").unwrap_or("unknown"),
            cpu: cpu.unwrap_or_else(|| env::consts::ARCH.to_owned()),
            cores: processors(),
            os: System::long_os_version().unwrap_or_else(|_| env::consts::OS.to_owned()),
        }
    }

    /// Remembers the command, its arguments quoted as a shell would need them.
    pub fn set_command(&mut self, arguments: impl IntoIterator<Item = OsString>) {
        let quoted: Vec<_> = arguments.into_iter().map(|a| quoted(&a.to_string_lossy())).collect();
        self.command = Some(quoted.join(" "));
    }

    /// Names and values, in words.
    pub(super) fn entries(&self) -> Vec<(&'static str, String)> {
        let mut entries: Vec<_> = self.command.iter().map(|command| ("command", command.clone())).collect();
        entries.extend([
            ("seed", self.seed.to_string()),
            ("program", format!("vdf {}, {} build", self.version, self.profile)),
            ("commit", self.commit.unwrap_or("unknown").to_owned()),
            ("compiler", self.rustc.to_owned()),
            ("processor", self.cpu.clone()),
            ("cores", self.cores.to_string()),
            ("system", self.os.clone()),
        ]);
        entries
    }
}

/// As a shell would need it.
fn quoted(argument: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=,:+@%".contains(c);
    if !argument.is_empty() && argument.chars().all(plain) {
        argument.to_owned()
    } else {
        format!("'{}'", argument.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_can_be_pasted_into_a_shell() {
        let mut here = Provenance::here(7);
        assert!(here.entries().iter().all(|(name, _)| *name != "command"));
        here.set_command(["vdf", "report", "a b", "", "it's", "-D", "x=1"].map(OsString::from));
        assert_eq!(here.entries()[0], ("command", r"vdf report 'a b' '' 'it'\''s' -D x=1".to_owned()));
        assert_eq!(here.entries()[1], ("seed", "7".to_owned()));
    }
}
