//! The page with both pictures side by side.

use minijinja::{Environment, context, value::Serde};

use super::file::{CompareFile, State};
use super::previews::ViewPreviews;
use super::text;

const TEMPLATE: &str = include_str!("page.j2");

/// HTML with the verdict, the checks that do not agree and the pictures of each view; `previews` contains one list per
/// scene.
pub(super) fn page(file: &CompareFile, previews: &[Vec<ViewPreviews>]) -> String {
    let scenes: Vec<_> = file
        .scenes
        .iter()
        .zip(previews)
        .map(|(scene, previews)| {
            let views: Vec<_> = scene
                .views
                .iter()
                .map(|view| {
                    let shown = previews.iter().find(|shown| shown.view == view.view.as_str());
                    let agrees = view.checks.iter().all(|check| check.state == State::Agrees);
                    context! { view => view.view.as_str(), agrees, checks => Serde(&view.checks), shown => Serde(shown) }
                })
                .collect();
            let kinds: Vec<&str> = scene.kinds.iter().map(|kind| kind.word()).collect();
            context! {
                scene => scene.scene.as_str(), kinds, views,
                tile_bound => 100.0 * scene.tile_bound, samples => scene.samples_each_half,
                source => scene.source_materials.as_ref().map(text::source_sentence),
            }
        })
        .collect();
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| minijinja::AutoEscape::Html);
    let text = environment.render_str(
        TEMPLATE,
        context! {
            tool => &file.tool, renderer => &file.renderer, dataset => Serde(&file.dataset), agrees => file.agrees,
            verdict => text::verdict(file), faults => text::faults(file), scenes,
        },
    );
    text.expect("the template uses only values that the context holds")
}
