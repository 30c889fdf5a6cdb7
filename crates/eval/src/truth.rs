//! The ground truth of views: maps, masks and light.

use mateval_image::{LinearRgb, Mask, Normal, Picture, exr_io, png_io};
use mateval_scene::RendererId;
use mateval_scene::dataset::View;
use mateval_scene::layout::{INPUT, SceneFolder};
use mateval_tracer::LightBasis;

use crate::error::EvalError;
use crate::relit::RelitLighting;
use crate::stored_light::StoredLight;

/// A view's true maps and its masks.
pub struct ViewTruth {
    /// base_color, linear.
    pub albedo: Picture<LinearRgb>,
    /// Perceptual, 0 to 1.
    pub roughness: Picture<f32>,
    /// 0 to 1.
    pub metallic: Picture<f32>,
    /// The pixels that are scored.
    pub valid: Mask,
    /// Valid pixels that the input view does not see; none for the input view.
    pub unobserved: Option<Mask>,
    /// Valid pixels that are metal or smooth in truth; none if there are no such pixels.
    pub specular: Option<Mask>,
    /// Instance index of each pixel's centre, 0 for nothing.
    pub instances: Picture<u16>,
    /// Normal at each pixel's centre, in world space.
    pub normals: Picture<Normal>,
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
            normals: exr_io::read_normal(&shown.join("normal.exr"))?,
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
            size(&truth.normals),
            size(&specular),
        ];
        check_sizes(view, &sizes)?;
        let both = intersection(&specular, &truth.valid);
        Ok(Self { specular: both.pixels().contains(&true).then_some(both), ..truth })
    }
}

/// A view's light, linear, before exposure: two independent halves, and the picture for SSIM, LPIPS and the fit.
#[derive(Clone, Debug)]
pub struct RgbTruth {
    /// The halves.
    pub halves: [Picture<LinearRgb>; 2],
    /// Their mean, with its noise taken out.
    pub shown: Picture<LinearRgb>,
}

impl RgbTruth {
    /// The view under the scene's own lights.
    pub fn read(folder: &SceneFolder, renderer: &RendererId, view: &View) -> Result<Self, EvalError> {
        let part = |name: &str| Self::read_part(folder, renderer, view, name);
        Ok(Self { halves: [part("rgb_a")?, part("rgb_b")?], shown: part("rgb")? })
    }

    /// The denoised picture of the view under one light group alone.
    pub fn shown_of_group(
        folder: &SceneFolder,
        renderer: &RendererId,
        view: &View,
        group: usize,
    ) -> Result<Picture<LinearRgb>, EvalError> {
        Self::read_part(folder, renderer, view, &group_name(group))
    }

    fn read_part(
        folder: &SceneFolder,
        renderer: &RendererId,
        view: &View,
        name: &str,
    ) -> Result<Picture<LinearRgb>, EvalError> {
        let picture = exr_io::read_linear(&folder.render(renderer, &view.id).join(format!("{name}.exr")))?;
        check_sizes(view, &[size(&picture)])?;
        Ok(picture)
    }
}

/// A view's light under one lighting, exposed: two independent halves, and the picture for SSIM and LPIPS.
pub struct TrueLight {
    /// The halves.
    pub(crate) halves: [StoredLight; 2],
    /// Their mean, with its noise taken out.
    pub(crate) shown: StoredLight,
}

impl TrueLight {
    /// The light of a view under the scene's own lights.
    pub fn new(truth: &RgbTruth, exposure: f64) -> Self {
        let stored = |picture| StoredLight::exposed(picture, exposure);
        Self { halves: [stored(&truth.halves[0]), stored(&truth.halves[1])], shown: stored(&truth.shown) }
    }

    /// The halves, exposed.
    pub fn halves(&self) -> [Picture<LinearRgb>; 2] {
        [0, 1].map(|half| self.halves[half].picture())
    }

    /// The view under each of `lightings`: weighted sums of the groups' pictures, each of which is read once.
    pub fn relit(
        folder: &SceneFolder,
        renderer: &RendererId,
        view: &View,
        lightings: &[RelitLighting],
        exposure: f64,
    ) -> Result<Vec<Self>, EvalError> {
        let Some(first) = lightings.first() else { return Ok(Vec::new()) };
        let k = view.camera.intrinsics;
        let mixed = |ending: &str| -> Result<Vec<StoredLight>, EvalError> {
            let group = |group| RgbTruth::read_part(folder, renderer, view, &format!("{}{ending}", group_name(group)));
            let pictures = (0..first.weights.len()).map(group).collect::<Result<_, _>>()?;
            let basis = LightBasis::new(k.width as usize, k.height as usize, pictures)?;
            let mix =
                |lighting: &RelitLighting| Ok(StoredLight::exposed(&basis.weighted(&lighting.weights)?, exposure));
            lightings.iter().map(mix).collect()
        };
        let (a, b, shown) = (mixed("_a")?, mixed("_b")?, mixed("")?);
        let lights = a.into_iter().zip(b).zip(shown);
        Ok(lights.map(|((a, b), shown)| Self { halves: [a, b], shown }).collect())
    }
}

fn group_name(group: usize) -> String {
    format!("group_{group:02}")
}

/// The pixels where both masks are set. The masks have the same size.
pub(crate) fn intersection(a: &Mask, b: &Mask) -> Mask {
    Mask::from_fn(a.width(), a.height(), |x, y| a.get(x, y) && b.get(x, y))
}

fn size<T: Copy>(picture: &Picture<T>) -> (usize, usize) {
    (picture.width(), picture.height())
}

fn check_sizes(view: &View, sizes: &[(usize, usize)]) -> Result<(), EvalError> {
    let expected = (view.camera.intrinsics.width as usize, view.camera.intrinsics.height as usize);
    match sizes.iter().find(|found| **found != expected) {
        None => Ok(()),
        Some(found) => Err(EvalError::TruthPictureSize {
            view: view.id.clone(),
            expected: expected.into(),
            found: (*found).into(),
        }),
    }
}
