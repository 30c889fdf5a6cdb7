//! The dataset format: types, reading, writing, validation.
//!
//! In: a converted scene, or a dataset's folder. Out: the same as files, or as checked Rust values.
//!
//! [`ids`] and [`findings`] are used everywhere; [`camera`] is the camera model; [`mesh`], [`material`] and
//! [`mod@reference`] describe a scene with its materials and lights; [`role`] states what its instances are;
//! [`dataset`], [`layout`], [`manifest`] and [`open`] are the files of a dataset, [`submission`] those of a submission.
//! [`bounded_cache`] keeps what later runs can use again. [`obj`], [`gltf_accessor`], [`gltf_file`] and
//! [`source_folder`] read untrusted files.

pub mod bounded_cache;
pub mod build_folder;
pub mod camera;
pub mod compare_file;
pub mod dataset;
pub mod dataset_id;
pub mod error;
pub mod findings;
pub mod glb;
pub mod gltf_accessor;
pub mod gltf_error;
pub mod gltf_file;
pub mod ids;
pub mod json;
pub mod layout;
pub mod lease;
pub mod manifest;
pub mod material;
pub mod material_class;
pub mod mesh;
pub mod obj;
pub mod open;
pub mod perturbation;
pub mod plain_instances;
pub mod process_cpu;
pub mod progress;
pub mod reference;
pub mod reference_io;
pub mod render_file;
pub mod render_noise;
pub mod role;
pub mod scene_change;
pub mod scene_cost;
pub mod scene_hashes;
pub mod scorer_file;
pub mod source_folder;
pub mod source_materials;
pub mod specular_glossiness;
pub mod splitmix64;
pub mod stored_encoding;
pub mod submission;
pub mod super_categories;
pub mod text_table;
pub mod triangle;
pub mod uv_atlas;
pub mod work_folder;

pub use camera::{Camera, Intrinsics};
pub use error::SceneError;
pub use findings::{Finding, FindingCount, Severity};
pub use ids::{InstanceId, InstanceIndex, PartId, PartSetId, RendererId, SceneId, ViewId};
pub use mesh::TriangleMesh;
pub use progress::{Progress, Report};
pub use role::{Role, SceneLights, SourceKind};
