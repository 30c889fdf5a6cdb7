//! The dataset format: types, reading, writing, validation.
//!
//! In: a converted scene, or a dataset's folder. Out: the same as files, or as checked Rust values.
//!
//! [`ids`] and [`findings`] are used everywhere; [`camera`] is the camera model; [`mod@mesh`], [`uv_atlas`], [`material`] and
//! [`mod@reference`] describe a scene with its materials and lights. [`dataset`], [`layout`], [`manifest`], [`open`]
//! [`render_file`] and [`verdict`] are the files of a dataset, [`submission`] those of a submission. [`obj`] and
//! [`gltf_file`] read untrusted files.

pub mod camera;
pub mod dataset;
pub mod error;
pub mod findings;
pub mod glb;
pub mod gltf_file;
pub mod ids;
pub mod json;
pub mod layout;
pub mod manifest;
pub mod material;
pub mod mesh;
pub mod obj;
pub mod open;
pub mod progress;
pub mod reference;
pub mod render_file;
pub mod scene_cost;
pub mod specular_glossiness;
pub mod splitmix64;
pub mod submission;
pub mod uv_atlas;
pub mod verdict;
pub mod word_enum;

pub use camera::{Camera, Intrinsics};
pub use dataset::{Role, SceneLights, SourceKind};
pub use error::SceneError;
pub use findings::{Finding, FindingCount, Severity};
pub use ids::{InstanceId, InstanceIndex, PartId, PartSetId, RendererId, SceneId, ViewId};
pub use mesh::TriangleMesh;
pub use progress::{Progress, Report};
