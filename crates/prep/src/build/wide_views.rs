//! Wide views, those from other places than the input view's.
//!
//! All look at the point that the middle of the input view shows at the median depth of that view. Those that are drawn
//! stand in free space, in reach of the input camera, see mostly what the scene holds and partly what the input view saw;
//! of those that do, the one is taken whose picture shows most that the input view did not.

use glam::{DVec2, DVec3};
use mateval_dataset::camera::Camera;
use mateval_dataset::dataset::{View, WideView};
use mateval_dataset::{Finding, Severity, ViewId};
use mateval_sources::front3d::camera_rules::SamplerRules;
use mateval_sources::front3d::camera_sampler::distance_to_anything;
use mateval_sources::front3d::camera_sampler::score_grid;
use mateval_tracer::aov::hit_through;
use mateval_tracer::{Ray, Sampler, World};

use crate::recipe::{DrawnViews, WideOffset, WideViews};
use crate::views::{ViewPixel, ViewScene};

/// The most places that are drawn for one view.
const TRIES: u32 = 256;
/// The most places that are compared for one view.
const COMPARED: usize = 16;
/// Columns of the small pictures by which places are judged.
const JUDGED_COLUMNS: u32 = 32;
/// Steepest way up or down from the input camera, in degrees: rooms are wider than high.
const STEEPEST_DEG: f64 = 25.0;
/// The least share of the valid pixels that the input view shows too.
const LEAST_SEEN: f64 = 0.3;
/// The least number of valid pixels, relative to the input view's.
const LEAST_VALID: f64 = 0.5;
/// By how much more of the picture than the input view's may see nothing of the scene.
const MORE_OUTSIDE: f64 = 0.02;

/// The wide views of a scene with the input camera `input`, and a finding for each that has no free place. `file` is
/// the one that findings refer to. `scored` states for each surface whether it is scored.
pub(super) fn wide_views(
    wide: &WideViews,
    world: &World,
    input: &Camera,
    scored: &[bool],
    file: &str,
) -> (Vec<View>, Vec<Finding>) {
    let Some(target) = looked_at(world, input) else {
        return (Vec::new(), vec![finding(file, "wide views", "the input view shows no surface to look at")]);
    };
    match wide {
        WideViews::Given(offsets) => {
            let (mut views, mut findings) = (Vec::new(), Vec::new());
            for WideOffset { id, offset_m } in offsets {
                let place = input.position() + input.rotation() * DVec3::from_array(*offset_m);
                match looking_at(id.clone(), place, target, input) {
                    Some(view) => views.push(view),
                    None => {
                        let what = "it stands at the point that it should look at, or straight above or below it";
                        findings.push(finding(file, &format!("view '{id}'"), what));
                    }
                }
            }
            (views, findings)
        }
        WideViews::Drawn(drawn) => {
            // Places are judged without regard to which instance they show.
            let instances = vec![1; scored.len()];
            let scene = ViewScene::new(world.scene(), world, &instances, scored);
            let judge = Judge::new(scene, world, input, target);
            let (mut views, mut findings) = (Vec::new(), Vec::new());
            for number in 0..drawn.count {
                let distance = distance_m(drawn, number);
                let id = ViewId::new(format!("{}{}", ViewId::WIDE, number + 1)).expect("our own ids are ids");
                match judge.draw(drawn.seed, number, distance) {
                    Some(place) => views.extend(looking_at(id, place, target, input)),
                    None => {
                        let what = format!("none of {TRIES} places {distance:.2} m from the input camera is free");
                        findings.push(finding(file, &format!("view '{id}'"), &what));
                    }
                }
            }
            (views, findings)
        }
    }
}

/// The distance of view number `number` from the input camera.
fn distance_m(drawn: &DrawnViews, number: u32) -> f64 {
    let [near, far] = drawn.distance_m;
    let last = f64::from(drawn.count.saturating_sub(1)).max(1.0);
    near + (far - near) * f64::from(number) / last
}

fn finding(file: &str, place: &str, message: &str) -> Finding {
    Finding::new(
        Severity::Warning,
        "no_wide_view",
        file,
        place,
        message,
        "left the view out; choose other distances or another seed, or give its place by hand",
    )
}

/// The point in the middle of the input view at the median depth of ten by ten rays; absent if no ray meets a surface.
fn looked_at(world: &World, input: &Camera) -> Option<DVec3> {
    let mut depths: Vec<f64> = score_grid(&input.intrinsics)
        .filter_map(|place| hit_through(world, input, place))
        .map(|hit| hit.depth)
        .collect();
    depths.sort_by(f64::total_cmp);
    let depth = *depths.get(depths.len() / 2)?;
    Some(input.unproject(DVec2::new(input.intrinsics.cx, input.intrinsics.cy), depth))
}

/// A camera at `place` that looks at `target`; absent if it would look straight up or down. What the input view does
/// not see is counted when its pictures are made.
fn looking_at(id: ViewId, place: DVec3, target: DVec3, input: &Camera) -> Option<View> {
    let camera = Camera::look_at(place, target, DVec3::Y, input.intrinsics)?;
    let distance_m = place.distance(input.position());
    Some(View { id, x_deg: 0.0, y_deg: 0.0, camera, wide: Some(WideView { distance_m, unseen_share: 0.0 }) })
}

/// Judges places by small pictures.
struct Judge<'a> {
    world: &'a World,
    scene: ViewScene<'a>,
    input: Camera,
    target: DVec3,
    /// The distance in metres that a place keeps from everything: that of drawn input cameras, or the input camera's
    /// own where that is smaller.
    clearance_m: f64,
    valid: f64,
    outside: f64,
}

/// What a small picture shows, as shares of its pixels.
#[derive(Default)]
struct Shown {
    valid: f64,
    unseen: f64,
    outside: f64,
}

impl<'a> Judge<'a> {
    fn new(scene: ViewScene<'a>, world: &'a World, input: &Camera, target: DVec3) -> Self {
        let wanted = SamplerRules::default().clearance_m;
        let clearance_m = distance_to_anything(world.scene(), input.position(), wanted);
        let mut judge = Self { world, scene, input: *input, target, clearance_m, valid: 0.0, outside: 0.0 };
        let Shown { valid, outside, .. } = judge.shown(input);
        (judge.valid, judge.outside) = (valid, outside);
        judge
    }

    /// The best of the places that are drawn at a distance; absent if no place will do.
    fn draw(&self, seed: u64, number: u32, distance: f64) -> Option<DVec3> {
        let place = |draw: u32| {
            let [around, up, ..] = Sampler::new(seed, [number, 0], draw).set(0).map(f64::from);
            let (around, up) = (around * std::f64::consts::TAU, (2.0 * up - 1.0) * STEEPEST_DEG.to_radians());
            let level = libm::cos(up);
            let way = DVec3::new(level * libm::cos(around), libm::sin(up), level * libm::sin(around));
            self.input.position() + distance * way
        };
        let mut best: Option<(f64, DVec3)> = None;
        let judged = (0..TRIES).map(place).filter_map(|place| Some((self.unseen_from(place)?, place)));
        for (unseen, place) in judged.take(COMPARED) {
            if best.is_none_or(|(most, _)| unseen > most) {
                best = Some((unseen, place));
            }
        }
        best.map(|(_, place)| place)
    }

    /// The share of the valid pixels that the input view does not show; absent if a rule is broken, the cheapest
    /// first.
    fn unseen_from(&self, place: DVec3) -> Option<f64> {
        let way = place - self.input.position();
        let ray = Ray::endless(self.input.position().as_vec3(), way.normalize().as_vec3());
        let is_reached = self.world.first_hit(&ray).is_none_or(|hit| f64::from(hit.distance) > way.length());
        if !is_reached || distance_to_anything(self.world.scene(), place, self.clearance_m) < self.clearance_m {
            return None;
        }
        let camera = Camera::look_at(place, self.target, DVec3::Y, self.input.intrinsics)?;
        let Shown { valid, unseen, outside } = self.shown(&camera);
        let will_do = valid > 0.0
            && valid >= LEAST_VALID * self.valid
            && outside <= self.outside + MORE_OUTSIDE
            && unseen <= (1.0 - LEAST_SEEN) * valid;
        will_do.then(|| unseen / valid)
    }

    fn shown(&self, camera: &Camera) -> Shown {
        let small = scaled_down(camera);
        let (width, height) = (small.intrinsics.width as usize, small.intrinsics.height as usize);
        let share = 1.0 / (width * height) as f64;
        let mut shown = Shown::default();
        for pixel in 0..width * height {
            let pixel: ViewPixel = self.scene.pixel(&small, &self.input, pixel % width, pixel / width);
            shown.outside += if pixel.triangle.is_none() { share } else { 0.0 };
            shown.valid += if pixel.valid { share } else { 0.0 };
            shown.unseen += if pixel.unobserved { share } else { 0.0 };
        }
        shown
    }
}

/// The same field of view in few pixels.
fn scaled_down(whole: &Camera) -> Camera {
    let scale = f64::from(JUDGED_COLUMNS) / f64::from(whole.intrinsics.width);
    let height = (f64::from(whole.intrinsics.height) * scale).round().max(1.0) as u32;
    whole.resized(JUDGED_COLUMNS, height)
}
