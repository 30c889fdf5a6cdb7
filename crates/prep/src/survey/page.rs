//! The page to pick rooms from.

use minijinja::{Environment, context, value::Serde};

use super::recipe_text::RecipeTexts;
use super::survey_file::SurveyFile;

const TEMPLATE: &str = include_str!("page.j2");

/// HTML that shows every candidate with its thumbnail and lists every rejected room with its reasons. A short script on
/// the page joins the ticked candidates into a recipe at its end.
pub(super) fn page(survey: &SurveyFile, texts: &RecipeTexts) -> String {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| minijinja::AutoEscape::Html);
    let text = environment.render_str(TEMPLATE, context! { survey => Serde(survey), texts => Serde(texts) });
    text.expect("the template uses only values that the context holds")
}
