//! `vdf compare`.

use crate::sandbox::Sandbox;

#[test]
fn identical_and_different() {
    let sandbox = Sandbox::new();
    sandbox.render(&["-o", "a.exr", "-j", "1"]);
    sandbox.render(&["-o", "b.exr", "-j", "2", "--method", "none"]);
    sandbox.render(&["-o", "c.exr", "--seed", "1"]);
    let same = sandbox.run(&["compare", "a.exr", "b.exr"]).succeeded();
    assert_eq!(same.stdout, "mse: 0e0\nrelmse: 0e0\nidentical: yes\n");
    let other = sandbox.run(&["compare", "a.exr", "c.exr"]).succeeded().stdout;
    let figure = |name| other.lines().find_map(|l| l.strip_prefix(name)).unwrap().parse::<f64>().unwrap();
    assert!(figure("mse: ") > 0.0 && figure("relmse: ") > 0.0 && other.ends_with("identical: no\n"), "{other}");
}

#[test]
fn sizes_differ() {
    let sandbox = Sandbox::new();
    sandbox.render(&["-o", "a.exr"]);
    sandbox.render(&["-o", "b.exr", "--crop", "0,0,8,4"]);
    sandbox.fails(&["compare", "a.exr", "b.exr"], 2, &["differ in size: 16 x 16 and 8 x 4"]);
}

#[test]
fn unreadable() {
    let sandbox = Sandbox::new();
    sandbox.render(&["-o", "a.exr"]);
    sandbox.fails(&["compare", "a.exr", "no.exr"], 1, &["cannot read no.exr: No such file"]);
    sandbox.fails(&["compare", ".", "a.exr"], 1, &["cannot read ."]);
    sandbox.fails(&["compare", "a.png", "a.exr"], 1, &["cannot read a.png"]);
    std::fs::write(sandbox.path().join("cut.exr"), &sandbox.read("a.exr")[..200]).unwrap();
    sandbox.fails(&["compare", "cut.exr", "a.exr"], 1, &["cannot read cut.exr"]);
}
