//! The triangle that each texel of an instance's uv atlas belongs to.
//!
//! Texels are counted from the top left; the centre of (x, y) lies at uv ((x + 0.5) / size, 1 - (y + 0.5) / size).

use std::num::NonZero;

use glam::{DVec2, DVec3};
use mateval_image::Picture;

use crate::TriangleMesh;
use crate::mesh::nearest_on_edges;

/// Texels whose centres are at most this far from a triangle, in texels, take part in bilinear lookups inside it.
const BILINEAR_REACH: f64 = std::f64::consts::SQRT_2;

/// The owner of every texel: the triangle that holds its centre, or else the nearest triangle from which a bilinear
/// lookup reaches it.
#[derive(Clone, Debug)]
pub struct UvAtlas {
    size: usize,
    corners: Vec<[DVec2; 3]>,
    owners: Picture<Option<Owner>>,
}

/// A triangle, and whether the texel's centre lies in it or only within bilinear reach of it.
///
/// It is twice the triangle's index plus 1, or plus 2 if the centre lies inside. Zero is left for an absent owner, so
/// that a texel takes 4 bytes: an atlas has up to 16 million.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Owner(NonZero<u32>);

impl Owner {
    fn new(triangle: usize, inside: bool) -> Self {
        let number = u32::try_from(2 * triangle + usize::from(inside) + 1).ok().and_then(NonZero::new);
        Self(number.expect("readers take at most 2^31 bytes of indices, and a triangle has three indices"))
    }

    fn triangle(self) -> usize {
        (self.0.get() - 1) as usize / 2
    }

    fn inside(self) -> bool {
        self.0.get() & 1 == 0
    }
}

impl UvAtlas {
    /// Rasterises the mesh's uv into `size` times `size` texels. A centre on the common edge of two triangles belongs
    /// to the first. A mesh without uv owns no texel.
    pub fn new(mesh: &TriangleMesh, size: usize) -> Self {
        let corners = texel_corners(mesh, size);
        let mut atlas = Self { size, corners, owners: Picture::filled(size, size, None) };
        atlas.claim_inside();
        atlas.claim_near();
        atlas
    }

    pub fn size(&self) -> usize {
        self.size
    }

    /// The triangle that the texel belongs to, and whether its centre lies inside.
    #[inline]
    pub fn owner(&self, x: usize, y: usize) -> Option<(usize, bool)> {
        self.owners.get(x, y).map(|owner| (owner.triangle(), owner.inside()))
    }

    /// Barycentric weights of a place, in texels from the top left, in a triangle. They add to one and are negative
    /// outside. For a triangle without area they are those of its middle.
    #[inline]
    pub fn barycentrics(&self, triangle: usize, place: DVec2) -> DVec3 {
        barycentrics(self.corners[triangle], place)
    }

    /// The weights of the triangle's place nearest to a place in texels.
    #[inline]
    pub fn nearest_barycentrics(&self, triangle: usize, place: DVec2) -> DVec3 {
        let corners = self.corners[triangle];
        // Rounding may move a place on an edge slightly outside.
        let weights = barycentrics(corners, nearest_in_triangle(corners, place)).max(DVec3::ZERO);
        weights / weights.element_sum()
    }

    /// The area of a triangle in texels.
    #[inline]
    pub fn texel_area(&self, triangle: usize) -> f64 {
        let [a, b, c] = self.corners[triangle];
        ((b - a).perp_dot(c - a) / 2.0).abs()
    }

    /// Gives every texel without an owner the value of an owned one nearby, breadth first. Changes nothing where no
    /// texel has an owner.
    pub fn fill_gutters<T: Copy>(&self, picture: &mut Picture<T>) {
        let pixels = picture.pixels_mut();
        self.each_gutter_texel(|to, from| pixels[to] = pixels[from]);
    }

    /// Calls `take` once for every texel without an owner, with the index of its pixel and that of the neighbour whose
    /// value it takes, in an order in which that neighbour already has its value. Calls nothing where no texel has an
    /// owner.
    pub fn each_gutter_texel(&self, mut take: impl FnMut(usize, usize)) {
        let size = self.size;
        let neighbours = |at: usize| {
            let (x, y) = (at % size, at / size);
            let all = [
                (x > 0).then(|| at - 1),
                (x + 1 < size).then_some(at + 1),
                (y > 0).then(|| at - size),
                (y + 1 < size).then_some(at + size),
            ];
            all.into_iter().flatten()
        };
        let mut done: Vec<bool> = self.owners.pixels().iter().map(Option::is_some).collect();
        // Of the owned texels only those at the rim of a gutter give their value to a neighbour.
        let at_rim = |at: &usize| done[*at] && neighbours(*at).any(|neighbour| !done[neighbour]);
        let mut front: Vec<usize> = (0..done.len()).filter(at_rim).collect();
        while !front.is_empty() {
            let mut next = Vec::new();
            for at in front {
                for neighbour in neighbours(at) {
                    if std::mem::replace(&mut done[neighbour], true) {
                        continue;
                    }
                    take(neighbour, at);
                    next.push(neighbour);
                }
            }
            front = next;
        }
    }

    fn claim_inside(&mut self) {
        for triangle in 0..self.corners.len() {
            if self.texel_area(triangle) == 0.0 {
                continue;
            }
            for (x, y) in self.texels_around(triangle, 0.0) {
                let weights = self.barycentrics(triangle, centre(x, y));
                if weights.min_element() >= 0.0 && self.owners.get(x, y).is_none() {
                    self.owners.set(x, y, Some(Owner::new(triangle, true)));
                }
            }
        }
    }

    fn claim_near(&mut self) {
        let mut distances = Picture::filled(self.size, self.size, f32::INFINITY);
        for triangle in 0..self.corners.len() {
            // A triangle without area is not visible, so it must not take its neighbours' texels.
            if self.texel_area(triangle) == 0.0 {
                continue;
            }
            for (x, y) in self.texels_around(triangle, BILINEAR_REACH) {
                if self.owners.get(x, y).is_some_and(Owner::inside) {
                    continue;
                }
                let place = centre(x, y);
                // 0 inside the triangle.
                let distance = nearest_in_triangle(self.corners[triangle], place).distance(place);
                if distance <= BILINEAR_REACH && (distance as f32) < distances.get(x, y) {
                    distances.set(x, y, distance as f32);
                    self.owners.set(x, y, Some(Owner::new(triangle, false)));
                }
            }
        }
    }

    /// The texels whose centres lie in the triangle's bounding box, grown by `reach` texels.
    fn texels_around(&self, triangle: usize, reach: f64) -> impl Iterator<Item = (usize, usize)> + use<> {
        let [a, b, c] = self.corners[triangle];
        let (low, high) = (a.min(b).min(c) - reach - 0.5, a.max(b).max(c) + reach - 0.5);
        let range = |low: f64, high: f64| {
            let first = low.ceil().max(0.0) as usize;
            let end = (high.floor() + 1.0).clamp(0.0, self.size as f64) as usize;
            first..end.max(first)
        };
        let (columns, rows) = (range(low.x, high.x), range(low.y, high.y));
        rows.flat_map(move |y| columns.clone().map(move |x| (x, y)))
    }
}

fn centre(x: usize, y: usize) -> DVec2 {
    DVec2::new(x as f64 + 0.5, y as f64 + 0.5)
}

/// The corners of every triangle in texels from the top left.
fn texel_corners(mesh: &TriangleMesh, size: usize) -> Vec<[DVec2; 3]> {
    let Some(uvs) = &mesh.uvs else {
        return Vec::new();
    };
    let texel = |vertex: u32| {
        let uv = uvs[vertex as usize].as_dvec2();
        DVec2::new(uv.x, 1.0 - uv.y) * size as f64
    };
    mesh.triangles.iter().map(|triangle| triangle.map(texel)).collect()
}

fn barycentrics([a, b, c]: [DVec2; 3], place: DVec2) -> DVec3 {
    let area = (b - a).perp_dot(c - a);
    if area == 0.0 {
        return DVec3::splat(1.0 / 3.0);
    }
    let second = (place - a).perp_dot(c - a) / area;
    let third = (b - a).perp_dot(place - a) / area;
    DVec3::new(1.0 - second - third, second, third)
}

/// The nearest place of the triangle: the place itself where it lies inside.
fn nearest_in_triangle(corners: [DVec2; 3], place: DVec2) -> DVec2 {
    let [a, b, c] = corners;
    if (b - a).perp_dot(c - a) != 0.0 && barycentrics(corners, place).min_element() >= 0.0 {
        return place;
    }
    nearest_on_edges(corners.map(|corner| corner.extend(0.0)), place.extend(0.0)).point.truncate()
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};

    use super::*;

    fn square() -> TriangleMesh {
        TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::Y],
            normals: None,
            uvs: Some(vec![Vec2::new(0.25, 0.25), Vec2::new(0.75, 0.25), Vec2::new(0.75, 0.75), Vec2::new(0.25, 0.75)]),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    #[test]
    fn owners_of_a_square() {
        let atlas = UvAtlas::new(&square(), 8);
        // Texels 2 to 5 of each side lie inside; the next one is in bilinear reach, the corner (0, 0) is not.
        assert_eq!(atlas.owner(3, 5), Some((0, true)));
        assert_eq!(atlas.owner(2, 2), Some((1, true)));
        assert_eq!(atlas.owner(1, 3), Some((1, false)));
        assert_eq!(atlas.owner(0, 0), None);
        let inside = (0..64).filter(|at| matches!(atlas.owner(at % 8, at / 8), Some((_, true)))).count();
        assert_eq!(inside, 16);
        assert!((atlas.texel_area(0) - 8.0).abs() < 1e-12);
    }

    #[test]
    fn barycentrics_continue_outside() {
        let atlas = UvAtlas::new(&square(), 8);
        assert_eq!(atlas.barycentrics(0, DVec2::new(2.0, 6.0)), DVec3::X);
        assert!((atlas.barycentrics(0, DVec2::new(0.0, 6.0)) - DVec3::new(1.5, -0.5, 0.0)).length() < 1e-12);
    }

    /// Clipping the weights alone would move this place by a third of the sliver's length.
    #[test]
    fn beside_a_sliver_its_nearest_place() {
        let uvs = [[0.0, 1.0], [1.0, 1.0], [0.0, 0.995]].map(Vec2::from);
        let mesh = TriangleMesh { uvs: Some(uvs.into()), triangles: vec![[0, 1, 2]], ..square() };
        let atlas = UvAtlas::new(&mesh, 100);
        let weights = atlas.nearest_barycentrics(0, DVec2::new(50.0, -1.0));
        assert!((weights - DVec3::new(0.5, 0.5, 0.0)).length() < 1e-6, "{weights}");
        let inside = DVec2::new(10.0, 0.1);
        assert!((atlas.nearest_barycentrics(0, inside) - atlas.barycentrics(0, inside)).length() < 1e-9);
    }

    #[test]
    fn gutters_take_the_nearest() {
        let atlas = UvAtlas::new(&square(), 8);
        let mut picture = Picture::from_fn(8, 8, |x, y| if atlas.owner(x, y).is_some() { x } else { 99 });
        atlas.fill_gutters(&mut picture);
        assert_eq!(picture.get(0, 4), 1);
        assert_eq!(picture.get(7, 4), 6);
        assert!(picture.pixels().iter().all(|value| *value != 99));
    }

    #[test]
    fn strange_uv_are_no_panic() {
        let mut mesh = square();
        for uv in [Vec2::splat(-3.0), Vec2::splat(1e9), Vec2::splat(0.5)] {
            mesh.uvs.as_mut().unwrap()[0] = uv;
            UvAtlas::new(&mesh, 4);
        }
        mesh.uvs = None;
        assert_eq!(UvAtlas::new(&mesh, 4).owner(1, 1), None);
    }
}
