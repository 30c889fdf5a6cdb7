//! Renders with MatEval's own path tracer.

use std::sync::Arc;

use mateval_image::{LinearRgb, Picture};
use mateval_scene::dataset::SceneFile;
use mateval_scene::layout::SceneFolder;
use mateval_scene::{Progress, SceneId, json, reference_io};
use mateval_tracer::{LightBasis, LightGroups, RenderSettings, RenderStats, World, render_views};

use super::noise::RenderNoise;
use super::render_file::RenderFile;
use super::render_run::{MAX_BOUNCES, RenderRun, seed, seed_texts};
use super::report::RenderReport;
use super::store::{self, ViewRender};
use crate::blender::LightPictures;
use crate::error::PrepError;

/// Renders the views that no earlier run has rendered, scene by scene.
pub(super) fn render_scenes(
    run: &RenderRun<'_>,
    scenes: &[&SceneId],
    progress: Progress<'_>,
) -> Result<RenderReport, PrepError> {
    let mut report = RenderReport::default();
    for id in scenes {
        render_scene(run, id, progress, &mut report)?;
    }
    Ok(report)
}

fn render_scene(
    run: &RenderRun<'_>,
    id: &SceneId,
    progress: Progress<'_>,
    report: &mut RenderReport,
) -> Result<(), PrepError> {
    let folder = SceneFolder::of(run.root, id);
    let scene: SceneFile = json::read(&folder.scene_file())?;
    let mut world: Option<World> = None;
    for view in &scene.views {
        let seeds = [0, 1].map(|half| seed(id, view, half));
        if run.is_done(&folder, view, &seed_texts(seeds)) {
            report.kept += 1;
            continue;
        }
        let world = match &mut world {
            Some(world) => world,
            none => none.insert(World::new(Arc::new(reference_io::read(&folder)?))?),
        };
        let step = format!("{id} {}", view.id);
        let shown = |done: usize, all: usize| progress(&step, done, all);
        let settings = RenderSettings { samples: run.samples, max_bounces: MAX_BOUNCES, ..Default::default() };
        let groups = LightGroups::apart(world.emitters().groups());
        let mut render = render_views(world, &[view.camera], &groups, &settings, &seeds, &shown)?;
        let [a, b]: [LightPictures; 2] =
            std::array::from_fn(|_| light_pictures(render.views[0].halves.remove(0).basis));
        report.remarks.extend(remark(&step, &render.stats));
        let file = RenderFile {
            renderer: run.renderer.clone(),
            renderer_version: None,
            samples_each_half: run.samples,
            seeds: seed_texts(seeds),
            max_bounces: MAX_BOUNCES,
            capped_throughput: Some(render.stats.capped_throughput),
            denoiser: None,
            noise: RenderNoise::of([&a.rgb, &b.rgb], None),
            approximations: Vec::new(),
        };
        let shown = LightPictures {
            rgb: mean(&a.rgb, &b.rgb),
            groups: a.groups.iter().zip(&b.groups).map(|(a, b)| mean(a, b)).collect(),
        };
        let render = ViewRender { halves: [&a, &b], shown: &shown, passes: None };
        store::write(&folder.render(&run.renderer, &view.id), &render, scene.exposure, &file)?;
        report.rendered += 1;
    }
    Ok(())
}

fn remark(step: &str, stats: &RenderStats) -> Option<String> {
    (stats.not_finite > 0)
        .then(|| format!("{step}: left out {} samples that were not finite; please report this bug", stats.not_finite))
}

fn light_pictures(basis: LightBasis) -> LightPictures {
    LightPictures { rgb: basis.sum(), groups: basis.pictures().to_vec() }
}

/// The mean of two pictures of one size.
fn mean(a: &Picture<LinearRgb>, b: &Picture<LinearRgb>) -> Picture<LinearRgb> {
    let pixels = a.pixels().iter().zip(b.pixels());
    let pixels = pixels.map(|(a, b)| LinearRgb(std::array::from_fn(|c| (a.0[c] + b.0[c]) / 2.0))).collect();
    Picture::new(a.width(), a.height(), pixels).expect("both halves are of one size")
}
