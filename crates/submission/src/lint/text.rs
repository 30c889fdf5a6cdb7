//! The report for people: one line for each code, then the verdict.

use std::fmt::Write as _;

use super::file::{FoldedFinding, LintFile};

/// How many further files are named after the first.
const PLACES: usize = 3;

/// Findings, errors first, then the verdict in one line.
pub fn plain(file: &LintFile) -> String {
    let mut text = String::new();
    for finding in &file.findings {
        line(&mut text, finding);
    }
    let verdict = if file.good { "good" } else { "not good" };
    let found =
        [(file.errors, "error"), (file.warnings, "warning"), (file.notes, "note")].map(|(n, word)| counted(n, word));
    // Writing to a String cannot fail.
    let _ = writeln!(text, "{verdict}: {}, {}, {}; {} read", found[0], found[1], found[2], counted(file.maps, "map"));
    text
}

fn line(text: &mut String, finding: &FoldedFinding) {
    let Some((first, others)) = finding.examples.split_first() else { return };
    let _ = write!(text, "{first}");
    if finding.count > 1 {
        let more: Vec<String> = others.iter().take(PLACES).map(|other| format!("'{}'", other.file)).collect();
        let rest = if finding.count > 1 + more.len() { ", ..." } else { "" };
        let _ = write!(text, " ({} times; also {}{rest})", finding.count, more.join(", "));
    }
    text.push('\n');
}

fn counted(count: usize, word: &str) -> String {
    format!("{count} {word}{}", if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lint::finding::{error, warning};
    use crate::lint::fold::folded;
    use mateval_scene::dataset_id::DatasetId;

    #[test]
    fn repeats_take_one_line() {
        let mut findings: Vec<_> = (0..6).map(|at| error("nan", &format!("f{at}"), "a NaN", "fix it")).collect();
        findings.push(warning("alpha", "g", "opacity", "drop it"));
        let dataset = DatasetId {
            name: String::new(),
            version: String::new(),
            manifest_sha256: String::new(),
            scenes: Vec::new(),
            total_scenes: 0,
            sources: Default::default(),
            houses: Default::default(),
            wide_views: Default::default(),
            photo_renderer: None,
        };
        let text = plain(&LintFile::new(String::new(), None, dataset, 1, folded(findings)));
        let expected = "error [nan] 'f0': a NaN; fix it (6 times; also 'f1', 'f2', 'f3', ...)\n\
                        warning [alpha] 'g': opacity; drop it\n\
                        not good: 6 errors, 1 warning, 0 notes; 1 map read\n";
        assert_eq!(text, expected);
    }
}
