//! The page of `mateval baseline delight`: what was found in each photo.

use std::fmt::Write as _;

use super::possible_light::FittedLight;
use crate::page_shell::{figure, page};

/// A scene on the page.
pub(super) struct Shown {
    pub(super) id: String,
    pub(super) lights: Vec<FittedLight>,
    pub(super) rounds: usize,
}

const PICTURES: [(&str, &str); 7] = [
    ("photo", "The photo"),
    ("base_color", "Base colour"),
    ("shading", "Light on a white surface, exposed as the photo"),
    ("gloss", "Light that does not depend on base colour"),
    ("confidence", "Confidence: black is unknown"),
    ("roughness", "Roughness"),
    ("metallic", "Metallic: white is a mirror"),
];

/// The page. Ids and names of lights contain no characters that are special in HTML.
pub(super) fn html(scenes: &[Shown]) -> String {
    let introduction = "A photo is base colour times the light on a white surface, plus light that does not depend on \
                        base colour. <code>mateval baseline relight</code> lights the rooms anew.";
    page("De-lit photos", introduction, &scenes.iter().map(section).collect::<String>())
}

fn section(Shown { id, lights, rounds }: &Shown) -> String {
    let mut text = format!("<section><h2>{id}</h2><div class=\"pictures\">\n");
    text.extend(PICTURES.map(|(file, caption)| figure(&format!("{id}/{file}.png"), id, caption)));
    let count = lights.len();
    text.push_str("</div><details><summary>");
    write!(text, "{count} lights after {rounds} rounds").expect("writing to a String cannot fail");
    text.push_str(
        "</summary><div class=\"scroll\"><table><tr><th>Light</th><th>Red</th><th>Green</th><th>Blue</th></tr>\n",
    );
    text.extend(lights.iter().map(|FittedLight { light, radiance: [r, g, b] }| {
        format!("<tr><td>{}</td><td>{r:.4}</td><td>{g:.4}</td><td>{b:.4}</td></tr>\n", light.name)
    }));
    text.push_str("</table></div></details></section>\n");
    text
}
