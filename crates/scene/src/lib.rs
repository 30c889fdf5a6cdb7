//! The dataset format: types, reading, writing, validation.
//!
//! In: a converted scene, or a dataset's folder. Out: the same as files, or as checked Rust values.
//!
//! [`ids`] and [`findings`] are used everywhere; [`camera`] is the camera model; [`mod@mesh`], [`material`] and
//! [`mod@reference`] describe a scene with its materials and lights. [`dataset`], [`layout`], [`manifest`], [`open`] and
//! [`render_file`] are the files of a dataset, [`submission`] those of a submission. [`obj`], [`gltf_file`] and
//! [`source_folder`] read untrusted files; [`work_folder`] and [`lease`] guard what several processes write.

pub mod camera;
pub mod dataset;
pub mod findings;
pub mod glb;
pub mod gltf_file;
pub mod ids;
pub mod json;
pub mod layout;
pub mod lease;
pub mod manifest;
pub mod material;
pub mod mesh;
pub mod obj;
pub mod open;
pub mod progress;
pub mod reference;
pub mod render_file;
pub mod scene_cost;
pub mod source_folder;
pub mod specular_glossiness;
pub mod splitmix64;
pub mod submission;
pub mod work_folder;

pub use camera::{Camera, Intrinsics};
pub use dataset::{Role, SceneLights, SourceKind};
pub use findings::{Finding, FindingCount, SceneError, Severity};
pub use ids::{InstanceId, InstanceIndex, PartId, PartSetId, RendererId, SceneId, ViewId};
pub use mesh::TriangleMesh;
pub use progress::{Progress, Report};

// OLD PATHS, removed after the merge.
#[doc(hidden)]
pub mod build_folder {
    pub use crate::layout::{BUILD, BuildFolder};
}
#[doc(hidden)]
pub mod bounded_cache {
    pub use crate::work_folder::{keep_below, mark_used};
}
#[doc(hidden)]
pub mod dataset_id {
    pub use crate::open::DatasetId;
}
#[doc(hidden)]
pub mod role {
    pub use crate::dataset::{Role, SceneLights, SourceKind};
}
#[doc(hidden)]
pub mod perturbation {
    pub use crate::dataset::{Perturbation, PerturbationKind, PerturbedGeometry};
}
#[doc(hidden)]
pub mod super_categories {
    pub use crate::dataset::SUPER_CATEGORIES;
}
#[doc(hidden)]
pub mod error {
    pub use crate::findings::SceneError;
}
#[doc(hidden)]
pub mod text_table {
    pub use crate::progress::{Table, row};
}
#[doc(hidden)]
pub mod process_cpu {
    pub use crate::scene_cost::processor_time as used;
}
#[doc(hidden)]
pub mod scene_hashes {
    pub use crate::manifest::SceneHashes;
}
#[doc(hidden)]
pub mod scene_change {
    pub use crate::manifest::change_scene;
}
#[doc(hidden)]
pub mod render_noise {
    pub use crate::render_file::RenderNoise;
}
#[doc(hidden)]
pub mod scorer_file {
    pub use crate::render_file::{SCORER_FORMAT, ScorerFile, light_inputs_sha256};
}
#[doc(hidden)]
pub mod compare_file {
    pub use crate::render_file::{CompareCounts, CompareFile, VERDICT_FORMAT};
}
#[doc(hidden)]
pub mod triangle {
    pub use crate::mesh::{nearest_weights, triangle_distance as distance};
}
#[doc(hidden)]
pub mod uv_atlas {
    pub use crate::mesh::UvAtlas;
}
#[doc(hidden)]
pub mod material_class {
    pub use crate::material::{ClassifiedPart, MaterialClass, MaterialClassesFile};
}
#[doc(hidden)]
pub mod source_materials {
    pub use crate::reference::SourceMaterials;
}
#[doc(hidden)]
pub mod reference_io {
    pub use crate::reference::{
        LightsFile, ReferenceFile, SOURCE_MATERIALS, SourceMaterialsFile, SurfaceEntry, TexelKind, TextureEntry,
        WrapWord, read, read_source_materials, write, write_source_materials,
    };
}
#[doc(hidden)]
pub mod plain_instances {
    pub use crate::reference::read_plain as read;
}
#[doc(hidden)]
pub mod stored_encoding {
    pub use crate::submission::StoredEncoding;
}
#[doc(hidden)]
pub mod gltf_error {
    pub use crate::gltf_file::GltfError;
}
#[doc(hidden)]
pub mod gltf_accessor {
    pub use crate::gltf_file::{first_numbers, indices, numbers, triangles, view_bytes};
}
