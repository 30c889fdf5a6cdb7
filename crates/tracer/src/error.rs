//! The error of this crate, split by what a caller can do about it.

use glam::Vec3;
use mateval_dataset::reference::{LightIndex, MaterialIndex, SurfaceIndex};

/// Why something cannot be traced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TracerError {
    /// The scene contradicts itself: fix the scene.
    #[error("invalid scene: {0}")]
    InvalidScene(#[from] SceneFault),
    /// The arguments of a call contradict each other or the world: fix the call.
    #[error("invalid request: {0}")]
    InvalidRequest(#[from] RequestFault),
    /// Everything is sound, but exceeds a limit: ask for less, or raise the limit where the caller sets it.
    #[error("unsupported: {0}")]
    Unsupported(#[from] ExceededLimit),
}

/// A part of a scene that contradicts itself or the rest of the scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SceneFault {
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
    /// It names a material that does not exist.
    #[error("material {material} does not exist; the scene has {count} materials")]
    MissingMaterial { material: usize, count: usize },
    /// A coordinate is not finite or too large for `f32` to resolve a metre.
    #[error("vertex {vertex} is at {position}, expected within {limit:e} m of the origin along each axis")]
    Position {
        vertex: usize,
        /// Its position, in metres.
        position: Vec3,
        /// The largest coordinate, in metres.
        limit: f32,
    },
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} names vertices {vertices:?}, expected indices below {count}")]
    MissingVertex { triangle: usize, vertices: [u32; 3], count: usize },
    /// The number of normals or uvs differs from the number of vertices.
    #[error("{found} {attribute}, expected one for each of {expected} vertices")]
    AttributeCount {
        /// Which array: "normals" or "uvs".
        attribute: &'static str,
        found: usize,
        expected: usize,
    },
    /// A normal or a uv is not finite.
    #[error("the {attribute} hold a value at vertex {vertex} that is not finite")]
    AttributeNotFinite {
        /// Which array: "normals" or "uvs".
        attribute: &'static str,
        /// The first vertex concerned.
        vertex: usize,
    },
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MaterialFault {
    /// A constant is not finite.
    #[error("value {0}, expected a finite one")]
    NotFinite(f32),
    /// An index of refraction is not a finite number above 0.
    #[error("index of refraction {0}, expected a finite one above 0")]
    IndexOfRefraction(f32),
    /// It names a texture that does not exist.
    #[error("texture {texture} does not exist; the scene has {count} textures")]
    MissingTexture { texture: usize, count: usize },
    /// It names a channel that textures do not have.
    #[error("texture channel {0}, expected 0, 1 or 2")]
    MissingChannel(usize),
}

/// What is wrong with a light, of the scene or of a stage.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LightFault {
    /// Its radiance is negative or not finite.
    #[error("radiance {0:?}, expected finite values of at least 0")]
    Radiance([f32; 3]),
    /// It names a texture that does not exist.
    #[error("texture {texture} does not exist; the scene has {count} textures")]
    MissingTexture { texture: usize, count: usize },
    /// It names a surface that does not exist.
    #[error("surface {surface} does not exist; the scene has {count} surfaces")]
    MissingSurface { surface: usize, count: usize },
    /// One of its surfaces emits for another light already.
    #[error("surface {0} emits twice, expected one light per surface")]
    SharedSurface(usize),
    /// The transform of its map's uv is not finite.
    #[error("the uv transform of its map is {0:?}, expected finite values")]
    MapTransform([[f32; 3]; 2]),
    /// A texel of its map is negative or not finite.
    #[error("texture {texture} holds the value {value}, expected finite values of at least 0")]
    MapValue {
        texture: usize,
        /// The first such value.
        value: f32,
    },
    /// The scale of its environment map is negative or not finite.
    #[error("scale {0} of its environment map, expected a finite one of at least 0")]
    EnvironmentScale(f32),
    /// The rotation of its environment map is not finite.
    #[error("rotation {0:?} of its environment map, expected finite values")]
    EnvironmentRotation([[f32; 3]; 3]),
    /// A light of a stage has no triangles.
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
    StageLight {
        /// Its place on the stage.
        light: LightIndex,
        fault: LightFault,
    },
    #[error("stage light {}: {fault}", light.0)]
    StageMesh {
        /// Its place on the stage.
        light: LightIndex,
        fault: SurfaceFault,
    },
    #[error("{0} samples per pixel, expected at least 1")]
    Samples(u32),
    /// The probability of surviving Russian roulette is out of range.
    #[error("roulette survival {0}, expected above 0 and at most 1")]
    RouletteSurvival(f32),
    /// Two halves would be the same picture.
    #[error("seed {0} occurs twice, expected another seed for each half")]
    RepeatedSeed(u64),
    /// A hierarchy is shared with a scene of other triangles.
    #[error("the hierarchy was built from other triangles than the scene's: it holds {hierarchy}, the scene {scene}")]
    OtherTriangles { hierarchy: usize, scene: usize },
    /// The number of lists of light mixes differs from the number of predictions.
    #[error("light mixes for {found} predictions, expected {expected}")]
    MixedPredictions {
        /// For how many predictions there are mixes.
        found: usize,
        expected: usize,
    },
    /// Predictions have different numbers of mixes.
    #[error("{found} light mixes for prediction {prediction}, expected {expected} as for the first")]
    MixCount {
        prediction: usize,
        found: usize,
        /// How many the first one has.
        expected: usize,
    },
    /// A mix or a weighted sum does not have one weight for each light or group of lights.
    #[error("{found} weights, expected {expected}: one for each light or group of lights")]
    WeightCount { found: usize, expected: usize },
    /// A weight is negative or not finite.
    #[error("weight {found} of light {}, expected a finite one of at least 0", light.0)]
    Weight { light: LightIndex, found: f64 },
    /// Predictions were made for a world with another number of surfaces.
    #[error("{atlases} atlases and {coats} coats, expected one of each for each of {surfaces} surfaces")]
    SurfaceCount {
        atlases: usize,
        /// How many coats there are, missing ones included.
        coats: usize,
        surfaces: usize,
    },
    /// An atlas has other triangles than its surface.
    #[error("surface {} '{name}': an atlas of {found} triangles for a mesh of {expected}", surface.0)]
    AtlasTriangles { surface: SurfaceIndex, name: String, found: usize, expected: usize },
    /// A surface has a coat, but its atlas does not have one finite uv for each vertex.
    #[error("surface {} '{name}': a coat whose atlas lacks a finite uv for some vertex", surface.0)]
    AtlasUv { surface: SurfaceIndex, name: String },
    /// Coats hold different numbers of base colours, or none.
    #[error("surface {} '{name}': {found} base colours, expected {expected} on each surface", surface.0)]
    BaseColorCount {
        surface: SurfaceIndex,
        name: String,
        found: usize,
        /// The largest number on any surface; at least 1.
        expected: usize,
    },
    /// The second roughness and metallic are of other surfaces than the coats.
    #[error("the second roughness and metallic do not cover exactly the surfaces that have a coat")]
    SecondScattering,
    /// Predictions are used with another world than they were made for.
    #[error("predictions for {found} surfaces in a world of {expected}")]
    OtherWorld { found: usize, expected: usize },
    /// Pictures of one light basis differ in size, or a picture differs from the view that it belongs to.
    #[error("a picture of {}x{}, expected {}x{}", found[0], found[1], expected[0], expected[1])]
    PictureSize {
        /// Width and height of the first picture that differs.
        found: [usize; 2],
        /// Width and height of the basis or view.
        expected: [usize; 2],
    },
}

/// A limit that a sound request exceeds.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExceededLimit {
    /// More triangles than the hierarchy can number.
    #[error("{found} triangles, the limit is {limit}")]
    Triangles { found: usize, limit: usize },
    /// The pictures of a view's lights take too much memory.
    #[error("{pictures} pictures of {width}x{height} take {bytes} bytes, the limit is {limit}")]
    PictureBytes { pictures: usize, width: usize, height: usize, bytes: u64, limit: u64 },
}
