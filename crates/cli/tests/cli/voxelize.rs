//! `vdf voxelize`.

use crate::sandbox::Sandbox;

fn lines<'a>(text: &'a str, start: &'a str) -> impl Iterator<Item = &'a str> {
    text.lines().filter(move |l| l.starts_with(start))
}

#[test]
fn figures_only() {
    let sandbox = Sandbox::new();
    let out = sandbox.run(&["voxelize", "--voxel", "8", "--grid", "scene"]).succeeded().stdout;
    assert!(
        out.starts_with("grid           77 x 73 x 169 voxels of 8\norigin         -32 -16 -789\noccupied "),
        "{out}"
    );
    assert!(out.contains(" of 949949, ") && out.contains("emitter 0      neighbourhood of "), "{out}");
    assert!(sandbox.files().is_empty());
    let out = sandbox.run(&["voxelize", "--method", "none"]).succeeded().stdout;
    assert!(!out.contains("emitter"), "{out}");
}

#[test]
fn exported_files() {
    let sandbox = Sandbox::new();
    let out = sandbox
        .run(&["voxelize", "cbox_vol3", "--voxel", "32", "--grid", "scene", "--export", "a/b"])
        .succeeded()
        .stdout;
    let wrote: Vec<_> = lines(&out, "wrote").map(|l| l.split_whitespace().nth(1).unwrap()).collect();
    let names = ["occupied.obj", "occupied.txt", "neighbourhood0.obj", "neighbourhood0.txt"];
    let names = names.into_iter().chain(["neighbourhood1.obj", "neighbourhood1.txt"]);
    assert_eq!(wrote, names.map(|n| format!("a/b/{n}")).collect::<Vec<_>>());

    // The figures, the list and the surface agree.
    let counts = |text: &str, word: usize| text.split_whitespace().nth(word).unwrap().parse::<usize>().unwrap();
    let occupied = counts(lines(&out, "occupied").next().unwrap(), 1);
    let of_emitters: Vec<_> = lines(&out, "emitter").map(|l| counts(l, 4)).collect();
    for (name, count) in
        ["occupied", "neighbourhood0", "neighbourhood1"].into_iter().zip([occupied].into_iter().chain(of_emitters))
    {
        let read = |extension| String::from_utf8(sandbox.read(&format!("a/b/{name}.{extension}"))).unwrap();
        let (list, surface) = (read("txt"), read("obj"));
        let header: Vec<_> = list.lines().take(2).collect();
        assert_eq!(header, [format!("# {count} of 16340 voxels").as_str(), "# resolution 20 19 43"], "{name}");
        assert!(list.contains("# origin -32 -16 -789\n# voxel size 32\n# linear index = a + b*X + c*X*Y\n"));
        assert_eq!(list.lines().filter(|l| !l.starts_with('#')).count(), count);
        assert!(count > 0 && lines(&surface, "v ").count() > 7 && lines(&surface, "f ").count() > 5, "{name}");
    }

    // A second run replaces the files; nothing else is left behind.
    sandbox.run(&["voxelize", "cbox_vol3", "--voxel", "64", "--export", "a/b"]).succeeded();
    assert_eq!(std::fs::read_dir(sandbox.path().join("a/b")).unwrap().count(), 6);
}

#[test]
fn failures() {
    let sandbox = Sandbox::new();
    sandbox.fails(&["voxelize", "nothing.xml"], 2, &["nothing.xml: no such file"]);
    sandbox.fails(&["voxelize", "--voxel", "0"], 2, &["--voxel must be a positive finite number, not 0"]);
    sandbox.fails(&["voxelize", "--voxel", "1e-9"], 2, &["the smallest usable voxel size is "]);
    sandbox.fails(&["voxelize", "-j", "0"], 2, &["--threads must be at least 1"]);
    sandbox.fails(&["voxelize", "--method", "magic"], 2, &["magic", "amr-sn"]);
    sandbox.write("file", "");
    sandbox.fails(&["voxelize", "--voxel", "64", "--export", "file"], 1, &["cannot make the folder file"]);
    std::fs::create_dir_all(sandbox.path().join("d/occupied.txt")).unwrap();
    let outcome = sandbox.run(&["voxelize", "--voxel", "64", "--export", "d"]);
    outcome.failed(1, &["cannot write d/occupied.txt"]);
}
