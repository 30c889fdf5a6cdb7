//! The dataset format: types, reading, writing, validation.
//!
//! In: what `prep` converted, or a dataset folder on disk. Out: the same on disk, or as checked Rust values.
//!
//! Between: [`ids`] and [`findings`] are the words that everything shares; [`camera`] is the one camera model;
//! [`obj`], [`gltf_accessor`] and [`source_folder`] read strangers' files without trust;
//! [`mesh`], [`material`] and [`mod@reference`] describe a scene as its makers meant it.

pub mod camera;
pub mod dataset;
pub mod dataset_id;
pub mod error;
pub mod findings;
pub mod glb;
pub mod gltf_accessor;
pub mod gltf_error;
pub mod ids;
pub mod json;
pub mod layout;
pub mod manifest;
pub mod material;
pub mod mesh;
pub mod obj;
pub mod open;
pub mod plain_instances;
pub mod progress;
pub mod reference;
pub mod reference_io;
pub mod source_folder;
pub mod splitmix64;
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
pub use progress::Progress;
