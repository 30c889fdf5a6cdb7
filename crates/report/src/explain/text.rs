//! The explanation as text and as a page, with rounded numbers.

use std::fmt::Write as _;

use mateval_dataset::ViewId;
use mateval_dataset::progress::{Table, fitted, wrapped};

use mateval_eval::metric::PictureKind;
use mateval_eval::result::key::Views;

use super::file::{AlignedBy, AlignmentScores, ExplainFile, InstanceExplanation, KindShares, LightShare};
use super::scores::{LIGHTS, WORST};
use crate::strips::WHITE_ERROR;

/// A picture of one of the worst instances.
pub(super) struct Crop {
    /// Its file name; it lies in the page's folder.
    pub(super) file: String,
    /// The view that it shows.
    pub(super) view: ViewId,
}

const KINDS: &str = "\
Shares of the squared error of linear values. The error of surfaces that the photo does not show (hidden) comes first. Of
the rest, each step removes its share from the error that the steps before it leave:
one scale for each instance; one for each channel (chroma); a smooth factor in each view (shading left in the albedo); a
shift of up to 4 pixels (misplacement); detail of the truth that the prediction lacks (blur). No step removes the rest.";

/// The explanation as text, with aligned tables, for a terminal of `columns`; of any width if absent.
pub fn plain(file: &ExplainFile, columns: Option<usize>) -> String {
    let fit = |text: String| match columns {
        Some(columns) => fitted(&text, columns),
        None => text,
    };
    let mut parts = vec![fit(format!("{}\n{}", title(file), hidden(file)))];
    parts.extend(tables(file).iter().map(|table| table.text(columns)));
    // One paragraph where its own lines do not fit.
    let is_fit = columns.is_none_or(|columns| KINDS.lines().all(|line| line.chars().count() <= columns));
    let paragraph = |columns| wrapped(KINDS.split_whitespace(), "", "", columns).join("\n");
    let kinds = columns.filter(|_| !is_fit).map_or_else(|| KINDS.to_owned(), paragraph);
    parts.push(format!("{kinds}\n"));
    parts.extend(findings(file).map(fit));
    parts.join("\n")
}

/// A page with the tables and links to the pictures, in the order of the worst instances.
pub(super) fn markdown(file: &ExplainFile, crops: &[Crop]) -> String {
    let mut parts = vec![format!("# {}\n\n{}", title(file), hidden(file))];
    for (at, table) in tables(file).iter().enumerate() {
        parts.push(format!("## {}\n\n{}", table.title, rows_in_markdown(table)));
        if at == 0 {
            parts.push(format!("{KINDS}\n"));
        }
    }
    if !crops.is_empty() {
        parts.push(format!(
            "## The worst instances\n\nTruth, prediction, and the root of the mean squared error over channels: black 0, \
             red {:.2}, yellow {:.2}, white {WHITE_ERROR} and above.\n",
            WHITE_ERROR / 3.0,
            WHITE_ERROR / 1.5
        ));
    }
    for (crop, instance) in crops.iter().zip(&file.instances) {
        let (id, share) = (&instance.instance, percent(instance.share));
        parts.push(format!("### {id}: {share} %, view {}\n\n![{id}]({})\n", crop.view, crop.file));
    }
    parts.extend(findings(file));
    parts.join("\n")
}

fn title(file: &ExplainFile) -> String {
    format!(
        "{}, scene {}: albedo MSE {} (1e-3, linear), PSNR {:.2} dB, over {} pixels in {} views",
        file.method,
        file.scene,
        thousandths(file.mse),
        file.psnr,
        file.pixels,
        file.views.len()
    )
}

/// How much of the error lies where the photo shows nothing.
fn hidden(file: &ExplainFile) -> String {
    let Some(kinds) = &file.kinds else { return String::new() };
    let pixels = file.unobserved_pixels as f64 / file.pixels as f64;
    let [error, pixels] = [kinds.unobserved, pixels].map(percent);
    format!(
        "{error} % of the squared error lies in the {pixels} % of the pixels whose surface the photo does not show.\n"
    )
}

fn findings(file: &ExplainFile) -> Option<String> {
    let lines: String = file.findings.iter().map(|finding| format!("- {finding}\n")).collect();
    (!lines.is_empty()).then(|| format!("Findings of the result in this scene:\n\n{lines}"))
}

fn tables(file: &ExplainFile) -> Vec<Table> {
    let mut tables = vec![kinds(file), details(file), alignments(&file.alignments)];
    for picture in LIGHTS {
        let shares: Vec<&LightShare> = file.light.iter().filter(|share| share.picture == picture).collect();
        tables.extend((!shares.is_empty()).then(|| light(picture, &shares)));
    }
    tables
}

fn worst(file: &ExplainFile) -> impl Iterator<Item = &InstanceExplanation> {
    file.instances.iter().take(WORST)
}

fn kinds(file: &ExplainFile) -> Table {
    let heads = ["Instance", "Category", "Share %", "Pixels", "MSE (1e-3)"];
    let kinds = ["Hidden %", "Scale %", "Chroma %", "Shading %", "Misplaced %", "Detail %", "Rest %"];
    let mut rows = vec![heads.into_iter().chain(kinds).map(str::to_owned).collect::<Vec<_>>()];
    let row = |names: [&str; 2], share: f64, pixels: usize, mse: f64, kinds: Option<&KindShares>| {
        let numbers = [percent(share), pixels.to_string(), thousandths(mse)];
        let kinds = kinds.map_or([(); 7].map(|()| "-".to_owned()), |k| {
            [k.unobserved, k.scale, k.chroma, k.shading, k.misplacement, k.detail, k.rest].map(percent)
        });
        names.into_iter().map(str::to_owned).chain(numbers).chain(kinds).collect::<Vec<_>>()
    };
    rows.push(row(["(whole scene)", ""], 1.0, file.pixels, file.mse, file.kinds.as_ref()));
    rows.extend(worst(file).map(|i| {
        let category = i.category.as_deref().unwrap_or("other");
        row([i.instance.as_str(), category], i.share, i.pixels, i.mse, i.kinds.as_ref())
    }));
    let shown = rows.len() - 2;
    let title =
        format!("Where and how the albedo errs: {shown} of {} instances, the worst first", file.instances.len());
    Table { title, words: 2, rows }
}

fn details(file: &ExplainFile) -> Table {
    let mut rows =
        vec![["Instance", "Scale", "R, G, B", "Prediction moved by (x, y)", "Blur sigma"].map(str::to_owned).to_vec()];
    rows.extend(worst(file).map(|i| {
        let [r, g, b] = i.channel_scales;
        let shifts: Vec<String> =
            i.shifts.iter().map(|shift| format!("{} ({}, {})", shift.view, shift.pixels[0], shift.pixels[1])).collect();
        vec![
            i.instance.to_string(),
            format!("{:.3}", i.scale),
            format!("{r:.3}, {g:.3}, {b:.3}"),
            if shifts.is_empty() { "-".to_owned() } else { shifts.join(", ") },
            i.blur_sigma_pixels.map_or("-".to_owned(), |sigma| format!("{sigma} px")),
        ]
    }));
    Table { title: "What each step did".to_owned(), words: 5, rows }
}

fn alignments(scores: &[AlignmentScores]) -> Table {
    let views = [Views::Input, Views::Novel, Views::Unobserved];
    let heads = views.iter().flat_map(|views| [format!("{views} MSE (1e-3)"), format!("{views} PSNR")]);
    let mut rows = vec![["Scales of".to_owned()].into_iter().chain(heads).collect::<Vec<_>>()];
    let kinds = [
        (AlignedBy::None, "nothing: albedo"),
        (AlignedBy::PictureAndChannel, "picture and channel: albedo_aligned"),
        (AlignedBy::Scene, "scene"),
        (AlignedBy::SceneAndChannel, "scene and channel"),
        (AlignedBy::Instance, "instance"),
        (AlignedBy::InstanceAndChannel, "instance and channel"),
    ];
    for (kind, name) in kinds {
        let found = views.map(|views| scores.iter().find(|score| score.scales == kind && score.views == views));
        let cells = found.iter().flat_map(|score| match score {
            Some(score) => [thousandths(score.mse), format!("{:.2}", score.psnr)],
            None => ["-".to_owned(), "-".to_owned()],
        });
        rows.push([name.to_owned()].into_iter().chain(cells).collect());
    }
    Table { title: "Scores after scaling alone (in the protocol's albedo space)".to_owned(), words: 1, rows }
}

fn light(picture: PictureKind, shares: &[&LightShare]) -> Table {
    let mut rows = vec![["Instance", "Category", "Share %", "Pixels", "MSE (1e-3)"].map(str::to_owned).to_vec()];
    rows.extend(shares.iter().map(|share| {
        let category = share.category.as_deref().unwrap_or("other").to_owned();
        let numbers = [percent(share.share), share.pixels.to_string(), thousandths(share.mse)];
        [share.instance.to_string(), category].into_iter().chain(numbers).collect()
    }));
    Table { title: format!("{}: the worst instances of the result", picture.title()), words: 2, rows }
}

fn percent(share: f64) -> String {
    format!("{:.1}", unsigned_zero(100.0 * share, 10.0))
}

fn thousandths(mse: f64) -> String {
    format!("{:.3}", unsigned_zero(1e3 * mse, 1e3))
}

/// Zero without a sign for values that round to zero in steps of 1 / `steps`.
fn unsigned_zero(value: f64, steps: f64) -> f64 {
    if (value * steps).abs() < 0.5 { 0.0 } else { value }
}

/// The rows of a table on a page, without its title.
fn rows_in_markdown(table: &Table) -> String {
    let mut text = String::new();
    for (at, row) in table.rows.iter().enumerate() {
        let cells: Vec<String> = row.iter().map(|cell| cell.replace('|', "\\|")).collect();
        // Writing to a String cannot fail, here and below.
        let _ = writeln!(text, "| {} |", cells.join(" | "));
        if at == 0 {
            let _ = writeln!(text, "{}{}|", "|---".repeat(table.words), "|---:".repeat(row.len() - table.words));
        }
    }
    text
}
