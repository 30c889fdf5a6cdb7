//! What all HTML pages that we write share: the shell, the style, light and dark, sortable tables, charts of curves, and
//! the slider that lays the truth over a prediction.
//!
//! In: a template that extends `shell.j2`, and its values. Out: the text of a page. A page of a site links its style and
//! scripts, a page on its own contains them. Either way its content security policy lets nothing else run, and nothing
//! is loaded from elsewhere.

use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment, Value, context};
use serde::Serialize;
use sha2::{Digest as _, Sha256};

/// The style sheet of every page.
pub const STYLE: &str = include_str!("style.css");

/// Sorts tables with `data-sortable` when a button in their head is pressed.
pub const SORT: &str = include_str!("sort.js");

/// Moves the sliders that the macros of `slider.j2` make.
pub const SLIDER: &str = include_str!("slider.js");

/// Templates that others extend, import or include.
const TEMPLATES: [(&str, &str); 3] = [
    ("shell.j2", include_str!("shell.j2")),
    ("slider.j2", include_str!("slider.j2")),
    ("charts.j2", include_str!("charts.j2")),
];

/// An environment for templates, which escapes what they show and has the shared ones.
pub fn environment() -> Environment<'static> {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    for (name, text) in TEMPLATES {
        environment.add_template(name, text).expect("a test fills the templates");
    }
    environment
}

/// How a page gets its style and its scripts: the value `shell` of `shell.j2`.
#[derive(Serialize)]
struct Shell {
    /// What the page's policy allows.
    style_sources: String,
    script_sources: String,
    /// Elements.
    style: String,
    scripts: String,
}

/// The value `shell` of a page of a site. `root` leads from the page to the site's folder, which holds [`STYLE`] as
/// `site.css` and the scripts.
pub fn linked(root: &str, scripts: &[&str]) -> Value {
    let [style_sources, script_sources] = ["'self' file:"; 2].map(str::to_owned);
    let script = |script: &&str| format!("<script src=\"{root}{script}\" defer></script>\n");
    Value::from(Serde(Shell {
        style_sources,
        script_sources,
        style: format!("<link rel=\"stylesheet\" href=\"{root}site.css\">"),
        scripts: scripts.iter().map(script).collect(),
    }))
}

/// The value `shell` of a page that contains its style and this script, which may be empty.
fn contained(script: &str) -> Value {
    let has_script = !script.is_empty();
    Value::from(Serde(Shell {
        style_sources: csp_hash(STYLE),
        script_sources: if has_script { csp_hash(script) } else { "'none'".to_owned() },
        style: format!("<style>{STYLE}</style>"),
        scripts: if has_script { format!("<script>{script}</script>") } else { String::new() },
    }))
}

/// The hash by which a page's policy allows the text of an element.
fn csp_hash(text: &str) -> String {
    format!("'sha256-{}'", base64::encode(Sha256::digest(text.as_bytes())))
}

/// A page on its own, from a template that extends `shell.j2` and uses only values that the context holds.
pub fn single(template: &str, values: Value, script: &str) -> String {
    let text = environment().render_str(template, context! { ..values, ..context! { shell => contained(script) } });
    text.expect("a test fills the template")
}

/// A page on its own with this title. `introduction`, a paragraph, and `content` are HTML.
pub fn plain(title: &str, introduction: &str, content: &str, script: &str) -> String {
    single("{% extends 'shell.j2' %}", context! { title, introduction, content }, script)
}

/// A picture with its caption, which is also its description. All are HTML.
pub fn figure(address: &str, scene: &str, caption: &str) -> String {
    format!("<figure><img src=\"{address}\" alt=\"{caption}, {scene}\"><figcaption>{caption}</figcaption></figure>\n")
}

/// Text with the characters replaced that are special in HTML and XML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_allows_its_own_style_and_script_alone() {
        let script = "document.title = 'x';";
        let page = plain("A & B", "<b>Why</b>", "<p>What</p>", script);
        assert!(page.contains("<title>A &amp; B</title>") && page.contains("<p><b>Why</b></p>\n<p>What</p>"), "{page}");
        assert!(page.contains(&format!("script-src {}; style-src {};", csp_hash(script), csp_hash(STYLE))));
        assert_eq!((page.matches("<script").count(), page.matches("<style").count()), (1, 1));
        let silent = plain("A", "", "", "");
        assert!(silent.contains("script-src 'none'") && !silent.contains("<script"));
    }

    /// FIPS 180-4's example, in base64.
    #[test]
    fn hashes_are_those_of_the_policy() {
        assert_eq!(csp_hash("abc"), "'sha256-ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0='");
    }

    #[test]
    fn a_page_of_a_site_links_what_it_needs() {
        let values = context! { title => "T", shell => linked("../", &["sort.js"]) };
        let page = environment().render_str("{% extends 'shell.j2' %}", values).unwrap();
        assert!(page.contains("href=\"../site.css\"") && page.contains("src=\"../sort.js\""), "{page}");
        assert!(!page.contains("<style"));
    }

    #[test]
    fn text_is_escaped() {
        assert_eq!(escaped("<a href=\"b\">&"), "&lt;a href=&quot;b&quot;&gt;&amp;");
    }
}
