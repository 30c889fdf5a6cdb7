//! Renders with MatEval's own path tracer.

use std::path::Path;
use std::sync::Arc;

use mateval_image::{ImageError, Picture, exr_io, png_io};
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::SceneFolder;
use mateval_scene::render_file::RenderFile;
use mateval_scene::render_noise::RenderNoise;
use mateval_scene::{Progress, Report, SceneId, json, reference_io};
use mateval_tracer::noise_filter::{self, Surfaces, filtered_mean};
use mateval_tracer::{LightBasis, LightGroups, RenderSettings, RenderStats, World, render_views};

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
    for (at, id) in scenes.iter().enumerate() {
        progress(Report::part(&format!("scene {id}"), at, scenes.len()));
        run.on_scene(id, || render_scene(run, id, progress, &mut report))?;
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
        let step = format!("view {}", view.id);
        let shown = |done: usize, all: usize| progress(Report::step(&step, done, all));
        let settings = RenderSettings { samples: run.samples, max_bounces: MAX_BOUNCES, ..Default::default() };
        let groups = LightGroups::apart(world.emitters().groups());
        let mut render = render_views(world, &[view.camera], &groups, &settings, &seeds, &shown)?;
        let [a, b]: [LightPictures; 2] =
            std::array::from_fn(|_| light_pictures(render.views[0].halves.remove(0).basis));
        let shown = without_noise(&folder, view, [&a, &b])?;
        report.remarks.extend(remark(&format!("{id} {}", view.id), &render.stats));
        let file = RenderFile {
            renderer: run.renderer.clone(),
            renderer_version: None,
            samples_each_half: run.samples,
            seeds: seed_texts(seeds),
            max_bounces: MAX_BOUNCES,
            capped_throughput: Some(render.stats.capped_throughput),
            denoiser: noise_filter::NAME.to_owned(),
            noise: RenderNoise::of([&a.rgb, &b.rgb], &shown.rgb),
            approximations: Vec::new(),
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

/// The means of both halves, filtered on the surfaces that the view's maps show.
fn without_noise(folder: &SceneFolder, view: &View, [a, b]: [&LightPictures; 2]) -> Result<LightPictures, PrepError> {
    let (shown, hidden) = (folder.view(&view.id), folder.truth_view(&view.id));
    let base_color = map_of(view, &hidden.join("albedo.exr"), exr_io::read_linear)?;
    let instances = map_of(view, &shown.join("instance.png"), png_io::read_ids)?;
    let normals = map_of(view, &shown.join("normal.exr"), exr_io::read_normal)?;
    let valid = instances.map(|instance| instance != 0);
    let surfaces = Surfaces { base_color: Some(&base_color), instances: &instances, normals: &normals, valid: &valid };
    Ok(LightPictures {
        rgb: filtered_mean([&a.rgb, &b.rgb], &surfaces),
        groups: a.groups.iter().zip(&b.groups).map(|(a, b)| filtered_mean([a, b], &surfaces)).collect(),
    })
}

/// Reads a map of a view. Fails if it has not the size of the camera's picture.
fn map_of<T: Copy>(
    view: &View,
    path: &Path,
    read: fn(&Path) -> Result<Picture<T>, ImageError>,
) -> Result<Picture<T>, PrepError> {
    let map = read(path)?;
    let k = view.camera.intrinsics;
    let (expected, found) = ([k.width as usize, k.height as usize], [map.width(), map.height()]);
    if found == expected { Ok(map) } else { Err(PrepError::MapSize { path: path.to_owned(), expected, found }) }
}
