//! What a scene consists of, whatever file holds it: ids, cameras, meshes with their atlases, materials, findings.

pub mod camera;
pub mod findings;
pub mod ids;
pub mod lens;
pub mod lighting;
pub mod material;
pub mod mesh;
pub mod uv_atlas;
