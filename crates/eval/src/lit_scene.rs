//! A scene and its true renders: the input for rendering predictions and for fitting their lights.

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Mask, Picture};
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::{Camera, TriangleMesh};
use mateval_tracer::World;

use crate::companions::Companions;
use crate::control_variate::base_color_ratio;
use crate::relit::{LightingName, RelitLighting};
use crate::truth::{TrueLight, ViewTruth};
use crate::view_set::ViewSet;

/// A scene, and the true renders that predictions are compared with.
pub(crate) struct LitScene<'a> {
    /// `scene.json`.
    pub(crate) scene: &'a SceneFile,
    /// Its true surfaces, materials and lights.
    pub(crate) world: &'a World,
    /// The meshes of `instances.glb`, one for each surface of the world.
    pub(crate) atlases: &'a [TriangleMesh],
    /// The views that are scored.
    pub(crate) views: Vec<&'a View>,
    /// The set that they are.
    pub(crate) set: ViewSet,
    /// The truth of each view.
    pub(crate) truths: &'a [ViewTruth],
    /// The true light of each view, by lighting (none: the scene's own lights).
    pub(crate) lights: BTreeMap<Option<LightingName>, Vec<TrueLight>>,
    /// The smallest number of samples of the truth's halves.
    pub(crate) truth_samples: u32,
    /// The noise blocks of each view, from [`crate::noise_blocks`].
    pub(crate) blocks: Vec<Picture<u32>>,
    /// The picture that radiances are fitted to.
    pub(crate) photo: Photo<'a>,
    /// The lightings of track `relit`.
    pub(crate) lightings: Vec<RelitLighting>,
    /// The companions of every prediction; without them, light takes more samples.
    pub(crate) companions: Option<&'a Companions>,
    /// The base colour of every prediction, by view.
    pub(crate) base_colors: &'a [Vec<Picture<LinearRgb>>],
}

/// The input view as the truth shows it.
#[derive(Clone)]
pub(crate) struct Photo<'a> {
    /// The view.
    pub(crate) view: &'a View,
    /// Its place among the scored views.
    pub(crate) place: usize,
    /// Its picture, linear, before exposure.
    pub(crate) light: Picture<LinearRgb>,
    /// The pixels that count.
    pub(crate) valid: &'a Mask,
    /// The light of each light group in these pixels ([`crate::relit::light_of`]).
    pub(crate) group_light: Vec<[f64; 3]>,
}

impl LitScene<'_> {
    /// The base colour of a prediction over that of the truth, in view number `view`.
    pub(crate) fn ratio(&self, prediction: usize, view: usize) -> Picture<LinearRgb> {
        base_color_ratio(&self.base_colors[prediction][view], &self.truths[view].albedo)
    }

    /// The cameras of the views.
    pub(crate) fn cameras(&self) -> Vec<Camera> {
        self.views.iter().map(|view| view.camera).collect()
    }
}
