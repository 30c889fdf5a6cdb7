//! The texels of an instance's atlas on its surface: the area of each, and whether the input camera sees it.

use glam::{DVec2, DVec3};
use mateval_dataset::camera::Projection;
use mateval_dataset::material::CUT_OUT_BELOW_OPACITY;
use mateval_dataset::reference::SurfaceIndex;
use mateval_dataset::{Camera, TriangleMesh};
use mateval_image::Texture;
use mateval_tracer::{Hit, Ray, World};
use rayon::prelude::*;

use crate::atlas::{Coverage, Part};

/// How far in front of a place, along the normal, another surface may lie without hiding it, in units of the rounding
/// of the largest coordinate: 0.01 mm at 10 m. That covers the rounding of rays, and is a tenth of the distance that
/// `prep` puts between coincident sheets.
pub const SAME_PLACE_ROUNDINGS: f64 = 16.0;
/// Half the spacing of f32 at 1.
const ROUNDING: f64 = 1.0 / (1 << 24) as f64;
/// The least cosine between ray and normal that is used; grazing rays count as having it.
pub const LEAST_COSINE: f64 = 1e-3;

/// A texel of an atlas that lies at least partly on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceTexel {
    pub column: usize,
    /// The uv of the place that represents it; absent if that is its centre.
    pub off_centre: Option<[f32; 2]>,
    /// Its area on the surface, in square metres.
    pub area_m2: f64,
    /// Whether the input camera sees that place.
    pub observed: bool,
}

/// The same in less memory; a scene has millions.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Texel {
    area_m2: f32,
    uv: [f32; 2],
    column: u16,
    at_centre: bool,
    observed: bool,
}

/// The texels of an atlas that lie on its surface. Their areas add up to that of the surface, except for triangles
/// without area in the atlas and for texels that are cut out ([`CUT_OUT_BELOW_OPACITY`]). No camera sees the latter.
///
/// A texel is represented by its centre if that lies in a triangle, else by the centroid of the part covered by the
/// triangle that covers most of it.
pub struct TexelMap {
    size: usize,
    rows: Vec<Vec<Texel>>,
}

impl TexelMap {
    /// The texels of an atlas of `size` texels a side, seen by `camera` (that of the input view).
    ///
    /// `atlas` has the triangles of the world's surface `surface`, with uv in the atlas. A texel is observed if its
    /// place lies in the camera's picture and a ray towards it hits that triangle first, or nothing that is nearer by
    /// more than rounding.
    pub fn new(world: &World, surface: SurfaceIndex, atlas: &TriangleMesh, size: usize, camera: &Camera) -> Self {
        let coverage = Coverage::new(atlas, size);
        let mesh = &world.scene().surfaces[surface.0].mesh;
        let texel_m2 = (0..mesh.triangles.len()).map(|triangle| texel_m2(mesh, &coverage, triangle)).collect();
        let observer = Observer { world, surface, mesh, coverage, texel_m2, camera: InputCamera::new(camera) };
        Self { size, rows: (0..size).into_par_iter().map(|y| observer.row(size, y)).collect() }
    }

    pub fn size(&self) -> usize {
        self.size
    }

    /// The texels of row `y`, from left to right; panics if the atlas has no such row.
    pub fn row(&self, y: usize) -> impl Iterator<Item = SurfaceTexel> + '_ {
        self.rows[y].iter().map(|texel| SurfaceTexel {
            column: usize::from(texel.column),
            off_centre: (!texel.at_centre).then_some(texel.uv),
            area_m2: f64::from(texel.area_m2),
            observed: texel.observed,
        })
    }

    /// `row` of every row, from the top, so that sums over the rows have the same bits for any number of threads.
    pub fn of_rows<T: Send>(&self, row: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
        (0..self.size).into_par_iter().map(row).collect()
    }

    /// What a texture of any size holds at the place of a texel in row `y`.
    pub fn value(&self, texture: &Texture, texel: &SurfaceTexel, y: usize) -> [f32; 3] {
        match (texture.width(), texel.off_centre) {
            (1, _) => texture.texel(0, 0),
            // The centre of its own texel: exactly, where a uv might be rounded.
            (size, None) if size == self.size => texture.texel(texel.column, y),
            _ => texture.sample(self.uv(texel, y)),
        }
    }

    /// The uv of the place that represents a texel in row `y`.
    pub fn uv(&self, texel: &SurfaceTexel, y: usize) -> [f32; 2] {
        let along = |at: usize| (at as f64 + 0.5) / self.size as f64;
        texel.off_centre.unwrap_or_else(|| [along(texel.column) as f32, (1.0 - along(y)) as f32])
    }
}

/// The area on the surface of one texel of a triangle, in square metres; 0 where the triangle has no texels.
fn texel_m2(mesh: &TriangleMesh, coverage: &Coverage, triangle: usize) -> f64 {
    let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
    let texels = coverage.area(triangle);
    if texels > 0.0 { (b - a).cross(c - a).length() / 2.0 / texels } else { 0.0 }
}

/// The coverage of one texel while triangles are added.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    area_m2: f64,
    /// The area of the triangle that covers most.
    largest_m2: f64,
    triangle: usize,
    /// In texels from the top left.
    place: DVec2,
    at_centre: bool,
}

impl Cell {
    fn add(&mut self, part: &Part, area_m2: f64, holds_centre: impl FnOnce() -> bool, centre: DVec2) {
        self.area_m2 += area_m2;
        if self.at_centre {
            return;
        }
        if part.area == 1.0 || holds_centre() {
            (self.triangle, self.place, self.at_centre) = (part.triangle, centre, true);
        } else if area_m2 > self.largest_m2 {
            (self.triangle, self.place, self.largest_m2) = (part.triangle, part.centroid, area_m2);
        }
    }
}

struct InputCamera {
    camera: Camera,
    projection: Projection,
    /// The camera's position, rounded as rays are.
    origin: DVec3,
}

impl InputCamera {
    fn new(camera: &Camera) -> Self {
        // Rays start at single precision, so their directions must be computed from the rounded place.
        let origin = camera.position().as_vec3().as_dvec3();
        Self { camera: *camera, projection: camera.projection(), origin }
    }

    fn frame_holds(&self, place: DVec3) -> bool {
        self.projection.project(place).is_some_and(|(pixel, _)| self.camera.holds(pixel))
    }
}

/// A place of a triangle, and the ray from the camera towards it.
struct AimedRay {
    triangle: usize,
    place: DVec3,
    ray: Ray,
}

impl AimedRay {
    fn new(camera: &InputCamera, triangle: usize, place: DVec3) -> Self {
        let offset = place - camera.origin;
        let direction = offset / offset.length();
        Self { triangle, place, ray: Ray::endless(camera.origin.as_vec3(), direction.as_vec3()) }
    }
}

/// The surface whose texels are classified, and the camera that sees them.
struct Observer<'a> {
    world: &'a World,
    surface: SurfaceIndex,
    mesh: &'a TriangleMesh,
    coverage: Coverage,
    /// By triangle.
    texel_m2: Vec<f64>,
    camera: InputCamera,
}

impl Observer<'_> {
    fn row(&self, size: usize, y: usize) -> Vec<Texel> {
        let mut cells = vec![Cell::default(); size];
        self.coverage.visit_row(y, |part| {
            let centre = DVec2::new(part.column as f64, y as f64) + 0.5;
            let holds_centre = || self.coverage.barycentrics(part.triangle, centre).min_element() >= 0.0;
            cells[part.column].add(&part, part.area * self.texel_m2[part.triangle], holds_centre, centre);
        });
        let covered = cells.iter().enumerate().filter(|(_, cell)| cell.area_m2 > 0.0);
        let (mut texels, aimed_rays): (Vec<Texel>, Vec<Option<AimedRay>>) =
            covered.filter_map(|(x, cell)| self.texel(size, x, cell)).unzip();
        let rays: Vec<Ray> = aimed_rays.iter().flatten().map(|aimed| aimed.ray).collect();
        let mut hits = Vec::with_capacity(rays.len());
        self.world.first_hits(&rays, &mut hits);
        let in_frame = texels.iter_mut().zip(&aimed_rays).filter_map(|(texel, aimed)| Some((texel, aimed.as_ref()?)));
        for ((texel, aimed), hit) in in_frame.zip(hits) {
            // A ray may miss the edge that it is aimed at; then nothing hides the place.
            texel.observed = hit.is_none_or(|hit| self.is_place(aimed, &hit));
        }
        texels
    }

    /// A texel that is not observed yet, and how the camera could see it, if its picture holds the place. None for a
    /// texel that is cut out.
    fn texel(&self, size: usize, x: usize, cell: &Cell) -> Option<(Texel, Option<AimedRay>)> {
        // Rounding may put a place on an edge slightly outside.
        let weights = self.coverage.barycentrics(cell.triangle, cell.place).max(DVec3::ZERO);
        let weights = weights / weights.element_sum();
        if self.opacity(cell.triangle, weights) < CUT_OUT_BELOW_OPACITY {
            return None;
        }
        let [a, b, c] = self.mesh.corners(cell.triangle).map(|corner| corner.as_dvec3());
        let place = a * weights.x + b * weights.y + c * weights.z;
        let [u, v] = (cell.place / size as f64).to_array();
        let texel = Texel {
            area_m2: cell.area_m2 as f32,
            uv: [u as f32, (1.0 - v) as f32],
            column: x as u16,
            at_centre: cell.at_centre,
            observed: false,
        };
        Some((texel, self.camera.frame_holds(place).then(|| AimedRay::new(&self.camera, cell.triangle, place))))
    }

    fn opacity(&self, triangle: usize, weights: DVec3) -> f32 {
        let Some(opacity) = &self.world.material_of(self.surface).opacity else { return 1.0 };
        opacity.at(self.world.textures(), self.mesh.uv_at(triangle, weights.as_vec3()).unwrap_or_default())
    }

    /// Whether the first hit towards a place is that place, or nothing nearer by more than rounding.
    fn is_place(&self, aimed: &AimedRay, hit: &Hit) -> bool {
        if hit.surface == self.surface && hit.triangle.0 == aimed.triangle {
            return true;
        }
        let offset = aimed.place - self.camera.origin;
        let distance = offset.length();
        let slope = self.mesh.geometric_normal(aimed.triangle).dot(offset / distance).abs().max(LEAST_COSINE);
        let coordinate = aimed.place.abs().max(self.camera.origin.abs()).max_element();
        f64::from(hit.distance) >= distance - SAME_PLACE_ROUNDINGS * ROUNDING * coordinate / slope
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{Vec2, Vec3};
    use mateval_dataset::Intrinsics;
    use mateval_dataset::material::{ColorInput, Material, MaterialModel, ScalarInput, TextureIndex};
    use mateval_dataset::reference::{MaterialIndex, ReferenceScene, SourceTexture, Surface};
    use mateval_image::{Texels, Texture, Wrap};

    use super::*;

    /// A parallelogram over the atlas from `uv` on, `uv_side` wide and high.
    fn add_quad(mesh: &mut TriangleMesh, [corner, u, v]: [Vec3; 3], uv: Vec2, uv_side: f32) {
        mesh.append(&TriangleMesh {
            positions: vec![corner, corner + u, corner + u + v, corner + v],
            normals: None,
            uvs: Some([Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y].map(|at| uv + at * uv_side).into()),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        });
    }

    /// A square about the axis that faces the camera.
    fn sheet(z: f32, side: f32) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        let corner = Vec3::new(-side / 2.0, -side / 2.0, z);
        add_quad(&mut mesh, [corner, Vec3::X * side, Vec3::Y * side], Vec2::ZERO, 1.0);
        mesh
    }

    /// Surface k has material k; of the first the left half of its uv may be cut out.
    fn world(meshes: &[TriangleMesh], cut_out: bool) -> World {
        let opacity = ScalarInput::Texture { texture: TextureIndex(0), channel: 0, uv: Default::default() };
        let material = |cut_out: bool| Material {
            name: String::new(),
            model: MaterialModel::Diffuse { reflectance: ColorInput::Constant([0.5; 3]), alpha: None },
            two_sided: true,
            opacity: cut_out.then_some(opacity),
            bump: None,
        };
        let half = Texture::new(2, 1, Texels::Grey(vec![0.0, 1.0]), Wrap::Clamp).unwrap();
        let surfaces = meshes.iter().enumerate().map(|(at, mesh)| Surface {
            name: String::new(),
            mesh: mesh.clone(),
            material: MaterialIndex(usize::from(at > 0)),
        });
        World::new(Arc::new(ReferenceScene {
            surfaces: surfaces.collect(),
            materials: vec![material(cut_out), material(false)],
            textures: vec![SourceTexture { name: String::new(), sha256: None, texture: half }],
            lights: Vec::new(),
        }))
        .unwrap()
    }

    /// At the origin, towards -Z, a right angle wide and high.
    fn camera() -> Camera {
        let intrinsics = Intrinsics::from_fov_x(64, 64, std::f64::consts::FRAC_PI_2);
        Camera::look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y, intrinsics).unwrap()
    }

    fn map(meshes: &[TriangleMesh], surface: usize, size: usize) -> TexelMap {
        TexelMap::new(&world(meshes, false), SurfaceIndex(surface), &meshes[surface], size, &camera())
    }

    /// Area that is observed, and that is not, in square metres.
    fn areas(map: &TexelMap) -> [f64; 2] {
        let mut areas = [0.0; 2];
        for texel in (0..map.size()).flat_map(|y| map.row(y)) {
            areas[usize::from(!texel.observed)] += texel.area_m2;
        }
        areas
    }

    #[test]
    fn weights_are_the_area_of_texels() {
        // Two triangles alike in the atlas, of 2 and 6 square metres.
        let mesh = TriangleMesh {
            positions: [[-1.0, 0.0], [1.0, 0.0], [-1.0, 2.0], [-3.0, 0.0], [1.0, 0.0], [-3.0, 3.0]]
                .map(|[x, y]| Vec3::new(x, y, -8.0))
                .into(),
            normals: None,
            uvs: Some([[0.0, 0.0], [0.5, 0.0], [0.0, 0.5], [0.5, 0.5], [1.0, 0.5], [0.5, 1.0]].map(Vec2::from).into()),
            triangles: vec![[0, 1, 2], [3, 4, 5]],
        };
        let map = map(&[mesh], 0, 64);
        let [lower, upper] = [32..64, 0..32].map(|rows| rows.flat_map(|y| map.row(y)).collect::<Vec<_>>());
        // Of 32 times 33 / 2 texels each the 32 on the long edge are halves, whose centres lie on it.
        for (texels, area_m2) in [(lower, 2.0), (upper, 6.0)] {
            let halves = texels.iter().filter(|texel| texel.area_m2 == area_m2 / 1024.0).count();
            let wholes = texels.iter().filter(|texel| texel.area_m2 == area_m2 / 512.0).count();
            assert_eq!((texels.len(), halves, wholes), (528, 32, 496));
            assert!(texels.iter().all(|texel| texel.off_centre.is_none()));
        }
    }

    /// A sheet of which the atlas holds a strip, much thinner than a texel, that no centre lies in: it keeps its area
    /// and its uv.
    #[test]
    fn what_no_centre_lies_in_counts_by_its_area() {
        let mut mesh = sheet(-4.0, 2.0);
        mesh.uvs = Some([[0.0, 0.501], [1.0, 0.501], [1.0, 0.5015], [0.0, 0.5015]].map(Vec2::from).into());
        let map = map(&[mesh], 0, 64);
        let [observed, unobserved] = areas(&map);
        assert!((observed - 4.0).abs() < 1e-6 && unobserved == 0.0);
        let texels: Vec<SurfaceTexel> = (0..64).flat_map(|y| map.row(y)).collect();
        assert_eq!(texels.len(), 64);
        for texel in texels {
            let [u, v] = texel.off_centre.unwrap();
            assert!((u * 64.0) as usize == texel.column && (0.501..0.5015).contains(&v), "{texel:?}");
        }
    }

    /// A box before the camera shows its front, and of its other sides nothing.
    #[test]
    fn of_a_box_one_side_is_observed() {
        let (low, side) = (Vec3::new(-1.0, -1.0, -5.0), 2.0);
        let (x, y, z) = (Vec3::X * side, Vec3::Y * side, Vec3::Z * side);
        let faces = [[low, x, y], [low + z, x, y], [low, x, z], [low + y, x, z], [low, y, z], [low + x, y, z]];
        let mut mesh = TriangleMesh::default();
        for (at, face) in faces.into_iter().enumerate() {
            add_quad(&mut mesh, face, Vec2::new((at % 3) as f32, (at / 3) as f32) * 0.25, 0.25);
        }
        let map = map(&[mesh], 0, 128);
        assert_eq!(areas(&map), [4.0, 20.0]);
        // The second face is the front: columns 32 to 63 of the lowest 32 rows.
        let seen = (0..128).flat_map(|y| map.row(y).map(move |texel| (texel, y))).filter(|(texel, _)| texel.observed);
        assert!(seen.into_iter().all(|(texel, y)| (32..64).contains(&texel.column) && y >= 96));
    }

    /// A square of one metre at two metres hides two by two metres at four. The twin without it sees them.
    #[test]
    fn what_lies_behind_is_unobserved() {
        let [wall, before] = [sheet(-4.0, 8.0), sheet(-2.0, 1.0)];
        assert_eq!(areas(&map(&[wall.clone(), before.clone()], 0, 64)), [60.0, 4.0]);
        assert_eq!(areas(&map(std::slice::from_ref(&wall), 0, 64)), [64.0, 0.0]);
        assert_eq!(areas(&map(&[wall, before], 1, 64)), [1.0, 0.0]);
    }

    #[test]
    fn what_the_frame_leaves_out_is_unobserved() {
        // The frame shows 8 by 8 metres at four; behind the camera it shows none.
        assert_eq!(areas(&map(&[sheet(-4.0, 16.0)], 0, 64)), [64.0, 192.0]);
        assert_eq!(areas(&map(&[sheet(4.0, 8.0)], 0, 64)), [0.0, 64.0]);
    }

    /// Sheets a tenth of a millimetre apart, as `prep` puts them, are distinguished even where they are seen at a
    /// grazing angle 10 m away; one sheet does not hide itself.
    #[test]
    fn sheets_a_hair_apart_are_distinguished() {
        let floor = |y: f32| {
            let mut mesh = TriangleMesh::default();
            add_quad(&mut mesh, [Vec3::new(-0.5, y, -10.0), Vec3::X, Vec3::Z], Vec2::ZERO, 1.0);
            mesh
        };
        let [lower, upper] = [floor(-0.2), floor(-0.1999)];
        let [seen, hidden] = areas(&map(&[lower.clone(), upper.clone()], 0, 64));
        assert!(seen < 0.01 * hidden, "{seen} {hidden}");
        assert_eq!(areas(&map(&[lower.clone(), upper], 1, 64)), [1.0, 0.0]);
        // Twice the same sheet: both are what is seen there.
        assert_eq!(areas(&map(&[lower.clone(), lower], 0, 64)), [1.0, 0.0]);
    }

    /// A wall behind a sheet whose left half is cut out is seen through the cut. Of the sheet itself only the right
    /// half counts.
    #[test]
    fn cut_out_texels_hide_nothing_and_count_nowhere() {
        let meshes = [sheet(-2.0, 2.0), sheet(-4.0, 8.0)];
        let world = world(&meshes, true);
        let areas =
            |surface: usize| areas(&TexelMap::new(&world, SurfaceIndex(surface), &meshes[surface], 64, &camera()));
        assert_eq!(areas(0), [2.0, 0.0]);
        assert_eq!(areas(1), [64.0 - 8.0, 8.0]);
    }
}
