//! Comparing photos of a real room with renders of its scan: the pixels that can be compared, and the exposure of a
//! photo.
//!
//! A clipped pixel states only the least radiance. Beside an edge of depth, a scan that is off by a pixel shows another
//! surface than the photo does.

use mateval_image::{LinearRgb, Mask, Picture};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The pixels of a photo of a real room that do not count.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PhotoRules {
    /// A pixel is clipped where a channel, exposed and linear, is at least this.
    pub clipped_from: f64,
    /// Depth jumps between three pixels of a row or column where the second difference of its inverse is more than this
    /// share of the largest of them. On a plane it is 0, however steep the view.
    pub depth_jump: f64,
    /// A pixel does not count whose centre is fewer pixels than this from a jump, along rows and columns.
    pub jump_pixels: u32,
}

impl Default for PhotoRules {
    /// `clipped_from` is byte 254 of sRGB: JPEGs of cameras seldom reach 255 where they clip.
    fn default() -> Self {
        Self { clipped_from: 0.991, depth_jump: 0.05, jump_pixels: 2 }
    }
}

impl PhotoRules {
    /// The `valid` pixels that count. `photo` is linear, before exposure; `depth` is 0 where nothing is seen.
    pub fn counted(&self, photo: &Picture<LinearRgb>, exposure: f64, depth: &Picture<f32>, valid: &Mask) -> Mask {
        let jumps = self.jumps(depth);
        // `jumps` already marks the first pixel on either side of a jump.
        let reach = self.jump_pixels.saturating_sub(1) as usize;
        let (width, height) = (depth.width(), depth.height());
        let near = |at: usize, size: usize| at.saturating_sub(reach)..(at + reach + 1).min(size);
        Mask::from_fn(width, height, |x, y| {
            let is_clipped = || photo.get(x, y).0.iter().any(|v| f64::from(*v) * exposure >= self.clipped_from);
            let is_beside_jump = || near(y, height).any(|y| near(x, width).any(|x| jumps.get(x, y)));
            valid.get(x, y) && !is_clipped() && !is_beside_jump()
        })
    }

    /// The pixels on both sides of each jump.
    fn jumps(&self, depth: &Picture<f32>) -> Mask {
        let (width, height) = (depth.width(), depth.height());
        let inverse = depth.map(|depth| if depth > 0.0 { 1.0 / f64::from(depth) } else { 0.0 });
        let bends = |[a, b, c]: [f64; 3]| (a - 2.0 * b + c).abs() > self.depth_jump * a.max(b).max(c);
        Mask::from_fn(width, height, |x, y| {
            let along_row = || bends([x - 1, x, x + 1].map(|x| inverse.get(x, y)));
            let along_column = || bends([y - 1, y, y + 1].map(|y| inverse.get(x, y)));
            ((1..width - 1).contains(&x) && along_row()) || ((1..height - 1).contains(&y) && along_column())
        })
    }
}

/// The factor with which a render, as the mean of two independent `halves`, has the least squared difference from the
/// photo, over all channels of the pixels that count; 1 if photo or render is black there. The square of the render is
/// taken as the product of its halves: their noise is independent, so it does not enlarge the square on average.
pub fn exposure_factor(halves: [&Picture<LinearRgb>; 2], photo: &Picture<LinearRgb>, counted: &Mask) -> f64 {
    let (mut of_photo, mut of_render) = (0.0, 0.0);
    for at in (0..counted.pixels().len()).filter(|at| counted.pixels()[*at]) {
        let [a, b, photo] = [halves[0], halves[1], photo].map(|picture| picture.pixels()[at].0.map(f64::from));
        for c in 0..3 {
            of_photo += photo[c] * 0.5 * (a[c] + b[c]);
            of_render += a[c] * b[c];
        }
    }
    if of_photo > 0.0 && of_render > 0.0 { of_photo / of_render } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULES: PhotoRules = PhotoRules { clipped_from: 0.9, depth_jump: 0.05, jump_pixels: 2 };

    fn grey(value: f32) -> Picture<LinearRgb> {
        Picture::filled(12, 8, LinearRgb([value; 3]))
    }

    fn counted(depth: impl Fn(usize, usize) -> f32) -> Vec<(usize, usize)> {
        let (depth, valid) = (Picture::from_fn(12, 8, depth), Mask::filled(12, 8, true));
        let found = RULES.counted(&grey(0.5), 1.0, &depth, &valid);
        let places = (0..8).flat_map(|y| (0..12).map(move |x| (x, y)));
        places.filter(|(x, y)| !found.get(*x, *y)).collect()
    }

    /// A floor that runs from 1.5 to 20 m, and a step of a tenth between columns 5 and 6: two columns on either side.
    #[test]
    fn depth_jumps_at_steps_and_not_along_planes() {
        assert_eq!(counted(|_, y| 20.0 / (1.0 + 1.7 * y as f32)), []);
        let step = counted(|x, _| if x < 6 { 3.0 } else { 3.3 });
        assert_eq!(step.len(), 4 * 8);
        assert!(step.iter().all(|(x, _)| (4..8).contains(x)));
        // A hole in the scan is a jump too, and a step of a fiftieth is none.
        assert!(counted(|x, _| if x < 6 { 3.0 } else { 0.0 }).len() == 4 * 8);
        assert_eq!(counted(|x, _| if x < 6 { 3.0 } else { 3.06 }), []);
    }

    #[test]
    fn clipped_and_invalid_pixels_do_not_count() {
        let photo = Picture::from_fn(12, 8, |x, _| LinearRgb([0.1, if x == 3 { 0.46 } else { 0.4 }, 0.1]));
        let valid = Mask::from_fn(12, 8, |_, y| y > 0);
        let found = RULES.counted(&photo, 2.0, &Picture::filled(12, 8, 2.0), &valid);
        assert!((0..12).all(|x| (0..8).all(|y| found.get(x, y) == (y > 0 && x != 3))));
        assert_eq!(RULES.counted(&photo, 1.0, &Picture::filled(12, 8, 2.0), &valid), valid);
    }

    /// A photo of three times the render's light. Noise that is independent between the halves does not move the mean.
    #[test]
    fn an_exposure_is_found_under_noise() {
        let render = Picture::from_fn(12, 8, |x, y| LinearRgb([x as f32, y as f32, 2.0]));
        let noisy = |sign: f32| {
            Picture::from_fn(12, 8, |x, y| {
                let LinearRgb(rgb) = render.get(x, y);
                LinearRgb(rgb.map(|v| v + sign * if (x + y) % 2 == 0 { 0.5 } else { -0.5 }))
            })
        };
        let photo = render.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| 3.0 * v)));
        let all = Mask::filled(12, 8, true);
        assert!((exposure_factor([&render, &render], &photo, &all) - 3.0).abs() < 1e-9);
        // Independent halves, in four pairs of signs.
        let found = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)]
            .map(|(a, b)| 1.0 / exposure_factor([&noisy(a), &noisy(b)], &photo, &all));
        assert!((found.iter().sum::<f64>() / 4.0 - 1.0 / 3.0).abs() < 1e-3, "{found:?}");
        assert_eq!(exposure_factor([&render, &render], &grey(0.0), &all), 1.0);
    }
}
