//! Blocks of pixels, across a scene's views, that may share noise.

use glam::{DVec2, DVec3};
use mateval_image::Picture;
use mateval_scene::Camera;
use mateval_tracer::shared_centre::groups_with_one_centre;

use super::rules::SampleRules;

/// The block of each pixel of each view. Pixels of one block, in any view, may share paths.
///
/// Cameras that share a centre share paths: a path goes into every view that holds its direction. Blocks are then squares
/// of [`SampleRules::block_pixels`] pixels of the image plane of the first of them. Other cameras have blocks of their own.
pub fn noise_blocks(rules: &SampleRules, cameras: &[Camera]) -> Vec<Picture<u32>> {
    let groups = groups_with_one_centre(cameras);
    // Row and column get what bits the number of the group leaves. Pictures have at most 16384 pixels a side.
    let bits = if groups.len() > 1 { 12 } else { 16 };
    let group_of =
        |view: usize| groups.iter().position(|group| group.contains(&view)).expect("every view is in a group");
    let of_view = |(view, camera): (usize, &Camera)| {
        let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
        let group = group_of(view);
        let first = &cameras[groups[group][0]];
        // Eight bits.
        let high = if groups.len() > 1 { (group as u32 % 256) << (2 * bits) } else { 0 };
        Picture::from_fn(width, height, |x, y| {
            let direction = camera.direction(DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
            high | block(first, direction, rules.block_pixels, bits)
        })
    };
    cameras.iter().enumerate().map(of_view).collect()
}

/// `bits` bits of row and of column each, counted from far above and left of the picture.
fn block(first: &Camera, direction: DVec3, side: u32, bits: u32) -> u32 {
    let local = first.rotation().transpose() * direction;
    let k = first.intrinsics;
    let at = DVec2::new(k.cx - k.fx * local.x / local.z, k.cy + k.fy * local.y / local.z);
    let middle = f64::from(1_u32 << (bits - 1));
    let step = |value: f64| ((value / f64::from(side)).floor() + middle).clamp(0.0, 2.0 * middle - 1.0) as u32;
    step(at.y) << bits | step(at.x)
}

#[cfg(test)]
mod tests {
    use mateval_scene::Intrinsics;

    use super::*;

    fn rules() -> SampleRules {
        crate::protocol::Protocol::named("mateval-3").unwrap().light.samples
    }

    fn cameras() -> Vec<Camera> {
        let intrinsics = Intrinsics::from_fov_x(96, 64, 1.0);
        let input = Camera::from_rotation(glam::DMat3::IDENTITY, DVec3::new(1.0, 2.0, 3.0), intrinsics);
        vec![input, input.turned(5.0, -5.0)]
    }

    /// What both views see, at a distance, is of one block in both; the first view's blocks are squares.
    #[test]
    fn one_direction_is_of_one_block() {
        let cameras = cameras();
        let blocks = noise_blocks(&rules(), &cameras);
        assert_eq!(blocks[0].get(0, 0), blocks[0].get(15, 15));
        assert_ne!(blocks[0].get(15, 0), blocks[0].get(16, 0));
        let mut distinct = blocks[0].pixels().to_vec();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(distinct.len(), 6 * 4);
        let mut met = 0;
        for (x, y) in [(50, 30), (70, 40), (90, 50), (40, 20)] {
            let place = cameras[1].position() + cameras[1].direction(DVec2::new(x as f64 + 0.5, y as f64 + 0.5)) * 9.0;
            let (pixel, _) = cameras[0].project(place).unwrap();
            if cameras[0].holds(pixel) {
                met += 1;
                assert_eq!(blocks[1].get(x, y), blocks[0].get(pixel.x as usize, pixel.y as usize));
            }
        }
        assert!(met >= 2, "{met}");
    }

    #[test]
    fn views_from_elsewhere_share_nothing() {
        let mut cameras = cameras();
        cameras[1] = Camera::from_rotation(glam::DMat3::IDENTITY, DVec3::ZERO, cameras[1].intrinsics);
        let blocks = noise_blocks(&rules(), &cameras);
        assert!(blocks[0].pixels().iter().all(|block| !blocks[1].pixels().contains(block)));
    }
}
