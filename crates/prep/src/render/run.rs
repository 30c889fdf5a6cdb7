//! What all renderers share: their names, the settings of a run, its report, and a view's pictures on disk.
//!
//! The pictures lie in `ground_truth/renders/<renderer>/<view>/`.

use std::path::Path;

use mateval_dataset::changes::change_scene;
use mateval_dataset::dataset::View;
use mateval_dataset::layout::{INPUT, SceneFolder};
use mateval_dataset::render_file::{RENDER_FILE, RenderFile};
use mateval_dataset::scene_cost::{self, Step, TimedStep};
use mateval_dataset::{Finding, RendererId, SceneId, ViewId, json, splitmix64, word_enum};
use mateval_files::FileError;
use mateval_files::work_folder::make_folder;
use mateval_image::exr_io::{self, Precision};
use mateval_image::{LinearRgb, Picture, png_io};

use crate::blender_job::{BlenderView, LightPictures};
use crate::error::PrepError;
use crate::views::write_preview;

word_enum! {
    /// In the order of [`RendererKind::ALL`], the first one that has rendered all views of a dataset makes its input
    /// pictures. The word is also that of the command line, of `render.json`, and of the folder of its pictures.
    RendererKind, a "renderer":
    /// Blender's Cycles.
    Blender = "blender",
    /// MatEval's own path tracer.
    Builtin = "builtin",
}

impl RendererKind {
    /// What the renderer is, in one sentence for a help text.
    pub fn summary(self) -> &'static str {
        match self {
            Self::Blender => "Blender's Cycles: denoised, and each light group in pictures of its own",
            Self::Builtin => "The built-in path tracer",
        }
    }

    /// The name as a dataset's files hold it.
    pub fn id(self) -> RendererId {
        RendererId::new(self.word()).expect("every renderer's word is a valid id")
    }
}

#[derive(Clone, Debug, Default)]
pub struct RenderReport {
    pub rendered: usize,
    /// Number of views that an earlier run had rendered.
    pub kept: usize,
    /// What a user should know, one line each.
    pub remarks: Vec<String>,
    /// Scenes that could not be rendered, and why. All other scenes were rendered.
    pub failures: Vec<Finding>,
}

impl RenderReport {
    /// Adds the report of another scene.
    pub(super) fn add(&mut self, other: Self) {
        self.rendered += other.rendered;
        self.kept += other.kept;
        self.remarks.extend(other.remarks);
        self.failures.extend(other.failures);
    }
}

/// Number of scatterings after the first hit after which a path is cut.
pub const MAX_BOUNCES: u32 = 16;

/// The settings that all views of a run share.
pub(super) struct RenderRun<'a> {
    pub(super) root: &'a Path,
    pub(super) renderer: RendererId,
    /// Samples per pixel of each half.
    pub(super) samples: u32,
    /// Whether pictures that already exist are rendered again.
    pub(super) force: bool,
    /// Whether scenes are rendered one after the other.
    pub(super) one_at_a_time: bool,
}

impl RenderRun<'_> {
    /// Renders a scene by `work`, as [`change_scene`], and records its cost.
    pub(super) fn on_scene<T>(
        &self,
        id: &SceneId,
        work: impl FnOnce() -> Result<T, PrepError>,
    ) -> Result<T, PrepError> {
        let ours = format!("/ground_truth/renders/{}/", self.renderer);
        let shown = format!("/views/{INPUT}/rgb.");
        let step = TimedStep { step: Step::Render, renderer: Some(&self.renderer), is_alone: self.one_at_a_time };
        let work = || scene_cost::timed(self.root, id, &step, work);
        change_scene(self.root, id, |path| path.contains(&ours) || path.contains(&shown), work)
    }

    /// The record of the view's pictures, where they exist and were made with these settings.
    pub(super) fn done(&self, folder: &SceneFolder, view: &View, seeds: &[String; 2]) -> Option<RenderFile> {
        let path = folder.render(&self.renderer, &view.id).join(RENDER_FILE);
        let has_same_settings = |found: &RenderFile| {
            (found.samples_each_half, &found.seeds, found.max_bounces) == (self.samples, seeds, MAX_BOUNCES)
        };
        json::read::<RenderFile>(&path).ok().filter(|found| !self.force && has_same_settings(found))
    }
}

/// The seed of one half of a view's picture. The two halves must not share a sequence: their errors would be
/// correlated.
pub(super) fn seed(scene: &SceneId, view: &View, half: usize) -> u64 {
    splitmix64::seed_of(&format!("{scene}/{}/{half}", view.id))
}

/// Seeds as `render.json` holds them.
pub(super) fn seed_texts(seeds: [u64; 2]) -> [String; 2] {
    seeds.map(|seed| format!("{seed:016x}"))
}

/// The pictures of a view that are written.
pub(super) struct ViewRender<'a> {
    pub(super) halves: [&'a LightPictures; 2],
    /// What people see: their mean, denoised.
    pub(super) shown: &'a LightPictures,
    /// Pictures that only Blender makes: base colour, ids, depth, normals.
    pub(super) passes: Option<&'a BlenderView>,
}

/// Writes the pictures. `render.json` is removed first and written last, so it never exists beside pictures of two
/// runs.
pub(super) fn write_view(
    place: &Path,
    render: &ViewRender<'_>,
    exposure: f64,
    file: &RenderFile,
) -> Result<(), PrepError> {
    make_folder(place)?;
    let mark = place.join(RENDER_FILE);
    if mark.exists() {
        std::fs::remove_file(&mark).map_err(FileError::io("remove", &mark))?;
    }
    let light = |name: &str, picture: &Picture<LinearRgb>| {
        exr_io::write_linear(&place.join(format!("{name}.exr")), picture, Precision::Float)
    };
    let [a, b] = render.halves;
    light("rgb_a", &a.rgb)?;
    light("rgb_b", &b.rgb)?;
    light("rgb", &render.shown.rgb)?;
    for (at, ((a, b), shown)) in a.groups.iter().zip(&b.groups).zip(&render.shown.groups).enumerate() {
        light(&format!("group_{at:02}_a"), a)?;
        light(&format!("group_{at:02}_b"), b)?;
        light(&format!("group_{at:02}"), shown)?;
    }
    write_preview(place, &render.shown.rgb, exposure)?;
    if let Some(view) = render.passes {
        write_passes(place, view)?;
    }
    Ok(json::write(&mark, file)?)
}

fn write_passes(place: &Path, view: &BlenderView) -> Result<(), PrepError> {
    exr_io::write_linear(&place.join("base_color.exr"), &view.base_color, Precision::Float)?;
    exr_io::write_scalar(&place.join("depth.exr"), &view.depth, Precision::Float)?;
    exr_io::write_normal(&place.join("normal.exr"), &view.normal, Precision::Half)?;
    png_io::write_ids(&place.join("instance.png"), &view.instance)?;
    png_io::write_ids(&place.join("part.png"), &view.part)?;
    Ok(())
}

/// Whether the renderer has rendered the scene's input view.
pub(crate) fn can_show_input(folder: &SceneFolder, renderer: &RendererId) -> bool {
    let input = ViewId::input();
    folder.render(renderer, &input).join(RENDER_FILE).is_file()
}

/// Copies the renderer's picture of the input view to `views/input/`, as the photo that methods see. Does nothing where
/// the renderer has not rendered that view.
pub(crate) fn show_input(folder: &SceneFolder, renderer: &RendererId) -> Result<(), PrepError> {
    let input = ViewId::input();
    let (from, to) = (folder.render(renderer, &input), folder.view(&input));
    if !can_show_input(folder, renderer) {
        return Ok(());
    }
    for name in ["rgb.exr", "rgb.png"] {
        let bytes = std::fs::read(from.join(name)).map_err(FileError::io("read", from.join(name)))?;
        if std::fs::read(to.join(name)).is_ok_and(|found| found == bytes) {
            continue;
        }
        mateval_files::whole::write_whole(&to.join(name), &bytes)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_parses_back_and_is_an_id() {
        for &kind in RendererKind::ALL {
            assert_eq!(kind.to_string().parse(), Ok(kind));
            assert_eq!(kind.id().as_str(), kind.word());
        }
        let unknown = "povray".parse::<RendererKind>().unwrap_err();
        assert_eq!(unknown.to_string(), "'povray' is not a renderer; expected one of: blender, builtin");
    }
}
