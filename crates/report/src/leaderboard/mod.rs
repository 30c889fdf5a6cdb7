//! The leaderboard as a static site that opens from the disk.
//!
//! In: results under one protocol, and optionally pictures. Out: a folder with pages for the board, for each method and
//! scene, for the protocol and errata, and with the numbers as files.
//!
//! `entries` lists the files of a folder, reads them and refuses those that cannot make a board. `pictures` and `rooms`
//! gather what is shown beside numbers. `board` holds all of it, with the `columns` of scores and facts about methods.
//! The other files are pages: each collects the values for its template in `templates`, and `site` writes it. No page
//! needs a server or loads anything from elsewhere.

mod board;
mod board_page;
mod columns;
mod curves;
pub mod entries;
pub mod file;
pub mod marks;
mod method_page;
mod pictures;
mod reference_pages;
mod robustness;
mod rooms;
mod scene_page;
mod site;
mod votes_page;

use std::collections::BTreeSet;
use std::path::Path;

use mateval_dataset::dataset::Secrecy;
use mateval_dataset::{Progress, Report};
use mateval_eval::protocol::Protocol;
use mateval_files::work_folder::{WorkFolder, check_free};

use self::board::Board;
pub use self::entries::{Hub, LeaderboardPlan, Submissions};
use self::file::LEADERBOARD_PATH;
pub use self::pictures::{check_may_be_shown, keep_seen};
use self::site::{CONSTANCY, CONTAMINATION, PAGES, PERTURBED, ROBUSTNESS, Site, SiteWriter, VOTES, WIDE_VIEWS};
use crate::error::ReportError;
use crate::ranking::rank;

/// Writes the site into the folder `out`, completely or not at all. Replaces a leaderboard that exists there if
/// `force`, and never replaces anything else.
pub fn write(plan: &LeaderboardPlan<'_>, out: &Path, force: bool, progress: Progress<'_>) -> Result<(), ReportError> {
    check_place(out, force)?;
    let falls = robustness::falls(plan)?;
    progress(Report::step("ranking", 0, 1));
    let ranking = rank(plan.results, plan.protocol, plan.partial)?;
    let ceiling = plan.ceiling.map(|result| board::ceiling(result, &ranking)).transpose()?;
    let work = WorkFolder::start(out)?;
    let named = pictures::named(plan, &ranking)?;
    if plan.votes && plan.pictures.is_none() && named.len() < 2 {
        return Err(ReportError::NothingToVoteOn);
    }
    let pictures = pictures::gather(plan, &named, &ranking, &work.path().join("pictures"), progress)?;
    let rooms = rooms::write(plan, &named, &ranking, &work.path().join("rooms"), progress)?;
    let board = Board::new(plan, ranking, ceiling, pictures, rooms);
    let site = SiteWriter::new(work.path(), site(&board, plan));
    site.assets()?;
    board_page::write_downloads(&board, plan.protocol, &site)?;
    if let Some(hub) = &plan.hub {
        board_page::write_hub(&board, hub, &site)?;
    }
    board_page::write(&board, &site)?;
    let pages = board.heads.len() + board.ranking().scenes.len();
    for at in 0..board.heads.len() {
        progress(Report::step("pages", at, pages));
        method_page::write(&board, at, &site)?;
    }
    for at in 0..board.ranking().scenes.len() {
        progress(Report::step("pages", board.heads.len() + at, pages));
        scene_page::write(&board, at, &site)?;
    }
    scene_page::write_list(&board, &site)?;
    scene_page::write_rooms(&board, &site)?;
    curves::write_wide_views(&board, &site)?;
    curves::write_perturbed(&board, &site)?;
    curves::write_constancy(&board, &site)?;
    robustness::write(&board, &site)?;
    robustness::write_contamination(&board, falls.as_ref(), &site)?;
    if plan.votes {
        votes_page::write(&board, &site)?;
    }
    reference_pages::write(&board, plan, &site)?;
    Ok(work.finish()?)
}

fn check_place(out: &Path, force: bool) -> Result<(), ReportError> {
    if !out.exists() || out.read_dir().is_ok_and(|mut files| files.next().is_none()) {
        return Ok(());
    }
    if !out.join(LEADERBOARD_PATH).is_file() {
        return Err(ReportError::NotALeaderboard { path: out.to_owned() });
    }
    Ok(check_free(out, force, "--out")?)
}

fn site(board: &Board<'_>, plan: &LeaderboardPlan<'_>) -> Site {
    let (dataset, ranking) = (&board.file.dataset, board.ranking());
    Site {
        title: format!("{} {} leaderboard", dataset.name, dataset.version),
        tool: board.file.tool.clone(),
        protocol: ranking.protocol.clone(),
        captured: board.scores.iter().any(|scores| scores.protocol.measured.is_some()),
        protocol_words: match ranking.protocol.as_str() {
            Protocol::DEFAULT => String::new(),
            other => format!(" --protocol {other}"),
        },
        fingerprint: ranking.fingerprint.clone(),
        scenes: ranking.scenes.len(),
        houses: ranking.houses.values().collect::<BTreeSet<_>>().len(),
        withheld: board.results.first().and_then(|result| result.dataset.withheld).map(Secrecy::text),
        has_intervals: board.has_intervals(),
        least_houses: ranking.rules.least_houses,
        pages: PAGES
            .into_iter()
            .chain(curves::has_wide_views(board).then_some(WIDE_VIEWS))
            .chain(curves::has_perturbed(board).then_some(PERTURBED))
            .chain(curves::has_constancy(board).then_some(CONSTANCY))
            .chain(robustness::has_page(board).then_some(ROBUSTNESS))
            .chain(plan.original.map(|_| CONTAMINATION))
            .chain(plan.votes.then_some(VOTES))
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    //! A small site of invented results; tests in a browser are in `tests/site`.

    use mateval_dataset::submission::Cost;
    use mateval_dataset::{SceneId, json};
    use mateval_eval::protocol::SCORER_VERSION;
    use mateval_eval::result::key::ResultKey;
    use mateval_eval::result::{Constancy, Deviation, MeasuredValues, ResultFile, TracerCheck};
    use mateval_image::{Picture, png_io};

    use super::file::LeaderboardFile;
    use super::marks::Verified;
    use super::*;
    use crate::ranking::tests::{result, scores};

    fn three() -> [ResultFile; 3] {
        let mut results =
            [("good", 30.0), ("<b>bold</b>", 25.0), ("bad", 20.0)].map(|(name, psnr)| result(name, &scores(psnr, 0.1)));
        results[0].submission.url = Some("https://example.org/?a=1&b=2".to_owned());
        results[1].submission.url = Some("javascript:alert(1)".to_owned());
        results[2].submission.cost = Some(Cost { seconds_a_scene: 12.34, hardware: "a laptop".to_owned() });
        results
    }

    fn plan(results: &[ResultFile]) -> LeaderboardPlan<'_> {
        LeaderboardPlan {
            results,
            ceiling: None,
            verified: vec![Verified::Confirmed, Verified::Claimed, Verified::Stale],
            protocol: "mateval-3",
            partial: false,
            errata: None,
            about: Some("Send it to *us*."),
            pictures: None,
            submissions: None,
            votes: false,
            original: None,
            hub: None,
            tool: "mateval".to_owned(),
        }
    }

    fn quiet(_: Report<'_>) {}

    #[test]
    fn a_site_has_all_its_pages() {
        let folder = tempfile::tempdir().unwrap();
        let (set, out) = (folder.path().join("set"), folder.path().join("site"));
        let results = three();
        let view = mateval_dataset::ViewId::new("input").unwrap();
        for (method, kind) in
            [("good", "albedo"), ("good", "albedo-error"), (pictures::TRUTH, "albedo"), ("no id", "x")]
        {
            let path = pictures::place(&set, method, &results[0].dataset.scenes[0], &view, kind);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            png_io::write_rgb_bytes(&path, &Picture::filled(8, 6, [90; 3])).unwrap();
        }
        write(&LeaderboardPlan { pictures: Some(&set), ..plan(&results) }, &out, false, &quiet).unwrap();
        let text = |file: &str| std::fs::read_to_string(out.join(file)).unwrap();
        let index = text("index.html");
        assert!(index.contains("&lt;b&gt;bold&lt;&#x2f;b&gt;") && !index.contains("<b>bold"), "{index}");
        assert_eq!((index.matches("> verified</span>").count(), index.matches("12.3<small>").count()), (1, 1));
        assert!(text("methods/good.html").contains("href=\"https:&#x2f;&#x2f;example.org&#x2f;?a=1&amp;b=2\""));
        assert!(!text("methods/b-bold-b.html").contains("javascript:"));
        let scene = text("scenes/s00.html");
        assert!(
            scene.contains("data-kinds=\"albedo albedo-error\"") && scene.contains("width=\"8\" height=\"6\""),
            "{scene}"
        );
        // Every page with pictures says once what black is; the twin has no pictures.
        for (file, legends) in [
            ("index.html", 1),
            ("methods/good.html", 1),
            ("scenes.html", 1),
            ("scenes/s00.html", 1),
            ("scenes/s01.html", 0),
        ] {
            assert_eq!(text(file).matches("Black areas of the pictures").count(), legends, "{file}");
        }
        assert!(text("scenes/s01.html").contains("No pictures were given"));
        // Without a dataset there are no rooms, and the page says why.
        assert!(scene.contains("There is no 3D view") && !out.join("rooms").exists());
        assert!(text("protocol.html").contains(&results[0].protocols["mateval-3"].fingerprint));
        assert!(text("errata.html").contains("None are known"));
        assert!(out.join("pictures/good/s00/input/albedo-error.png").is_file() && !out.join("pictures/no id").exists());
        let file: LeaderboardFile = json::read(&out.join(LEADERBOARD_PATH)).unwrap();
        assert_eq!((file.methods.len(), file.ranking.keys.len()), (3, 2));
        let lines = text("downloads/leaderboard.csv").lines().count();
        assert_eq!((lines, text("methods/bad.csv").lines().count()), (1 + 3 * 2, 1 + 12));
    }

    /// Pictures of two methods and of the truth in one view, of a third in no view: one pair.
    #[test]
    fn people_vote_on_pictures_beside_the_truth() {
        let folder = tempfile::tempdir().unwrap();
        let (set, out) = (folder.path().join("set"), folder.path().join("site"));
        let mut results = three();
        results[2].submission.oracle = true;
        let view = mateval_dataset::ViewId::new("input").unwrap();
        let add = |method: &str, kind: &str| {
            let path = pictures::place(&set, method, &results[0].dataset.scenes[0], &view, kind);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            png_io::write_rgb_bytes(&path, &Picture::filled(8, 6, [90 + method.len() as u8; 3])).unwrap();
        };
        [pictures::TRUTH, "good", "bad"].into_iter().for_each(|method| add(method, "albedo"));
        let with_votes = |pictures| LeaderboardPlan { pictures, votes: true, ..plan(&results) };
        for pictures in [None, Some(set.as_path())] {
            let error = write(&with_votes(pictures), &out, false, &quiet).unwrap_err().to_string();
            assert!(error.contains("pictures of the truth and of two methods"), "{error}");
        }
        ["albedo", "albedo-error", "unknown"].into_iter().for_each(|kind| add("b-bold-b", kind));
        write(&with_votes(Some(&set)), &out, false, &quiet).unwrap();
        let page = std::fs::read_to_string(out.join("votes.html")).unwrap();
        let data = page.split("data-board=\"").nth(1).unwrap().split('"').next().unwrap();
        let data = data.replace("&quot;", "\"").replace("&#x2f;", "/").replace("&lt;", "<").replace("&gt;", ">");
        let data: serde_json::Value = serde_json::from_str(&data).unwrap();
        let [shown] = data["pictures"].as_array().unwrap().as_slice() else { panic!("{data}") };
        assert_eq!([&shown["scene"], &shown["view"], &shown["picture"]], ["s00", "input", "albedo"]);
        assert_eq!(data["methods"][1]["method"], "<b>bold</b>");
        // The files are those of the methods, and do not name them.
        let files = [(pictures::TRUTH, &shown["truth"]), ("good", &shown["methods"][0]["file"])];
        for (method, file) in files.into_iter().chain([("b-bold-b", &shown["methods"][1]["file"])]) {
            let file = file.as_str().unwrap();
            assert!(file.len() == 36 && !file.contains(method), "{file}");
            let bytes = |path: &std::path::Path| std::fs::read(path).unwrap();
            assert_eq!(
                bytes(&out.join("votes").join(file)),
                bytes(&out.join(format!("pictures/{method}/s00/input/albedo.png")))
            );
        }
        let ids: Vec<&serde_json::Value> = (0..2).map(|at| &shown["methods"][at]["id"]).collect();
        assert_eq!(ids, ["good", "b-bold-b"]);
        assert_eq!(data["fingerprint"], results[0].protocols["mateval-3"].fingerprint);
        assert!(std::fs::read_to_string(out.join("index.html")).unwrap().contains("votes.html"));
    }

    /// Its page and table exist only where a method answers twins; a method without contrast has a row and no point.
    #[test]
    fn constancy_has_a_page_where_methods_answer_twins() {
        let folder = tempfile::tempdir().unwrap();
        let mut results = three();
        let site = |results: &[ResultFile], name: &str| {
            let out = folder.path().join(name);
            write(&plan(results), &out, false, &quiet).unwrap();
            let [index, tables] =
                ["index.html", "downloads/tables.csv"].map(|file| std::fs::read_to_string(out.join(file)).unwrap());
            (std::fs::read_to_string(out.join("constancy.html")).ok(), index, tables)
        };
        let (page, index, tables) = site(&results, "without");
        assert!(page.is_none() && !index.contains("constancy.html") && !tables.contains("Constancy"));
        for (result, relative) in results.iter_mut().zip([Some(0.125), Some(0.5), None]) {
            let deviation = Deviation { linear: 0.01, relative, ..Deviation::default() };
            result.constancy = vec![Constancy {
                scene: result.dataset.scenes[0].clone(),
                lightings: vec!["warm_cool".parse().unwrap()],
                area_m2: 1.0,
                raw: deviation.clone(),
                aligned: deviation,
                mean_mse: 0.01,
                mean_delta_e: 5.0,
            }];
        }
        let (page, index, tables) = site(&results, "with");
        let page = page.unwrap();
        // Two charts of two points each, three rows each.
        assert_eq!((page.matches("r=\"3\"").count(), page.matches("<tr><th scope=\"row\"").count()), (4, 6), "{page}");
        assert!(page.contains("0.125") && page.contains("1 scene is shown again"), "{page}");
        assert!(index.contains("constancy.html") && tables.contains("Constancy"), "{tables}");
    }

    /// The pages of captured rooms list the measured regions with the answers of all methods. The twin has no regions.
    #[test]
    fn measured_regions_are_listed_with_the_answers() {
        let folder = tempfile::tempdir().unwrap();
        let mut results = three();
        let key: ResultKey = "measured.input.region_delta_e".parse().unwrap();
        for (result, predicted) in results.iter_mut().zip([1.0, 0.5, 0.0]) {
            let scene = result.dataset.scenes[0].clone();
            let scores = result.protocols.get_mut("mateval-3").unwrap();
            for (at, values) in scores.scenes.values_mut().enumerate() {
                values.insert(key, 10.0 + at as f64);
            }
            scores.summary.insert(key, 15.5);
            scores.measured = vec![MeasuredValues {
                scene,
                view: mateval_dataset::ViewId::new("input").unwrap(),
                region: "left <wall>".to_owned(),
                pixels: 321,
                predicted: [predicted, 0.0, 0.0],
                measured: [0.0, 1.0, 2.0],
                delta_e: 12.3456,
                measurement_delta_e: Some(0.75),
            }];
        }
        // A method that was not scored on the scene.
        results[2].protocols.get_mut("mateval-3").unwrap().measured.clear();
        let out = folder.path().join("site");
        write(&plan(&results), &out, false, &quiet).unwrap();
        let text = |file: &str| std::fs::read_to_string(out.join(file)).unwrap();
        let page = text("scenes/s00.html");
        let table = &page[page.find(">Measured colours</h2>").unwrap()..page.find("<h2>Scores</h2>").unwrap()];
        // In linear light 1 is #ff, 0.5 is #bc, and more than 1 is shown as 1.
        for words in ["left &lt;wall&gt;", "321", "0.750", "fill=\"#00ffff\"", "fill=\"#ff0000\"", "fill=\"#bc0000\""] {
            assert_eq!(
                table.matches(&format!(">{words}<")).count() + table.matches(&format!(" {words}/>")).count(),
                1,
                "{words}: {table}"
            );
        }
        assert_eq!(table.matches("12.346 #").count(), 2, "{table}");
        assert!(page.contains("there are no pictures of them"));
        assert!(!text("scenes/s01.html").contains("Measured colours</h2>"));
        // The number is a headline, on the pages of scenes and methods and on the board.
        let head = "Measured colours, input view <b>CIEDE2000</b>";
        assert!(page.contains(head) && text("methods/good.html").contains(head));
        assert!(text("index.html").contains("Measured colours, input view"));
    }

    /// The results of methods with these PSNR of albedo in novel views, raw and aligned, on the dataset with this
    /// manifest; scenes differ by up to 2 dB.
    fn redressed(manifest: &str, methods: &[(&str, [f64; 2])]) -> Vec<ResultFile> {
        let of_method = |(name, psnr): &(&str, [f64; 2])| {
            let mut result = result(name, &scores(20.0, 0.1));
            let protocol = result.protocols.get_mut("mateval-3").unwrap();
            for (at, values) in protocol.scenes.values_mut().enumerate() {
                values.extend(robustness::FALLS.into_iter().zip(psnr.map(|psnr| psnr + (at % 3) as f64)));
            }
            result.dataset.manifest_sha256 = manifest.to_owned();
            scored_anew(&mut result, SCORER_VERSION);
            result
        };
        methods.iter().map(of_method).collect()
    }

    fn scored_anew(result: &mut ResultFile, scorer_version: u32) {
        let ids: Vec<&SceneId> = result.dataset.scenes.iter().collect();
        let scores = result.protocols.get_mut("mateval-3").unwrap();
        scores.protocol.scorer_version = scorer_version;
        scores.fingerprint = scores.protocol.fingerprint(&result.dataset.manifest_sha256, &ids, None);
    }

    /// One method is made to fall in both numbers. Another one falls further in the raw number alone: its tint changed.
    #[test]
    fn the_method_that_falls_from_public_textures_is_named_first() {
        let folder = tempfile::tempdir().unwrap();
        let original =
            redressed("o", &[("tinted", [44.0, 27.0]), ("contaminated", [40.0, 41.0]), ("gone", [20.0, 20.0])]);
        let mut results =
            redressed("r", &[("tinted", [24.5, 26.25]), ("contaminated", [22.0, 23.0]), ("new", [30.0, 30.0])]);
        results[1].submission.trained_on = vec!["3D-FRONT".to_owned()];
        let out = folder.path().join("with");
        let text = |file: &str| std::fs::read_to_string(out.join(file)).unwrap();
        write(&LeaderboardPlan { original: Some(&original), ..plan(&results) }, &out, false, &quiet).unwrap();
        let page = text("contamination.html");
        let [first, second] = ["contaminated", "tinted"].map(|id| page.find(&format!("methods/{id}.html")).unwrap());
        assert!(first < second && page.contains("3D-FRONT"), "{page}");
        for fall in ["18.00", "19.50", "0.75"] {
            assert_eq!(page.matches(&format!("<td><b>{fall}</b></td>")).count(), if fall == "18.00" { 2 } else { 1 });
        }
        assert!(page.contains("on the original rooms: new.") && page.contains("on this board: gone."), "{page}");
        assert!(!page.contains("methods/new.html") && text("index.html").contains("contamination.html"));
        // The twin has no results on original rooms.
        let without = folder.path().join("without");
        write(&plan(&results), &without, false, &quiet).unwrap();
        let index = std::fs::read_to_string(without.join("index.html")).unwrap();
        assert!(!without.join("contamination.html").exists() && !index.contains("contamination.html"));
    }

    #[test]
    fn results_that_say_nothing_about_contamination_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let [methods, others] = [["a", "b", "c"], ["d", "e", "f"]].map(|names| names.map(|name| (name, [20.0, 20.0])));
        let results = redressed("r", &methods);
        let out = folder.path().join("site");
        let refused = |original: &[ResultFile]| {
            let plan = LeaderboardPlan { original: Some(original), ..plan(&results) };
            write(&plan, &out, false, &quiet).unwrap_err().to_string()
        };
        let error = refused(&results);
        assert!(error.contains("the board's own dataset"), "{error}");
        let error = refused(&redressed("o", &others));
        assert!(error.contains("no method of the board (a, b, c)") && error.contains("(d, e, f)"), "{error}");
        let mut older = redressed("o", &methods);
        older.iter_mut().for_each(|result| scored_anew(result, SCORER_VERSION - 1));
        let error = refused(&older);
        assert!(error.contains("different rules") && error.contains(&SCORER_VERSION.to_string()), "{error}");
        let mixed = [redressed("o", &methods[..1]), redressed("p", &methods[1..])].concat();
        let error = refused(&mixed);
        assert!(error.contains("--original: 'a' and 'b' have different fingerprints"), "{error}");
        assert!(refused(&[]).contains("none was given"));
        let without: Vec<ResultFile> = ["a", "b", "c"].map(|name| result(name, &scores(20.0, 0.1))).into();
        let error = refused(&without);
        assert!(error.contains("the page 'Contamination'"), "{error}");
        assert!(!out.exists());
        write(&LeaderboardPlan { original: Some(&redressed("o", &methods)), ..plan(&results) }, &out, false, &quiet)
            .unwrap();
    }

    /// The twins: the split is public, or no picture shows what is hidden.
    #[test]
    fn a_set_of_pictures_does_not_show_a_hidden_truth() {
        let view = mateval_dataset::ViewId::new("input").unwrap();
        let mut results = three();
        let check = |results: &[ResultFile], pictures: &[(&str, &str)]| {
            let set = tempfile::tempdir().unwrap();
            for (method, kind) in pictures {
                let path = pictures::place(set.path(), method, &results[0].dataset.scenes[0], &view, kind);
                std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                png_io::write_rgb_bytes(&path, &Picture::filled(8, 6, [90; 3])).unwrap();
            }
            check_may_be_shown(set.path(), results).map_err(|error| error.to_string())
        };
        let [truth, errors, shown] = [(pictures::TRUTH, "albedo"), ("good", "albedo-error"), ("good", "albedo")];
        check(&results, &[truth, errors, shown]).unwrap();
        results[2].dataset.withheld = Some(Secrecy::Secret);
        check(&results, &[shown]).unwrap();
        for picture in [truth, errors] {
            let error = check(&results, &[shown, picture]).unwrap_err();
            assert!(error.contains(picture.1) && error.contains("--with-ground-truth"), "{error}");
        }
    }

    #[test]
    fn the_ceiling_is_shown_and_not_ranked() {
        let folder = tempfile::tempdir().unwrap();
        let (results, ceiling) = (three(), result("gt", &scores(48.0, 0.0)));
        let out = folder.path().join("site");
        write(&LeaderboardPlan { ceiling: Some(&ceiling), ..plan(&results) }, &out, false, &quiet).unwrap();
        let index = std::fs::read_to_string(out.join("index.html")).unwrap();
        assert!(index.contains("<tfoot>") && index.contains("ceiling: the truth itself"), "{index}");
        let file: LeaderboardFile = json::read(&out.join(LEADERBOARD_PATH)).unwrap();
        assert_eq!(
            (file.ranking.methods.len(), file.ceiling.map(|ceiling| ceiling.method)),
            (3, Some("gt".to_owned()))
        );
        assert!(std::fs::read_to_string(out.join("downloads/tables.csv")).unwrap().contains("\"gt (ceiling)\""));
        let mut other = ceiling;
        other.dataset.scenes.pop();
        let plan = LeaderboardPlan { ceiling: Some(&other), ..plan(&results) };
        let error = write(&plan, &out, true, &quiet).unwrap_err().to_string();
        assert!(error.contains("'good' and 'gt' were scored on different scenes"), "{error}");
    }

    /// A board whose keeper says nothing asks for what is missing by name.
    #[test]
    fn the_page_about_shows_what_the_keeper_says_or_asks_for_it() {
        let folder = tempfile::tempdir().unwrap();
        let results = three();
        let out = folder.path().join("site");
        let page = |about: Option<&str>| {
            let verified = vec![Verified::Confirmed, Verified::Refuted, Verified::Stale];
            write(&LeaderboardPlan { about, verified, ..plan(&results) }, &out, true, &quiet).unwrap();
            std::fs::read_to_string(out.join("about.html")).unwrap()
        };
        let asks = "states no contact, licence, paper or date";
        let (said, silent) = (page(Some("Send it to *us*.")), page(None));
        assert!(said.contains("Send it to <em>us</em>.") && !said.contains(asks), "{said}");
        assert!(silent.contains(asks), "{silent}");
        for state in ["1 result is verified", "1 result is claimed", "1 result is refuted"] {
            assert!(said.contains(state), "{said}");
        }
    }

    /// The names are JSON strings, which YAML reads as they are. The twin is not on the Hub.
    #[test]
    fn a_board_on_the_hub_is_a_space_and_states_a_result_of_each_method() {
        let folder = tempfile::tempdir().unwrap();
        let mut results = redressed("m", &[("good", [30.0; 2]), ("fine", [25.0; 2]), ("gt", [48.0; 2])]);
        results[2].submission.oracle = true;
        let out = folder.path().join("site");
        let hub = Hub { dataset: "NAME/rooms".to_owned(), url: "https://example.org/board/".to_owned() };
        write(&LeaderboardPlan { hub: Some(hub), ..plan(&results) }, &out, false, &quiet).unwrap();
        let text = |file: &str| std::fs::read_to_string(out.join(file)).unwrap();
        let front = "---\ntitle: \"d 1 leaderboard\"\nsdk: static\napp_file: index.html\nlicense: other\ndatasets:\n- \
                     \"NAME/rooms\"\n---\n";
        assert_eq!(text("README.md"), front);
        let file: LeaderboardFile = json::read(&out.join(LEADERBOARD_PATH)).unwrap();
        let interval = file.ranking.keys[&robustness::FALLS[0]].standings[0].interval.unwrap();
        // The scenes differ by 0, 1 and 2 dB.
        let expected = format!(
            "- dataset: {{id: \"NAME/rooms\", task_id: albedo_novel_psnr}}\n  value: 31.00\n  source: {{url: \
             \"https://example.org/board/methods/good.html\", name: \"d 1 leaderboard\"}}\n  notes: \"protocol mateval-3, \
             fingerprint {}; confirmed; 95 % interval {:.2} to {:.2}, houses: 12\"\n",
            file.ranking.fingerprint, interval.low, interval.high
        );
        assert_eq!(text("downloads/eval_results/good.yaml"), expected);
        assert!(text("downloads/eval_results/fine.yaml").contains("; claimed; "));
        // What was made from the ground truth is no method.
        assert_eq!(std::fs::read_dir(out.join("downloads/eval_results")).unwrap().count(), 2);
        write(&plan(&results), &out, true, &quiet).unwrap();
        assert!(!out.join("README.md").exists() && !out.join("downloads/eval_results").exists());
    }

    /// The check that speaks most against the tracer is stated, and its absence.
    #[test]
    fn a_board_states_whether_the_tracer_was_checked() {
        let folder = tempfile::tempdir().unwrap();
        let line = |checks: [Option<(usize, usize)>; 3]| {
            let mut results = three();
            for (result, check) in results.iter_mut().zip(checks) {
                result.tracer_check = check.map(|(informative, agree)| TracerCheck { informative, agree });
            }
            let out = folder.path().join("site");
            write(&plan(&results), &out, true, &quiet).unwrap();
            let index = std::fs::read_to_string(out.join("index.html")).unwrap();
            index.lines().find(|line| line.contains("racer")).unwrap().to_owned()
        };
        let good = "<p class=\"small\">Tracer and Blender agree in 65 of 65 informative checks.</p>";
        let bad = "<p class=\"notice\">Tracer and Blender agree in 62 of 65 informative checks.</p>";
        let absent = "<p class=\"notice\">The tracer was not compared with Blender on this dataset.</p>";
        assert_eq!(line([None, Some((65, 65)), Some((65, 65))]), good);
        assert_eq!(line([Some((65, 62)), Some((65, 65)), None]), bad);
        assert_eq!(line([None; 3]), absent);
    }

    #[test]
    fn only_a_leaderboard_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let results = three();
        let out = folder.path().join("site");
        write(&plan(&results), &out, false, &quiet).unwrap();
        let error = write(&plan(&results), &out, false, &quiet).unwrap_err().to_string();
        assert!(error.contains("add --force"), "{error}");
        write(&plan(&results[..2]), &out, true, &quiet).unwrap();
        assert!(!out.join("methods/bad.html").exists());
        let other = folder.path().join("other");
        std::fs::create_dir(&other).unwrap();
        std::fs::write(other.join("mine.txt"), "mine").unwrap();
        let error = write(&plan(&results), &other, true, &quiet).unwrap_err().to_string();
        assert!(error.contains("is not a leaderboard") && other.join("mine.txt").exists(), "{error}");
    }
}
