//! Paints one material per part into atlases.

use mateval_image::Picture;
use mateval_scene::uv_atlas::UvAtlas;

use crate::estimate::Values;
use crate::geometry::SceneGeometry;
use crate::lift::{PartialAtlas, Texel};
use crate::part_triangles::PartTriangles;

/// The values of each part.
pub struct PartColors<'a> {
    triangles: PartTriangles<'a>,
    of_part: Vec<Option<Values>>,
}

impl<'a> PartColors<'a> {
    /// Calls `color_of` for every part, with the part's index and its instance's index.
    pub fn new(triangles: PartTriangles<'a>, mut color_of: impl FnMut(usize, usize) -> Option<Values>) -> Self {
        let owners = triangles.owners.iter().enumerate();
        let of_part = owners.map(|(part, owner)| color_of(part, (*owner)?)).collect();
        Self { triangles, of_part }
    }

    /// The atlas of an instance with each texel in its part's colour; texels of parts without a colour are `Unseen`.
    pub fn paint(&self, geometry: &SceneGeometry<'_>, instance: usize, size: usize) -> PartialAtlas {
        let atlas = UvAtlas::new(geometry.mesh(instance), size);
        let known = |part: Option<usize>| self.of_part[part?];
        let parts = self.triangles.of(instance).iter();
        let of_triangle: Vec<Texel> = parts.map(|part| known(*part).map_or(Texel::Unseen, Texel::Seen)).collect();
        let texels = Picture::from_fn(size, size, |x, y| {
            atlas.owner(x, y).map_or(Texel::Unused, |(triangle, _)| of_triangle[triangle])
        });
        PartialAtlas { atlas, texels }
    }
}
