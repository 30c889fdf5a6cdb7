//! What commands note of their work on a dataset: how pictures were rendered, what a scene has cost, whether two
//! renderers agree.

pub mod render_file;
pub mod scene_cost;
pub mod verdict;
