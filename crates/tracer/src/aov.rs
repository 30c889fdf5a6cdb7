//! First hits at points of a picture, for the pictures that show no light: depth, normals, ids, materials.

use glam::{DVec2, DVec3, Vec3};
use mateval_dataset::Camera;
use mateval_dataset::material::Appearance;
use mateval_dataset::reference::SurfaceIndex;

use crate::ray::{Hit, Ray};
use crate::world::World;

/// Sub-pixels along each side of a pixel.
const SUBPIXELS_A_SIDE: usize = 8;
/// Sub-pixels per pixel.
pub const SUBPIXELS: usize = SUBPIXELS_A_SIDE * SUBPIXELS_A_SIDE;
/// Sub-pixels that are looked at first; the others only where these differ.
pub const COARSE_SUBPIXELS: usize = SUBPIXELS / 4;
/// Where no value of the coarse sub-pixels differs by more than this from another, their mean is the pixel's.
pub const FLAT_RANGE: f32 = 1.0 / 512.0;

/// The point at which sub-pixel `index` of pixel (x, y) is sampled, the same for truth and prediction: the centres of a
/// regular 8x8 grid. The first [`COARSE_SUBPIXELS`] are one of each 2x2 of them, and about the pixel's centre like all.
pub fn subpixel(x: usize, y: usize, index: usize) -> DVec2 {
    /// The four places of a block, in turn.
    const IN_BLOCK: [[usize; 2]; 4] = [[0, 0], [1, 0], [1, 1], [0, 1]];
    const BLOCKS_A_SIDE: usize = SUBPIXELS_A_SIDE / 2;
    let (block, turn) = match index.checked_sub(COARSE_SUBPIXELS) {
        None => (index, 0),
        Some(rest) => (rest / 3, 1 + rest % 3),
    };
    let (column, row) = (block % BLOCKS_A_SIDE, block / BLOCKS_A_SIDE);
    let [right, down] = IN_BLOCK[(column + 2 * row + turn) % 4];
    let step = |block: usize, offset: usize| ((2 * block + offset) as f64 + 0.5) / SUBPIXELS_A_SIDE as f64;
    DVec2::new(x as f64 + step(column, right), y as f64 + step(row, down))
}

/// The coarse points at which pixel (x, y) is sampled.
pub fn coarse_subpixels(x: usize, y: usize) -> [DVec2; COARSE_SUBPIXELS] {
    std::array::from_fn(|index| subpixel(x, y, index))
}

/// The mean of what a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelMean<const N: usize> {
    /// The means over the places that show anything; 0 if none does.
    pub mean: [f32; N],
    /// Whether all places that were looked at show something.
    pub whole: bool,
    /// The number of places that were looked at: [`COARSE_SUBPIXELS`] or [`SUBPIXELS`].
    pub looked: usize,
}

impl<const N: usize> PixelMean<N> {
    /// The mean of the values that `look` gives for the sub-pixel of an index: of the coarse ones, or of all if the
    /// coarse ones differ or some show nothing.
    pub fn of(mut look: impl FnMut(usize) -> Option<[f32; N]>) -> Self {
        let (mut sum, mut count) = ([0.0_f64; N], 0_usize);
        let (mut low, mut high) = ([f32::INFINITY; N], [f32::NEG_INFINITY; N]);
        let mut looked = 0;
        for end in [COARSE_SUBPIXELS, SUBPIXELS] {
            for values in (looked..end).filter_map(&mut look) {
                for at in 0..N {
                    sum[at] += f64::from(values[at]);
                    (low[at], high[at]) = (low[at].min(values[at]), high[at].max(values[at]));
                }
                count += 1;
            }
            looked = end;
            if count == looked && (0..N).all(|at| high[at] - low[at] <= FLAT_RANGE) {
                break;
            }
        }
        let mean = sum.map(|sum| if count == 0 { 0.0 } else { (sum / count as f64) as f32 });
        Self { mean, whole: count == looked, looked }
    }
}

/// base_color, roughness and metallic of a surface's own material at a place of a triangle.
pub fn appearance(world: &World, surface: SurfaceIndex, triangle: usize, barycentrics: Vec3) -> Option<Appearance> {
    let shown = &world.scene().surfaces[surface.0];
    let uv = shown.mesh.uv_at(triangle, barycentrics).unwrap_or_default();
    world.scene().materials[shown.material.0].appearance(world.textures(), uv)
}

/// The values of a pixel by which the truth decides how many of its places are looked at: base colour, its diffuse
/// part, roughness and metallic.
pub fn flatness_values(seen: &Appearance) -> [f32; 8] {
    let [r, g, b] = seen.base_color;
    let rest = 1.0 - seen.metallic;
    [r, g, b, r * rest, g * rest, b * rest, seen.roughness, seen.metallic]
}

/// The first hit behind one point of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelHit {
    pub surface: SurfaceIndex,
    /// The triangle, within the surface's mesh.
    pub triangle: usize,
    /// Barycentric weights of the triangle's corners; they add up to 1.
    pub barycentrics: Vec3,
    /// Distance along the camera's axis, in metres.
    pub depth: f64,
    /// World-space shading normal, unit length, turned towards the camera.
    pub normal: Vec3,
    /// Whether the front is visible: the side of the vertex normals, or without them the side from which the triangle's
    /// corners run counter-clockwise. A one-sided emitter emits on that side.
    pub front: bool,
}

/// The first hit behind each of `pixels`, or `None`, as [`hit_through`] finds it, without depth and normal.
pub fn places_through(world: &World, camera: &Camera, pixels: impl Iterator<Item = DVec2>) -> Vec<Option<Hit>> {
    let origin = camera.position().as_vec3();
    let rays: Vec<Ray> = pixels.map(|pixel| Ray::endless(origin, camera.direction(pixel).as_vec3())).collect();
    let mut hits = Vec::with_capacity(rays.len());
    world.first_hits(&rays, &mut hits);
    hits
}

/// The first hit behind `pixel`, or `None`. Masked-out texels (opacity below one half) do not count as hits, glass
/// does.
pub fn hit_through(world: &World, camera: &Camera, pixel: DVec2) -> Option<PixelHit> {
    let direction = camera.direction(pixel);
    let hit = world.first_hit(&Ray::endless(camera.position().as_vec3(), direction.as_vec3()))?;
    let mesh = &world.scene().surfaces[hit.surface.0].mesh;
    let triangle = hit.triangle.0;
    let corners = mesh.corners(triangle).map(|corner| corner.as_dvec3());
    let geometric = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let front = world.surface_hit(&hit).is_front(-direction.as_vec3());
    // The point comes from the corners, not from the distance along the ray, so it is as exact as the mesh.
    let weights = hit.barycentrics.as_dvec3();
    let point = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
    let depth = camera.depth(point)?;
    let shading = mesh.normals.as_deref().map(|normals| {
        let [a, b, c] = mesh.triangles[triangle].map(|vertex| normals[vertex as usize].as_dvec3());
        a * weights.x + b * weights.y + c * weights.z
    });
    let normal = towards_camera(shading.unwrap_or(geometric), geometric, direction);
    Some(PixelHit { surface: hit.surface, triangle, barycentrics: hit.barycentrics, depth, normal, front })
}

/// Whether a surface of fractional opacity is the first behind `pixel`. Such a point has no one colour or depth.
pub fn is_veiled(world: &World, camera: &Camera, pixel: DVec2) -> bool {
    world.meets_fractional_opacity(&Ray::endless(camera.position().as_vec3(), camera.direction(pixel).as_vec3()))
}

/// The shading normal on the side of the surface that the camera sees; the geometric normal where the shading normal
/// has no length.
fn towards_camera(shading: DVec3, geometric: DVec3, direction: DVec3) -> Vec3 {
    let geometric = if geometric.dot(direction) > 0.0 { -geometric } else { geometric }.normalize_or_zero();
    let shading = if shading.dot(geometric) < 0.0 { -shading } else { shading };
    shading.try_normalize().unwrap_or(geometric).as_vec3()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use mateval_dataset::Intrinsics;
    use mateval_dataset::material::{Material, ScalarInput, TextureIndex};
    use mateval_dataset::reference::{ReferenceScene, SourceTexture};
    use mateval_image::{Texels, Texture, Wrap};
    use mateval_testkit::scenes::{Builder, grey, quad};

    use super::*;

    /// A sheet at z = -2 whose left half is cut out, in front of a wall at z = -4.
    fn world() -> World {
        let [sheet, wall] = [-2.0, -4.0].map(|z| quad(Vec3::new(-1.0, -1.0, z), Vec3::X * 2.0, Vec3::Y * 2.0));
        let opacity = ScalarInput::Texture { texture: TextureIndex(0), channel: 0, uv: Default::default() };
        let texture = Texture::new(2, 1, Texels::Grey(vec![0.0, 1.0]), Wrap::Clamp).unwrap();
        let covered = Material { opacity: Some(opacity), ..grey(0.5) };
        let mut scene = Builder::default().surface(sheet, covered).surface(wall, grey(0.5)).scene();
        scene.textures.push(SourceTexture { name: String::new(), sha256: None, texture });
        World::new(Arc::new(scene)).unwrap()
    }

    fn camera() -> Camera {
        let intrinsics = Intrinsics::from_fov_x(64, 64, std::f64::consts::FRAC_PI_4);
        Camera::look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y, intrinsics).unwrap()
    }

    #[test]
    fn depth_lies_along_the_axis_and_the_normal_faces_the_camera() {
        for x in [40.5, 50.5, 60.5] {
            let hit = hit_through(&world(), &camera(), DVec2::new(x, 20.5)).unwrap();
            assert!((hit.depth - 2.0).abs() < 1e-6 && hit.front, "{hit:?}");
            assert_eq!(hit.normal, Vec3::Z);
        }
    }

    #[test]
    fn cut_out_texels_are_looked_through() {
        let hit = hit_through(&world(), &camera(), DVec2::new(20.5, 20.5)).unwrap();
        assert_eq!((hit.surface, hit.depth.round()), (SurfaceIndex(1), 4.0));
    }

    /// Opacities from 0.04 to 0.97 over the sheet: whatever the wall behind it, only what is neither clear nor opaque
    /// is a veil.
    #[test]
    fn fractional_opacity_is_a_veil() {
        let mut scene = world().scene().clone();
        let veiled = |value: f32, sheet: &mut ReferenceScene| {
            let texture = Texture::new(1, 1, Texels::Grey(vec![value]), Wrap::Clamp).unwrap();
            sheet.textures[0].texture = texture;
            is_veiled(&World::new(Arc::new(sheet.clone())).unwrap(), &camera(), DVec2::new(32.3, 20.5))
        };
        let found = [0.0, 0.04, 0.06, 0.5, 0.94, 0.97, 1.0].map(|value| veiled(value, &mut scene));
        assert_eq!(found, [false, false, true, true, true, false, false]);
        // Nothing veils what stands before it.
        scene.surfaces.swap(0, 1);
        scene.surfaces[0].mesh.positions.iter_mut().for_each(|position| position.z = -1.0);
        assert!(!veiled(0.5, &mut scene));
    }

    #[test]
    fn subpixels_lie_in_the_pixel_and_about_its_centre() {
        let mean = |places: &[DVec2]| places.iter().sum::<DVec2>() / places.len() as f64;
        let places: [DVec2; SUBPIXELS] = std::array::from_fn(|index| subpixel(3, 7, index));
        assert_eq!(mean(&places), DVec2::new(3.5, 7.5));
        assert_eq!(mean(&coarse_subpixels(3, 7)), DVec2::new(3.5, 7.5));
        let mut cells = places.map(|p| ((p - DVec2::new(3.0, 7.0)) * 8.0).floor().as_u64vec2().to_array());
        cells.sort_unstable();
        assert_eq!(cells, std::array::from_fn(|at| [at as u64 / 8, at as u64 % 8]));
    }

    #[test]
    fn a_pixel_is_looked_at_more_closely_where_it_is_not_flat() {
        let looks = |value: fn(usize) -> Option<f32>| {
            let mut count = 0;
            let mean = PixelMean::of(|index| {
                count += 1;
                value(index).map(|value| [0.5, value])
            });
            (count, mean)
        };
        assert_eq!(looks(|_| Some(0.25)), (16, PixelMean { mean: [0.5, 0.25], whole: true, looked: 16 }));
        assert_eq!(looks(|at| Some((at % 2) as f32)), (64, PixelMean { mean: [0.5, 0.5], whole: true, looked: 64 }));
        assert_eq!(
            looks(|at| (at > 0).then_some(0.25)),
            (64, PixelMean { mean: [0.5, 0.25], whole: false, looked: 64 })
        );
        assert_eq!(looks(|_| None), (64, PixelMean { mean: [0.0, 0.0], whole: false, looked: 64 }));
    }
}
