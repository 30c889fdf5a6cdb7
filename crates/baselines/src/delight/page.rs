//! The page of `mateval baseline delight`: what was found in each photo.

use std::fmt::Write as _;

/// A scene on the page.
pub(super) struct Shown {
    pub(super) id: String,
    pub(super) radiances: Vec<(String, [f64; 3])>,
    pub(super) rounds: usize,
}

const STYLE: &str = "\
:root{color-scheme:light dark}\
body{font:16px/1.5 system-ui,sans-serif;margin:1rem auto;max-width:80rem;padding:0 1rem}\
.pictures{display:grid;grid-template-columns:repeat(auto-fill,minmax(16rem,1fr));gap:1rem}\
figure{margin:0}\
img{width:100%;height:auto;image-rendering:auto;border:1px solid #8888}\
table{border-collapse:collapse}\
th,td{padding:.1rem .8rem .1rem 0;text-align:right}\
th:first-child,td:first-child{text-align:left}";

const PICTURES: [(&str, &str); 6] = [
    ("base_color", "Base colour"),
    ("shading", "Light on a white surface, exposed as the photo"),
    ("gloss", "Light that does not depend on base colour"),
    ("confidence", "Confidence: black is unknown"),
    ("roughness", "Roughness"),
    ("metallic", "Metallic: white is a mirror"),
];

/// The page. Ids and names of lights hold no characters that HTML would read.
pub(super) fn html(scenes: &[Shown]) -> String {
    let mut text = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>De-lit photos</title>\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><style>{STYLE}</style></head><body>\
         <main><h1>De-lit photos</h1>\n"
    );
    let mut add = |words: std::fmt::Arguments<'_>| {
        text.write_fmt(words).expect("writing to a String cannot fail");
        text.push('\n');
    };
    for Shown { id, radiances, rounds } in scenes {
        add(format_args!("<section><h2>{id}</h2><div class=\"pictures\">"));
        for (file, caption) in PICTURES {
            add(format_args!(
                "<figure><img src=\"{id}/{file}.png\" alt=\"{caption}, {id}\"><figcaption>{caption}</figcaption></figure>"
            ));
        }
        add(format_args!("</div><details><summary>{} lights after {rounds} rounds</summary><table>", radiances.len()));
        add(format_args!("<tr><th>Light</th><th>Red</th><th>Green</th><th>Blue</th></tr>"));
        for (name, [r, g, b]) in radiances {
            add(format_args!("<tr><td>{name}</td><td>{r:.4}</td><td>{g:.4}</td><td>{b:.4}</td></tr>"));
        }
        add(format_args!("</table></details></section>"));
    }
    text.push_str("</main></body></html>\n");
    text
}
