//! Cameras that nobody set: drawn in a room until one stands free and sees enough of it.
//!
//! Height, pitch, clearance and coverage are those of BlenderProc's 3D-FRONT examples (SOURCE_FORMATS 3.7): height and
//! pitch uniform, the place uniform over the floor's bounding box with that very floor straight below, ten by ten rays for
//! nearness and for a score of what is seen.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3, Vec3};
use mateval_scene::camera::{Camera, Intrinsics};
use mateval_scene::{TriangleMesh, triangle};
use mateval_tracer::aov::{PixelHit, hit_through};
use mateval_tracer::{Hit, Ray, Sampler, World};

use super::furnish::{FurnishedHouse, Role};

/// What a camera must keep to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplerRules {
    /// Metres above the floor, least and most.
    pub height_m: [f64; 2],
    /// Degrees below the horizon, least and most.
    pub pitch_down_deg: [f64; 2],
    /// Metres to the nearest thing in any view.
    pub min_distance_m: f64,
    /// Metres to the nearest thing on any side, seen or not.
    pub clearance_m: f64,
    /// Metres, the mean distance in the input view: least and most.
    pub mean_distance_m: [f64; 2],
    /// What the score of the input view must exceed.
    pub min_score: f64,
    /// Draws before it is given up.
    pub tries: u32,
}

impl Default for SamplerRules {
    fn default() -> Self {
        Self {
            height_m: [1.4, 1.8],
            // BlenderProc's 1.2217 to 1.338 rad from straight down.
            pitch_down_deg: [13.34, 20.0],
            min_distance_m: 1.0,
            clearance_m: 0.3,
            mean_distance_m: [2.5, 3.5],
            min_score: 0.8,
            tries: 10_000,
        }
    }
}

/// A camera that keeps to the rules.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundCamera {
    /// The input camera.
    pub camera: Camera,
    /// What it sees; see [`score`].
    pub score: f64,
    /// Metres to the nearest thing in any view.
    pub nearest_m: f64,
    /// Metres on the average, input view.
    pub mean_m: f64,
    /// Draws that it took, this one included.
    pub tries: u32,
}

/// Why a draw is thrown away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Refusal {
    /// Not above the room's floor alone.
    OffFloor,
    /// Sees the outside.
    Open,
    /// Sees something too near.
    Near,
    /// The mean distance is out of range.
    Mean,
    /// The score is too low.
    Dull,
    /// Something is within the clearance, seen or not.
    Crowded,
}

/// Draws cameras in room number `room` until one keeps to the rules. `turns` are the novel views', degrees about x and y.
///
/// Fails, in words, where the room has no floor, or where none of all draws will do.
pub fn sample(
    house: &FurnishedHouse,
    room: usize,
    intrinsics: Intrinsics,
    turns: &[[f64; 2]],
    rules: &SamplerRules,
    seed: u64,
) -> Result<FoundCamera, String> {
    let world = World::new(Arc::new(house.scene.clone())).map_err(|error| error.to_string())?;
    RoomSampler::new(house, &world, room)?.sample(intrinsics, turns, rules, seed)
}

/// A room made ready for drawing many cameras.
pub struct RoomSampler<'a> {
    house: &'a FurnishedHouse,
    world: &'a World,
    room: usize,
    floor: [Vec3; 2],
}

impl<'a> RoomSampler<'a> {
    /// `world` is of the whole house. Fails, in words, where the room has no floor.
    pub fn new(house: &'a FurnishedHouse, world: &'a World, room: usize) -> Result<Self, String> {
        let name = &house.house.rooms[room].id;
        let floors = (0..house.placed.len()).filter(|&surface| is_floor(house, surface, room));
        let positions =
            || floors.clone().flat_map(|surface| house.scene.surfaces[surface].mesh.positions.iter().copied());
        let (Some(low), Some(high)) = (positions().reduce(Vec3::min), positions().reduce(Vec3::max)) else {
            return Err(format!("room '{name}' has no floor for a camera to stand on; give it one by hand"));
        };
        Ok(Self { house, world, room, floor: [low, high] })
    }

    /// Whether the first floor straight below a place is the room's own; furniture may be in between.
    pub fn stands_in_room(&self, place: DVec3) -> bool {
        let is_any_floor = |hit: &Hit| is_architecture(self.house, hit.surface.0, "Floor");
        let down = Ray::endless(place.as_vec3(), Vec3::NEG_Y);
        let floor = self.world.accel().closest_where(&down, is_any_floor);
        floor.is_some_and(|hit| is_floor(self.house, hit.surface.0, self.room))
    }

    /// Draws until a camera keeps to the rules.
    pub fn sample(
        &self,
        intrinsics: Intrinsics,
        turns: &[[f64; 2]],
        rules: &SamplerRules,
        seed: u64,
    ) -> Result<FoundCamera, String> {
        let mut refusals = Vec::new();
        for number in 0..rules.tries {
            // One pixel of a picture of the room: every draw follows from seed, room and number alone.
            let sampler = Sampler::new(seed, [self.room as u32, 0], number);
            match self.draw(&sampler, intrinsics, rules).and_then(|camera| self.judge(camera, turns, rules)) {
                Ok(found) => return Ok(FoundCamera { tries: number + 1, ..found }),
                Err(refusal) => refusals.push(refusal),
            }
        }
        Err(self.told(&refusals, rules))
    }

    fn told(&self, refusals: &[Refusal], rules: &SamplerRules) -> String {
        let count = |which: Refusal| refusals.iter().filter(|refusal| **refusal == which).count();
        format!(
            "none of {} cameras will do in room '{}': {} not above its floor alone, {} see the outside, {} see something \
             nearer than {} m, {} have a mean distance out of {:?} m, {} score no more than {}, {} within {} m of something; \
             give one by hand, or try another seed",
            rules.tries,
            self.house.house.rooms[self.room].id,
            count(Refusal::OffFloor),
            count(Refusal::Open),
            count(Refusal::Near),
            rules.min_distance_m,
            count(Refusal::Mean),
            rules.mean_distance_m,
            count(Refusal::Dull),
            rules.min_score,
            count(Refusal::Crowded),
            rules.clearance_m,
        )
    }

    /// A camera above the room's floor.
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

    /// Whether a camera keeps to the rules; what costs least is asked first.
    fn judge(&self, camera: Camera, turns: &[[f64; 2]], rules: &SamplerRules) -> Result<FoundCamera, Refusal> {
        let holds = |holds: bool, refusal: Refusal| if holds { Ok(()) } else { Err(refusal) };
        let seen = self.rays(&camera).ok_or(Refusal::Open)?;
        holds(nearest(&seen) >= rules.min_distance_m, Refusal::Near)?;
        let mean_m = seen.iter().map(|(_, distance)| distance).sum::<f64>() / seen.len() as f64;
        holds((rules.mean_distance_m[0]..=rules.mean_distance_m[1]).contains(&mean_m), Refusal::Mean)?;
        let score = score(self.house, &seen.iter().map(|(surface, _)| Some(*surface)).collect::<Vec<_>>());
        holds(score > rules.min_score, Refusal::Dull)?;
        let turned: Vec<Camera> = turns.iter().map(|turn| camera.turned(turn[0], turn[1])).collect();
        for view in &turned {
            self.rays(view).ok_or(Refusal::Open)?;
        }
        let views = turned.iter().chain([&camera]);
        let nearest_m = views.map(|view| self.nearest_between(view)).fold(nearest(&seen), f64::min);
        holds(nearest_m >= rules.min_distance_m, Refusal::Near)?;
        let clearance_m = self.distance_to_anything(camera.position(), rules.clearance_m);
        holds(clearance_m >= rules.clearance_m, Refusal::Crowded)?;
        Ok(FoundCamera { camera, score, nearest_m, mean_m, tries: 0 })
    }

    /// The place at the drawn height above the floor below; none where something else is below, or nothing above that
    /// keeps the room in (a lamp or a ceiling, or the open sky, may be there).
    fn on_own_floor(&self, above: DVec3, rules: &SamplerRules, height: f64) -> Option<DVec3> {
        let down = self.world.first_hit(&Ray::endless(above.as_vec3(), Vec3::NEG_Y))?;
        if !is_floor(self.house, down.surface.0, self.room) {
            return None;
        }
        let floor = above.y - f64::from(down.distance);
        let lifted = floor + rules.height_m[0] + (rules.height_m[1] - rules.height_m[0]) * height;
        Some(DVec3::new(above.x, lifted, above.z))
    }

    /// To the nearest point of any triangle of the house; anything beyond `enough` may come out as `enough`.
    fn distance_to_anything(&self, from: DVec3, enough: f64) -> f64 {
        let from = from.as_vec3();
        let mut nearest = enough as f32;
        for surface in &self.house.scene.surfaces {
            nearest = nearest.min(distance_to_mesh(&surface.mesh, from, nearest));
        }
        f64::from(nearest)
    }

    /// Metres to the nearest thing that many more rays meet: table edges and lamps fit between ten by ten. Only cameras that
    /// keep to all other rules are worth it.
    fn nearest_between(&self, view: &Camera) -> f64 {
        let met = grid(&view.intrinsics, DENSE_GRID).filter_map(|place| {
            let hit = hit_through(self.world, view, place)?;
            Some(view.camera_direction(place).length() * hit.depth)
        });
        met.fold(f64::INFINITY, f64::min)
    }

    /// What ten by ten rays meet, corners included, and how far away; none where one leaves the house.
    fn rays(&self, camera: &Camera) -> Option<Vec<(usize, f64)>> {
        grid(&camera.intrinsics, GRID)
            .map(|place| {
                let hit: PixelHit = hit_through(self.world, camera, place)?;
                let distance = camera.camera_direction(place).length() * hit.depth;
                Some((hit.surface.0, distance))
            })
            .collect()
    }
}

fn is_floor(house: &FurnishedHouse, surface: usize, room: usize) -> bool {
    let placed = &house.placed[surface];
    placed.room == room && is_architecture(house, surface, "Floor")
}

fn is_architecture(house: &FurnishedHouse, surface: usize, wanted: &str) -> bool {
    matches!(&house.placed[surface].role, Role::Architecture { kind } if kind == wanted)
}

fn nearest(seen: &[(usize, f64)]) -> f64 {
    seen.iter().map(|(_, distance)| *distance).fold(f64::INFINITY, f64::min)
}

/// Rays of a side.
const GRID: usize = 10;
/// Rays of a side, where nothing may be missed.
const DENSE_GRID: usize = 60;

/// The places of ten by ten rays over the picture, corners included.
pub fn score_grid(intrinsics: &Intrinsics) -> impl Iterator<Item = DVec2> + use<> {
    grid(intrinsics, GRID)
}

fn grid(intrinsics: &Intrinsics, side: usize) -> impl Iterator<Item = DVec2> + use<> {
    let size = DVec2::new(f64::from(intrinsics.width), f64::from(intrinsics.height));
    let share = move |k: usize| k as f64 / (side - 1) as f64;
    // A hair within the frame: its border belongs to the pixel beyond.
    let within = move |place: DVec2| (size - DVec2::splat(1e-3)) * place;
    (0..side * side).map(move |k| within(DVec2::new(share(k % side), share(k / side))))
}

/// BlenderProc's coverage score of the surfaces met by 100 rays: chairs, sofas, tables and beds count ten times, all else
/// once; the sum over 100, times a third of the number of different kinds, times the product over kinds of one minus the
/// kind's share. Walls and floors are kinds too; a ray that meets nothing adds nothing.
pub fn score(house: &FurnishedHouse, seen: &[Option<usize>]) -> f64 {
    const SPECIAL: [&str; 4] = ["chair", "sofa", "table", "bed"];
    let mut kinds: BTreeMap<String, usize> = BTreeMap::new();
    let mut weighted = 0;
    for surface in seen.iter().flatten() {
        let name = match &house.placed[*surface].role {
            Role::Architecture { kind } => kind.to_lowercase(),
            Role::Furniture { name, .. } => name.clone(),
        };
        weighted += if SPECIAL.iter().any(|special| name.contains(special)) { 10 } else { 1 };
        *kinds.entry(name).or_insert(0) += 1;
    }
    let all = seen.len().max(1) as f64;
    let spread: f64 = kinds.values().map(|count| 1.0 - *count as f64 / all).product();
    f64::from(weighted) / all * (kinds.len() as f64 / 3.0) * spread
}

/// To the nearest point of a mesh, or `enough` where that is nearer.
fn distance_to_mesh(mesh: &TriangleMesh, from: Vec3, enough: f32) -> f32 {
    let mut nearest = enough;
    for index in 0..mesh.triangles.len() {
        let corners = mesh.corners(index);
        // Most triangles are far: their box tells.
        let (low, high) = (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
        if (from.clamp(low, high) - from).length() < nearest {
            let corners = corners.map(|corner| corner.as_dvec3());
            nearest = nearest.min(triangle::distance(corners, from.as_dvec3()) as f32);
        }
    }
    nearest
}
