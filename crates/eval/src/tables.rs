//! Tables of several results, laid out as the paper's Tables III to V.

use std::fmt::Write as _;

use crate::error::EvalError;
use crate::result::{RESULT_FORMAT, ResultFile};

/// How a table is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    /// GitHub's Markdown; best bold, second underlined.
    Markdown,
    /// LaTeX with booktabs; best bold, second underlined.
    Latex,
    /// Comma-separated, all digits, no marks.
    Csv,
}

/// Whether more is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Better {
    Lower,
    Higher,
}

struct Column {
    key: &'static str,
    title: &'static str,
    scale: f64,
    digits: usize,
    better: Better,
}

/// The paper's four columns; MSE in units of 1e-3 as it prints it.
const COLUMNS: [Column; 4] = [
    Column { key: "mse", title: "MSE (1e-3)", scale: 1e3, digits: 3, better: Better::Lower },
    Column { key: "psnr", title: "PSNR", scale: 1.0, digits: 2, better: Better::Higher },
    Column { key: "ssim", title: "SSIM", scale: 1.0, digits: 4, better: Better::Higher },
    Column { key: "lpips_alex", title: "LPIPS", scale: 1.0, digits: 4, better: Better::Lower },
];

/// Title and the blocks of columns (title, `<picture>.<views>`) of each table.
const TABLES: [(&str, &[(&str, &str)]); 3] = [
    ("Albedo, input view", &[("Albedo", "albedo.input"), ("Aligned albedo", "albedo_aligned.input")]),
    ("Albedo, novel views", &[("Albedo", "albedo.novel"), ("Aligned albedo", "albedo_aligned.novel")]),
    ("Aligned albedo, unobserved regions", &[("Aligned albedo", "albedo_aligned.unobserved")]),
];

/// Sets the results side by side under one protocol. Results of different fingerprints, or of different scenes, are
/// refused; a value that a result lacks is shown as missing.
pub fn tables(results: &[ResultFile], protocol: &str, format: TableFormat) -> Result<String, EvalError> {
    check_comparable(results, protocol)?;
    let mut text = String::new();
    for (title, blocks) in TABLES {
        let table = fill(results, protocol, blocks);
        match format {
            TableFormat::Markdown => write_markdown(&mut text, title, &table),
            TableFormat::Latex => write_latex(&mut text, title, blocks, &table),
            TableFormat::Csv => write_csv(&mut text, title, &table),
        }
    }
    Ok(text)
}

fn check_comparable(results: &[ResultFile], protocol: &str) -> Result<(), EvalError> {
    let Some(first) = results.first() else {
        return Err(EvalError::Invalid("no result to make a table of".to_owned()));
    };
    let mut faults = Vec::new();
    for result in results {
        if result.format != RESULT_FORMAT {
            faults.push(format!(
                "'{}' is of format '{}'; this version reads '{RESULT_FORMAT}'",
                result.method, result.format
            ));
        }
        let Some(scores) = result.protocols.get(protocol) else {
            faults.push(format!(
                "'{}' has no scores under protocol '{protocol}'; score it with --protocol {protocol}",
                result.method
            ));
            continue;
        };
        let expected = first.protocols.get(protocol).map(|scores| &scores.fingerprint);
        if expected.is_some_and(|expected| *expected != scores.fingerprint) {
            faults.push(format!(
                "'{}' and '{}' have different fingerprints: dataset, protocol, scorer or LPIPS weights are not the same; \
                 score both again with one",
                first.method, result.method
            ));
        }
        if result.dataset.scenes != first.dataset.scenes {
            faults.push(format!("'{}' and '{}' were scored on different scenes", first.method, result.method));
        }
    }
    if faults.is_empty() { Ok(()) } else { Err(EvalError::Invalid(faults.join("; "))) }
}

struct Table {
    heads: Vec<String>,
    methods: Vec<String>,
    /// Row by row.
    cells: Vec<Vec<Cell>>,
}

#[derive(Clone, Copy)]
struct Cell {
    value: Option<f64>,
    digits: usize,
    /// 0 best, 1 second.
    rank: Option<usize>,
}

fn fill(results: &[ResultFile], protocol: &str, blocks: &[(&str, &str)]) -> Table {
    let columns: Vec<(&str, &str, &Column)> =
        blocks.iter().flat_map(|(name, key)| COLUMNS.iter().map(move |column| (*name, *key, column))).collect();
    let heads = columns
        .iter()
        .map(|(block, _, column)| {
            let arrow = if column.better == Better::Lower { "↓" } else { "↑" };
            format!("{block} {} {arrow}", column.title)
        })
        .collect();
    let by_column: Vec<Vec<Cell>> = columns
        .iter()
        .map(|(_, block, column)| {
            let key = format!("{block}.{}", column.key);
            let value = |result: &ResultFile| Some(result.protocols.get(protocol)?.summary.get(&key)? * column.scale);
            ranked(&results.iter().map(value).collect::<Vec<_>>(), column)
        })
        .collect();
    let cells = (0..results.len()).map(|row| by_column.iter().map(|column| column[row]).collect()).collect();
    Table { heads, methods: results.iter().map(|result| result.method.clone()).collect(), cells }
}

/// Marks the best and the second best value; equal values share a mark.
fn ranked(values: &[Option<f64>], column: &Column) -> Vec<Cell> {
    let mut distinct: Vec<f64> = values.iter().flatten().copied().collect();
    distinct.sort_by(f64::total_cmp);
    if column.better == Better::Higher {
        distinct.reverse();
    }
    distinct.dedup();
    let rank = |value: f64| distinct.iter().position(|other| *other == value).filter(|rank| *rank < 2);
    values.iter().map(|value| Cell { value: *value, digits: column.digits, rank: value.and_then(rank) }).collect()
}

impl Cell {
    fn text(&self, bold: (&str, &str), underlined: (&str, &str)) -> String {
        let Some(value) = self.value else { return "missing".to_owned() };
        let digits = self.digits;
        let (before, after) = match self.rank {
            Some(0) => bold,
            Some(1) => underlined,
            _ => ("", ""),
        };
        format!("{before}{value:.digits$}{after}")
    }
}

fn write_markdown(text: &mut String, title: &str, table: &Table) {
    // Writing to a String cannot fail, here and below.
    let _ = writeln!(text, "### {title}\n\n| Method | {} |", table.heads.join(" | "));
    let _ = writeln!(text, "|---|{}", "---:|".repeat(table.heads.len()));
    for (method, cells) in table.methods.iter().zip(&table.cells) {
        let cells: Vec<String> = cells.iter().map(|cell| cell.text(("**", "**"), ("<u>", "</u>"))).collect();
        let _ = writeln!(text, "| {} | {} |", method.replace('|', "\\|"), cells.join(" | "));
    }
    text.push('\n');
}

fn write_latex(text: &mut String, title: &str, blocks: &[(&str, &str)], table: &Table) {
    let _ = writeln!(text, "% {title}\n\\begin{{tabular}}{{l{}}}\n\\toprule", "r".repeat(table.heads.len()));
    let groups: Vec<String> =
        blocks.iter().map(|(name, _)| format!("\\multicolumn{{{}}}{{c}}{{{name}}}", COLUMNS.len())).collect();
    let _ = writeln!(text, " & {} \\\\", groups.join(" & "));
    let heads: Vec<String> = blocks
        .iter()
        .flat_map(|_| COLUMNS.iter())
        .map(|column| {
            let arrow = if column.better == Better::Lower { "downarrow" } else { "uparrow" };
            format!("{} $\\{arrow}$", column.title.replace("1e-3", "$10^{-3}$"))
        })
        .collect();
    let _ = writeln!(text, "Method & {} \\\\\n\\midrule", heads.join(" & "));
    for (method, cells) in table.methods.iter().zip(&table.cells) {
        let cells: Vec<String> =
            cells.iter().map(|cell| cell.text(("\\textbf{", "}"), ("\\underline{", "}"))).collect();
        let _ = writeln!(text, "{} & {} \\\\", latex_text(method), cells.join(" & "));
    }
    text.push_str("\\bottomrule\n\\end{tabular}\n\n");
}

fn latex_text(text: &str) -> String {
    text.chars()
        .flat_map(|c| match c {
            '\\' => "\\textbackslash{}".chars().collect::<Vec<_>>(),
            '~' => "\\textasciitilde{}".chars().collect(),
            '^' => "\\textasciicircum{}".chars().collect(),
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => vec!['\\', c],
            _ => vec![c],
        })
        .collect()
}

fn write_csv(text: &mut String, title: &str, table: &Table) {
    let quoted = |field: &str| format!("\"{}\"", field.replace('"', "\"\""));
    let heads: Vec<String> = table.heads.iter().map(|head| quoted(head)).collect();
    let _ = writeln!(text, "{},{}", quoted(title), heads.join(","));
    for (method, cells) in table.methods.iter().zip(&table.cells) {
        let cells: Vec<String> =
            cells.iter().map(|cell| cell.value.map_or_else(String::new, |value| value.to_string())).collect();
        let _ = writeln!(text, "{},{}", quoted(method), cells.join(","));
    }
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::protocol::Protocol;
    use crate::result::{DatasetId, ProtocolResult, SubmissionId};

    fn result(method: &str, psnr: f64, fingerprint: &str) -> ResultFile {
        let summary = BTreeMap::from([
            ("albedo.input.psnr".to_owned(), psnr),
            ("albedo.input.mse".to_owned(), 1.0 / psnr),
            ("albedo_aligned.input.psnr".to_owned(), 20.0),
        ]);
        let scores = ProtocolResult {
            protocol: Protocol::named("paper").unwrap(),
            fingerprint: fingerprint.to_owned(),
            summary,
            scenes: BTreeMap::new(),
            summary_noise: BTreeMap::new(),
            noise: BTreeMap::new(),
            fits: BTreeMap::new(),
            pictures: Vec::new(),
            texels: Vec::new(),
            instances: Vec::new(),
        };
        ResultFile {
            format: RESULT_FORMAT.to_owned(),
            tool: String::new(),
            method: method.to_owned(),
            submission: SubmissionId { sha256: String::new(), description: String::new() },
            dataset: DatasetId {
                name: String::new(),
                version: String::new(),
                manifest_sha256: String::new(),
                scenes: Vec::new(),
                scenes_in_all: 0,
            },
            lpips_weights: BTreeMap::new(),
            protocols: BTreeMap::from([("paper".to_owned(), scores)]),
            missing: Vec::new(),
            findings: Vec::new(),
        }
    }

    #[test]
    fn best_is_bold_second_is_underlined_missing_is_said() {
        let results = [result("a", 10.0, "f"), result("b_1", 40.0, "f"), result("c", 20.0, "f")];
        let markdown = tables(&results, "paper", TableFormat::Markdown).unwrap();
        assert!(markdown.contains("| b_1 | **25.000** | **40.00** | missing |"), "{markdown}");
        assert!(markdown.contains("| c | <u>50.000</u> | <u>20.00</u> |"), "{markdown}");
        // Equal values share the mark.
        assert_eq!(markdown.matches("**20.00**").count(), 3, "{markdown}");
        let latex = tables(&results, "paper", TableFormat::Latex).unwrap();
        assert!(latex.contains("b\\_1 & \\textbf{25.000} & \\textbf{40.00} & missing"), "{latex}");
        assert!(tables(&results, "paper", TableFormat::Csv).unwrap().contains("\"a\",100,10,,,"));
    }

    #[test]
    fn fingerprints_are_not_mixed() {
        let error = tables(&[result("a", 1.0, "f"), result("b", 1.0, "g")], "paper", TableFormat::Csv).unwrap_err();
        assert!(error.to_string().contains("different fingerprints"));
        let error = tables(&[result("a", 1.0, "f")], "mateval-1", TableFormat::Csv).unwrap_err();
        assert!(error.to_string().contains("--protocol mateval-1"));
    }
}
