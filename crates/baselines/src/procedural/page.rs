//! The report page: the pictures of each room, and of each part with a fit the graph that was chosen.

use std::fmt::Write as _;

use super::report_file::{GraphReport, PartReport, ReasonWord, SceneReport};
use crate::page_shell::{figure, page};
use crate::submission::Method;

/// A scene on the page.
pub(super) struct ShownScene {
    pub(super) report: SceneReport,
    pub(super) has_photo: bool,
}

/// The page. Ids and names of graphs contain no characters that are special in HTML, save those of a user's files.
pub(super) fn html(method: &Method, scenes: &[ShownScene]) -> String {
    let introduction = format!(
        "<strong>{}</strong>: {}. Parts are sorted by the number of pixels that show them. Errors are mean squares of \
         differences of linear colours at pixels that took no part in the fit.",
        escaped(&method.name),
        escaped(&method.description)
    );
    page("Procedural materials", &introduction, &scenes.iter().map(section).collect::<String>())
}

fn section(scene: &ShownScene) -> String {
    let id = &scene.report.id;
    let mut text = format!("<section><h2>{id}</h2><div class=\"pictures\">\n");
    for (name, caption) in pictures(scene.has_photo) {
        text.push_str(&figure(&format!("{id}/{name}.png"), id, caption));
    }
    text.push_str("</div>\n");
    let mut parts: Vec<&PartReport> = scene.report.parts.iter().collect();
    parts.sort_by(|a, b| b.pixels.cmp(&a.pixels).then(a.part.cmp(&b.part)));
    let count = |reason: ReasonWord| parts.iter().filter(|part| part.reason == reason).count();
    let (graphs, colors) = (count(ReasonWord::Graph), count(ReasonWord::OneColor));
    let (few, unseen) = (count(ReasonWord::FewPixels), count(ReasonWord::Unseen));
    writeln!(
        text,
        "<p>Parts with a graph: {graphs}; of one colour: {colors}; with too few pixels: {few}; not seen: {unseen}. The \
         graphs with their parameters: <a href=\"{id}/materials.mtlx\">materials.mtlx</a></p>"
    )
    .expect("writing to a String cannot fail");
    text.extend(parts.iter().filter(|part| part.chosen.is_some()).map(|part| with_graph(scene, part)));
    text.push_str(&table(&parts));
    text.push_str("</section>\n");
    text
}

fn pictures(has_photo: bool) -> Vec<(&'static str, &'static str)> {
    let photo = has_photo.then_some(("photo", "The photo"));
    photo.into_iter().chain([("estimate", "The estimate's base colour"), ("fitted", "The fitted materials")]).collect()
}

/// A part with its pictures and parameters.
fn with_graph(scene: &ShownScene, part: &PartReport) -> String {
    let (id, name) = (&scene.report.id, &part.part);
    let Some(chosen) = &part.chosen else { return String::new() };
    let mut text = format!("<h3>{name}: {}</h3><div class=\"pictures\">\n", escaped(&chosen.graph));
    for (picture, caption) in pictures(scene.has_photo).into_iter().chain([("swatch", "The graph from the front")]) {
        text.push_str(&figure(&format!("{id}/{name}-{picture}.png"), name, caption));
    }
    text.push_str("</div><p>");
    text.push_str(&errors(part, chosen));
    text.push_str("</p><details><summary>Parameters</summary><div class=\"scroll\"><table>\n");
    for (parameter, numbers) in &chosen.parameters {
        let numbers: Vec<String> = numbers.iter().map(|number| format!("{number:.4}")).collect();
        writeln!(text, "<tr><td>{}</td><td>{}</td></tr>", escaped(parameter), numbers.join(", "))
            .expect("writing to a String cannot fail");
    }
    text.push_str("</table></div></details>\n");
    text
}

/// The errors of the graph, of one colour, and of the graph that came next.
fn errors(part: &PartReport, chosen: &GraphReport) -> String {
    let mut text = format!("{} pixels, error {:.5}", part.pixels, chosen.error);
    if let Some(error) = part.error_of_one_color {
        write!(text, "; one colour {error:.5}").expect("writing to a String cannot fail");
    }
    if let Some(next) = part.runner_up() {
        let name = escaped(&next.graph);
        write!(text, "; runner-up {name} {:.5}", next.error).expect("writing to a String cannot fail");
    }
    text
}

/// All parts that are seen, in a table.
fn table(parts: &[&PartReport]) -> String {
    let mut text = String::from(
        "<details><summary>All seen parts</summary><div class=\"scroll\"><table><tr><th>Part</th><th>Pixels</th>\
         <th>Material</th><th>Error</th><th>One colour</th><th>Runner-up</th></tr>\n",
    );
    let number = |error: Option<f64>| error.map_or("-".to_owned(), |error| format!("{error:.5}"));
    for part in parts.iter().filter(|part| part.pixels > 0) {
        let material = match (&part.chosen, part.reason) {
            (Some(chosen), _) => escaped(&chosen.graph),
            (None, ReasonWord::FewPixels) => "one colour: few pixels".to_owned(),
            (None, _) => "one colour".to_owned(),
        };
        let runner_up = part.runner_up().map_or("-".to_owned(), |other| escaped(&other.graph));
        let (error, flat) = (part.chosen.as_ref().map(|chosen| chosen.error), part.error_of_one_color);
        writeln!(
            text,
            "<tr><td>{}</td><td>{}</td><td>{material}</td><td>{}</td><td>{}</td><td>{runner_up}</td></tr>",
            part.part,
            part.pixels,
            number(error),
            number(flat)
        )
        .expect("writing to a String cannot fail");
    }
    text.push_str("</table></div></details>\n");
    text
}

/// Text with the characters replaced that are special in HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_escaped() {
        assert_eq!(escaped("<a href=\"b\">&"), "&lt;a href=&quot;b&quot;&gt;&amp;");
    }
}
