//! Paints one material per part into atlases.

use std::collections::HashMap;

use mateval_image::Picture;
use mateval_scene::dataset::Part;
use mateval_scene::uv_atlas::UvAtlas;
use mateval_scene::{PartSetId, SceneError, glb};

use crate::error::BaselineError;
use crate::estimate::Values;
use crate::geometry::SceneGeometry;
use crate::lift::{PartialAtlas, Texel};

/// The bits of a triangle's corners, which are the same in `instances.glb` and `parts.glb`.
type Corners = [[u32; 3]; 3];

/// The values of each triangle of a scene.
pub struct PartColors {
    of_instance: Vec<HashMap<Corners, Values>>,
}

impl PartColors {
    /// Calls `color_of` for every part of the set, with the part's index in [`parts_of`] and its instance's index.
    pub fn new(
        geometry: &SceneGeometry<'_>,
        set: Option<&PartSetId>,
        mut color_of: impl FnMut(usize, usize) -> Option<Values>,
    ) -> Result<Self, BaselineError> {
        let parts = parts_of(geometry, set)?;
        let instances = &geometry.scene.instances;
        let place_of: HashMap<&str, usize> =
            instances.iter().enumerate().map(|(at, instance)| (instance.id.as_str(), at)).collect();
        let mut of_instance = vec![HashMap::new(); instances.len()];
        for (number, (part, node)) in parts.iter().zip(glb::read(&geometry.folder.parts(set))?).enumerate() {
            let Some(&at) = place_of.get(part.instance.as_str()) else { continue };
            let Some(color) = color_of(number, at) else { continue };
            let triangles = 0..node.mesh.triangles.len();
            of_instance[at].extend(triangles.map(|triangle| (corners(&node.mesh, triangle), color)));
        }
        Ok(Self { of_instance })
    }

    /// The atlas of an instance with each texel in its part's colour; texels of parts without a colour are `Unseen`.
    pub fn paint(&self, geometry: &SceneGeometry<'_>, instance: usize, size: usize) -> PartialAtlas {
        let mesh = geometry.mesh(instance);
        let atlas = UvAtlas::new(mesh, size);
        let known = |triangle| self.of_instance[instance].get(&corners(mesh, triangle));
        let of_triangle: Vec<Texel> = (0..mesh.triangles.len())
            .map(|triangle| known(triangle).map_or(Texel::Unseen, |values| Texel::Seen(*values)))
            .collect();
        let texels = Picture::from_fn(size, size, |x, y| {
            atlas.owner(x, y).map_or(Texel::Unused, |(triangle, _)| of_triangle[triangle])
        });
        PartialAtlas { atlas, texels }
    }
}

fn corners(mesh: &mateval_scene::TriangleMesh, triangle: usize) -> Corners {
    mesh.corners(triangle).map(|corner| corner.to_array().map(f32::to_bits))
}

/// The parts of a set; `None` stands for the parts of the source.
pub fn parts_of<'a>(geometry: &SceneGeometry<'a>, set: Option<&PartSetId>) -> Result<&'a [Part], BaselineError> {
    let found = geometry.scene.all_part_sets().find(|(id, _)| *id == set).map(|(_, parts)| parts);
    found.ok_or_else(|| {
        let what = format!("no part set '{}'; `part_labels` in a recipe makes one", set.map_or("", PartSetId::as_str));
        SceneError::Unsupported { path: geometry.folder.scene_file(), what }.into()
    })
}
