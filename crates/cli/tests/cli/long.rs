//! Renders in parts: checkpoints, shards, limits of time, progress for programs.

use std::fs;

use crate::sandbox::{Outcome, Sandbox};

/// A render of some tiles and so many samples per pixel.
fn of_spp<'a>(spp: &'a str, out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let size = ["render", "-D", "width=40", "-D", "height=24", "--spp", spp, "--reproducible", "-o", out];
    [&size[..], more].concat()
}

/// A render of some passes and tiles.
fn args<'a>(out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    of_spp("11", out, more)
}

/// The whole render to `whole.exr`.
fn with_whole() -> Sandbox {
    let sandbox = Sandbox::new();
    sandbox.run(&args("whole.exr", &[])).succeeded();
    sandbox
}

#[track_caller]
fn same(sandbox: &Sandbox, name: &str) {
    for extension in ["exr", "png"] {
        let [a, b] = ["whole", name].map(|name| sandbox.read(&format!("{name}.{extension}")));
        assert!(a == b, "{name}.{extension} is not that of the whole render");
    }
}

#[test]
fn a_checkpoint_of_fewer_samples_is_gone_on_with() {
    let sandbox = with_whole();
    let keep = ["--checkpoint", "a.film"];
    sandbox.run(&of_spp("5", "part.exr", &keep)).succeeded();
    let resumed = args("resumed.exr", &[&keep[..], &["--resume", "--method", "none", "-j", "1"]].concat());
    sandbox.run(&resumed).succeeded();
    same(&sandbox, "resumed");
    let fewer = of_spp("7", "fewer.exr", &["--checkpoint", "a.film", "--resume"]);
    sandbox.fails(&fewer, 2, &["a.film has samples up to 11, which cannot be taken back to 7; give --spp 11 or more"]);
    // Once more, with nothing left to do.
    sandbox.run(&args("again.exr", &[&keep[..], &["--resume"]].concat())).succeeded();
    same(&sandbox, "again");
    // Without a checkpoint there is nothing to go on with, which is no error: the same command line is run again and again.
    sandbox.run(&args("new.exr", &["--checkpoint", "new.film", "--resume"])).succeeded();
    same(&sandbox, "new");
}

#[test]
fn checkpoints_are_not_lost_or_mistaken() {
    let sandbox = Sandbox::new();
    let keep = ["--checkpoint", "a.film"];
    sandbox.run(&args("a.exr", &keep)).succeeded();
    let good = sandbox.read("a.film");
    sandbox.fails(&args("b.exr", &keep), 2, &["--checkpoint a.film: there is such a file", "--resume"]);
    for (change, field) in [
        (&["--seed", "9"][..], "the seed differs, 9 and 0"),
        (&["-D", "max_depth=3"], "the scene (its checksum) differs"),
        (&["cbox_vol4"], "the scene (its checksum) differs"),
        (&["--integrator", "raymarch"], "the integrator differs, raymarch 7 and volpath"),
        (&["--sampler", "independent"], "the sampler differs, independent and sobol"),
        (&["--crop", "0,0,8,8"], "the crop differs, 0,0,8,8 and 0,0,40,24"),
    ] {
        let resumed = args("b.exr", &[&keep[..], &["--resume"], change].concat());
        sandbox.fails(&resumed, 2, &["--resume: a.film is of another render:", field]);
    }
    assert_eq!(sandbox.read("a.film"), good);
    let resume = args("b.exr", &["--checkpoint", "a.film", "--resume"]);
    let mut flipped = good.clone();
    flipped[good.len() / 2] ^= 4;
    for (bytes, reason) in [
        (flipped.as_slice(), "its checksum is"),
        (&good[..good.len() / 2], "the file is cut off"),
        (b"", "it is no film of vdf"),
    ] {
        fs::write(sandbox.path().join("a.film"), bytes).unwrap();
        sandbox.fails(&resume, 1, &["cannot read a.film", reason]);
        assert_eq!(sandbox.read("a.film"), bytes);
    }
    sandbox.fails(&args("a.exr", &["--checkpoint", "a.exr"]), 2, &["--output and --checkpoint both write a.exr"]);
    sandbox.fails(&args("b.exr", &["--checkpoint", "no/b.film"]), 1, &["cannot write no/b.film"]);
}

#[test]
fn shards_make_up_the_whole_render() {
    let sandbox = with_whole();
    for (count, tiles) in [(3, false), (4, true), (13, false)] {
        let mut films = Vec::new();
        for index in 0..count {
            let (film, shard) = (format!("{count}-{index}.film"), format!("{index}/{count}"));
            let method = if index % 2 == 0 { "lb" } else { "none" };
            let how = if tiles { &["--tiles"][..] } else { &[] };
            let outcome = sandbox.run(&args(&film, &[&["--shard", &shard, "--method", method], how].concat()));
            assert!(outcome.succeeded().stdout.contains(&film));
            films.push(film);
        }
        films.reverse();
        let films: Vec<&str> = films.iter().map(String::as_str).collect();
        let name = format!("merged-{count}");
        let exr = format!("{name}.exr");
        let merge = [&["merge", "-o", &exr, "--stats", "a.json", "--reproducible"], &films[..]].concat();
        sandbox.run(&merge).succeeded();
        same(&sandbox, &name);
        let json: serde_json::Value = serde_json::from_slice(&sandbox.read("a.json")).unwrap();
        assert_eq!((&json["paths"], &json["samples"]), (&10560.into(), &10560.into()));
        assert_eq!(json["runs"].as_array().unwrap().len(), count);
    }
}

fn incomplete(outcome: &Outcome, parts: &[&str]) {
    assert_eq!(outcome.code, Some(3), "{}", outcome.stderr);
    assert!(parts.iter().all(|part| outcome.stderr.contains(part)), "{}", outcome.stderr);
}

#[test]
fn shards_are_merged_as_they_arrive() {
    let sandbox = with_whole();
    for index in ["0", "1", "2"] {
        let (film, shard) = (format!("{index}.film"), format!("{index}/3"));
        sandbox.run(&args(&film, &["--shard", &shard])).succeeded();
    }
    let into = ["merge", "--into", "all.film", "--reproducible"];
    let outcome = sandbox.run(&[&into[..], &["1.film"]].concat());
    incomplete(&outcome, &["error: the film lacks samples 0 to 2, and samples 7 to 10, of 11 in the whole render"]);
    let partial = sandbox.run(&["merge", "all.film", "-o", "so-far.exr", "--so-far"]);
    incomplete(&partial, &["the film lacks"]);
    assert!(!sandbox.read("so-far.exr").is_empty());
    let outcome = sandbox.run(&[&into[..], &["-o", "merged.exr", "0.film", "1.film"]].concat());
    incomplete(&outcome, &["note: 1.film is passed over", "lacks samples 7 to 10, of 11"]);
    assert!(!sandbox.files().contains(&"merged.exr".to_owned()));
    let outcome = sandbox.run(&[&into[..], &["-o", "merged.exr", "--quiet", "2.film", "0.film"]].concat());
    outcome.succeeded();
    same(&sandbox, "merged");
    // As `*.film` names all of them from now on.
    let all = ["--quiet", "-o", "again.exr", "0.film", "1.film", "2.film", "./all.film"];
    sandbox.run(&[&into[..], &all].concat()).succeeded();
    same(&sandbox, "again");
    sandbox.fails(&["merge", "0.film", "--into", "all.exr"], 2, &["--into all.exr: a film"]);
}

/// What has no end of its own has no shards; the message says so.
#[test]
fn a_checkpoint_among_shards_is_recognized() {
    let sandbox = Sandbox::new();
    sandbox.run(&args("0.film", &["--shard", "0/2"])).succeeded();
    let kept = ["--time-limit", "50ms", "--checkpoint", "kept.film", "-o", "a.exr", "--reproducible"];
    sandbox.run(&[&["render", "-D", "width=40", "-D", "height=24"][..], &kept].concat()).succeeded();
    let parts = ["kept.film", "one of them is a checkpoint of a render with --time-limit, not a shard"];
    sandbox.fails(&["merge", "0.film", "kept.film", "-o", "b.exr"], 2, &parts);
}

#[test]
fn what_is_there_only_in_part_is_rendered_again() {
    let sandbox = with_whole();
    let skip = ["--skip-existing", "--stats", "a.json"];
    let skipped = || sandbox.run(&args("whole.exr", &skip)).stderr.contains("is not rendered again");
    assert!(!skipped());
    assert!(skipped());
    fs::remove_file(sandbox.path().join("whole.png")).unwrap();
    assert!(!skipped());
    assert!(skipped());
}

#[test]
fn strangers_are_not_merged() {
    let sandbox = Sandbox::new();
    sandbox.run(&args("0.film", &["--shard", "0/2"])).succeeded();
    for (change, field) in [
        (&["--shard", "1/2", "--seed", "9"][..], "the seed differs"),
        (&["--shard", "1/2", "cbox_vol4"], "the scene (its checksum) differs"),
        (
            &["--shard", "1/2", "--transmittance", "analog"],
            "the estimator of transmittance differs, analytic and analog",
        ),
        (&["--shard", "1/2", "--crop", "0,0,8,8"], "the crop differs"),
        (&["--shard", "1/2", "-D", "height=25"], "differs"),
        (&["--shard", "1/3"], "both films have the samples 3 to 4 of 6 tiles"),
    ] {
        sandbox.run(&args("1.film", change)).succeeded();
        sandbox.fails(&["merge", "0.film", "1.film", "-o", "a.exr"], 2, &["cannot merge 1.film with 0.film:", field]);
    }
    fs::write(sandbox.path().join("1.film"), "junk").unwrap();
    sandbox.fails(&["merge", "0.film", "1.film", "-o", "a.exr"], 1, &["1.film: it is no film of vdf"]);
    sandbox.fails(&["merge", "0.film", "-o", "0.film"], 2, &["must end in .exr"]);
    sandbox.fails(&["merge", "0.film", "-o", "b.exr", "--stats", "0.film"], 2, &["would overwrite the input"]);
    sandbox.fails(&args("a.exr", &["--shard", "0/2"]), 2, &["a.exr: the output of a shard must end in .film"]);
    sandbox.fails(&args("a.film", &["--shard", "2/2"]), 2, &["the shards of 2 are 0/2 to 1/2"]);
}

/// Every line of stderr.
fn lines(outcome: &Outcome) -> Vec<serde_json::Value> {
    outcome.stderr.lines().map(|line| serde_json::from_str(line).expect(line)).collect()
}

#[test]
fn progress_is_one_object_a_line() {
    let sandbox = Sandbox::new();
    let outcome = sandbox.run(&args("a.exr", &["--progress", "json", "--method", "amr"]));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let lines = lines(&outcome);
    let phases: Vec<_> = lines.iter().filter(|l| l["event"] == "phase").map(|l| &l["phase"]).collect();
    assert_eq!((phases.first(), phases.last()), (Some(&&"hierarchy".into()), Some(&&"rendering".into())), "{phases:?}");
    let progress: Vec<_> = lines.iter().filter(|l| l["event"] == "progress" && l["phase"] == "rendering").collect();
    // Passes of 1, 1, 2, 4 and 3 samples.
    let mut spp: Vec<_> = progress.iter().filter_map(|l| l["spp"].as_u64()).collect();
    spp.dedup();
    assert_eq!(spp, [1, 2, 4, 8, 11]);
    let last = progress.last().unwrap();
    assert_eq!((&last["done"], &last["total"]), (&10560.into(), &10560.into()));
    assert_eq!(last["remaining"], 0.0);
    let error = last["error"].as_f64().unwrap();
    assert!(error > 0.0 && error < 10.0, "{error}");
    assert_eq!(*lines.last().unwrap(), serde_json::json!({ "event": "end", "code": 0 }));

    let outcome = sandbox.run(&["render", "no.xml", "--progress", "json"]);
    let lines = self::lines(&outcome);
    assert_eq!((lines.len(), &lines[0]["event"], &lines[1]["code"]), (2, &"error".into(), &2.into()));
    assert!(lines[0]["message"].as_str().unwrap().starts_with("no.xml: no such file"));

    // What the arguments themselves are wrong in is told in the same way.
    for wrong in [&["--spp", "x", "--progress", "json"][..], &["--progress=json", "--nosuch"]] {
        let lines = self::lines(&sandbox.run(&[&["render"], wrong].concat()));
        assert_eq!((lines.len(), &lines[0]["event"], &lines[1]["code"]), (2, &"error".into(), &2.into()));
    }
}

/// Whatever the time lets be done is a whole render of so many samples.
#[test]
fn a_limit_of_time_gives_a_whole_render_of_fewer_samples() {
    let sandbox = Sandbox::new();
    let size = ["render", "-D", "width=16", "-D", "height=16", "--reproducible", "--method", "none"];
    let limited = [&size[..], &["-o", "limited.exr", "--time-limit", "200ms", "--stats", "a.json"]].concat();
    sandbox.run(&limited).succeeded();
    let json: serde_json::Value = serde_json::from_slice(&sandbox.read("a.json")).unwrap();
    let spp = json["spp"].to_string();
    assert_eq!(json["paths"].as_u64().unwrap(), 256 * json["spp"].as_u64().unwrap());
    sandbox.run(&[&size[..], &["-o", "whole.exr", "--spp", &spp]].concat()).succeeded();
    same(&sandbox, "limited");
    // Where the limit came while some tiles were ahead, those behind follow before there is a picture; three times, so that it mostly does.
    for _ in 0..3 {
        let size = [
            "render",
            "-D",
            "width=64",
            "-D",
            "height=48",
            "--time-limit",
            "37ms",
            "-o",
            "kept.exr",
            "--stats",
            "a.json",
        ];
        sandbox.run(&[&size[..], &["--checkpoint", "a.film", "--resume"]].concat()).succeeded();
        let json: serde_json::Value = serde_json::from_slice(&sandbox.read("a.json")).unwrap();
        assert_eq!(json["paths"].as_u64().unwrap(), 64 * 48 * json["spp"].as_u64().unwrap());
    }
    // One sample there always is; and no more than were asked for.
    for (args, spp) in [(&["--time-limit", "1ms"][..], None), (&["--time-limit", "1h", "--spp", "3"], Some(3))] {
        sandbox.run(&[&size[..], args, &["-o", "a.exr", "--stats", "a.json"]].concat()).succeeded();
        let json: serde_json::Value = serde_json::from_slice(&sandbox.read("a.json")).unwrap();
        assert!(json["spp"].as_u64().unwrap() >= 1);
        assert!(spp.is_none_or(|spp| json["spp"] == spp), "{}", json["spp"]);
    }
}

#[test]
fn a_sequence_has_a_picture_for_each_value() {
    let sandbox = Sandbox::new();
    let size = ["render", "-D", "width=8", "-D", "height=8", "--spp", "1", "-q", "--reproducible"];
    let run = |more: &[&str]| sandbox.run(&[&size[..], more].concat());
    run(&["--sequence", "max_depth=2..4", "-o", "fog.####.exr", "--stats", "##.json"]).succeeded();
    let names = |n: &str| [format!("fog.000{n}.exr"), format!("fog.000{n}.png")];
    let expected: Vec<String> = ["02.json", "03.json", "04.json"]
        .map(str::to_owned)
        .into_iter()
        .chain(["2", "3", "4"].iter().flat_map(|n| names(n)))
        .collect();
    assert_eq!(sandbox.files(), expected);
    run(&["-D", "max_depth=3", "-o", "three.exr"]).succeeded();
    assert!(sandbox.read("three.exr") == sandbox.read("fog.0003.exr"));
    assert!(sandbox.read("three.exr") != sandbox.read("fog.0004.exr"));
    sandbox.write("frames.csv", "frame, max_depth, spp\n10, 3, 1\n20, 4, 1\n");
    run(&["--sequence", "frames.csv", "--frames", "20", "-o", "##.exr"]).succeeded();
    assert!(sandbox.read("20.exr") == sandbox.read("fog.0004.exr"));
    let outcome = run(&["--sequence", "frames.csv", "-o", "##.exr", "--skip-existing"]);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(0), "note: 20.exr is there and is not rendered again\n"));
    let fails = |more: &[&str], part: &str| sandbox.fails(&[&size[..], more].concat(), 2, &[part]);
    fails(
        &["--sequence", "max_depth=1..2", "-o", "a.exr"],
        "--output a.exr: the name of a file of a sequence needs ####",
    );
    fails(&["--sequence", "no.csv"], "--sequence no.csv: cannot read it");
    fails(&["--sequence", "max_depth=1..2", "--frames", "7"], "there are no such frames");
    fails(&["--sequence", "max_depth=2..1"], "the step does not lead");
}

/// Layers are there whatever the render is divided into, and do not touch the picture.
#[test]
fn layers_are_divided_like_the_picture() {
    let sandbox = Sandbox::new();
    let aov = ["--aov", "albedo,normal,depth,position,variance,samples,cost,unknown", "--method", "amr-sn"];
    sandbox.run(&args("plain.exr", &[])).succeeded();
    sandbox.run(&args("whole.exr", &aov)).succeeded();
    assert_eq!(sandbox.read("plain.png"), sandbox.read("whole.png"));
    let exr = sandbox.read("whole.exr");
    for channel in ["albedo.R", "normal.X", "depth.Z", "position.Y", "variance.B", "samples.Y", "cost.Y", "unknown.Y"] {
        assert!(exr.windows(channel.len()).any(|w| w == channel.as_bytes()), "{channel}");
    }
    let shards: Vec<String> = (0..3).map(|i| format!("{i}/3")).collect();
    for (shard, film) in shards.iter().zip(["0.film", "1.film", "2.film"]) {
        sandbox.run(&args(film, &[&aov[..], &["--shard", shard]].concat())).succeeded();
    }
    sandbox.run(&["merge", "0.film", "1.film", "2.film", "-o", "merged.exr", "--reproducible"]).succeeded();
    same(&sandbox, "merged");
    let other = ["--shard", "0/3", "--method", "none"];
    sandbox.run(&args("0.film", &[&aov[..2], &other].concat())).succeeded();
    let merge = ["merge", "0.film", "1.film", "2.film", "-o", "merged.exr"];
    sandbox.fails(&merge, 2, &["the method, on which layers depend, differs, none and amr-sn"]);
    sandbox.fails(&args("a.exr", &["--aov", "colour"]), 2, &["unknown layer; the layers are albedo, normal"]);
}

/// Tiles stop at their own noise, whatever the render is divided into.
#[test]
fn noise_ends_tiles_one_by_one() {
    let sandbox = Sandbox::new();
    let way = ["--integrator", "raymarch", "--samples-per-segment", "2"];
    let noise = [&["--noise", "0.15"][..], &way].concat();
    let run = |out: &str, spp: &str, more: &[&str]| sandbox.run(&of_spp(spp, out, &[&noise[..], more].concat()));
    run("whole.exr", "64", &["--stats", "a.json"]).succeeded();
    let json: serde_json::Value = serde_json::from_slice(&sandbox.read("a.json")).unwrap();
    let (tiles, quiet) = (json["noise"]["tiles"].as_u64().unwrap(), json["noise"]["quiet_tiles"].as_u64().unwrap());
    let mean = json["noise"]["mean_spp"].as_f64().unwrap();
    assert!(tiles == 6 && quiet > 0 && (16.0..64.0).contains(&mean), "{json}");
    assert_eq!(json["paths"].as_f64().unwrap(), (mean * 40.0 * 24.0).round());
    run("other.exr", "64", &["--method", "none", "-j", "1"]).succeeded();
    same(&sandbox, "other");
    // Gone on with from fewer samples, and from a limit that was higher.
    let keep = ["--checkpoint", "a.film", "--resume"];
    run("part.exr", "19", &keep).succeeded();
    run("resumed.exr", "64", &keep).succeeded();
    same(&sandbox, "resumed");
    let loose = [&["--noise", "0.4", "--checkpoint", "b.film", "--resume"][..], &way].concat();
    sandbox.run(&of_spp("64", "part.exr", &loose)).succeeded();
    run("resumed.exr", "64", &["--checkpoint", "b.film", "--resume"]).succeeded();
    same(&sandbox, "resumed");
    let message =
        "b.film was rendered with --noise 0.15, and can be gone on with only with the same or a lower one, not 0.4";
    sandbox.fails(&of_spp("64", "part.exr", &loose), 2, &[message]);
    let layers = [&["--aov", "variance,samples", "--checkpoint", "b.film", "--resume"][..], &way].concat();
    sandbox.fails(&of_spp("64", "part.exr", &layers), 2, &["was rendered with --noise 0.15", "not none"]);
    // The pixels can be shared out, samples cannot.
    for (shard, film) in [("0/2", "0.film"), ("1/2", "1.film")] {
        run(film, "64", &["--shard", shard, "--tiles"]).succeeded();
    }
    let merge = ["merge", "0.film", "1.film", "-o", "merged.exr", "--reproducible"];
    sandbox.run(&merge).succeeded();
    same(&sandbox, "merged");
    sandbox
        .run(&of_spp("64", "1.film", &[&["--noise", "0.4", "--shard", "1/2", "--tiles"][..], &way].concat()))
        .succeeded();
    sandbox.fails(&merge, 2, &["the limit of noise differs, 0.15 and 0.4"]);
    let shard = of_spp("64", "0.film", &["--noise", "0.4", "--shard", "0/2"]);
    sandbox.fails(&shard, 2, &["--noise with --shard", "--tiles"]);
    sandbox.fails(&args("a.exr", &["--noise", "0"]), 2, &["must be a positive number, such as 0.02"]);
}

#[test]
fn an_exr_is_stored_as_asked() {
    let sandbox = Sandbox::new();
    let size = |how: &[&str]| {
        sandbox.run(&args("a.exr", how)).succeeded();
        sandbox.read("a.exr").len()
    };
    let [float, half] = ["float", "half"].map(|format| size(&["--exr-compression", "none", "--exr-format", format]));
    // Three numbers a pixel.
    assert_eq!(float - half, 40 * 24 * 3 * 2);
    size(&["--exr-compression", "piz"]);
    let exr = sandbox.read("a.exr");
    for attribute in [&b"worldToCamera\0m44f\0"[..], b"compression\0compression\0\x01\0\0\0\x04"] {
        assert!(exr.windows(attribute.len()).any(|w| w == attribute), "{attribute:?}");
    }
}

/// What a viewer reads of a message, piece by piece.
struct Message<'a>(&'a [u8]);

impl Message<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let (start, rest) = self.0.split_first_chunk::<N>().unwrap();
        self.0 = rest;
        *start
    }

    fn int(&mut self) -> u32 {
        u32::from_le_bytes(self.bytes())
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|&b| b == 0).unwrap();
        let (text, rest) = (self.0[..end].to_vec(), &self.0[end + 1..]);
        self.0 = rest;
        String::from_utf8(text).unwrap()
    }
}

/// A viewer that goes away after so many bytes; returns those, and how the render ended.
fn shown(bytes: u64) -> (Vec<u8>, Outcome) {
    use std::io::Read as _;
    let sandbox = with_whole();
    let viewer = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = viewer.local_addr().unwrap().to_string();
    let reader = std::thread::spawn(move || {
        let mut seen = Vec::new();
        viewer.accept().unwrap().0.take(bytes).read_to_end(&mut seen).unwrap();
        seen
    });
    let outcome = sandbox.run(&args("a.exr", &["--display", &address]));
    same(&sandbox, "a");
    (reader.join().unwrap(), outcome)
}

#[test]
fn a_viewer_sees_each_pass() {
    let (seen, outcome) = shown(u64::MAX);
    outcome.succeeded();
    let mut rest = Message(&seen);
    let mut next = || {
        let length = rest.int() as usize;
        let (message, others) = rest.0.split_at(length - 4);
        rest.0 = others;
        Message(message)
    };
    let mut create = next();
    assert_eq!((create.bytes(), create.text().as_str()), ([4, 0], "cbox_vol2"));
    assert_eq!([create.int(), create.int(), create.int()], [40, 24, 3]);
    assert_eq!([create.text(), create.text(), create.text()], ["R", "G", "B"]);
    assert!(create.0.is_empty());
    let mut pictures = Vec::new();
    for _ in 0..5 {
        let mut update = next();
        assert_eq!((update.bytes(), update.text().as_str(), update.int()), ([6, 0], "cbox_vol2", 3));
        assert_eq!([update.text(), update.text(), update.text()], ["R", "G", "B"]);
        assert_eq!([update.int(), update.int(), update.int(), update.int()], [0, 0, 40, 24]);
        let layout: [u64; 6] = [(); 6].map(|()| u64::from_le_bytes(update.bytes()));
        assert_eq!(layout, [0, 1, 2, 3, 3, 3]);
        assert_eq!(update.0.len(), 40 * 24 * 3 * 4);
        pictures.push(update.0);
    }
    assert!(rest.0.is_empty());
    assert!(pictures.windows(2).all(|p| p[0] != p[1]));
}

#[test]
fn a_render_goes_on_without_its_viewer() {
    let (_, outcome) = shown(100);
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let sandbox = Sandbox::new();
    // Nobody listens at a port that was just given back.
    let nobody = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let outcome = sandbox.run(&args("a.exr", &["--display", &nobody]));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    assert!(outcome.stderr.starts_with(&format!("warning: --display {nobody}: ")), "{}", outcome.stderr);
    assert_eq!(sandbox.files(), ["a.exr", "a.png"]);
}
