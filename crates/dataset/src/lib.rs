//! The dataset format: types, reading, writing, validation.
//!
//! In: a converted scene, or a dataset's folder. Out: the same as files, or as checked Rust values.
//!
//! Each folder uses those before it: `values` (what a scene consists of), `foreign` (untrusted files of other formats),
//! `format` (the files of a dataset and of a submission), `records` (what commands note of their work on a dataset).
//! [`open`] reads a dataset through all of them.

mod foreign {
    //! Reads untrusted files of formats that are not ours: glTF and OBJ, with their materials.

    pub mod gltf_file;
    pub mod obj;
    pub mod specular_glossiness;
}

mod format {
    //! The files of a dataset and of a submission: their JSON types, paths, geometry and manifest.

    pub mod dataset;
    pub mod glb;
    pub mod json;
    pub mod layout;
    pub mod manifest;
    pub mod measured;
    pub mod reference;
    pub mod submission;
    pub mod withheld;
}

mod records {
    //! What commands note of their work on a dataset: who is changing what, how pictures were rendered, what a scene has
    //! cost, whether two renderers agree.

    pub mod changes;
    pub mod render_file;
    pub mod scene_cost;
    pub mod verdict;
}

mod values {
    //! What a scene consists of, whatever file holds it: ids, cameras, meshes with their atlases, materials, findings.

    pub mod camera;
    pub mod findings;
    pub mod ids;
    pub mod lens;
    pub mod lighting;
    pub mod material;
    pub mod mesh;
    pub mod uv_atlas;
}

pub mod error;
pub mod open;
pub mod progress;
pub mod splitmix64;
pub mod word_enum;

pub use foreign::{gltf_file, obj, specular_glossiness};
pub use format::{dataset, glb, json, layout, manifest, measured, reference, submission, withheld};
pub use records::{changes, render_file, scene_cost, verdict};
pub use values::{camera, findings, ids, lens, lighting, material, mesh, uv_atlas};

pub use camera::{Camera, Intrinsics};
pub use dataset::{Role, SceneLights, SourceKind};
pub use error::DatasetError;
pub use findings::{Finding, FindingCount, Severity};
pub use ids::{InstanceId, InstanceIndex, PartId, PartSetId, RendererId, SceneId, ViewId};
pub use mesh::TriangleMesh;
pub use progress::{Progress, Report};
