//! The rooms of one house: their properties, and cameras in them with what these see or why they are not offered.

use std::collections::BTreeSet;

use glam::DVec2;
use mateval_dataset::TriangleMesh;
use mateval_dataset::camera::{Camera, Intrinsics};
use mateval_dataset::ids::id_text_from;
use mateval_dataset::mesh::bounds;
use mateval_image::Picture;
use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_sources::front3d::FurnishedHouse;
use mateval_sources::front3d::camera_sampler::{CameraError, RoomSampler, score, score_grid};
use mateval_tracer::World;
use mateval_tracer::aov::hit_through;
use rayon::prelude::*;

use super::intersect::{MeshIntersection, intersections};
use super::rules::{RoomFacts, SurveyOptions};
use super::survey_file::{CandidateCamera, IntersectingPair, Rejection, SurveyedRoom};
use crate::error::PrepError;
use crate::recipe::Offset;

/// A picture of sRGB bytes.
type Thumbnail = Picture<[u8; 3]>;

/// A thumbnail with the name of its file.
pub(super) type NamedThumbnail = (String, Thumbnail);

/// Length of a thumbnail's longer side, in pixels.
const THUMBNAIL_SIDE: u32 = 320;

/// The rooms of a house and the pictures of their cameras.
pub(super) struct HouseSurvey {
    pub(super) rooms: Vec<SurveyedRoom>,
    /// The names of the thumbnails, as the cameras list them, and what they show.
    pub(super) pictures: Vec<NamedThumbnail>,
}

/// Searches all rooms of the house.
pub(super) fn search_rooms(options: &SurveyOptions, house: &FurnishedHouse) -> Result<HouseSurvey, PrepError> {
    let world = World::new(house.scene.clone())?;
    let views = crate::recipe::default_views();
    let draws = CameraDraws::new(options, house, &world, &views);
    let search = RoomSearch { options, house, world: &world, views, draws };
    let mut survey = HouseSurvey { rooms: Vec::new(), pictures: Vec::new() };
    for room in 0..house.house.rooms.len() {
        let (mut surveyed, pictures) = search.room(room)?;
        for (camera, picture) in surveyed.cameras.iter_mut().zip(pictures) {
            camera.thumbnail = format!("{room}-{}.png", camera.origin.replace(' ', ""));
            survey.pictures.push((camera.thumbnail.clone(), picture));
        }
        survey.rooms.push(surveyed);
    }
    Ok(survey)
}

/// A house that is searched, and how.
struct RoomSearch<'a> {
    options: &'a SurveyOptions,
    house: &'a FurnishedHouse,
    world: &'a World,
    views: Vec<Offset>,
    draws: CameraDraws<'a>,
}

/// A camera that breaks no rule, and its thumbnail.
type Candidate = (CandidateCamera, Thumbnail);

impl RoomSearch<'_> {
    /// Searches a room. Returns it with a picture for each of its cameras.
    fn room(&self, room: usize) -> Result<(SurveyedRoom, Vec<Thumbnail>), PrepError> {
        let facts = self.facts(room)?;
        let source = &self.house.house.rooms[room];
        let mut rejections = self.options.rules.check(&facts);
        let (mut cameras, mut pictures) = (Vec::new(), Vec::new());
        if rejections.is_empty() {
            let (found, refused) = self.cameras(room);
            if found.is_empty() {
                let none = "no camera was drawn, and no designer's camera is in the room".to_owned();
                let refused: Vec<String> = refused.iter().map(RefusedCamera::to_string).collect();
                let reason = if refused.is_empty() { none } else { refused.join("; ") };
                rejections.push(Rejection::new("no_camera", reason));
            }
            for (camera, picture) in found {
                pictures.push(picture);
                cameras.push(camera);
            }
        }
        let surveyed = SurveyedRoom {
            room: source.id.clone(),
            room_type: facts.kind,
            objects: facts.objects,
            super_categories: facts.super_categories,
            size_m: facts.size_m,
            intersecting: facts.intersecting,
            missing: facts.missing,
            rejections,
            rank: None,
            choice: None,
            cameras,
        };
        Ok((surveyed, pictures))
    }

    fn facts(&self, room: usize) -> Result<RoomFacts, PrepError> {
        let house = self.house;
        let furniture: Vec<usize> = (0..house.placed.len()).filter(|&k| self.is_furniture_of(k, room)).collect();
        let meshes: Vec<&TriangleMesh> = furniture.iter().map(|&k| &house.scene.surfaces[k].mesh).collect();
        let name = |place: usize| house.scene.surfaces[furniture[place]].name.clone();
        // Such a room is rejected anyway, and testing every pair of its pieces takes long.
        let too_many = furniture.len() > self.options.rules.max_objects;
        let found = if too_many { Vec::new() } else { intersections(&meshes)? };
        let named = |MeshIntersection { pair, depth_m, volume_share }: MeshIntersection| IntersectingPair {
            pieces: pair.map(name),
            depth_m,
            volume_share,
        };
        let complete = |k: &&usize| house.placed[**k].model.as_ref().is_some_and(|model| model.complete);
        let kinds: BTreeSet<&str> =
            furniture.iter().filter_map(|&k| house.placed[k].origin.super_category.as_deref()).collect();
        Ok(RoomFacts {
            kind: house.house.rooms[room].kind.clone(),
            objects: furniture.len(),
            super_categories: kinds.len(),
            size_m: self.size_m(room),
            intersecting: found.into_iter().map(named).collect(),
            missing: house.wanted_pieces[room] - furniture.iter().filter(complete).count(),
        })
    }

    fn is_furniture_of(&self, surface: usize, room: usize) -> bool {
        let placed = &self.house.placed[surface];
        placed.room == room && placed.origin.role.is_furniture()
    }

    fn size_m(&self, room: usize) -> [f64; 2] {
        let is_floor = |k: &usize| {
            let placed = &self.house.placed[*k];
            placed.room == room && placed.origin.role.architecture_kind() == Some("Floor")
        };
        let floors = (0..self.house.placed.len()).filter(is_floor);
        let positions = floors.flat_map(|k| self.house.scene.surfaces[k].mesh.positions.iter().copied());
        let [low, high] = bounds(positions).unwrap_or_default();
        [f64::from(high.x - low.x), f64::from(high.z - low.z)]
    }

    /// The drawn cameras and the designers' cameras in this room that break no rule, the best score first; and the
    /// others with the rules that they break.
    fn cameras(&self, room: usize) -> (Vec<Candidate>, Vec<RefusedCamera>) {
        let (posed, mut refused) = self.draws.posed(room);
        let mut found = Vec::new();
        for Posed { origin, camera, fov_y_deg } in posed {
            match self.candidate(room, &origin, camera, fov_y_deg) {
                Ok(candidate) => found.push(candidate),
                Err(why) => refused.push(RefusedCamera { origin: Some(origin), why }),
            }
        }
        found.sort_by(|a, b| b.0.score.total_cmp(&a.0.score).then(a.0.scene.cmp(&b.0.scene)));
        (found, refused)
    }

    /// Looks through a camera. Fails where it breaks a rule.
    fn candidate(&self, room: usize, origin: &str, camera: Camera, fov_y_deg: f64) -> Result<Candidate, CameraRefusal> {
        let small = thumbnail_camera(&camera);
        let seen = self.seen(&small);
        let pieces: BTreeSet<usize> =
            seen.iter().flatten().map(|hit| hit.0).filter(|&k| self.is_furniture_of(k, room)).collect();
        let turned: Vec<Vec<Option<Seen>>> =
            self.views.iter().map(|view| self.seen(&small.turned(view.x_deg, view.y_deg))).collect();
        let pixels = seen.len() * (1 + self.views.len());
        let missed: usize =
            turned.iter().chain([&seen]).map(|seen| seen.iter().filter(|hit| hit.is_none()).count()).sum();
        let outside = missed as f64 / pixels as f64;
        let rules = &self.options.rules;
        if seen.iter().all(Option::is_none) || outside > rules.max_outside {
            return Err(CameraRefusal::SeesOutside { share: outside, most: rules.max_outside });
        }
        if pieces.len() < rules.min_seen_objects {
            return Err(CameraRefusal::SeesTooLittle { seen: pieces.len(), least: rules.min_seen_objects });
        }
        let nearest_of_all = turned.iter().map(|seen| nearest(seen)).fold(nearest(&seen), f64::min);
        if nearest_of_all < rules.min_nearest_m {
            return Err(CameraRefusal::TooNear { nearest_m: nearest_of_all, least_m: rules.min_nearest_m });
        }
        let surfaces: Vec<Option<usize>> =
            score_grid(&small.intrinsics).map(|place| Some(self.look_at(&small, place)?.0)).collect();
        let position = camera.position();
        let forward = camera.rotation() * -glam::DVec3::Z;
        let scene = self.scene_id(room, origin);
        let candidate = CandidateCamera {
            thumbnail: String::new(),
            scene,
            origin: origin.to_owned(),
            position: position.to_array(),
            target: (position + forward).to_array(),
            fov_y_deg,
            score: score(self.house, &surfaces, &self.options.camera_rules.sampler_rules()),
            nearest_m: nearest(&seen),
            outside,
            seen_objects: pieces.len(),
        };
        let (width, height) = (small.intrinsics.width as usize, small.intrinsics.height as usize);
        let picture = Picture::from_fn(width, height, |x, y| seen[y * width + x].map_or(OUTSIDE, |hit| hit.2));
        Ok((candidate, picture))
    }

    /// An id from room, house and camera, which may still be another's too.
    fn scene_id(&self, room: usize, origin: &str) -> String {
        let house: String = self.house.house.uid.chars().take(8).collect();
        let room: String = self.house.house.rooms[room].id.chars().take(28).collect();
        id_text_from(&format!("{room}-{house}-{}", origin.replace(' ', "")), "room")
    }

    /// What each pixel of the camera sees, row by row.
    fn seen(&self, camera: &Camera) -> Vec<Option<Seen>> {
        let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
        let place = |k: usize| DVec2::new((k % width) as f64 + 0.5, (k / width) as f64 + 0.5);
        (0..width * height).into_par_iter().map(|k| self.look_at(camera, place(k))).collect()
    }

    /// What the camera sees at a place of its picture; none for the outside.
    fn look_at(&self, camera: &Camera, place: DVec2) -> Option<Seen> {
        let hit = hit_through(self.world, camera, place)?;
        let surface = &self.house.scene.surfaces[hit.surface.0];
        let uv = surface.mesh.uv_at(hit.triangle, hit.barycentrics).unwrap_or_default();
        let material = &self.house.scene.materials[surface.material.0];
        let color = material.appearance(self.world.textures(), uv).map_or([0.5; 3], |seen| seen.base_color);
        let distance = camera.camera_direction(place).length() * hit.depth;
        // Shaded as if lit by a lamp on the camera, which shows shapes without tracing paths.
        let facing = hit.normal.as_dvec3().dot(camera.direction(place)).abs() as f32;
        let shade = 0.25 + 0.75 * facing;
        Some((hit.surface.0, distance, color.map(|v| byte_from_unit(srgb_from_linear(v * shade)))))
    }
}

/// Index of the surface, distance in metres, colour as sRGB bytes.
type Seen = (usize, f64, [u8; 3]);

/// Distance to the nearest surface seen, in metres; infinite where none is seen.
fn nearest(seen: &[Option<Seen>]) -> f64 {
    seen.iter().flatten().map(|hit| hit.1).fold(f64::INFINITY, f64::min)
}

/// The colour of the outside, which no room has: magenta.
const OUTSIDE: [u8; 3] = [255, 0, 255];

/// The camera at a thumbnail's resolution.
fn thumbnail_camera(camera: &Camera) -> Camera {
    let old = camera.intrinsics;
    let scale = f64::from(THUMBNAIL_SIDE) / f64::from(old.width.max(old.height));
    let [width, height] = [old.width, old.height].map(|side| (f64::from(side) * scale).round().max(1.0));
    let intrinsics = Intrinsics {
        width: width as u32,
        height: height as u32,
        fx: old.fx * scale,
        fy: old.fy * scale,
        cx: (old.cx - f64::from(old.width) / 2.0) * scale + width / 2.0,
        cy: (old.cy - f64::from(old.height) / 2.0) * scale + height / 2.0,
    };
    Camera { intrinsics, ..*camera }
}

/// A camera and where it comes from.
struct Posed {
    /// As in `seed 3` or `designer 5`.
    origin: String,
    camera: Camera,
    fov_y_deg: f64,
}

/// Draws the cameras of one house.
struct CameraDraws<'a> {
    options: &'a SurveyOptions,
    house: &'a FurnishedHouse,
    world: &'a World,
    /// Degrees about X and Y of each novel view.
    turns: Vec<[f64; 2]>,
    /// The floor area of each room that has a floor, in square metres.
    areas: Vec<f64>,
}

impl<'a> CameraDraws<'a> {
    fn new(options: &'a SurveyOptions, house: &'a FurnishedHouse, world: &'a World, views: &[Offset]) -> Self {
        let turns = views.iter().map(|view| [view.x_deg, view.y_deg]).collect();
        let samplers = (0..house.house.rooms.len()).filter_map(|room| RoomSampler::new(house, world, room).ok());
        let areas = samplers.map(|sampler| sampler.floor_area_m2()).collect();
        Self { options, house, world, turns, areas }
    }

    /// Every camera of a room that may be tried; and why no more could be drawn.
    fn posed(&self, room: usize) -> (Vec<Posed>, Vec<RefusedCamera>) {
        let sampler = match RoomSampler::new(self.house, self.world, room) {
            Ok(sampler) => sampler,
            Err(why) => return (Vec::new(), vec![RefusedCamera { origin: None, why: why.into() }]),
        };
        let (mut posed, refused) = self.drawn(&sampler);
        posed.extend(self.designers(&sampler));
        (posed, refused)
    }

    /// As many cameras as the rules give the room, the best of all draws.
    fn drawn(&self, sampler: &RoomSampler<'_>) -> (Vec<Posed>, Vec<RefusedCamera>) {
        let (options, rules) = (self.options, self.options.camera_rules);
        let [width, height] = options.resolution;
        let fov_y_deg = options.fov_y_deg;
        let intrinsics = Intrinsics::from_fov_y(width, height, fov_y_deg.to_radians());
        let wanted = self.number_of_cameras(sampler);
        let (mut found, mut refused) = (Vec::new(), Vec::new());
        for number in 0..wanted * rules.draws_for_each() {
            let seed = options.seed + u64::from(number);
            let origin = format!("seed {seed}");
            match sampler.sample(intrinsics, &self.turns, &rules.sampler_rules(), seed) {
                Ok(drawn) => found.push((drawn.score, Posed { origin, camera: drawn.camera, fov_y_deg })),
                Err(why) => {
                    // Another seed would take as long and is unlikely to succeed.
                    refused.push(RefusedCamera { origin: Some(origin), why: why.into() });
                    break;
                }
            }
        }
        // Stable: of equal scores the earlier draw.
        found.sort_by(|one, other| other.0.total_cmp(&one.0));
        found.truncate(wanted as usize);
        (found.into_iter().map(|(_, posed)| posed).collect(), refused)
    }

    fn number_of_cameras(&self, sampler: &RoomSampler<'_>) -> u32 {
        let total: f64 = self.areas.iter().sum();
        let share = if total > 0.0 { sampler.floor_area_m2() / total } else { 0.0 };
        self.options.camera_rules.cameras_of_room(self.options.cameras_per_room, self.areas.len(), share)
    }

    /// The designers' cameras that stand in the room.
    fn designers(&self, sampler: &RoomSampler<'_>) -> Vec<Posed> {
        let [width, height] = self.options.resolution;
        let own = self.house.cameras.iter().filter(|camera| sampler.stands_in_room(camera.position));
        let posed = own.filter_map(|camera| {
            let intrinsics = Intrinsics::from_fov_y(width, height, camera.fov_y_deg.to_radians());
            let posed = Camera::look_at(camera.position, camera.target, glam::DVec3::Y, intrinsics)?;
            Some(Posed { origin: format!("designer {}", camera.number), camera: posed, fov_y_deg: camera.fov_y_deg })
        });
        posed.collect()
    }
}

/// A camera that is not offered, and why.
#[derive(Clone, Debug, PartialEq)]
struct RefusedCamera {
    /// Where the camera comes from, as in `seed 3`; absent if no camera can be drawn in the room at all.
    origin: Option<String>,
    why: CameraRefusal,
}

/// The rule that a camera breaks.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
enum CameraRefusal {
    /// No camera could be drawn.
    #[error(transparent)]
    Sampler(#[from] CameraError),
    /// Too many pixels of the five views see the outside.
    #[error("{:.0} % of the pixels see the outside, expected at most {:.0} %", 100.0 * share, 100.0 * most)]
    SeesOutside {
        share: f64,
        /// The largest share that the rules allow.
        most: f64,
    },
    #[error("it sees {seen} pieces of furniture, expected at least {least}")]
    SeesTooLittle {
        /// Number of pieces that it sees.
        seen: usize,
        /// The smallest number that the rules allow.
        least: usize,
    },
    /// A surface is too near in one of the five views.
    #[error("a surface is {nearest_m:.1e} m away, expected at least {least_m} m")]
    TooNear {
        /// Distance to the nearest surface, in metres.
        nearest_m: f64,
        /// The smallest distance that the rules allow, in metres.
        least_m: f64,
    },
}

impl std::fmt::Display for RefusedCamera {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.origin {
            Some(origin) => write!(f, "{origin}: {}", self.why),
            None => write!(f, "{}", self.why),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thumbnails_are_small_whatever_the_resolution() {
        for ([width, height], expected) in [
            ([480, 270], (320, 180)),
            ([96, 72], (320, 240)),
            ([16, 8192], (1, 320)),
            ([8192, 16], (320, 1)),
            ([300, 400], (240, 320)),
        ] {
            let intrinsics = Intrinsics::from_fov_y(width, height, 0.8);
            let camera = Camera::look_at(glam::DVec3::ZERO, glam::DVec3::X, glam::DVec3::Y, intrinsics).unwrap();
            let small = thumbnail_camera(&camera).intrinsics;
            assert_eq!((small.width, small.height), expected);
            assert_eq!((small.cx, small.cy), (f64::from(small.width) / 2.0, f64::from(small.height) / 2.0));
        }
    }
}
