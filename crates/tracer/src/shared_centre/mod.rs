//! Several views of one centre from one set of paths.
//!
//! Radiance along a direction is the same in every view from one place. So paths are drawn once over the union of the
//! views' pictures, on the image plane of the first camera (`plane`), spread evenly (`cell_points`) and put into every
//! view that holds their direction (`splat`). A path counts there by how much of that view's picture the path stands
//! for: the Jacobian between the two planes over the known number of samples. Nothing is divided by sums of weights, so
//! every pixel's expectation is its radiance under a box filter of one pixel.

mod cell_points;
mod job;
mod lighting;
mod plane;
mod splat;
mod view_light;

use mateval_scene::Camera;

use crate::error::TracerError;
use crate::light_basis::LightGroups;
use crate::material_source::OwnMaterials;
use crate::settings::RenderSettings;
use crate::world::World;
pub(crate) use job::{Progress, ViewsJob};
pub use lighting::{LightMix, Lighting};
use plane::Plane;
pub(crate) use splat::Subject;
pub use view_light::{HalfLight, ViewLight, ViewsRender};

/// Renders what all `cameras` see, once a seed, one picture a group of lights.
///
/// Where the cameras share a centre ([`share_centre`]) all views come from one set of paths a seed, else each view from
/// its own. A pixel gets about `settings.samples` paths a seed; `settings.seed` itself is not used. `progress` is told,
/// from any thread, how many tiles of how many are done. The same bytes for any number of threads of the current rayon
/// pool. Fails for settings that make no sense, for seeds that occur twice (halves would be one) and for groups made for
/// another number of lights.
pub fn render_views(
    world: &World,
    cameras: &[Camera],
    groups: &LightGroups,
    settings: &RenderSettings,
    seeds: &[u64],
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<ViewsRender, TracerError> {
    let lighting = Lighting::Apart(groups);
    let subject = Subject { world, materials: OwnMaterials(world), first: 0, lighting };
    let job = ViewsJob { subject, cameras, settings, seeds };
    let planes = job.planes(1)?;
    let [render] = job.render(&planes, &Progress::new(job.tiles(&planes), progress));
    Ok(render)
}

/// Whether views from these cameras can come from one set of paths: all stand in one place, to the rounding of rays'
/// origins, and no picture reaches further than 75 degrees from where the first one looks.
pub fn share_centre(cameras: &[Camera]) -> bool {
    Plane::new(cameras, 1).is_some()
}
