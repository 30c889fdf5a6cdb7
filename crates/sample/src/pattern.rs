//! Painted textures. Only integer hashes and basic arithmetic are used, whose results are the same on every machine.
//! Pictures hold sRGB bytes. Coordinates run from 0 to 1 over the picture, v downwards.

use mateval_image::Picture;

/// The room's textures and their names.
pub(super) fn all() -> Vec<(&'static str, Picture<[u8; 3]>)> {
    vec![
        ("planks", paint(512, 512, planks)),
        ("wood", paint(256, 256, wood)),
        ("wallpaper", paint(256, 256, wallpaper)),
        ("fabric", paint(128, 128, fabric)),
        ("rug", paint(384, 256, rug)),
        ("outside", paint(256, 128, outside)),
    ]
}

/// An sRGB-encoded colour, 0 to 1.
pub type Color = [f64; 3];

/// A picture whose texels are the colours that `color_at` gives at their centres.
pub fn paint(width: usize, height: usize, color_at: impl Fn(f64, f64) -> Color) -> Picture<[u8; 3]> {
    Picture::from_fn(width, height, |x, y| {
        let color = color_at((x as f64 + 0.5) / width as f64, (y as f64 + 0.5) / height as f64);
        color.map(|v| (v.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
    })
}

/// A hash of three numbers (the finaliser of MurmurHash3).
fn hash(x: i64, y: i64, seed: u32) -> u32 {
    let mut h =
        (x as u32).wrapping_mul(0x9e37_79b1) ^ (y as u32).wrapping_mul(0x85eb_ca77) ^ seed.wrapping_mul(0xc2b2_ae3d);
    for factor in [0x85eb_ca6b, 0xc2b2_ae35] {
        h = (h ^ (h >> 16)).wrapping_mul(factor);
    }
    h ^ (h >> 16)
}

/// A pseudo-random number of 0 to 1 that follows from the arguments.
pub(super) fn random(x: i64, y: i64, seed: u32) -> f64 {
    f64::from(hash(x, y, seed)) / f64::from(u32::MAX)
}

/// Smooth noise of 0 to 1 with `nx` by `ny` cells over the picture. It repeats without a seam.
pub fn noise(u: f64, v: f64, nx: i64, ny: i64, seed: u32) -> f64 {
    let (x, y) = (u * nx as f64, v * ny as f64);
    let (i, j) = (x.floor() as i64, y.floor() as i64);
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let (s, t) = (smooth(x - x.floor()), smooth(y - y.floor()));
    let at = |di: i64, dj: i64| random((i + di).rem_euclid(nx), (j + dj).rem_euclid(ny), seed);
    mix1(mix1(at(0, 0), at(1, 0), s), mix1(at(0, 1), at(1, 1), s), t)
}

/// Linear interpolation from `a` to `b`.
fn mix1(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// Linear interpolation from `a` to `b`; `t` is clamped to 0 to 1.
pub fn mix(a: Color, b: Color, t: f64) -> Color {
    std::array::from_fn(|c| mix1(a[c], b[c], t.clamp(0.0, 1.0)))
}

/// A triangle wave of period 1: 0 at whole numbers, 1 between them.
pub(super) fn triangle(t: f64) -> f64 {
    1.0 - (2.0 * (t - t.floor()) - 1.0).abs()
}

/// 0 below `from`, 1 above `to`, linear in between.
pub fn ramp(from: f64, to: f64, value: f64) -> f64 {
    ((value - from) / (to - from)).clamp(0.0, 1.0)
}

/// Eight rows of oak planks along u, two planks a row, with dark joints.
pub(super) fn planks(u: f64, v: f64) -> Color {
    const ROWS: i64 = 8;
    // The plank under the point, and the place within it.
    let row = (v * ROWS as f64).floor() as i64;
    let shifted = u + random(row, 0, 1);
    let half = (shifted * 2.0).floor() as i64;
    let plank = half.rem_euclid(2) + 2 * row;
    let (across, along) = (v * ROWS as f64 - row as f64, shifted * 2.0 - half as f64);
    // Growth rings and fibres give the tone.
    let seed = 100 + plank as u32;
    let waves = noise(u, v, 6, 24, seed);
    let rings = triangle(across * 3.0 + waves * 2.2 + random(plank, 1, 2));
    let fibres = noise(u, v, 24, 256, seed);
    let tone = 0.35 * random(plank, 2, 3) + 0.35 * rings + 0.3 * fibres;
    let color = mix([0.40, 0.26, 0.16], [0.74, 0.55, 0.36], tone);
    let joint = ramp(0.0, 0.025, across.min(1.0 - across)) * ramp(0.0, 0.004, along.min(1.0 - along));
    mix([0.16, 0.10, 0.07], color, 0.25 + 0.75 * joint)
}

/// Dark walnut with its grain along u.
pub(super) fn wood(u: f64, v: f64) -> Color {
    let bend = noise(u, v, 3, 4, 7) + 0.4 * noise(u, v, 6, 12, 8);
    let rings = triangle(v * 7.0 + bend * 1.6);
    let fibres = noise(u, v, 12, 128, 9);
    let pores = ramp(0.82, 0.95, noise(u, v, 20, 128, 10));
    let color = mix([0.26, 0.15, 0.09], [0.52, 0.33, 0.2], 0.6 * rings + 0.4 * fibres);
    mix(color, [0.14, 0.08, 0.05], 0.6 * pores)
}

/// Wallpaper with pale leaves and dots on sage green; every second column is shifted by half a repeat.
fn wallpaper(u: f64, v: f64) -> Color {
    let column = (u * 2.0).floor();
    let x = u * 2.0 - column - 0.5;
    let y = (v + 0.5 * column).rem_euclid(1.0) - 0.5;
    // Each shape is a function that is positive inside it.
    let leaf = |cx: f64, cy: f64, tilt: f64, long: f64, wide: f64| {
        let (dx, dy) = (x - cx, 2.0 * (y - cy));
        let (a, b) = (dx + tilt * dy, dy - tilt * dx);
        1.0 - (a * a / (wide * wide) + b * b / (long * long))
    };
    let bud = leaf(0.0, -0.2, 0.0, 0.26, 0.12);
    let sides = [leaf(-0.2, -0.02, -0.7, 0.24, 0.1), leaf(0.2, -0.02, 0.7, 0.24, 0.1)];
    let low = [leaf(-0.16, 0.18, -1.1, 0.2, 0.08), leaf(0.16, 0.18, 1.1, 0.2, 0.08)];
    let stem = 1.0 - x * x / 0.0004 - (y - 0.1) * (y - 0.1) / 0.08;
    let dot = 1.0 - (x * x + (2.0 * (y - 0.4)) * (2.0 * (y - 0.4))) / 0.004;
    let shape = sides.into_iter().chain(low).chain([bud, stem, dot]).fold(f64::MIN, f64::max);
    // Shapes are drawn over the ground, the bud with a darker vein.
    let ground = mix([0.44, 0.53, 0.47], [0.48, 0.57, 0.50], noise(u, v, 64, 64, 11));
    let vein = if shape == bud && x.abs() < 0.012 { 0.5 } else { 1.0 };
    mix(ground, [0.88, 0.86, 0.74], ramp(0.0, 0.12, shape) * vein)
}

/// A plain weave in two blues.
pub(super) fn fabric(u: f64, v: f64) -> Color {
    const THREADS: f64 = 32.0;
    let (i, j) = ((u * THREADS).floor() as i64, (v * THREADS).floor() as i64);
    let (x, y) = (u * THREADS - i as f64, v * THREADS - j as f64);
    let over = (i + j).rem_euclid(2) == 0;
    let (bulge, thread) = if over { (x, random(i, 0, 12)) } else { (y, random(0, j, 13)) };
    let light = 0.55 + 0.45 * 4.0 * bulge * (1.0 - bulge);
    let color = mix([0.20, 0.28, 0.42], [0.36, 0.46, 0.60], 0.6 * thread + 0.4 * noise(u, v, 4, 4, 14));
    color.map(|c| c * light)
}

/// A rug: borders around a field of lozenges.
fn rug(u: f64, v: f64) -> Color {
    const ASPECT: f64 = 1.9 / 1.3;
    // The field of lozenges.
    let edge = (u.min(1.0 - u) * ASPECT).min(v.min(1.0 - v));
    let (a, b) = ((u * ASPECT + v) * 6.0, (u * ASPECT - v) * 6.0);
    let lozenge = triangle(a).min(triangle(b));
    let checked = (a.floor() as i64 + b.floor() as i64).rem_euclid(2) == 0;
    let field = if lozenge < 0.18 {
        [0.86, 0.78, 0.62]
    } else if checked {
        [0.58, 0.16, 0.13]
    } else {
        [0.16, 0.20, 0.30]
    };
    // The borders, by the distance to the nearest edge.
    let color = if edge < 0.03 {
        [0.86, 0.78, 0.62]
    } else if edge < 0.11 {
        let tooth = triangle((u * ASPECT + v) * 16.0) > ramp(0.03, 0.11, edge);
        if tooth { [0.16, 0.20, 0.30] } else { [0.58, 0.16, 0.13] }
    } else if edge < 0.13 {
        [0.86, 0.78, 0.62]
    } else {
        field
    };
    let pile = 0.82 + 0.36 * (noise(u, v, 192, 128, 15) - 0.5) + 0.12 * noise(u, v, 12, 8, 16);
    color.map(|c| c * pile)
}

/// A latitude-longitude picture of a cloudy sky, hills and a meadow.
fn outside(u: f64, v: f64) -> Color {
    let hills = 0.48 - 0.035 * noise(u, 0.5, 12, 1, 17) - 0.015 * noise(u, 0.5, 40, 1, 18);
    if v < hills {
        let clouds = 0.6 * noise(u, v, 12, 14, 19) + 0.4 * noise(u, v, 32, 36, 20);
        let sky = mix([0.36, 0.58, 0.88], [0.80, 0.89, 0.97], ramp(0.0, 0.48, v));
        return mix(sky, [0.98, 0.98, 0.97], ramp(0.5, 0.72, clouds) * 0.85);
    }
    let near = ramp(hills, 0.62, v);
    let grass = mix([0.30, 0.40, 0.36], [0.24, 0.34, 0.14], near);
    let shade = 0.75 + 0.5 * noise(u, v, 64, 48, 21);
    grass.map(|c| c * shade)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_repeats_and_stays_within_bounds() {
        for step in 0..100 {
            let at = f64::from(step) / 37.0;
            let value = noise(at, 0.3, 8, 5, 1);
            assert!((0.0..=1.0).contains(&value));
            assert!((noise(at + 1.0, 0.3, 8, 5, 1) - value).abs() < 1e-9);
        }
    }

    /// A texture that repeats has no seam: its first and last columns differ no more than neighbouring columns do.
    #[test]
    fn tiles_have_no_seam() {
        for (name, picture) in all().into_iter().filter(|(name, _)| ["wood", "wallpaper", "fabric"].contains(name)) {
            let (width, height) = (picture.width(), picture.height());
            let difference = |x0: usize, x1: usize| -> i32 {
                (0..height).map(|y| (i32::from(picture.get(x0, y)[1]) - i32::from(picture.get(x1, y)[1])).abs()).sum()
            };
            let worst = (1..width).map(|x| difference(x - 1, x)).max().unwrap();
            assert!(difference(width - 1, 0) <= worst, "{name}");
        }
    }

    #[test]
    fn no_texture_is_flat() {
        for (name, picture) in all() {
            let greens: Vec<u8> = picture.pixels().iter().map(|p| p[1]).collect();
            assert!(greens.iter().max().unwrap() - greens.iter().min().unwrap() > 30, "{name}");
        }
    }
}
