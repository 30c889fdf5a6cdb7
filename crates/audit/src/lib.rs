//! Examines finished datasets: whether they are sound, whether two renderers agree on them, what they contain.
//!
//! In: a dataset's folder. Out: findings ([`verify`]), the agreement of Blender's pictures with those of the built-in
//! tracer ([`compare`]), counts ([`stats`]), a scene for Mitsuba 3 ([`mitsuba_export`]), a public and a private copy
//! ([`publish`]).

pub mod compare;
pub mod error;
pub mod mitsuba_export;
pub mod publish;
pub mod stats;
pub mod verify;

pub use error::AuditError;
