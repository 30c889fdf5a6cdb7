//! The built-in tracer's pictures of light, rendered for the comparison.

use mateval_image::{LinearRgb, Picture};
use mateval_scene::dataset::View;
use mateval_scene::manifest::sha256_of_bytes;
use mateval_scene::{Camera, Progress, Report, SceneId};
use mateval_tracer::light_basis::DEFAULT_BASIS_BYTES;
use mateval_tracer::{LightGroups, RenderSettings, ViewLight, World, render_views};

use super::tiles::Halves;
use crate::error::AuditError;
use mateval_prep::render::MAX_BOUNCES;

/// The built-in tracer's pictures of one view.
pub(super) struct OurLight {
    /// Under all lights.
    pub(super) rgb: Halves,
    /// Under each light group alone, in the order of `lights.json`.
    pub(super) groups: Vec<Halves>,
}

/// The seeds of a scene's two halves. No other render of the scene uses them, so that the errors are independent.
pub(super) fn seeds(scene: &SceneId) -> [u64; 2] {
    ["a", "b"].map(|half| {
        let text = sha256_of_bytes(format!("compare/{scene}/{half}").as_bytes());
        u64::from_str_radix(&text[..16], 16).expect("a hash is hexadecimal")
    })
}

/// Renders `views` of the scene: all from one set of paths where they share a centre and their pictures fit in memory,
/// otherwise one after the other.
pub(super) fn render(
    world: &World,
    id: &SceneId,
    views: &[&View],
    samples: u32,
    progress: Progress<'_>,
) -> Result<Vec<OurLight>, AuditError> {
    let settings = RenderSettings { samples, max_bounces: MAX_BOUNCES, ..Default::default() };
    let cameras: Vec<Camera> = views.iter().map(|view| view.camera).collect();
    let lights = world.scene().lights.len();
    let merged = |cameras: &[Camera]| {
        Ok::<_, AuditError>(LightGroups::within(DEFAULT_BASIS_BYTES, lights, cameras, 2)?.is_merged())
    };
    let at_once = if merged(&cameras)? { 1 } else { cameras.len().max(1) };
    let groups = LightGroups::apart(lights);
    let mut found = Vec::new();
    let passes = cameras.len().div_ceil(at_once);
    for (pass, cameras) in cameras.chunks(at_once).enumerate() {
        if merged(cameras)? {
            return Err(AuditError::TooManyLights { scene: id.clone(), lights, most_bytes: DEFAULT_BASIS_BYTES });
        }
        let step = format!("{id} ours");
        let shown = |done: usize, all: usize| progress(Report::step(&step, pass * all + done, passes * all));
        let rendered = render_views(world, cameras, &groups, &settings, &seeds(id), &shown)?;
        found.extend(rendered.views.iter().map(light));
    }
    Ok(found)
}

fn light(view: &ViewLight) -> OurLight {
    let [a, b] = [0, 1].map(|half| &view.halves[half].basis);
    let groups = a.pictures().iter().zip(b.pictures());
    OurLight { rgb: Halves { a: a.sum(), b: b.sum() }, groups: groups.map(|(a, b)| halves(a, b)).collect() }
}

fn halves(a: &Picture<LinearRgb>, b: &Picture<LinearRgb>) -> Halves {
    Halves { a: a.clone(), b: b.clone() }
}
