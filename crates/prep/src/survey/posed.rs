//! The cameras that are tried in a room: those that are drawn, and the designers'.

use mateval_scene::camera::{Camera, Intrinsics};
use mateval_sources::front3d::FurnishedHouse;
use mateval_sources::front3d::camera_sampler::RoomSampler;
use mateval_tracer::World;

use super::camera_refusal::RefusedCamera;
use super::options::SurveyOptions;
use crate::recipe::Offset;

/// A camera and where it comes from.
pub(super) struct Posed {
    /// As in `seed 3` or `designer 5`.
    pub(super) origin: String,
    pub(super) camera: Camera,
    pub(super) fov_y_deg: f64,
}

/// Draws the cameras of one house.
pub(super) struct CameraDraws<'a> {
    options: &'a SurveyOptions,
    house: &'a FurnishedHouse,
    world: &'a World,
    /// Degrees about X and Y of each novel view.
    turns: Vec<[f64; 2]>,
    /// The floor area of each room that has a floor, in square metres.
    areas: Vec<f64>,
}

impl<'a> CameraDraws<'a> {
    pub(super) fn new(
        options: &'a SurveyOptions,
        house: &'a FurnishedHouse,
        world: &'a World,
        views: &[Offset],
    ) -> Self {
        let turns = views.iter().map(|view| [view.x_deg, view.y_deg]).collect();
        let samplers = (0..house.house.rooms.len()).filter_map(|room| RoomSampler::new(house, world, room).ok());
        let areas = samplers.map(|sampler| sampler.floor_area_m2()).collect();
        Self { options, house, world, turns, areas }
    }

    /// Every camera of a room that may be tried; and why no more could be drawn.
    pub(super) fn posed(&self, room: usize) -> (Vec<Posed>, Vec<RefusedCamera>) {
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
