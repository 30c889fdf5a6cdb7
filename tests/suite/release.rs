//! The report of a release: what it states, what it refuses, and what it must not state while the truth is withheld.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mateval_prep::compare::file::CompareFile;
use mateval_report::release::ReleaseFile;
use mateval_testkit::{copy_folder, kept_folder};
use serde_json::{Value, json};

use super::command::{Run, baseline, mateval, run, score};
use super::sample::{copied_dataset, dataset, files_below, json, manifest, unrendered};

/// `mateval prep publish DATASET --report OUT`, and more words.
fn report<'a>(dataset: &Path, out: &Path, words: impl IntoIterator<Item = (&'a str, &'a Path)>) -> Run {
    let mut command = mateval();
    command.args(["prep", "publish"]).arg(dataset).arg("--report").arg(out);
    for (name, value) in words {
        command.arg(name).arg(value);
        // The sample's truth follows from the sample.
        command.args((name == "--withhold").then_some("--open-book"));
    }
    run(&mut command)
}

/// The words that split the dataset into folders of `out`.
fn split(out: &Path) -> [(&'static str, PathBuf); 3] {
    let folder = |name: &str| out.join(name);
    [("--withhold", "ground_truth".into()), ("--public", folder("public")), ("--private", folder("private"))]
}

fn page(out: &Path) -> String {
    std::fs::read_to_string(out.join("index.html")).unwrap()
}

fn stated(out: &Path) -> ReleaseFile {
    mateval_dataset::json::read(&out.join("release.json")).unwrap()
}

/// A comparison of the dataset's scene with one check a view; the first has this state.
fn verdict(dataset: &Path, state: &str) -> Value {
    let check = |state: &str| {
        json!({"picture": "depth", "quantity": "median_m", "state": state, "measured": 0.123456789, "bound": 0.001,
            "count": 9, "to_decide": null, "message": "median 123.456789 mm"})
    };
    let scene = json(&dataset.join("scenes/room/scene.json"));
    let ids = scene["views"].as_array().unwrap().iter().map(|view| view["id"].as_str().unwrap());
    let state_of = |at: usize| if at == 0 { state } else { "agrees" };
    let views: Vec<Value> =
        ids.enumerate().map(|(at, id)| json!({"view": id, "checks": [check(state_of(at))], "light": []})).collect();
    let file = json(&dataset.join("dataset.json"));
    json!({
        "format": "mateval-compare/4", "tool": "mateval 9.8.7",
        "dataset": {"name": file["name"], "version": file["version"], "manifest_sha256": file["manifest_sha256"]},
        "renderer": "blender", "bounds": mateval_prep::compare::file::BOUNDS,
        "agrees": state != "differs", "undecided": usize::from(state == "too_noisy"),
        "scenes": [{"scene": "room", "kinds": ["lambert"], "tile_bound": 0.01, "passes": [4],
            "seeds": ["0000000000000001", "0000000000000002"], "views": views}],
    })
}

/// Writes a verdict as the workflow does, in a folder for the scene.
fn write_verdict(folder: &Path, name: &str, verdict: &Value) -> PathBuf {
    serde_json::from_value::<CompareFile>(verdict.clone()).unwrap();
    write_json(&folder.join(name).join("compare.json"), verdict)
}

fn write_json(path: &Path, value: &Value) -> PathBuf {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, value.to_string()).unwrap();
    path.to_owned()
}

/// The results of the truth and of grey on the dataset without renders, which are scored within seconds.
static RESULTS: LazyLock<[PathBuf; 2]> = LazyLock::new(|| {
    let folder = kept_folder("release-results");
    ["gt", "grey"].map(|name| {
        let [submission, result] = [name.to_owned(), format!("{name}.json")].map(|name| folder.join(name));
        run(&mut baseline(name, unrendered(), &submission)).ends_with(0);
        run(&mut score(&submission, unrendered(), &result)).ends_with(0);
        result
    })
});

/// Every picture exists and is shown, and nothing is loaded from elsewhere.
fn check_pictures(out: &Path) {
    let html = page(out).replace("&#x2f;", "/");
    let mut shown: Vec<PathBuf> =
        html.split("<img src=\"").skip(1).map(|rest| rest.split('"').next().unwrap().into()).collect();
    shown.sort();
    shown.dedup();
    let files = files_below(out);
    let pictures: Vec<PathBuf> = files.iter().filter(|file| file.starts_with("pictures")).cloned().collect();
    assert_eq!(shown, pictures);
    assert_eq!(files.len(), pictures.len() + 2, "{files:?}");
    assert!(!html.contains("src=\"http") && !html.contains("href=\"http") && !html.contains("url("));
}

#[test]
fn the_report_states_what_the_release_is() {
    let folder = tempfile::tempdir().unwrap();
    write_verdict(&folder.path().join("verdicts"), "room", &verdict(dataset(), "agrees"));
    let verdicts = folder.path().join("verdicts");
    let outs = ["first", "second"].map(|name| folder.path().join(name));
    for out in &outs {
        let words = [("--verdicts", verdicts.as_path()), ("--date", Path::new("2026-11-24"))];
        report(dataset(), out, words).ends_with(0).prints("1 scene, sound; renderers agree on 1 of 1 compared scenes");
        check_pictures(out);
    }
    // The same inputs give the same bytes.
    let [first, second] = outs;
    assert_eq!(files_below(&first), files_below(&second));
    for file in files_below(&first) {
        assert!(std::fs::read(first.join(&file)).unwrap() == std::fs::read(second.join(&file)).unwrap(), "{file:?}");
    }
    let (file, html) = (stated(&first), page(&first));
    let hash = &file.dataset.manifest_sha256;
    assert!(html.contains(hash) && file.citation.contains(hash.as_str()) && file.citation.contains("{2026}"));
    assert!(html.contains("5 of 5 checks agree") && !html.contains("not compared"));
    assert_eq!(file.scenes[0].noise.as_ref().unwrap().len(), 5);
    let steps: Vec<String> = file.scenes[0].costs.iter().map(|cost| format!("{:?}", cost.step)).collect();
    assert_eq!(steps, ["Build", "Render", "Scorer"]);
    assert!(file.scenes[0].costs.iter().all(|cost| cost.wall_seconds > 0.0 && cost.cpu_seconds.unwrap() > 0.0));
    assert_eq!(
        file.remake.unwrap().commands[1],
        "mateval prep render DATASET --renderer builtin --samples 1 --scorer-samples 2"
    );
    // What was not given is stated, with the way to give it.
    for text in ["The ceiling is not given", "--floor grey.json", "<h2 id=\"cite\">", "184", "13.2"] {
        assert!(html.replace("&#x2f;", "/").contains(text), "no '{text}'");
    }
    assert!(!html.contains("What fails"));
}

#[test]
fn scores_of_truth_and_grey_are_shown() {
    let out = tempfile::tempdir().unwrap();
    let [ceiling, floor] = RESULTS.each_ref().map(PathBuf::as_path);
    report(unrendered(), &out.path().join("report"), [("--ceiling", ceiling), ("--floor", floor)]).ends_with(0);
    let file = stated(&out.path().join("report"));
    let key = "albedo.novel.psnr".parse().unwrap();
    let [ceiling, floor] = [file.ceiling.unwrap(), file.floor.unwrap()];
    assert!(ceiling.summary[&key] > 30.0 && floor.summary[&key] < 15.0);
    assert_eq!((ceiling.method.as_str(), floor.method.as_str()), ("gt", "grey"));
    let html = page(&out.path().join("report"));
    assert!(html.contains(&format!("{:.2} – {:.2}", floor.summary[&key], ceiling.summary[&key])));
    assert!(html.contains("not rendered") && !html.contains("<img"));
}

#[test]
fn a_faulty_release_fails_and_says_where() {
    let (copy, folder) = (copied_dataset(), tempfile::tempdir().unwrap());
    std::fs::write(copy.path().join("scenes/room/ground_truth/lights.json"), "{}").unwrap();
    let out = folder.path().join("faulty");
    report(copy.path(), &out, []).ends_with(1).prints("1 scene, NOT sound; no scene compared");
    let html = page(&out).replace("&#x2f;", "/");
    assert!(html.contains("What fails") && html.contains("[changed_file] &#x27;scenes/room/ground_truth/lights.json"));
    // A verdict that does not agree.
    let verdict = write_verdict(folder.path(), "room", &verdict(dataset(), "differs"));
    let out = folder.path().join("differs");
    report(dataset(), &out, [("--verdicts", verdict.as_path())]).ends_with(1).prints("agree on 0 of 1");
    let html = page(&out);
    assert!(html.contains("What fails") && html.contains("4 of 5 checks agree, 1 differs"), "{html}");
    assert!(html.contains("median 123.456789 mm"));
    // The twin: a check that decides nothing is stated and is no fault of the release.
    let undecided = write_verdict(folder.path(), "undecided", &self::verdict(dataset(), "too_noisy"));
    let out = folder.path().join("too_noisy");
    report(dataset(), &out, [("--verdicts", undecided.as_path())]).ends_with(0).prints("agree on 1 of 1");
    let html = page(&out);
    assert!(html.contains("agree, 1 undecided") && html.contains("some checks of 1 are undecided"), "{html}");
}

#[test]
fn files_that_do_not_fit_are_refused_together() {
    let folder = tempfile::tempdir().unwrap();
    let verdicts = folder.path().join("verdicts");
    let change = |pointer: &str, value: Value| {
        let mut changed = verdict(dataset(), "agrees");
        *changed.pointer_mut(pointer).unwrap() = value;
        changed
    };
    write_verdict(&verdicts, "a_sound", &change("/tool", json!("mateval 1")));
    write_verdict(&verdicts, "b_repeated", &change("/tool", json!("mateval 1")));
    write_verdict(&verdicts, "c_foreign", &change("/dataset/manifest_sha256", json!("0".repeat(64))));
    write_verdict(&verdicts, "d_unknown", &change("/scenes/0/scene", json!("attic")));
    write_verdict(&verdicts, "e_contradicts", &change("/agrees", json!(false)));
    write_verdict(&verdicts, "f_partial", &change("/scenes/0/views/1/view", json!("elsewhere")));
    write_json(&verdicts.join("g_other.json"), &json!({"format": "mateval-lint/1"}));
    write_json(&verdicts.join("h_bad.json"), &json!({"format": "mateval-compare/4", "agrees": "yes"}));
    // Results of another dataset, and one that was changed.
    let [ceiling, floor] = RESULTS.each_ref().map(|path| json(path));
    let mut changed = floor;
    changed["protocols"]["mateval-3"]["fingerprint"] = json!("0".repeat(64));
    let [ceiling, floor] = [("gt", ceiling), ("grey", changed)]
        .map(|(name, result)| write_json(&folder.path().join(name).with_extension("json"), &result));
    let out = folder.path().join("report");
    let words = [("--verdicts", verdicts.as_path()), ("--ceiling", &ceiling), ("--floor", &floor)];
    let refused = report(dataset(), &out, words).ends_with(2);
    for (file, place) in [
        ("b_repeated/compare.json", "/scenes/0/scene"),
        ("c_foreign/compare.json", "/dataset/manifest_sha256"),
        ("d_unknown/compare.json", "/scenes/0/scene"),
        ("e_contradicts/compare.json", "/agrees"),
        ("f_partial/compare.json", "/scenes/0/views"),
        ("g_other.json", "/format"),
        ("h_bad.json", "/agrees"),
        ("gt.json", "/dataset/manifest_sha256"),
        ("grey.json", "/protocols/mateval-3/fingerprint"),
    ] {
        let lines: Vec<&str> = refused.stderr.lines().filter(|line| line.contains(file)).collect();
        assert!(lines.iter().any(|line| line.contains(&format!("' {place}:"))), "{file}: {}", refused.stderr);
    }
    assert!(!refused.stderr.contains("a_sound/compare.json' /"), "{}", refused.stderr);
    assert!(!out.exists());
    // The twins: a folder without verdicts, and a file that does not exist.
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    report(dataset(), &out, [("--verdicts", empty.as_path())]).ends_with(2).says("holds no .json file");
    report(dataset(), &out, [("--floor", empty.join("none.json").as_path())]).ends_with(2).says("cannot read");
}

/// All numbers with many digits, and all seeds, in a JSON value.
fn fingerprints(value: &Value) -> Vec<String> {
    match value {
        Value::Number(number) if number.to_string().len() > 8 => vec![number.to_string()],
        Value::String(text) if text.len() == 16 && text.bytes().all(|b| b.is_ascii_hexdigit()) => vec![text.clone()],
        Value::Array(all) => all.iter().flat_map(fingerprints).collect(),
        Value::Object(all) => all.values().flat_map(fingerprints).collect(),
        _ => Vec::new(),
    }
}

/// The numbers of the ground truth's render.json files.
fn truths_numbers() -> Vec<String> {
    let files = files_below(dataset()).into_iter().filter(|file| file.ends_with("render.json"));
    files.flat_map(|file| fingerprints(&json(&dataset().join(file)))).collect()
}

/// With one scene, every mean is that scene's score.
#[test]
fn a_hidden_split_does_not_leak_into_the_report() {
    let folder = tempfile::tempdir().unwrap();
    let verdict = write_verdict(folder.path(), "room", &verdict(dataset(), "differs"));
    let [hidden, shown] = ["hidden", "shown"].map(|name| folder.path().join(name));
    let halves = split(folder.path());
    let words = halves.iter().map(|(name, path)| (*name, path.as_path()));
    report(dataset(), &hidden, words.chain([("--verdicts", verdict.as_path())])).ends_with(1).prints("commitment ");
    report(dataset(), &shown, [("--verdicts", verdict.as_path())]).ends_with(1);
    check_pictures(&hidden);
    let texts = |out: &Path| page(out) + &std::fs::read_to_string(out.join("release.json")).unwrap();
    let [hidden_text, shown_text] = [texts(&hidden), texts(&shown)];
    // The twin: the other report states the noise.
    let numbers = truths_numbers();
    assert!(numbers.len() >= 4 * 5, "{numbers:?}");
    assert!(numbers.iter().filter(|number| shown_text.contains(number.as_str())).count() >= 2 * 5);
    for number in &numbers {
        assert!(!hidden_text.contains(number.as_str()), "{number} leaks");
    }
    assert!(shown_text.contains("123.456789") && !hidden_text.contains("123.456789"));
    assert!(hidden_text.contains("4 of 5 checks agree, 1 differs"));
    check_equal_to_public(&hidden, folder.path());
}

/// What the public tree alone gives is what the report states, except for the verdicts and how the truth was rendered.
fn check_equal_to_public(hidden: &Path, folder: &Path) {
    let [public, out] = ["public", "of_public"].map(|name| folder.join(name));
    copy_folder(&dataset().join(".build/costs"), &public.join(".build/costs"));
    let verdict = write_verdict(&folder.join("of_public_verdict"), "room", &verdict(&public, "differs"));
    report(&public, &out, [("--verdicts", verdict.as_path())]).ends_with(1);
    let [mut ours, mut theirs] = [hidden, &out].map(|out| json(&out.join("release.json")));
    for file in [&mut ours, &mut theirs] {
        file["rendered"].take();
    }
    assert_eq!(ours, theirs);
    let picture = "pictures/room.jpg";
    assert!(std::fs::read(hidden.join(picture)).unwrap() == std::fs::read(out.join(picture)).unwrap());
}

#[test]
fn scores_of_a_hidden_split_do_not_leak() {
    let folder = tempfile::tempdir().unwrap();
    let [ceiling, floor] = RESULTS.each_ref().map(PathBuf::as_path);
    let bounds = [("--ceiling", ceiling), ("--floor", floor)];
    let [hidden, shown] = ["hidden", "shown"].map(|name| folder.path().join(name));
    let halves = split(folder.path());
    report(unrendered(), &hidden, halves.iter().map(|(name, path)| (*name, path.as_path())).chain(bounds)).ends_with(0);
    report(unrendered(), &shown, bounds).ends_with(0);
    let scores: Vec<String> =
        RESULTS.iter().flat_map(|path| fingerprints(&json(path)["protocols"]["mateval-3"]["scenes"])).collect();
    let texts = [&hidden, &shown].map(|out| std::fs::read_to_string(out.join("release.json")).unwrap() + &page(out));
    assert!(scores.len() > 20, "{scores:?}");
    for score in &scores {
        assert!(!texts[0].contains(score.as_str()) && texts[1].contains(score.as_str()), "{score}");
    }
    // Nor do they after they were rounded.
    let rounded = |at: usize| {
        texts[at]
            .contains(&format!("{:.2} –", stated(&shown).floor.unwrap().summary[&"albedo.novel.psnr".parse().unwrap()]))
    };
    assert_eq!([rounded(0), rounded(1)], [false, true]);
}

#[test]
fn only_reports_are_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("report");
    report(unrendered(), &out, []).ends_with(0);
    report(unrendered(), &out, []).ends_with(2).says("add --force");
    let force = |out: &Path| {
        let mut command = mateval();
        command.args(["prep", "publish", "--force"]).arg(unrendered()).arg("--report").arg(out);
        run(&mut command)
    };
    force(&out).ends_with(0);
    std::fs::write(folder.path().join("notes.txt"), "mine").unwrap();
    force(folder.path()).ends_with(2).says("is not the report of a release");
    let inside = unrendered().join("report");
    report(unrendered(), &inside, []).ends_with(2).says("would lie in the dataset");
    let halves = split(&folder.path().join("split"));
    let words = halves.iter().map(|(name, path)| (*name, path.as_path()));
    report(unrendered(), &folder.path().join("split/public/report"), words)
        .ends_with(2)
        .says("choose another --report");
    // Replacing the report would delete the split.
    let words = halves.iter().map(|(name, path)| (*name, path.as_path()));
    report(unrendered(), &folder.path().join("split"), words).ends_with(2).says("choose another --report");
    assert!(!inside.exists() && !folder.path().join("split").exists());
    // Neither a part to withhold nor a report.
    run(mateval().args(["prep", "publish"]).arg(unrendered())).ends_with(2).says("--report");
    let day = report(unrendered(), &out, [("--date", Path::new("today"))]).ends_with(2);
    assert!(day.stderr.contains("is not a day"), "{}", day.stderr);
}

/// `dataset.json` is not part of its own identity, so that anybody can change the name.
#[test]
fn names_are_text() {
    let (copy, out) = (copied_dataset(), tempfile::tempdir().unwrap());
    let path = copy.path().join("dataset.json");
    let mut file = json(&path);
    file["name"] = json!("</title><script>alert(1)</script>{{ 7 * 7 }}");
    write_json(&path, &file);
    let out = out.path().join("report");
    report(copy.path(), &out, [("--url", Path::new("javascript:alert(1)"))]).ends_with(0);
    let html = page(&out);
    assert_eq!(html.matches("<script").count(), 1);
    assert!(html.contains("&lt;script&gt;alert(1)") && html.contains("{{ 7 * 7 }}"));
    assert!(!html.contains("href=\"javascript"));
}

/// The manifest is the same however long the work took.
#[test]
fn costs_are_no_part_of_the_dataset() {
    assert!(dataset().join(".build/costs/room.json").is_file());
    assert!(!manifest(dataset()).contains("costs"));
}
