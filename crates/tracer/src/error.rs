//! The error of this crate, split by what a caller can do about it.

use glam::Vec3;
use mateval_dataset::reference::{LightIndex, MaterialIndex, SurfaceIndex};

/// Why something cannot be traced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TracerError {
    /// The scene contradicts itself: fix the scene.
    #[error("invalid scene: {0}")]
    InvalidScene(#[from] ElementFault),
    /// The arguments of a call contradict each other or the world: fix the call.
    #[error("invalid request: {0}")]
    InvalidRequest(#[from] RequestFault),
    /// Everything is sound, but exceeds a limit: ask for less, or raise the limit where the caller sets it.
    #[error("unsupported: {0}")]
    Unsupported(#[from] ExceededLimit),
}

/// A part of a scene that contradicts itself or the rest of the scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ElementFault {
    #[error("surface {}{}: {fault}", surface.0, quoted(name))]
    Surface {
        surface: SurfaceIndex,
        /// Its name, where the meshes come with names.
        name: Option<String>,
        fault: SurfaceFault,
    },
    #[error("material {} '{name}': {fault}", material.0)]
    Material { material: MaterialIndex, name: String, fault: MaterialFault },
    #[error("light {} '{name}': {fault}", light.0)]
    Light { light: LightIndex, name: String, fault: LightFault },
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceFault {
    #[error("material {material} does not exist; the scene has {count} materials")]
    MissingMaterial { material: usize, count: usize },
    #[error("vertex {vertex} is at {position}, expected within {limit:e} m of the origin along each axis")]
    Position { vertex: usize, position: Vec3, limit: f32 },
    #[error("triangle {triangle} names vertices {vertices:?}, expected indices below {count}")]
    MissingVertex { triangle: usize, vertices: [u32; 3], count: usize },
    #[error("{found} {attribute}, expected one for each of {expected} vertices")]
    AttributeCount {
        /// Which array: "normals" or "uvs".
        attribute: &'static str,
        found: usize,
        expected: usize,
    },
    #[error("the {attribute} hold a value at vertex {vertex} that is not finite")]
    AttributeNotFinite {
        /// Which array: "normals" or "uvs".
        attribute: &'static str,
        vertex: usize,
    },
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MaterialFault {
    #[error("value {0}, expected a finite one")]
    NotFinite(f32),
    #[error("index of refraction {0}, expected a finite one above 0")]
    IndexOfRefraction(f32),
    #[error("texture {texture} does not exist; the scene has {count} textures")]
    MissingTexture { texture: usize, count: usize },
    #[error("texture channel {0}, expected 0, 1 or 2")]
    MissingChannel(usize),
}

/// What is wrong with a light, of the scene or of a stage.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LightFault {
    #[error("radiance {0:?}, expected finite values of at least 0")]
    Radiance([f32; 3]),
    #[error("texture {texture} does not exist; the scene has {count} textures")]
    MissingTexture { texture: usize, count: usize },
    #[error("surface {surface} does not exist; the scene has {count} surfaces")]
    MissingSurface { surface: usize, count: usize },
    #[error("surface {0} emits twice, expected one light per surface")]
    SharedSurface(usize),
    #[error("the uv transform of its map is {0:?}, expected finite values")]
    MapTransform([[f32; 3]; 2]),
    #[error("texture {texture} holds the value {value}, expected finite values of at least 0")]
    MapValue { texture: usize, value: f32 },
    #[error("scale {0} of its environment map, expected a finite one of at least 0")]
    EnvironmentScale(f32),
    #[error("rotation {0:?} of its environment map, expected finite values")]
    EnvironmentRotation([[f32; 3]; 3]),
    #[error("its mesh has no triangles, expected at least one")]
    NoTriangles,
}

fn quoted(name: &Option<String>) -> String {
    name.as_ref().map_or_else(String::new, |name| format!(" '{name}'"))
}

/// An argument that contradicts another, or the world it is used with.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RequestFault {
    #[error("stage light {}: {fault}", light.0)]
    StageLight { light: LightIndex, fault: LightFault },
    #[error("stage light {}: {fault}", light.0)]
    StageMesh { light: LightIndex, fault: SurfaceFault },
    #[error("{0} samples per pixel, expected at least 1")]
    Samples(u32),
    #[error("roulette survival {0}, expected above 0 and at most 1")]
    RouletteSurvival(f32),
    #[error("seed {0} occurs twice, expected another seed for each half")]
    RepeatedSeed(u64),
    #[error("the hierarchy was built from other triangles than the scene's: it holds {hierarchy}, the scene {scene}")]
    OtherTriangles { hierarchy: usize, scene: usize },
    #[error("light mixes for {found} predictions, expected {expected}")]
    MixedPredictions { found: usize, expected: usize },
    #[error("{found} light mixes for prediction {prediction}, expected {expected} as for the first")]
    MixCount { prediction: usize, found: usize, expected: usize },
    #[error("{found} weights, expected {expected}: one for each light or group of lights")]
    WeightCount { found: usize, expected: usize },
    #[error("weight {found} of light {}, expected a finite one of at least 0", light.0)]
    Weight { light: LightIndex, found: f64 },
    #[error("{atlases} atlases and maps of {maps} surfaces, expected one of each for each of {surfaces} surfaces")]
    SurfaceCount { atlases: usize, maps: usize, surfaces: usize },
    #[error("surface {} '{name}': an atlas of {found} triangles for a mesh of {expected}", surface.0)]
    AtlasTriangles { surface: SurfaceIndex, name: String, found: usize, expected: usize },
    #[error("surface {} '{name}': maps whose atlas lacks a finite uv for some vertex", surface.0)]
    AtlasUv { surface: SurfaceIndex, name: String },
    #[error("surface {} '{name}': {found} base colours, expected {expected} on each surface", surface.0)]
    BaseColorCount { surface: SurfaceIndex, name: String, found: usize, expected: usize },
    #[error("the second roughness and metallic do not cover exactly the surfaces that have a coat")]
    SecondScattering,
    #[error("predictions for {found} surfaces in a world of {expected}")]
    OtherWorld { found: usize, expected: usize },
    #[error("a picture of {}x{}, expected {}x{}", found[0], found[1], expected[0], expected[1])]
    PictureSize { found: [usize; 2], expected: [usize; 2] },
}

/// A limit that a sound request exceeds.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExceededLimit {
    #[error("{found} triangles, the limit is {limit}")]
    Triangles { found: usize, limit: usize },
    #[error("{pictures} pictures of {width}x{height} take {bytes} bytes, the limit is {limit}")]
    PictureBytes { pictures: usize, width: usize, height: usize, bytes: u64, limit: u64 },
}
