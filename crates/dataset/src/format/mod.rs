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
