//! Draws cameras in a room until one keeps its distance from everything and sees enough of the room.
//!
//! Height and pitch are uniform, the position is uniform over the floor's bounding box and must be above the floor, and
//! ten by ten rays decide on the distances and on a score of what is seen. Which heights, distances and scores are
//! wanted is stated by [`SamplerRules`].

use std::collections::BTreeMap;

use glam::{DMat3, DVec2, DVec3, Vec3};
use mateval_dataset::camera::{Camera, Intrinsics};
use mateval_dataset::reference::ReferenceScene;
use mateval_dataset::{TriangleMesh, mesh};
use mateval_tracer::aov::{PixelHit, hit_through};
use mateval_tracer::{Hit, Ray, Sampler, World};

use super::camera_rules::{Coverage, SamplerRules};
use super::furnish::FurnishedHouse;

/// A camera that keeps to the rules.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundCamera {
    pub camera: Camera,
    /// The [`score`] of the input view.
    pub score: f64,
    /// The distance to the nearest surface seen in any view, in metres.
    pub nearest_m: f64,
    /// The mean distance in the input view, in metres.
    pub mean_m: f64,
    /// The number of draws, including this one.
    pub tries: u32,
}

/// The rule that a draw breaks first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Refusal {
    OffFloor,
    SeesOutside,
    TooNear,
    MeanDistance,
    LowScore,
    NoClearance,
}

/// How many draws broke each rule, as in "3 see the outside, 2 are within 0.3 m of something".
fn counted(refusals: &BTreeMap<Refusal, u32>, rules: &SamplerRules) -> String {
    let [nearest, farthest] = rules.mean_distance_m;
    let counted = refusals.iter().map(|(refusal, count)| match refusal {
        Refusal::OffFloor => format!("{count} are not above the room's floor"),
        Refusal::SeesOutside => format!("{count} see the outside"),
        Refusal::TooNear => format!("{count} see something nearer than {} m", rules.min_distance_m),
        Refusal::MeanDistance => format!("{count} have a mean distance outside {nearest} to {farthest} m"),
        Refusal::LowScore => format!("{count} have a score below {}", rules.min_score),
        Refusal::NoClearance => format!("{count} are within {} m of something", rules.clearance_m),
    });
    counted.collect::<Vec<_>>().join(", ")
}

/// Why no camera can be drawn in a room.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CameraError {
    #[error("room '{room}' has no floor for a camera to stand on; give a camera by hand")]
    NoFloor { room: String },
    #[error(
        "none of {} cameras drawn in room '{room}' keeps the rules: {}; give a camera by hand, or try other rules or \
         another seed",
        rules.tries, counted(refusals, rules)
    )]
    NoneFound { room: String, rules: Box<SamplerRules>, refusals: BTreeMap<Refusal, u32> },
}

/// A room made ready for drawing many cameras.
pub struct RoomSampler<'a> {
    house: &'a FurnishedHouse,
    world: &'a World,
    room: usize,
    floor: [Vec3; 2],
}

impl<'a> RoomSampler<'a> {
    /// A sampler of room number `room`; `world` was made of `house.scene`. Fails where the room has no floor.
    pub fn new(house: &'a FurnishedHouse, world: &'a World, room: usize) -> Result<Self, CameraError> {
        let floors = (0..house.placed.len()).filter(|&surface| is_floor(house, surface, room));
        let positions = floors.flat_map(|surface| house.scene.surfaces[surface].mesh.positions.iter().copied());
        let no_floor = || CameraError::NoFloor { room: house.house.rooms[room].id.clone() };
        Ok(Self { house, world, room, floor: mesh::bounds(positions).ok_or_else(no_floor)? })
    }

    /// The area of the room's floor, in square metres.
    pub fn floor_area_m2(&self) -> f64 {
        let surfaces = (0..self.house.placed.len()).filter(|&surface| is_floor(self.house, surface, self.room));
        surfaces.map(|surface| self.house.scene.surfaces[surface].mesh.area()).sum()
    }

    /// Whether the first floor below a position belongs to the room. Furniture in between is ignored.
    pub fn stands_in_room(&self, place: DVec3) -> bool {
        let is_any_floor = |hit: &Hit| is_architecture(self.house, hit.surface.0, "Floor");
        let down = Ray::endless(place.as_vec3(), Vec3::NEG_Y);
        let floor = self.world.accel().closest_where(&down, is_any_floor);
        floor.is_some_and(|hit| is_floor(self.house, hit.surface.0, self.room))
    }

    /// Draws until a camera keeps to the rules. `turns` are the novel views', degrees about x and y.
    ///
    /// Fails where none of all draws will do.
    pub fn sample(
        &self,
        intrinsics: Intrinsics,
        turns: &[[f64; 2]],
        rules: &SamplerRules,
        seed: u64,
    ) -> Result<FoundCamera, CameraError> {
        let mut refusals = BTreeMap::new();
        for number in 0..rules.tries {
            // Every draw follows from seed, room and number alone.
            let sampler = Sampler::new(seed, [self.room as u32, 0], number);
            match self.draw(&sampler, intrinsics, rules).and_then(|camera| self.judge(camera, turns, rules)) {
                Ok(found) => return Ok(FoundCamera { tries: number + 1, ..found }),
                Err(refusal) => *refusals.entry(refusal).or_insert(0) += 1,
            }
        }
        let room = self.house.house.rooms[self.room].id.clone();
        Err(CameraError::NoneFound { room, rules: Box::new(*rules), refusals })
    }

    /// Draws a camera above the room's floor.
    fn draw(&self, sampler: &Sampler, intrinsics: Intrinsics, rules: &SamplerRules) -> Result<Camera, Refusal> {
        let [x, z, height, pitch] = sampler.set(0).map(f64::from);
        let [yaw, ..] = sampler.set(1).map(f64::from);
        let between = |[low, high]: [f64; 2], share: f64| low + (high - low) * share;
        let [low, high] = self.floor.map(|corner| corner.as_dvec3());
        let above = DVec3::new(
            between([low.x, high.x], x),
            high.y + between(rules.height_m, height),
            between([low.z, high.z], z),
        );
        let position = self.on_own_floor(above, rules, height).ok_or(Refusal::OffFloor)?;
        let pitch = -between(rules.pitch_down_deg, pitch).to_radians();
        let rotation = DMat3::from_rotation_y(yaw * std::f64::consts::TAU) * DMat3::from_rotation_x(pitch);
        Ok(Camera::from_rotation(rotation, position, intrinsics))
    }

    /// Checks a camera against the rules, the cheapest first.
    fn judge(&self, camera: Camera, turns: &[[f64; 2]], rules: &SamplerRules) -> Result<FoundCamera, Refusal> {
        let holds = |holds: bool, refusal: Refusal| if holds { Ok(()) } else { Err(refusal) };
        // The input view, with few rays.
        let seen = self.rays(&camera, rules)?;
        holds(nearest(&seen) >= rules.min_distance_m, Refusal::TooNear)?;
        let distances = || seen.iter().flatten().map(|(_, distance)| distance);
        let mean_m = distances().sum::<f64>() / distances().count() as f64;
        holds((rules.mean_distance_m[0]..=rules.mean_distance_m[1]).contains(&mean_m), Refusal::MeanDistance)?;
        let surfaces: Vec<Option<usize>> = seen.iter().map(|hit| Some((*hit)?.0)).collect();
        let score = score(self.house, &surfaces, rules);
        holds(score >= rules.min_score, Refusal::LowScore)?;
        // All views, with few rays and then with many.
        let turned: Vec<Camera> = turns.iter().map(|turn| camera.turned(turn[0], turn[1])).collect();
        for view in &turned {
            self.rays(view, rules)?;
        }
        let views = turned.iter().chain([&camera]);
        let nearest_m = views.map(|view| self.nearest_by_dense_rays(view)).fold(nearest(&seen), f64::min);
        holds(nearest_m >= rules.min_distance_m, Refusal::TooNear)?;
        // Everything around the camera.
        let clearance_m = distance_to_anything(&self.house.scene, camera.position(), rules.clearance_m);
        holds(clearance_m >= rules.clearance_m, Refusal::NoClearance)?;
        Ok(FoundCamera { camera, score, nearest_m, mean_m, tries: 0 })
    }

    /// The position at the drawn height above the floor below `above`; absent if something else is below.
    fn on_own_floor(&self, above: DVec3, rules: &SamplerRules, height: f64) -> Option<DVec3> {
        let down = self.world.first_hit(&Ray::endless(above.as_vec3(), Vec3::NEG_Y))?;
        if !is_floor(self.house, down.surface.0, self.room) {
            return None;
        }
        let floor = above.y - f64::from(down.distance);
        let lifted = floor + rules.height_m[0] + (rules.height_m[1] - rules.height_m[0]) * height;
        Some(DVec3::new(above.x, lifted, above.z))
    }

    /// The distance to the nearest surface that a dense grid of rays meets, since table edges and lamps fit between ten
    /// by ten rays. It is expensive and so checked late.
    fn nearest_by_dense_rays(&self, view: &Camera) -> f64 {
        let met = grid(&view.intrinsics, DENSE_GRID).filter_map(|place| self.met(view, place));
        met.map(|(_, distance)| distance).fold(f64::INFINITY, f64::min)
    }

    /// The surface that the ray through a place of the picture meets, and its distance.
    fn met(&self, camera: &Camera, place: DVec2) -> Option<(usize, f64)> {
        let hit: PixelHit = hit_through(self.world, camera, place)?;
        Some((hit.surface.0, camera.camera_direction(place).length() * hit.depth))
    }

    /// The surfaces that ten by ten rays meet and their distances; none for a ray that leaves the house. Fails where a
    /// ray does and must not, and where all do.
    fn rays(&self, camera: &Camera, rules: &SamplerRules) -> Result<Vec<Option<(usize, f64)>>, Refusal> {
        let mut seen = Vec::new();
        for place in grid(&camera.intrinsics, GRID) {
            let hit = self.met(camera, place);
            if hit.is_none() && rules.no_background {
                return Err(Refusal::SeesOutside);
            }
            seen.push(hit);
        }
        if seen.iter().all(Option::is_none) { Err(Refusal::SeesOutside) } else { Ok(seen) }
    }
}

fn is_floor(house: &FurnishedHouse, surface: usize, room: usize) -> bool {
    let placed = &house.placed[surface];
    placed.room == room && is_architecture(house, surface, "Floor")
}

fn is_architecture(house: &FurnishedHouse, surface: usize, wanted: &str) -> bool {
    house.placed[surface].origin.role.architecture_kind() == Some(wanted)
}

fn nearest(seen: &[Option<(usize, f64)>]) -> f64 {
    seen.iter().flatten().map(|(_, distance)| *distance).fold(f64::INFINITY, f64::min)
}

/// Rays along a side of the coarse grid.
const GRID: usize = 10;
/// Rays along a side of the dense grid.
const DENSE_GRID: usize = 60;

/// The pixel positions of ten by ten rays over the picture, corners included.
pub fn score_grid(intrinsics: &Intrinsics) -> impl Iterator<Item = DVec2> + use<> {
    grid(intrinsics, GRID)
}

fn grid(intrinsics: &Intrinsics, side: usize) -> impl Iterator<Item = DVec2> + use<> {
    let size = DVec2::new(f64::from(intrinsics.width), f64::from(intrinsics.height));
    let share = move |k: usize| k as f64 / (side - 1) as f64;
    // Slightly within the frame, since its right and lower borders belong to pixels outside.
    let within = move |place: DVec2| (size - DVec2::splat(1e-3)) * place;
    (0..side * side).map(move |k| within(DVec2::new(share(k % side), share(k / side))))
}

/// BlenderProc's coverage score of the surfaces that the rays of [`score_grid`] meet.
///
/// It is the product of three factors: the mean weight of the rays, which is 10 for chairs, sofas, tables and beds, 0
/// for a ray that meets nothing, `architecture_weight` for walls and the like, and 1 otherwise; a third of the number
/// of different kinds, where walls and floors are kinds too; and the product over all kinds of one minus the kind's
/// fraction of the rays.
///
/// The fork 3dlg-hcvc/BlenderProc-3DFront multiplies the mean weight by the entropy, in bits, of the hits by instance,
/// without those of weight 0.
pub fn score(house: &FurnishedHouse, seen: &[Option<usize>], rules: &SamplerRules) -> f64 {
    const SPECIAL: [&str; 4] = ["chair", "sofa", "table", "bed"];
    let mut kinds: BTreeMap<String, usize> = BTreeMap::new();
    let mut instances: BTreeMap<usize, usize> = BTreeMap::new();
    let mut weighted = 0;
    for surface in seen.iter().flatten() {
        let placed = &house.placed[*surface];
        let kind = || placed.origin.role.architecture_kind().unwrap_or_default().to_lowercase();
        let name = placed.model.as_ref().map_or_else(kind, |model| model.name.clone());
        let weight = match SPECIAL.iter().any(|special| name.contains(special)) {
            true => 10,
            false if placed.model.is_none() => rules.architecture_weight,
            false => 1,
        };
        weighted += weight;
        *kinds.entry(name).or_insert(0) += 1;
        if weight > 0 {
            *instances.entry(*surface).or_insert(0) += 1;
        }
    }
    let all = seen.len().max(1) as f64;
    let mean_weight = f64::from(weighted) / all;
    match rules.coverage {
        Coverage::Kinds => {
            let spread: f64 = kinds.values().map(|count| 1.0 - *count as f64 / all).product();
            mean_weight * (kinds.len() as f64 / 3.0) * spread
        }
        Coverage::EntropyOfInstances => mean_weight * entropy_bits(instances.values().copied()),
    }
}

/// Shannon's entropy in bits of a distribution that counts state.
fn entropy_bits(counts: impl Iterator<Item = usize> + Clone) -> f64 {
    let all: usize = counts.clone().sum();
    let bits = |count: usize| {
        let share = count as f64 / all as f64;
        -share * libm::log2(share)
    };
    counts.filter(|count| *count > 0).map(bits).sum()
}

/// The distance in metres to the nearest triangle of the scene, or `enough` where that is smaller.
pub fn distance_to_anything(scene: &ReferenceScene, from: DVec3, enough: f64) -> f64 {
    let from = from.as_vec3();
    let mut nearest = enough as f32;
    for surface in &scene.surfaces {
        nearest = nearest.min(distance_to_mesh(&surface.mesh, from, nearest));
    }
    f64::from(nearest)
}

/// The distance to the nearest point of a mesh, or `enough` where that is smaller.
fn distance_to_mesh(mesh: &TriangleMesh, from: Vec3, enough: f32) -> f32 {
    let mut nearest = enough;
    for index in 0..mesh.triangles.len() {
        let corners = mesh.corners(index);
        // The bounding box excludes most triangles.
        let (low, high) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
        if (from.clamp(low, high) - from).length() < nearest {
            let corners = corners.map(|corner| corner.as_dvec3());
            nearest = nearest.min(mesh::triangle_distance(corners, from.as_dvec3()) as f32);
        }
    }
    nearest
}
