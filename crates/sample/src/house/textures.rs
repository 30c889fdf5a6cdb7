//! The textures of floors and walls, whose letters and arrows show their orientation. Some are stored mirrored or rotated,
//! which their materials' `UVTransform` undoes.

use mateval_image::Picture;

use super::font::Lettering;
use crate::pattern::{self, Color, noise, paint, ramp, random};

/// How a texture is stored in its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stored {
    /// As it appears on the wall.
    Upright,
    /// Left and right swapped.
    Mirrored,
    /// Rotated by 90 degrees.
    Turned,
}

impl Stored {
    /// The row-major matrix from texture coordinates in metres to those of the file, whose texture spans `tile` metres.
    pub(super) fn uv_transform(self, tile: f64) -> [f64; 9] {
        let s = 1.0 / tile;
        match self {
            Self::Upright => [s, 0.0, 0.0, 0.0, s, 0.0, 0.0, 0.0, 1.0],
            Self::Mirrored => [-s, 0.0, 0.0, 0.0, s, 0.0, 0.0, 0.0, 1.0],
            Self::Turned => [0.0, -s, 0.0, s, 0.0, 0.0, 0.0, 0.0, 1.0],
        }
    }

    /// The content of the file for a texture that appears as `seen`, which is square.
    fn stored(self, seen: &Picture<[u8; 3]>) -> Picture<[u8; 3]> {
        let n = seen.width();
        Picture::from_fn(n, n, |x, y| match self {
            Self::Upright => seen.get(x, y),
            Self::Mirrored => seen.get(n - 1 - x, y),
            Self::Turned => seen.get(n - 1 - y, x),
        })
    }
}

/// A texture for floors or walls.
pub(super) struct ArchitectureTexture {
    /// The name by which materials refer to it.
    pub(super) name: &'static str,
    /// The number in its id.
    pub(super) number: u32,
    /// Metres that it spans on a wall.
    pub(super) tile: f64,
    pub(super) stored: Stored,
    /// The texture as it appears on the wall.
    pub(super) seen: Picture<[u8; 3]>,
}

impl ArchitectureTexture {
    /// The texture as the file stores it.
    pub(super) fn file(&self) -> Picture<[u8; 3]> {
        self.stored.stored(&self.seen)
    }
}

/// Every texture of the architecture.
pub(super) fn all() -> Vec<ArchitectureTexture> {
    let texture = |name, number, tile, stored, seen| ArchitectureTexture { name, number, tile, stored, seen };
    vec![
        texture("wallpaper", 1, 0.6, Stored::Upright, paint(256, 256, wallpaper)),
        texture("planks", 2, 1.2, Stored::Upright, paint(512, 512, planks)),
        texture("stripes", 3, 0.8, Stored::Mirrored, paint(256, 256, stripes)),
        texture("panel", 4, 0.8, Stored::Turned, paint(256, 256, panel)),
        texture("tiles", 5, 0.6, Stored::Upright, paint(256, 256, tiles)),
        texture("door_wood", 6, 0.8, Stored::Upright, paint(256, 256, door_wood)),
    ]
}

/// `ink` where one of the texts covers the point, else `color`.
fn lettered(texts: &[Lettering], u: f64, v: f64, color: Color, ink: Color) -> Color {
    if texts.iter().any(|text| text.covers(u, v)) { ink } else { color }
}

/// Sage green with a thin frame, the project's name and an arrow up.
fn wallpaper(u: f64, v: f64) -> Color {
    let name = Lettering::fitted(&["MATEVAL"], [0.14, 0.16], [0.86, 0.42], 1.0);
    let top = Lettering::fitted(&["^ TOP"], [0.3, 0.55], [0.7, 0.9], 1.0);
    let edge = u.min(1.0 - u).min(v.min(1.0 - v));
    let ground = pattern::mix([0.62, 0.70, 0.62], [0.67, 0.75, 0.66], noise(u, v, 48, 48, 31));
    let ground = if (0.03..0.045).contains(&edge) { [0.72, 0.78, 0.70] } else { ground };
    lettered(&[name, top], u, v, ground, [0.36, 0.47, 0.41])
}

/// Oak planks with an arrow X along +u and an arrow Z along -v (downwards). On a floor, whose u runs along +x and v along
/// -z, these are the room's axes.
fn planks(u: f64, v: f64) -> Color {
    let x = Lettering::fitted(&["X>"], [0.55, 0.40], [0.80, 0.52], 1.0);
    let z = Lettering::fitted(&["Z", "_"], [0.42, 0.55], [0.52, 0.80], 1.0);
    lettered(&[x, z], u, v, pattern::planks(u, v), [0.15, 0.22, 0.36])
}

/// Stripes in two creams with the words BED ROOM.
fn stripes(u: f64, v: f64) -> Color {
    let word = Lettering::fitted(&["BED", "ROOM", "^"], [0.3, 0.2], [0.7, 0.8], 1.0);
    let stripe = (u * 8.0) as i64 % 2 == 0;
    let ground = if stripe { [0.80, 0.76, 0.70] } else { [0.86, 0.83, 0.78] };
    let grain = 0.96 + 0.06 * noise(u, v, 64, 64, 32);
    lettered(&[word], u, v, ground.map(|c: f64| c * grain), [0.52, 0.43, 0.50])
}

/// Wood with its grain along u, an arrow up and an arrow right.
fn panel(u: f64, v: f64) -> Color {
    let word = Lettering::fitted(&["UP ^", "EAST >"], [0.15, 0.25], [0.85, 0.75], 1.0);
    lettered(&[word], u, v, pattern::wood(u, v).map(|c| 0.25 + 0.8 * c), [0.95, 0.85, 0.6])
}

/// A floor tile with joints, a compass and the room's number. North is up, which is -z on a floor.
fn tiles(u: f64, v: f64) -> Color {
    let compass = [
        Lettering::fitted(&["N"], [0.44, 0.12], [0.56, 0.26], 1.0),
        Lettering::fitted(&["S"], [0.44, 0.74], [0.56, 0.88], 1.0),
        Lettering::fitted(&["W"], [0.12, 0.43], [0.24, 0.57], 1.0),
        Lettering::fitted(&["E"], [0.76, 0.43], [0.88, 0.57], 1.0),
        Lettering::fitted(&["103"], [0.36, 0.40], [0.64, 0.60], 1.0),
    ];
    let edge = u.min(1.0 - u).min(v.min(1.0 - v));
    let stone = pattern::mix([0.66, 0.64, 0.60], [0.78, 0.76, 0.72], noise(u, v, 9, 9, 33));
    let stone = pattern::mix([0.40, 0.39, 0.37], stone, ramp(0.008, 0.016, edge));
    lettered(&compass, u, v, stone, [0.30, 0.34, 0.42])
}

/// Pale wood with its grain along v.
fn door_wood(u: f64, v: f64) -> Color {
    let speck = 0.04 * random((u * 256.0) as i64, (v * 64.0) as i64, 34);
    pattern::wood(v, u).map(|c| 0.42 + 0.6 * c - speck)
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::*;

    /// The texel at texture coordinates, v upwards, with repetition.
    fn look_up(picture: &Picture<[u8; 3]>, u: f64, v: f64) -> [u8; 3] {
        let n = picture.width() as f64;
        picture.get((u.rem_euclid(1.0) * n) as usize, ((1.0 - v.rem_euclid(1.0)) * n).min(n - 1.0) as usize)
    }

    /// Looked up through its matrix, a file shows the texture as it appears on the wall. Looked up without the matrix's
    /// mirror or rotation, it does not.
    #[test]
    fn the_matrix_undoes_how_the_texture_is_stored() {
        let mut differing = 0;
        for texture in all() {
            let rows = texture.stored.uv_transform(texture.tile);
            let matrix = DMat3::from_cols_array(&rows).transpose();
            let (file, n) = (texture.file(), texture.seen.width());
            let wrong = |matrix: DMat3| {
                let differs = |i: &usize| {
                    let at = DVec3::new((i % n) as f64 + 0.5, (i / n) as f64 + 0.5, 0.0) / n as f64;
                    let there = matrix * at * texture.tile;
                    look_up(&file, there.x, there.y) != look_up(&texture.seen, at.x, at.y)
                };
                (0..n * n).filter(differs).count()
            };
            assert_eq!(wrong(matrix), 0, "{}", texture.name);
            let plain = DMat3::from_diagonal(DVec3::new(1.0 / texture.tile, 1.0 / texture.tile, 1.0));
            if texture.stored != Stored::Upright {
                assert!(wrong(plain) > n * n / 20, "{}", texture.name);
                differing += 1;
            }
        }
        assert_eq!(differing, 2);
    }

    /// Every texture with letters changes when it is mirrored or turned upside down.
    #[test]
    fn no_lettered_texture_is_its_own_mirror_image() {
        for texture in all().iter().filter(|texture| texture.name != "door_wood") {
            let (seen, n) = (&texture.seen, texture.seen.width());
            let ink = |a: [u8; 3], b: [u8; 3]| a[0].abs_diff(b[0]) > 60;
            let changed = |turned: fn(usize, usize, usize) -> (usize, usize)| {
                (0..n * n)
                    .filter(|i| {
                        let (x, y) = turned(i % n, i / n, n);
                        ink(seen.get(i % n, i / n), seen.get(x, y))
                    })
                    .count()
            };
            assert!(changed(|x, y, n| (n - 1 - x, y)) > n * n / 200, "{}", texture.name);
            assert!(changed(|x, y, n| (x, n - 1 - y)) > n * n / 200, "{}", texture.name);
            assert!(changed(|x, y, n| (n - 1 - x, n - 1 - y)) > n * n / 200, "{}", texture.name);
        }
    }
}
