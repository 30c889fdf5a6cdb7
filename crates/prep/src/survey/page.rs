//! The page to pick rooms from.

use minijinja::{Environment, context, value::Serde};

use super::{RecipeTexts, SurveyFile};

const TEMPLATE: &str = include_str!("page.j2");

/// HTML that shows every candidate with its thumbnail and lists every rejected room with its reasons. What is ticked is
/// put together as a recipe at the end of the page, by a few lines of script.
pub(super) fn page(survey: &SurveyFile, texts: &RecipeTexts) -> String {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| minijinja::AutoEscape::Html);
    let text = environment.render_str(TEMPLATE, context! { survey => Serde(survey), texts => Serde(texts) });
    text.expect("the template is ours, and all its values are there")
}
