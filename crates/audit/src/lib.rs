//! What is said of a finished dataset: whether it is sound, whether two renderers agree on it, what it contains.
//!
//! In: a dataset's folder. Out: findings ([`verify`]), agreement of Blender's pictures with the built-in tracer's
//! ([`compare`]), counts ([`stats`]), a scene for Mitsuba 3 ([`mitsuba_export`]), a public and a private copy
//! ([`publish`]).

pub mod compare;
pub mod error;
pub mod mitsuba_export;
pub mod publish;
pub mod stats;
pub mod verify;

pub use error::AuditError;
