//! `mateval graph`: procedural materials.

use super::command::{mateval, run};

const GOOD: &str = include_str!("../../crates/procedural/library/checks.mtlx");

#[test]
fn the_library_is_listed() {
    let list = run(mateval().args(["graph", "list"])).ends_with(0);
    assert_eq!(list.stdout.lines().count(), 28);
    list.prints("herringbone     lattice").prints("parameters  blocks at right angles");
    let list = run(mateval().args(["graph", "list", "checks"])).ends_with(0);
    list.prints("size_u             float    0.1                0.005 to 1     width of a field, in metres\n");
    let list = run(mateval().args(["graph", "list", "--format", "json"])).ends_with(0);
    let list: serde_json::Value = serde_json::from_str(&list.stdout).unwrap();
    assert_eq!(list["format"], "mateval-graphs/1");
    assert_eq!(list["graphs"].as_array().unwrap().len(), 28);
    run(mateval().args(["graph", "list", "check"])).ends_with(2).says("neither a .mtlx file nor a built-in graph");
}

#[test]
fn files_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let good = folder.path().join("good.mtlx");
    std::fs::write(&good, GOOD).unwrap();
    let bad = folder.path().join("bad.mtlx");
    std::fs::write(&bad, GOOD.replace("<fract ", "<bump ").replace("</fract>", "</bump>")).unwrap();
    let words = ["graph", "check", "good.mtlx"];
    let found = run(mateval().current_dir(folder.path()).args(words)).ends_with(0);
    assert_eq!((found.stdout.as_str(), found.stderr.as_str()), ("good.mtlx: good\n", ""));
    let found = run(mateval().current_dir(folder.path()).args(words).arg("bad.mtlx")).ends_with(1);
    found.prints("good.mtlx: good\nbad.mtlx: line ").prints("[unknown_node]");
    run(mateval().current_dir(folder.path()).args(["graph", "check", "no.mtlx"]))
        .ends_with(2)
        .says("cannot read 'no.mtlx'");
}

#[test]
fn pictures_are_rendered_and_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let render = |words: &[&str]| {
        let common = ["graph", "render", "checks", "--resolution", "40", "--size", "0.2", "--out", "out.png"];
        run(mateval().current_dir(folder.path()).args(common).args(words))
    };
    let found = render(&["--set", "color_b=0,0,1", "--set", "color_a=1,1,1"]).ends_with(0);
    assert_eq!(found.stdout, "out.png\n");
    let picture = image::open(folder.path().join("out.png")).unwrap().to_rgb8();
    assert_eq!(picture.dimensions(), (40, 40));
    // Fields of 0.1 metres: 20 pixels. The lower left one has the first colour, and its neighbours the second.
    let at = |x: u32, y: u32| picture.get_pixel(x, y).0;
    assert_eq!(
        [at(10, 30), at(30, 30), at(10, 10), at(30, 10)],
        [[255, 255, 255], [0, 0, 255], [0, 0, 255], [255, 255, 255],]
    );
    render(&[]).ends_with(2).says("'out.png' already exists");
    render(&["--force", "--set", "size_u=7"]).ends_with(2).says("'size_u' of 'checks': expected 0.005 to 1, found 7");
    render(&["--force", "--set", "sise=7"]).ends_with(2).says("has no parameter 'sise'");
    render(&["--force"]).ends_with(0);
    let file = folder.path().join("broken.mtlx");
    std::fs::write(&file, "<materialx/>").unwrap();
    let words = ["graph", "render", "broken.mtlx", "--out", "other.png"];
    run(mateval().current_dir(folder.path()).args(words))
        .ends_with(2)
        .says("broken.mtlx: line 1: <materialx>: expected");
    assert!(!folder.path().join("other.png").exists());
}
