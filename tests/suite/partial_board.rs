//! A leaderboard of partial results: a scene shows the methods that were scored on it.

use super::command::{baseline, build, mateval, run, score};
use super::sample::{files_below, write_source};

#[test]
fn rooms_and_pictures_leave_out_methods_that_were_not_scored_there() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let head = "resolution = [32, 24]\natlas_size = 64\nviews = []";
    let recipe = write_source(&place("source"), head, &["room", "twin"]);
    run(&mut build(&recipe, &place("dataset"))).ends_with(0);
    for name in ["gt", "grey"] {
        run(&mut baseline(name, &place("dataset"), &place(name))).ends_with(0);
    }
    run(&mut score(&place("gt"), &place("dataset"), &place("gt.json"))).ends_with(0);
    run(score(&place("grey"), &place("dataset"), &place("grey.json")).args(["--scene", "room"])).ends_with(0);
    let mut board = mateval();
    board.args(["eval", "leaderboard", "--partial", "gt.json", "grey.json", "--out", "site", "--dataset", "dataset"]);
    board.args(["--submission", "gt", "--submission", "grey"]).current_dir(folder.path());
    run(&mut board).ends_with(0);
    let shown = |part: &str| -> Vec<&str> {
        let folder = place("site").join(part);
        ["grey", "gt"].into_iter().filter(|id| folder.join(format!("{id}.js")).exists()).collect()
    };
    assert_eq!((shown("rooms/room"), shown("rooms/twin")), (vec!["grey", "gt"], vec!["gt"]));
    let pictures = |id: &str| {
        let mut scenes = files_below(&place("site/pictures").join(id));
        scenes.iter_mut().for_each(|file| *file = file.iter().take(1).collect());
        scenes.dedup();
        scenes
    };
    assert_eq!((pictures("gt").len(), pictures("grey")), (2, vec!["room".into()]));
    let page = std::fs::read_to_string(place("site/rooms/twin.html")).unwrap();
    assert!(page.contains("value=\"gt\"") && !page.contains("value=\"grey\""), "{page}");
}
