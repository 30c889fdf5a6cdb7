//! What commands note of their work on a dataset: who is changing what, how pictures were rendered, what a scene has
//! cost, whether two renderers agree.

pub mod changes;
pub mod render_file;
pub mod scene_cost;
pub mod verdict;
