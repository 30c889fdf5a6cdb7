//! Tables as LaTeX with booktabs.

use std::fmt::Write as _;

use super::table::Table;
use mateval_eval::metric::Better;

/// A comment with the title and the table.
pub(super) fn text(table: &Table<'_>) -> String {
    let words = 1 + usize::from(table.group_head.is_some());
    let layout = "l".repeat(words) + &"r".repeat(table.columns.len());
    let mut text = format!("% {}\n\\begin{{tabular}}{{{layout}}}\n\\toprule\n", table.title);
    let blocks = table.blocks.iter().map(|(title, columns)| format!("\\multicolumn{{{columns}}}{{c}}{{{title}}}"));
    let blocks: Vec<String> = std::iter::repeat_n(String::new(), words).chain(blocks).collect();
    // Writing to a String cannot fail, here and below.
    let _ = writeln!(text, "{} \\\\", blocks.join(" & ").trim_start());
    let heads = table.columns.iter().map(|column| {
        let arrow = match column.key.quantity.better() {
            Some(Better::Lower) => " $\\downarrow$",
            Some(Better::Higher) => " $\\uparrow$",
            None => "",
        };
        format!("{}{arrow}", column.key.quantity.style().title.replace("1e-3", "$10^{-3}$"))
    });
    let names = table.group_head.into_iter().chain(["Method"]).map(str::to_owned);
    let _ = writeln!(text, "{} \\\\", names.chain(heads).collect::<Vec<_>>().join(" & "));
    for group in &table.groups {
        text.push_str("\\midrule\n");
        for (method, cells) in &group.rows {
            let names = table.group_head.iter().map(|_| group.name).chain([method.as_str()]).map(latex_text);
            let cells = cells.iter().map(|cell| cell.text(("\\textbf{", "}"), ("\\underline{", "}"), "$\\pm$"));
            let _ = writeln!(text, "{} \\\\", names.chain(cells).collect::<Vec<_>>().join(" & "));
        }
    }
    text.push_str("\\bottomrule\n\\end{tabular}\n\n");
    text
}

/// LaTeX that shows the text as it is, in one line: names of methods are untrusted.
fn latex_text(text: &str) -> String {
    text.chars()
        .flat_map(|c| match c {
            '\\' => "\\textbackslash{}".chars().collect::<Vec<_>>(),
            '~' => "\\textasciitilde{}".chars().collect(),
            '^' => "\\textasciicircum{}".chars().collect(),
            '<' => "\\textless{}".chars().collect(),
            '>' => "\\textgreater{}".chars().collect(),
            '|' => "\\textbar{}".chars().collect(),
            // An empty line would end the paragraph inside the cell.
            _ if c.is_control() => vec![' '],
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => vec!['\\', c],
            _ => vec![c],
        })
        .collect()
}
