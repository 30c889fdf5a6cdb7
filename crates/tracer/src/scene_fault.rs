//! What is wrong with a scene, by the part that is at fault.

use glam::Vec3;
use mateval_scene::reference::{LightIndex, MaterialIndex, SurfaceIndex};

/// A part of a scene that contradicts itself or the rest of the scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SceneFault {
    /// A surface.
    #[error("surface {}{}: {fault}", surface.0, quoted(name))]
    Surface {
        /// Its place in the scene.
        surface: SurfaceIndex,
        /// Its name, where the meshes come with names.
        name: Option<String>,
        /// The fault.
        fault: SurfaceFault,
    },
    /// A material.
    #[error("material {} '{name}': {fault}", material.0)]
    Material {
        /// Its place in the scene.
        material: MaterialIndex,
        /// Its name.
        name: String,
        /// The fault.
        fault: MaterialFault,
    },
    /// A group of lights.
    #[error("light {} '{name}': {fault}", light.0)]
    Light {
        /// Its place in the scene.
        light: LightIndex,
        /// Its name.
        name: String,
        /// The fault.
        fault: LightFault,
    },
}

/// What is wrong with a surface.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceFault {
    /// It names a material that does not exist.
    #[error("material {material} does not exist; the scene has {count} materials")]
    MissingMaterial {
        /// The material named.
        material: usize,
        /// How many materials the scene has.
        count: usize,
    },
    /// A coordinate is not finite or too large for `f32` to resolve a metre.
    #[error("vertex {vertex} is at {position}, expected within {limit:e} m of the origin along each axis")]
    Position {
        /// The vertex.
        vertex: usize,
        /// Its position, in metres.
        position: Vec3,
        /// The largest coordinate, in metres.
        limit: f32,
    },
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} names vertices {vertices:?}, expected indices below {count}")]
    MissingVertex {
        /// The triangle.
        triangle: usize,
        /// The vertices named.
        vertices: [u32; 3],
        /// How many vertices the mesh has.
        count: usize,
    },
    /// The number of normals or uvs differs from the number of vertices.
    #[error("{found} {attribute}, expected one for each of {expected} vertices")]
    AttributeCount {
        /// Which array: "normals" or "uvs".
        attribute: &'static str,
        /// Its length.
        found: usize,
        /// The number of vertices.
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

/// What is wrong with a material.
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
    MissingTexture {
        /// The texture named.
        texture: usize,
        /// How many textures the scene has.
        count: usize,
    },
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
    MissingTexture {
        /// The texture named.
        texture: usize,
        /// How many textures the scene has.
        count: usize,
    },
    /// It names a surface that does not exist.
    #[error("surface {surface} does not exist; the scene has {count} surfaces")]
    MissingSurface {
        /// The surface named.
        surface: usize,
        /// How many surfaces the scene has.
        count: usize,
    },
    /// One of its surfaces emits for another light already.
    #[error("surface {0} emits twice, expected one light per surface")]
    SharedSurface(usize),
    /// The transform of its map's uv is not finite.
    #[error("the uv transform of its map is {0:?}, expected finite values")]
    MapTransform([[f32; 3]; 2]),
    /// A texel of its map is negative or not finite.
    #[error("texture {texture} holds the value {value}, expected finite values of at least 0")]
    MapValue {
        /// The texture.
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
