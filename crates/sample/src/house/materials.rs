//! The materials of floors, walls and fittings, and their textures, whose letters and arrows show their orientation. Some
//! textures are stored mirrored or rotated, which their materials' `UVTransform` undoes.

use mateval_image::Picture;

use super::font::Lettering;
use crate::pattern::{self, Color, noise, paint, random};

pub struct ArchitectureMaterial {
    /// The name by which meshes refer to it.
    pub name: &'static str,
    /// The name of its texture; without one it shows its colour.
    pub texture: Option<&'static str>,
    /// sRGB bytes.
    pub color: [u8; 3],
    /// The data's `contentType`: a constant word and the finish.
    pub content: [&'static str; 2],
}

impl ArchitectureMaterial {
    /// A material that shows a texture.
    pub const fn pictured(name: &'static str, texture: &'static str, content: [&'static str; 2]) -> Self {
        Self { name, texture: Some(texture), color: [255; 3], content }
    }

    /// A material of one colour.
    pub const fn plain(name: &'static str, color: [u8; 3], content: [&'static str; 2]) -> Self {
        Self { name, texture: None, color, content }
    }
}

/// The materials of the built-in house.
pub(super) fn materials() -> Vec<ArchitectureMaterial> {
    let (pictured, plain) = (ArchitectureMaterial::pictured, ArchitectureMaterial::plain);
    vec![
        pictured("floor", "planks", ["material", "flooring - hardwood"]),
        pictured("wallpaper", "wallpaper", ["material", "wallpaper"]),
        pictured("bedroom_wallpaper", "stripes", ["material", "wallpaper"]),
        pictured("panel", "panel", ["material", "wood"]),
        pictured("door", "door_wood", ["material", "wood"]),
        plain("ceiling", [246, 244, 238], ["material", "paint"]),
        plain("trim", [238, 236, 230], ["material", "paint"]),
        plain("outer_wall", [206, 198, 184], ["material", "paint"]),
        plain("light_band", [255, 244, 214], ["material", "emissive"]),
    ]
}

/// How a texture is stored in its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stored {
    /// As it appears on the wall.
    Upright,
    /// Left and right swapped.
    Mirrored,
    /// Rotated by 90 degrees.
    Turned,
}

impl Stored {
    /// The row-major matrix from texture coordinates in metres to those of the file, whose texture spans `tile` metres.
    pub fn uv_transform(self, tile: f64) -> [f64; 9] {
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
pub struct ArchitectureTexture {
    /// The name by which materials refer to it.
    pub name: &'static str,
    /// The number in its id.
    pub number: u32,
    /// Metres that it spans on a wall.
    pub tile: f64,
    pub stored: Stored,
    /// The texture as it appears on the wall.
    pub seen: Picture<[u8; 3]>,
}

impl ArchitectureTexture {
    /// Its id, which names its folder: made up, shaped as the data's.
    pub fn jid(&self) -> String {
        format!("cc0a0000-5a3b-4e00-8000-{:012}", self.number)
    }

    /// The texture as the file stores it.
    pub fn file(&self) -> Picture<[u8; 3]> {
        self.stored.stored(&self.seen)
    }
}

/// The textures of the built-in house. Their numbers stay, since they are part of ids; 5 is one of the test kit's.
pub(super) fn textures() -> Vec<ArchitectureTexture> {
    let texture = |name, number, tile, stored, seen| ArchitectureTexture { name, number, tile, stored, seen };
    vec![
        texture("wallpaper", 1, 0.6, Stored::Upright, paint(256, 256, wallpaper)),
        texture("planks", 2, 1.2, Stored::Upright, paint(512, 512, planks)),
        texture("stripes", 3, 0.8, Stored::Mirrored, paint(256, 256, stripes)),
        texture("panel", 4, 0.8, Stored::Turned, paint(256, 256, panel)),
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
        for texture in textures() {
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
        for texture in textures().iter().filter(|texture| texture.name != "door_wood") {
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
