//! A scene and its true renders: the input for rendering predictions and for fitting their lights.

use mateval_image::{LinearRgb, Mask, Picture};
use mateval_scene::TriangleMesh;
use mateval_scene::dataset::{SceneFile, View};
use mateval_tracer::World;

use crate::relit::RelitLighting;
use crate::rgb::LightReference;
use crate::truth::ViewTruth;

/// A scene, and the true renders that predictions are compared with.
pub struct LitScene<'a> {
    /// `scene.json`.
    pub scene: &'a SceneFile,
    /// Its true surfaces, materials and lights.
    pub world: &'a World,
    /// The meshes of `instances.glb`, one for each surface of the world.
    pub atlases: &'a [TriangleMesh],
    /// The views that are scored.
    pub views: Vec<&'a View>,
    /// The truth of each view.
    pub truths: &'a [ViewTruth],
    /// The reference pictures of each view, under the scene's own lights.
    pub references: &'a [LightReference],
    /// The noise blocks of each view, from [`crate::noise_blocks`].
    pub blocks: &'a [Picture<u32>],
    /// The picture that radiances are fitted to.
    pub photo: Photo<'a>,
    /// The lightings of track `relit`.
    pub lightings: Vec<RelitLighting>,
}

/// The input view as the truth shows it.
#[derive(Clone)]
pub struct Photo<'a> {
    /// The view.
    pub view: &'a View,
    /// Its picture, linear, before exposure.
    pub light: Picture<LinearRgb>,
    /// The pixels that count.
    pub valid: &'a Mask,
}
