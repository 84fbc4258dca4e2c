//! Where a report's figures come from: machine, program, command.

use std::env;

use serde::Serialize;
use sysinfo::{CpuRefreshKind, RefreshKind, System};

use super::bench::processors;

/// What one has to know to repeat a measurement.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Provenance {
    /// The command line.
    pub(super) command: String,
    /// Seed of the renders.
    pub(super) seed: u64,
    /// Version of this program.
    pub(super) version: &'static str,
    /// The commit that it was built from, if it was built in a repository.
    pub(super) commit: Option<&'static str>,
    /// Profile of the build: times of `debug` say little.
    pub(super) profile: &'static str,
    /// The compiler.
    pub(super) rustc: &'static str,
    /// Model of the processor.
    pub(super) cpu: String,
    /// Logical processors that the program may use.
    pub(super) cores: usize,
    /// The operating system.
    pub(super) os: String,
}

impl Provenance {
    pub(super) fn new(seed: u64) -> Self {
        let refresh = RefreshKind::nothing().with_cpu(CpuRefreshKind::nothing());
        let system = System::new_with_specifics(refresh).ok();
        let brand = system.as_ref().and_then(|s| s.cpus().first()).map(|c| c.brand().trim().to_owned());
        let cpu = brand.filter(|brand| !brand.is_empty());
        Self {
            command: env::args_os().map(|a| quoted(&a.to_string_lossy())).collect::<Vec<_>>().join(" "),
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

    /// Names and values, in words.
    pub(super) fn entries(&self) -> [(&'static str, String); 8] {
        [
            ("command", self.command.clone()),
            ("seed", self.seed.to_string()),
            ("program", format!("vdf {}, {} build", self.version, self.profile)),
            ("commit", self.commit.unwrap_or("unknown").to_owned()),
            ("compiler", self.rustc.to_owned()),
            ("processor", self.cpu.clone()),
            ("cores", self.cores.to_string()),
            ("system", self.os.clone()),
        ]
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
