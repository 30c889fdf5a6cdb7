//! Several views with a common centre, rendered from one set of paths.
//!
//! Radiance along a direction is the same in every view from one centre. So paths are distributed once over the union
//! of the views' pictures, on the image plane of the first camera (`plane`), evenly (`cell_points`), and added to every
//! view that contains their direction (`splat`). In each view a path has the weight of the picture area it represents:
//! the Jacobian between the two planes over the known number of samples. Nothing is divided by sums of weights, so the
//! expectation of every pixel is its radiance under a box filter of one pixel.

mod cell_points;
mod job;
mod lighting;
mod plane;
mod splat;
mod view_light;

use mateval_scene::Camera;

use crate::error::TracerError;
use crate::light_basis::LightGroups;
use crate::path::OwnMaterials;
use crate::path::RenderSettings;
use crate::world::World;
use job::planes;
pub(crate) use job::{Progress, ViewsJob};
pub use lighting::{LightMix, Lighting};
pub(crate) use splat::Subject;
pub use view_light::{HalfLight, ViewLight, ViewsRender};

/// Renders what all `cameras` see, once per seed, one picture per group of lights.
///
/// Views whose cameras share a centre ([`groups_with_one_centre`]) come from one set of paths per seed. A pixel gets
/// about `settings.samples` paths per seed; `settings.seed` is not used. `progress` is called from any thread with the
/// number of finished tiles and their total. The bytes of the pictures are the same for any number of threads in the
/// current rayon pool.
///
/// Fails if a setting is out of range, if a seed occurs twice (two halves would be the same), or if the groups were
/// made for another number of lights.
pub fn render_views(
    world: &World,
    cameras: &[Camera],
    groups: &LightGroups,
    settings: &RenderSettings,
    seeds: &[u64],
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<ViewsRender, TracerError> {
    let lighting = Lighting::Apart(groups);
    let subject = Subject { world, materials: OwnMaterials(world), first: 0, variants: 1, lighting };
    let job = ViewsJob { subject, cameras, settings, seeds };
    let planes = job.planes(1)?;
    let mut renders = job.render::<1>(&planes, &Progress::new(job.tiles(&planes), progress));
    Ok(renders.pop().expect("there is one variant"))
}

/// The cameras in groups whose views can come from one set of paths, as indices: the cameras of a group stand at one point,
/// up to the rounding of ray origins, and no picture extends more than 75 degrees from where the group's first camera looks.
/// A camera belongs to the first group that will have it, so that cameras from elsewhere never change a group.
pub fn groups_with_one_centre(cameras: &[Camera]) -> Vec<Vec<usize>> {
    planes(cameras, 1).into_iter().map(|group| group.views).collect()
}
