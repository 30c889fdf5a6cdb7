//! What views are compared with.

use mateval_image::{LinearRgb, Mask, Picture, exr_io, png_io};
use mateval_scene::RendererId;
use mateval_scene::dataset::View;
use mateval_scene::layout::{INPUT, SceneFolder};
use mateval_tracer::LightBasis;

use crate::error::EvalError;
use crate::relit::RelitLighting;

/// A view's true maps and its masks.
pub struct ViewTruth {
    /// base_color, linear.
    pub albedo: Picture<LinearRgb>,
    /// Perceptual, 0 to 1.
    pub roughness: Picture<f32>,
    /// 0 to 1.
    pub metallic: Picture<f32>,
    /// What is scored.
    pub valid: Mask,
    /// Valid and not seen by the input view; none for the input view.
    pub unobserved: Option<Mask>,
    /// Valid and metal or smooth in truth; none where nothing is.
    pub specular: Option<Mask>,
    /// Instance index of each pixel's centre, 0 for nothing.
    pub instances: Picture<u16>,
}

impl ViewTruth {
    /// Reads a view's maps and masks. Fails where one is missing, unreadable or not of the camera's size.
    pub fn read(folder: &SceneFolder, view: &View) -> Result<Self, EvalError> {
        let (shown, hidden) = (folder.view(&view.id), folder.truth_view(&view.id));
        let valid = png_io::read_mask(&shown.join("valid.png"))?;
        let is_input = view.id.as_str() == INPUT;
        let unobserved = (!is_input).then(|| png_io::read_mask(&shown.join("unobserved.png"))).transpose()?;
        let truth = Self {
            albedo: exr_io::read_linear(&hidden.join("albedo.exr"))?,
            roughness: exr_io::read_scalar(&hidden.join("roughness.exr"))?,
            metallic: exr_io::read_scalar(&hidden.join("metallic.exr"))?,
            specular: None,
            instances: png_io::read_ids(&shown.join("instance.png"))?,
            unobserved,
            valid,
        };
        let specular = png_io::read_mask(&hidden.join("specular_region.png"))?;
        let sizes = [
            size(&truth.albedo),
            size(&truth.roughness),
            size(&truth.metallic),
            size(&truth.valid),
            truth.unobserved.as_ref().map_or(size(&truth.valid), size),
            size(&truth.instances),
            size(&specular),
        ];
        check_sizes(view, &sizes)?;
        let both = intersection(&specular, &truth.valid);
        Ok(Self { specular: both.pixels().contains(&true).then_some(both), ..truth })
    }
}

/// A view's light: two independent halves and what SSIM, LPIPS and the fit look at; linear, before exposure.
#[derive(Clone, Debug)]
pub struct RgbTruth {
    /// The halves.
    pub halves: [Picture<LinearRgb>; 2],
    /// Denoised, or their mean.
    pub shown: Picture<LinearRgb>,
}

impl RgbTruth {
    /// The view under the scene's own lights.
    pub fn read(folder: &SceneFolder, renderer: &RendererId, view: &View) -> Result<Self, EvalError> {
        Self::named(folder, renderer, view, "rgb")
    }

    /// The view under one light group alone.
    pub fn of_group(folder: &SceneFolder, renderer: &RendererId, view: &View, group: usize) -> Result<Self, EvalError> {
        Self::named(folder, renderer, view, &format!("group_{group:02}"))
    }

    /// The view under each of `lightings`: weighted sums of the groups' pictures, which are read once.
    pub fn relit(
        folder: &SceneFolder,
        renderer: &RendererId,
        view: &View,
        lightings: &[RelitLighting],
    ) -> Result<Vec<Self>, EvalError> {
        let Some(first) = lightings.first() else { return Ok(Vec::new()) };
        let groups = (0..first.weights.len())
            .map(|group| Self::of_group(folder, renderer, view, group))
            .collect::<Result<Vec<_>, _>>()?;
        let k = view.camera.intrinsics;
        let basis = |picture: fn(&Self) -> &Picture<LinearRgb>| {
            LightBasis::new(k.width as usize, k.height as usize, groups.iter().map(|g| picture(g).clone()).collect())
        };
        let [a, b, shown] = [basis(|g| &g.halves[0])?, basis(|g| &g.halves[1])?, basis(|g| &g.shown)?];
        let mixed = |lighting: &RelitLighting| {
            let halves = [a.weighted(&lighting.weights)?, b.weighted(&lighting.weights)?];
            Ok(Self { halves, shown: shown.weighted(&lighting.weights)? })
        };
        lightings.iter().map(mixed).collect()
    }

    fn named(folder: &SceneFolder, renderer: &RendererId, view: &View, name: &str) -> Result<Self, EvalError> {
        let place = folder.render(renderer, &view.id);
        let read = |ending: &str| exr_io::read_linear(&place.join(format!("{name}{ending}.exr")));
        let truth = Self { halves: [read("_a")?, read("_b")?], shown: read("")? };
        check_sizes(view, &[size(&truth.halves[0]), size(&truth.halves[1]), size(&truth.shown)])?;
        Ok(truth)
    }
}

/// Where both masks are set; they are of one size.
pub(crate) fn intersection(a: &Mask, b: &Mask) -> Mask {
    Mask::from_fn(a.width(), a.height(), |x, y| a.get(x, y) && b.get(x, y))
}

fn size<T: Copy>(picture: &Picture<T>) -> (usize, usize) {
    (picture.width(), picture.height())
}

fn check_sizes(view: &View, sizes: &[(usize, usize)]) -> Result<(), EvalError> {
    let expected = (view.camera.intrinsics.width as usize, view.camera.intrinsics.height as usize);
    if sizes.iter().all(|found| *found == expected) {
        return Ok(());
    }
    let what = format!("view '{}': the truth's pictures are not of the camera's size", view.id);
    Err(EvalError::Invalid(format!("{what}; run `mateval prep verify`")))
}
