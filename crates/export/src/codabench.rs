//! A competition for Codabench, in version 2 of its bundles
//! (<https://docs.codabench.org/latest/Organizers/Benchmark_Creation/Yaml-Structure/>).
//!
//! A task is a slice of the scenes that can be scored within the platform's time limit: its `reference_data` is the
//! dataset with these scenes and their truth, and all tasks share a scoring program, a shell script that runs the
//! command in the competition's image. Codabench shows the columns of each task side by side and ranks by those of the
//! first, so a board has one slice if its queue allows.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use mateval_dataset::layout::{DATASET, MANIFEST};
use mateval_dataset::open::{Dataset, check_outside, is_below};
use mateval_dataset::withheld::WITHHELD;
use mateval_dataset::{DatasetError, Progress, Report, SceneId, manifest};
use mateval_files::work_folder::WorkFolder;
use serde_json::Value;

use crate::dataset::{ExportError, Format, SoundDataset, copy_file, inert, shown_views, write_file};

const SCORE: &str = include_str!("codabench_score.sh");
const PROTOCOL: &str = include_str!("../../../dataset_spec/PROTOCOL.md");
const SUBMISSION: &str = include_str!("../../../dataset_spec/format/submission.md");
const RULES: &str = include_str!("codabench_terms.md");

/// What a bundle is made from.
#[derive(Clone, Debug)]
pub struct Competition {
    pub dataset: PathBuf,
    /// The private folder of a split whose public folder is `dataset`; absent if `dataset` holds its truth.
    pub private: Option<PathBuf>,
    /// For a hidden split: results of baselines that anybody can make, on all scenes. Participants see numbers that are
    /// better than theirs (`eval score --floor`).
    pub floors: Vec<PathBuf>,
    pub out: PathBuf,
    /// Name and tag of the image on Docker Hub.
    pub image: String,
    /// The name of the protocol that the columns belong to.
    pub protocol: String,
    pub columns: Vec<Column>,
    /// How long a scene takes to score, in seconds; without it all scenes are one task.
    pub seconds_a_scene: Option<u32>,
    /// The most seconds that a task may take.
    pub limit: u32,
    /// Where the public files can be downloaded.
    pub url: Option<String>,
    /// The day on which the board opens, as in `2026-11-24`.
    pub date: Option<String>,
}

/// A column of the board.
#[derive(Clone, Debug)]
pub struct Column {
    /// The key of a result, as in `albedo.novel.psnr`.
    pub key: String,
    pub higher_is_better: bool,
    pub digits: usize,
}

/// Writes the bundle as a folder, and returns the numbers of its scenes and tasks. Fails before anything is written where
/// the dataset is not whole, no scene fits the limit, or the output exists; and where the truth is not complete.
pub fn export(competition: &Competition, progress: Progress<'_>) -> Result<(usize, usize), ExportError> {
    if competition.out.exists() {
        return Err(ExportError::Exists { path: competition.out.clone() });
    }
    for root in competition.private.iter().chain([&competition.dataset]) {
        check_outside(&competition.out, root, "--out")?;
    }
    let per_task = match competition.seconds_a_scene {
        Some(seconds) if seconds > competition.limit => {
            return Err(ExportError::SceneOverLimit { seconds, limit: competition.limit });
        }
        Some(seconds) => (competition.limit / seconds.max(1)) as usize,
        None => usize::MAX,
    };
    let SoundDataset { mut dataset, mut files } =
        SoundDataset::open(&competition.dataset, Format::Croissant, progress)?;
    // Tasks are slices of the scored scenes. The twins of a scene lie in its task.
    (dataset.twins, dataset.scenes) =
        dataset.scenes.into_iter().partition(|scene| dataset.file.twins.contains_key(&scene.id));
    // What a split withholds lies in its private folder, or with the rest.
    let truth = competition.private.as_ref().unwrap_or(&competition.dataset);
    let mut withheld = Vec::new();
    if competition.private.is_some() {
        withheld = manifest::list_files(truth)?;
        withheld.retain(|file| file.starts_with("scenes/"));
    }
    if truth.join(WITHHELD).is_file() {
        withheld.push(WITHHELD.to_owned());
    }
    files.extend([MANIFEST, DATASET].map(str::to_owned));

    let work = WorkFolder::start(&competition.out)?;
    let out = work.path();
    let ids: Vec<&SceneId> = dataset.scenes.iter().map(|scene| &scene.id).collect();
    let slices: Vec<&[&SceneId]> = ids.chunks(per_task.min(ids.len().max(1))).collect();
    for (at, slice) in slices.iter().enumerate() {
        progress(Report::part(&format!("task {}", at + 1), at, slices.len()));
        let slice: Vec<SceneId> = slice.iter().map(|id| (*id).clone()).collect();
        let twins = slice.iter().flat_map(|id| dataset.twins_of(id)).map(|twin| twin.id.clone());
        let slice: Vec<SceneId> = slice.iter().cloned().chain(twins).collect();
        let belongs = |file: &&String| !file.starts_with("scenes/") || is_below(file, &slice);
        let reference = out.join(format!("data/reference_{at}"));
        let public = files.iter().map(|file| (&competition.dataset, file));
        for (root, file) in public.chain(withheld.iter().map(|file| (truth, file))) {
            if belongs(&file) {
                copy_file(&root.join(file), &reference.join(file))?;
            }
        }
        // They state errors of instances, so they lie with the truth and not with the program, which is public.
        for (at, floor) in competition.floors.iter().enumerate() {
            copy_file(floor, &reference.join(format!("floor_{at}.json")))?;
        }
        // Truth that is missing, or not that of this dataset, is found here.
        let findings = manifest::check_those(&reference, |file| is_below(file, &slice))?;
        if !findings.is_empty() {
            return Err(DatasetError::Invalid { path: truth.clone(), findings }.into());
        }
    }
    write_program(competition, dataset.is_hidden(), &out.join("data/scoring_program"))?;
    if let Some(shown) = dataset.scenes.first().and_then(|scene| shown_views(&dataset, scene).into_iter().next()) {
        copy_file(&dataset.root.join(shown.picture), &out.join("logo.png"))?;
    }
    let pages = [
        ("overview.md", overview(competition, &dataset)),
        ("submission.md", without_relative_links(SUBMISSION)),
        ("protocol.md", without_relative_links(PROTOCOL)),
        ("terms.md", terms(&dataset)),
    ];
    for (file, text) in pages {
        write_file(&out.join("pages").join(file), text.as_bytes())?;
    }
    write_file(&out.join("competition.yaml"), competition_yaml(competition, &dataset, &slices).as_bytes())?;
    work.finish()?;
    Ok((ids.len(), slices.len()))
}

fn write_program(competition: &Competition, is_hidden: bool, out: &Path) -> Result<(), ExportError> {
    let numbers = if is_hidden { "rounded" } else { "whole" };
    let columns: String = competition.columns.iter().map(|column| format!("{}\n", column.key)).collect();
    let command = format!("command: sh /app/program/score.sh {numbers} {}\n", competition.protocol);
    write_file(&out.join("metadata.yaml"), command.as_bytes())?;
    write_file(&out.join("score.sh"), SCORE.as_bytes())?;
    write_file(&out.join("columns.txt"), columns.as_bytes())
}

/// `competition.yaml`. Texts are written as JSON strings, which YAML reads as they are.
fn competition_yaml(competition: &Competition, dataset: &Dataset, slices: &[&[&SceneId]]) -> String {
    let quoted = |text: &str| Value::from(text).to_string();
    let is_hidden = dataset.is_hidden();
    let (mut tasks, mut indexes) = (String::new(), String::new());
    for (at, slice) in slices.iter().enumerate() {
        let name = if slices.len() == 1 { "All scenes".to_owned() } else { format!("Scenes, part {}", at + 1) };
        // Writing to a String cannot fail.
        let _ = write!(
            tasks,
            "  - index: {at}\n    name: {}\n    description: {}\n    reference_data: data/reference_{at}\n    \
             scoring_program: data/scoring_program\n",
            quoted(&name),
            quoted(&format!("{} of {} scenes", slice.len(), dataset.scenes.len()))
        );
        let _ = writeln!(indexes, "      - {at}");
    }
    let mut columns = String::new();
    for (index, column) in competition.columns.iter().enumerate() {
        let _ = write!(
            columns,
            "      - title: {}\n        key: {}\n        index: {index}\n        sorting: {}\n        precision: {}\n",
            quoted(&column.key),
            quoted(&column.key.replace('.', "_")),
            if column.higher_is_better { "desc" } else { "asc" },
            column.digits
        );
    }
    // A tenth of the submissions from whose rounded numbers the mean colour of each instance follows, some 14 a room
    // (dataset_spec/guides/leaderboard_keeper.md); each slice has numbers of its own.
    let most = if is_hidden { (14 * dataset.scenes.len() / (10 * slices.len())).clamp(1, 100) } else { 100 };
    let _ = write!(
        tasks,
        "phases:\n  - index: 0\n    name: Submissions\n    start: {} 00:00:00\n    execution_time_limit: {}\n    \
         max_submissions_per_day: {}\n    max_submissions: {most}\n    accepts_only_result_submissions: True\n    \
         hide_output: {hidden}\n    hide_score_output: {hidden}\n    tasks:\n{indexes}",
        competition.date.as_deref().unwrap_or("2000-01-01"),
        competition.limit,
        if is_hidden { 1 } else { 5 },
        hidden = if is_hidden { "True" } else { "False" },
    );
    format!(
        "version: 2\ntitle: {}\ndescription: {}\nimage: logo.png\nterms: pages/terms.md\ndocker_image: {}\n\
         make_programs_available: True\nmake_input_data_available: False\nenable_detailed_results: True\npages:\n  \
         - title: Overview\n    file: pages/overview.md\n  - title: Submissions\n    file: pages/submission.md\n  \
         - title: Scores\n    file: pages/protocol.md\ntasks:\n{tasks}leaderboards:\n  - title: Results\n    key: main\n    \
         submission_rule: \"Add_And_Delete_Multiple\"\n    columns:\n{columns}{FACT_SHEET}",
        quoted(&dataset.file.name),
        quoted("Materials of the objects of a room, from one photo and the room's geometry"),
        quoted(&competition.image),
    )
}

/// What a submission states about itself.
const FACT_SHEET: &str = r#"fact_sheet:
  url: {"key": "url", "type": "text", "title": "Address of the method", "selection": "", "is_required": "false", "is_on_leaderboard": "true"}
  licence: {"key": "licence", "type": "text", "title": "Licence of the method", "selection": "", "is_required": "false", "is_on_leaderboard": "false"}
  trained_on: {"key": "trained_on", "type": "text", "title": "Datasets that the method was trained on", "selection": "", "is_required": "true", "is_on_leaderboard": "true"}
  cost: {"key": "cost", "type": "text", "title": "Seconds a scene, and the hardware", "selection": "", "is_required": "false", "is_on_leaderboard": "true"}
"#;

fn overview(competition: &Competition, dataset: &Dataset) -> String {
    let file = &dataset.file;
    let place = match &competition.url {
        Some(url) => format!("Download the dataset from <{url}>."),
        None => "The organisers state where the dataset can be downloaded.".to_owned(),
    };
    let is_captured = dataset.scenes.iter().any(|scene| !scene.source.kind.states_materials());
    let numbers = match (dataset.is_hidden(), is_captured) {
        (true, _) => "Scores are rounded to 0.1 dB or to their error, since exact ones give the truth away.",
        (false, true) => "The page of a submission shows all of its numbers.",
        (false, false) => "The page of a submission shows all of its numbers, and its base colours beside the truth.",
    };
    format!(
        "# {}\n\nA method gets a photo of a room and its geometry, and returns a base colour for each object, with \
         roughness and metallic if it predicts them.\n\n{place} Number of scenes: {}; SHA-256 of its manifest: \
         `{}`.\n\nHand in a .zip of the submission, without a file `metadata` or `metadata.yaml`: `mateval eval lint` checks it \
         in seconds.\n\n{numbers} Places of this table are those of single numbers; whether two methods differ is not \
         tested here.\n",
        inert(&file.name),
        dataset.scenes.len(),
        file.manifest_sha256
    )
}

/// The rules, and each licence once.
fn terms(dataset: &Dataset) -> String {
    let texts = dataset.file.shared_licences().into_iter().map(|licence| licence.text);
    let shown = |text: String| format!("\n```text\n{}\n```\n", text.trim_end().replace("```", "'''"));
    let unstated = dataset.unstated_licences().map(|text| format!("\nAsk the organisers: {text}.\n"));
    format!("{RULES}{}{}", texts.map(shown).collect::<String>(), unstated.unwrap_or_default())
}

/// The text with the words of its links to files in place of the links.
fn without_relative_links(text: &str) -> String {
    let (mut shown, mut rest) = (String::new(), text);
    while let Some((before, after)) = rest.split_once("](") {
        let (Some(start), Some((target, after))) = (before.rfind('['), after.split_once(')')) else { break };
        if target.starts_with("http") {
            let _ = write!(shown, "{before}]({target})");
        } else {
            let _ = write!(shown, "{}{}", &before[..start], &before[start + 1..]);
        }
        rest = after;
    }
    shown + rest
}

#[cfg(test)]
mod tests {
    #[test]
    fn links_to_other_files_become_their_words() {
        let text = "a ([keys](../k.json), [b](#c)) [d](https://e) f[0] g";
        assert_eq!(super::without_relative_links(text), "a (keys, b) [d](https://e) f[0] g");
        for page in [super::PROTOCOL, super::SUBMISSION] {
            let shown = super::without_relative_links(page);
            assert!(shown.len() > page.len() / 2 && !shown.contains("](../") && !shown.contains("](#"));
        }
    }
}
