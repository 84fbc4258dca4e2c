//! Signals, full devices and closed pipes, as Linux has them.

use std::{
    fs::{self, File, OpenOptions},
    io,
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use crate::sandbox::{Outcome, Sandbox, TINY};

fn full() -> File {
    OpenOptions::new().write(true).open("/dev/full").unwrap()
}

/// Seconds of processor time that the child used, in hundredths.
fn ticks(child: &Child) -> u64 {
    let stat = fs::read_to_string(format!("/proc/{}/stat", child.id())).unwrap();
    let fields: Vec<_> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
    fields[11].parse::<u64>().unwrap() + fields[12].parse::<u64>().unwrap()
}

/// The signal of Ctrl-C. Where these tests run in the background of a script it is ignored, by the program as well: there it is another one.
fn stop() -> &'static str {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).unwrap();
    if u64::from_str_radix(ignored.trim(), 16).unwrap() & 2 == 0 { "-INT" } else { "-TERM" }
}

/// Runs the program until it has worked for 0.3 s, and sends it the signal of Ctrl-C; it must end soon.
fn interrupted(sandbox: &Sandbox, args: &[&str]) -> Outcome {
    let mut child = sandbox.command(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let deadline = Instant::now() + Duration::from_secs(60);
    while ticks(&child) < 30 && Instant::now() < deadline {
        thread::sleep(Duration::from_millis(10));
    }
    signal(&child, stop());
    let deadline = Instant::now() + Duration::from_secs(20);
    while child.try_wait().unwrap().is_none() {
        if Instant::now() > deadline {
            child.kill().unwrap();
        }
        thread::sleep(Duration::from_millis(10));
    }
    Outcome::new(args, &child.wait_with_output().unwrap())
}

#[test]
fn ctrl_c_stops_inside_a_tile() {
    // One tile of minutes of work.
    let size = ["render", "-D", "width=16", "-D", "height=16", "--spp", "100000000", "--method", "none"];
    nothing_is_left_after_ctrl_c(&[&size[..], &["--stats", "fog.json"]].concat());
}

#[test]
fn ctrl_c_stops_a_verification() {
    nothing_is_left_after_ctrl_c(&["verify", "--segments", "1e12", "--voxel", "32", "--stats", "fog.json"]);
}

#[test]
fn ctrl_c_stops_a_recording_and_a_report() {
    let queries = ["--max-queries", "1e12", "-D", "spp=1000", "--html", "fog.html", "--export", "fog"];
    nothing_is_left_after_ctrl_c(&[&["report", "queries"], &queries[..]].concat());
    nothing_is_left_after_ctrl_c(&["report", "thesis", "--scenes", "cbox_vol4", "--csv", "fog.csv"]);
}

fn nothing_is_left_after_ctrl_c(args: &[&str]) {
    let sandbox = Sandbox::new();
    let outcome = interrupted(&sandbox, args);
    assert_eq!(outcome.code, Some(130), "{}", outcome.stderr);
    assert_eq!((outcome.stdout.as_str(), outcome.stderr.as_str()), ("", "interrupted; nothing was written\n"));
    assert!(sandbox.files().is_empty(), "{:?}", sandbox.files());
}

#[test]
fn ctrl_c_stops_inside_a_file() {
    let sandbox = Sandbox::new();
    // Seconds of work, most of it in two files.
    let outcome = interrupted(&sandbox, &["scene", "write", "scape", "a", "--triangles", "10000000"]);
    let message = format!("interrupted; {} files were written, each of them whole\n", outcome.stdout.lines().count());
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(130), message.as_str()));
    let on_disk: usize = ["a", "a/meshes"].map(|f| fs::read_dir(sandbox.path().join(f)).unwrap().count()).iter().sum();
    // The folder of the meshes is not listed; nothing else may be there that is not.
    assert_eq!(on_disk, outcome.stdout.lines().count() + 1, "{}", outcome.stdout);
}

#[test]
fn statistics_to_a_full_device() {
    let args = [&["render", "--stats", "/dev/full"], &TINY[..]].concat();
    Sandbox::new().fails(&args, 1, &["cannot write /dev/full: No space left on device"]);
}

/// A failed write leaves nothing: neither the images that were written before it nor the statistics.
#[cfg(target_os = "linux")]
#[test]
fn images_appear_together_or_not_at_all() {
    for full in ["a.exr", "a.png"] {
        let sandbox = Sandbox::new();
        std::os::unix::fs::symlink("/dev/full", sandbox.path().join(full)).unwrap();
        let args = [&["render", "-o", "a.exr", "--stats", "a.json"], &TINY[..]].concat();
        sandbox.fails(&args, 1, &[&format!("cannot write {full}: No space left on device")]);
        assert_eq!(sandbox.files(), [full]);
    }
}

/// The commands that write to stdout.
fn talkers() -> [(Sandbox, Vec<&'static str>); 7] {
    let compare = Sandbox::new();
    compare.render(&["-o", "a.exr"]);
    [
        (Sandbox::new(), [&["render"], &TINY[..]].concat()),
        (Sandbox::new(), vec!["scene", "list"]),
        (Sandbox::new(), vec!["scene", "write", "cbox_vol2"]),
        (Sandbox::new(), vec!["verify", "--segments", "1000", "--voxel", "32"]),
        (Sandbox::new(), vec!["voxelize", "--voxel", "32"]),
        (Sandbox::new(), vec!["report", "queries", "--voxel", "32", "--methods", "ndf", "--max-queries", "999"]),
        (compare, vec!["compare", "a.exr", "a.exr"]),
    ]
}

#[test]
fn stdout_is_a_full_device() {
    for (sandbox, args) in talkers() {
        let output = sandbox.command(&args).stdout(full()).output().unwrap();
        Outcome::new(&args, &output).failed(1, &["cannot write to standard output: No space left on device"]);
    }
}

#[test]
fn stdout_is_a_closed_pipe() {
    for (sandbox, args) in talkers() {
        let (reader, writer) = io::pipe().unwrap();
        drop(reader);
        let output = sandbox.command(&args).stdout(writer).output().unwrap();
        let outcome = Outcome::new(&args, &output);
        assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(1), ""), "{args:?}");
    }
}

/// Nobody reads the names of the files; all of them are written.
#[test]
fn files_are_written_though_stdout_is_closed() {
    for (args, files) in [
        (vec!["scene", "write", "cbox_vol6"], &["cbox_vol6.xml", "meshes"][..]),
        (
            [&["render", "--sequence", "max_depth=2..3", "-o", "a#.exr", "--record-queries", "a#.vdfq"], &TINY[..]]
                .concat(),
            &["a2.exr", "a2.png", "a2.vdfq", "a3.exr", "a3.png", "a3.vdfq"],
        ),
    ] {
        let sandbox = Sandbox::new();
        let output = sandbox.command(&args).stdout(full()).output().unwrap();
        Outcome::new(&args, &output).failed(1, &["cannot write to standard output: No space left on device"]);
        assert_eq!(sandbox.files(), files);
        if files.contains(&"meshes") {
            assert_eq!(fs::read_dir(sandbox.path().join("meshes")).unwrap().count(), 3);
        }
    }
}

#[test]
fn stderr_is_a_full_device() {
    let sandbox = Sandbox::new();
    let status = sandbox.command(&["render", "nothing.xml"]).stderr(full()).status().unwrap();
    assert_eq!(status.code(), Some(2));
    let args = [&["render"], &TINY[..]].concat();
    let status = sandbox.command(&args).stdout(full()).stderr(full()).status().unwrap();
    assert_eq!(status.code(), Some(1));
}

#[test]
fn statistics_to_stdout() {
    let sandbox = Sandbox::new();
    let json = sandbox.render(&["--quiet", "--stats", "/dev/stdout"]).stdout;
    assert!(serde_json::from_str::<serde_json::Value>(&json).unwrap()["queries"].as_u64().unwrap() > 0);
}

/// A file that is larger than the shell's limit fails like one on a full disk, and nothing of it stays.
#[test]
fn files_beyond_the_limit_of_their_size() {
    let sandbox = Sandbox::new();
    // The limit counts blocks of 512 or 1024 bytes; the output is no file, so it has none.
    let limited = |args: &str| {
        let script = format!("ulimit -f 8; exec '{}' {args}", env!("CARGO_BIN_EXE_vdf"));
        let output = Command::new("sh").args(["-c", &script]).current_dir(sandbox.path()).output().unwrap();
        Outcome::new(&["sh", "-c", &script], &output)
    };
    let size = "-D width=128 -D height=128 --spp 1 --method none -q";
    limited(&format!("render {size} -o a.exr")).failed(1, &["cannot write a.", "File too large"]);
    assert!(sandbox.files().is_empty(), "{:?}", sandbox.files());
    sandbox.render(&["-o", "a.exr", "-D", "width=16"]);
    limited("scene write cbox_vol6 s").succeeded();
    limited("scene write scape t").failed(1, &["File too large"]);
    limited("voxelize --method amr --voxel 8 --export v").failed(1, &["cannot write v/occupied.obj: File too large"]);
    assert_eq!(fs::read_dir(sandbox.path().join("v")).unwrap().count(), 0);
}

/// Where the system has a limit, what is larger is an error and no abort.
#[cfg(target_os = "linux")]
#[test]
fn fields_that_do_not_fit_the_memory() {
    let sandbox = Sandbox::new();
    let script =
        format!("ulimit -v 400000; exec '{}' voxelize --method amr --voxel 1.5 -j 1", env!("CARGO_BIN_EXE_vdf"));
    let output = Command::new("sh").args(["-c", &script]).current_dir(sandbox.path()).output().unwrap();
    let outcome = Outcome::new(&["sh", "-c", &script], &output);
    outcome.failed(1, &["a voxel size of 1.5 needs", "bytes of memory, which are not there; use larger voxels"]);
}

/// Work outside of a pool of ours would start rayon's own, which panics if it cannot have its threads.
#[test]
fn a_comparison_needs_no_threads_but_its_own() {
    let sandbox = Sandbox::new();
    sandbox.render(&["-o", "a.exr"]);
    let mut command = sandbox.command(&["compare", "a.exr", "a.exr"]);
    let output = command.env("RAYON_NUM_THREADS", "1000000").output().unwrap();
    Outcome::new(&["compare"], &output)
        .failed(1, &["cannot start the rendering threads: RAYON_NUM_THREADS must be at most 4096"]);
}

/// A render of some seconds that keeps its samples, and the same without interruption.
const LONG: [&str; 7] = ["render", "-D", "width=48", "-D", "height=32", "--reproducible", "-q"];

fn spawn(sandbox: &Sandbox, args: &[&str]) -> Child {
    sandbox.command(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
}

fn wait_for(mut what: impl FnMut() -> bool) {
    let deadline = Instant::now() + Duration::from_secs(60);
    while !what() {
        assert!(Instant::now() < deadline, "it does not come");
        thread::sleep(Duration::from_millis(5));
    }
}

/// However often and at whatever moment it is killed, it ends with the bytes of an uninterrupted render.
#[test]
fn a_render_that_is_killed_again_and_again_is_the_same() {
    let sandbox = Sandbox::new();
    sandbox.run(&[&LONG[..], &["--spp", "300", "-o", "whole.exr"]].concat()).succeeded();
    let kept = ["--spp", "300", "-o", "a.exr", "--checkpoint", "a.film", "--every", "50ms", "--resume"];
    let kept = [&LONG[..], &kept].concat();
    let film = sandbox.path().join("a.film");
    let modified = || film.metadata().and_then(|m| m.modified()).ok();
    let mut killed = 0;
    for kill in 0..6 {
        let (before, mut child) = (modified(), spawn(&sandbox, &kept));
        wait_for(|| modified() != before || child.try_wait().unwrap().is_some());
        thread::sleep(Duration::from_millis(7 * kill));
        killed += u32::from(child.try_wait().unwrap().is_none());
        child.kill().unwrap();
        child.wait().unwrap();
    }
    assert!(killed >= 2, "it was done before it was killed {killed} times");
    // The checkpoint at hand may have left its temporary file, but nothing else.
    sandbox.run(&kept).succeeded();
    for extension in ["exr", "png"] {
        let [a, b] = ["whole", "a"].map(|name| sandbox.read(&format!("{name}.{extension}")));
        assert!(a == b, "{extension}");
    }
}

#[test]
fn an_interrupt_writes_a_last_checkpoint() {
    for name in [stop(), "-TERM"] {
        let sandbox = Sandbox::new();
        let kept = ["--spp", "100000000", "--checkpoint", "a.film", "--every", "1h", "-o", "a.exr"];
        let kept = [&LONG[..], &kept].concat();
        let child = spawn(&sandbox, &kept);
        wait_for(|| ticks(&child) > 20);
        signal(&child, name);
        let outcome = Outcome::new(&kept, &child.wait_with_output().unwrap());
        assert_eq!(outcome.code, Some(130), "{}", outcome.stderr);
        assert!(outcome.stderr.contains("samples are kept in a.film; go on with --resume"), "{}", outcome.stderr);
        assert_eq!(sandbox.files(), ["a.film"]);
    }
}

/// As under `nohup`: what is ignored from the start stays so.
#[test]
fn a_signal_that_is_ignored_stays_ignored() {
    let sandbox = Sandbox::new();
    let size = "-D width=48 -D height=32 --spp 100000000 -q -o a.exr";
    let script = format!("trap '' HUP; exec '{}' render {size}", env!("CARGO_BIN_EXE_vdf"));
    let mut shell = Command::new("sh");
    shell.args(["-c", &script]).current_dir(sandbox.path()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = shell.spawn().unwrap();
    wait_for(|| ticks(&child) > 20);
    signal(&child, "-HUP");
    let before = ticks(&child);
    wait_for(|| ticks(&child) > before + 20);
    assert!(child.try_wait().unwrap().is_none());
    signal(&child, stop());
    let outcome = Outcome::new(&["sh", "-c", &script], &child.wait_with_output().unwrap());
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(130), "interrupted; nothing was written\n"));
}

/// Two renders that were given the same name: the first to write has it.
#[test]
fn a_checkpoint_of_another_program_is_not_replaced() {
    let sandbox = Sandbox::new();
    let kept = ["--spp", "100000000", "--checkpoint", "a.film", "--every", "1h", "-o", "a.exr"];
    let kept = [&LONG[..], &kept].concat();
    let child = spawn(&sandbox, &kept);
    wait_for(|| ticks(&child) > 20);
    sandbox.write("a.film", "of another");
    signal(&child, stop());
    let outcome = Outcome::new(&kept, &child.wait_with_output().unwrap());
    outcome.failed(1, &["--checkpoint a.film: another program has written such a file"]);
    assert_eq!(sandbox.read("a.film"), b"of another");
}

/// Nobody writes to it, and nobody waits.
#[test]
fn a_pipe_is_no_film() {
    let sandbox = Sandbox::new();
    assert!(Command::new("mkfifo").arg(sandbox.path().join("a.film")).status().unwrap().success());
    sandbox.fails(&["merge", "a.film", "-o", "a.exr"], 1, &["a.film", "it is not a plain file"]);
}

#[test]
fn a_signal_shows_the_picture_so_far() {
    let sandbox = Sandbox::new();
    let endless = ["render", "-D", "width=48", "-D", "height=32", "--spp", "100000000", "-o", "a.exr"];
    let child = spawn(&sandbox, &endless);
    wait_for(|| ticks(&child) > 20);
    signal(&child, "-USR1");
    // The EXR comes last.
    wait_for(|| sandbox.files().contains(&"a.partial.exr".to_owned()));
    signal(&child, stop());
    let outcome = Outcome::new(&endless, &child.wait_with_output().unwrap());
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(130), "interrupted; nothing was written\n"));
    assert_eq!(sandbox.files(), ["a.partial.exr", "a.partial.png"]);
    sandbox.run(&["compare", "a.partial.exr", "a.partial.exr"]).succeeded();
}

/// As on a full disk: the older checkpoint stays, and can be gone on with.
#[test]
fn a_checkpoint_that_does_not_fit_leaves_the_older_one() {
    let sandbox = Sandbox::new();
    let size = "render -D width=64 -D height=64 --method none -q --checkpoint a.film --resume --every 1ms";
    let limited = |blocks: u32, args: &str| {
        let script = format!("ulimit -f {blocks}; exec '{}' {size} {args}", env!("CARGO_BIN_EXE_vdf"));
        let output = Command::new("sh").args(["-c", &script]).current_dir(sandbox.path()).output().unwrap();
        Outcome::new(&["sh", "-c", &script], &output)
    };
    limited(1000, "--spp 1 -o a.exr").succeeded();
    let good = sandbox.read("a.film");
    limited(8, "--spp 100000000 -o b.exr").failed(1, &["cannot write a.film: File too large"]);
    assert_eq!(sandbox.read("a.film"), good);
    assert_eq!(sandbox.files(), ["a.exr", "a.film", "a.png"]);
    limited(1000, "--spp 2 -o b.exr").succeeded();
}
