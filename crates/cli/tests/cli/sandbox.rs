//! A temporary folder to run the program in.

use std::{fs, path::Path, process, time::Duration};

use tempfile::TempDir;

/// Arguments that make a render tiny.
pub(crate) const TINY: [&str; 6] = ["-D", "width=16", "-D", "height=16", "--spp", "1"];

/// The current folder of the program, empty at first and removed at the end.
pub(crate) struct Sandbox(TempDir);

impl Sandbox {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    pub(crate) fn write(&self, name: &str, text: &str) {
        fs::write(self.path().join(name), text).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path().join(name)).unwrap()
    }

    /// Names of all there is in the folder, sorted.
    pub(crate) fn files(&self) -> Vec<String> {
        let entries = fs::read_dir(self.path()).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// The program, not yet started, where the streams or the signals matter.
    pub(crate) fn command(&self, args: &[&str]) -> process::Command {
        let mut command = process::Command::new(env!("CARGO_BIN_EXE_vdf"));
        command.args(args).current_dir(self.path());
        command
    }

    /// Runs the program to its end.
    pub(crate) fn run(&self, args: &[&str]) -> Outcome {
        let mut command = assert_cmd::Command::from_std(self.command(args));
        Outcome::new(args, &command.timeout(Duration::from_secs(120)).output().unwrap())
    }

    /// Renders tiny with more arguments; must succeed.
    pub(crate) fn render(&self, args: &[&str]) -> Outcome {
        self.run(&[&["render"], args, &TINY].concat()).succeeded()
    }

    /// Runs the program; it must fail with this code, with one message that has all `parts`, and leave nothing behind.
    #[track_caller]
    pub(crate) fn fails(&self, args: &[&str], code: i32, parts: &[&str]) -> Outcome {
        let before = self.files();
        let outcome = self.run(args).failed(code, parts);
        assert_eq!(self.files(), before, "{args:?} left files behind");
        outcome
    }
}

/// What a run of the program said.
pub(crate) struct Outcome {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
    command: String,
}

impl Outcome {
    pub(crate) fn new(args: &[&str], output: &process::Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        Self {
            code: output.status.code(),
            stdout: text(&output.stdout),
            stderr: text(&output.stderr),
            command: format!("vdf {}", args.join(" ")),
        }
    }

    #[track_caller]
    pub(crate) fn succeeded(self) -> Self {
        // On a slow machine even a tiny render may take so long that progress is told.
        let said = self.stderr.lines().filter(|line| !line.ends_with(" %")).collect::<Vec<_>>();
        assert_eq!((self.code, said), (Some(0), vec![]), "{}", self.command);
        self
    }

    #[track_caller]
    pub(crate) fn failed(self, code: i32, parts: &[&str]) -> Self {
        let Self { stderr, command, .. } = &self;
        assert_eq!(self.code, Some(code), "{command}: {stderr}");
        assert_eq!(self.stdout, "", "{command}");
        assert!(stderr.starts_with("error: ") && stderr.matches("error:").count() == 1, "{command}: {stderr}");
        for part in parts {
            assert!(stderr.contains(part), "{command}: no '{part}' in: {stderr}");
        }
        self
    }
}
