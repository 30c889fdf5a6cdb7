//! Writes the camera, its film and the integrator.

use glam::DVec3;
use mateval_scene::Camera;
use mateval_scene::reference::ReferenceScene;
use mateval_tracer::RenderSettings;

use super::element::Element;
use super::remarks::Remarks;

/// The path tracer. Mitsuba's `max_depth` also counts the camera's ray and the last direct light, hence 2 more.
pub(super) fn integrator(settings: &RenderSettings) -> Element {
    Element::plugin("integrator", "path").integer("max_depth", settings.max_bounces.saturating_add(2))
}

/// The camera, with a box filter over pixels and independent samples.
pub(super) fn sensor(
    scene: &ReferenceScene,
    camera: &Camera,
    settings: &RenderSettings,
    remarks: &mut Remarks,
) -> Element {
    let k = &camera.intrinsics;
    if (k.fx / k.fy - 1.0).abs() > 1e-9 {
        let message = format!("focal lengths are {} and {} pixels; Mitsuba's pixels are square", k.fx, k.fy);
        remarks.warn("square_pixels", "camera", &message, "wrote the first of them");
    }
    let (width, height) = (f64::from(k.width), f64::from(k.height));
    let fov = 2.0 * libm::atan(width / (2.0 * k.fx)).to_degrees();
    let reach = reach(scene, camera.position());
    Element::plugin("sensor", "perspective")
        .string("fov_axis", "x")
        .float("fov", fov)
        .float("principal_point_offset_x", 0.5 - k.cx / width)
        .float("principal_point_offset_y", 0.5 - k.cy / height)
        .float("near_clip", reach * 1e-4)
        .float("far_clip", reach * 4.0)
        .matrix("to_world", turned(camera))
        .child(
            Element::plugin("film", "hdrfilm")
                .integer("width", k.width)
                .integer("height", k.height)
                .string("pixel_format", "rgb")
                .string("component_format", "float32")
                .child(Element::plugin("rfilter", "box")),
        )
        .child(
            Element::plugin("sampler", "independent")
                .integer("sample_count", settings.samples)
                .integer("seed", settings.seed & 0x7fff_ffff),
        )
}

/// The camera's pose for Mitsuba, whose cameras look along +Z with +X to the left: x and z change sign.
fn turned(camera: &Camera) -> [[f64; 4]; 4] {
    camera.world_from_camera.map(|[x, y, z, t]| [-x, y, -z, t])
}

/// The distance from the camera to the farthest corner of the scene's bounding box, in metres.
fn reach(scene: &ReferenceScene, from: DVec3) -> f64 {
    let positions = || scene.surfaces.iter().flat_map(|surface| &surface.mesh.positions).map(|p| p.as_dvec3());
    let farthest = positions().map(|p| (p - from).abs()).reduce(DVec3::max).unwrap_or(DVec3::ONE);
    farthest.length().max(1e-3)
}

#[cfg(test)]
mod tests {
    use mateval_scene::Intrinsics;

    use super::*;

    /// The direction of the picture's corner, computed here from the matrix and field of view as Mitsuba does (PEERS B3: +Z
    /// ahead, +X left), equals that of our camera.
    #[test]
    fn the_corner_pixel_looks_the_same_way() {
        let intrinsics = Intrinsics::from_fov_x(64, 48, 1.1);
        let camera = Camera::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.0, 0.5, 0.0), DVec3::Y, intrinsics);
        let camera = camera.unwrap();
        let ours = camera.direction(glam::DVec2::new(0.0, 0.0));
        let rows = turned(&camera);
        let tan = 64.0 / (2.0 * intrinsics.fx);
        let local = DVec3::new(tan, tan * 48.0 / 64.0, 1.0).normalize();
        let theirs = DVec3::from_array([0, 1, 2].map(|r| DVec3::from_slice(&rows[r][..3]).dot(local)));
        assert!((ours - theirs).length() < 1e-9, "{ours} {theirs}");
    }
}
