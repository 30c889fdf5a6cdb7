//! The materials of floors, walls and fittings, and their textures, whose letters and arrows show their orientation.
//! Some textures are stored mirrored or rotated, which their materials' `UVTransform` undoes.
//!
//! The texture of a piece of furniture has up to four fields, two by two. An unused field has opacity 0, as in the
//! data.

use mateval_image::Picture;

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

/// Oak planks with an arrow X along +u and an arrow Z along -v (downwards). On a floor, whose u runs along +x and v
/// along -z, these are the room's axes.
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

/// The content of one field of a model's texture.
#[derive(Clone, Copy, Debug)]
pub enum Swatch {
    /// Wood of this colour with its grain along u.
    Wood(Color),
    /// A weave of this colour.
    Fabric(Color),
    /// A smooth surface such as metal, paint or a lampshade.
    Plain(Color),
    /// Dark letters on this colour that fill the field, for a surface `aspect` times as wide as high.
    Text { lines: &'static [&'static str], ground: Color, ink: Color, aspect: f64 },
}

impl Swatch {
    /// The colour at a point of the field, v downwards.
    fn color(&self, u: f64, v: f64) -> Color {
        match *self {
            Self::Wood(tone) => {
                let light = pattern::wood(u, v)[1] / 0.33;
                tone.map(|c| c * (0.65 + 0.35 * light))
            }
            Self::Fabric(tone) => {
                let light = pattern::fabric(u, v)[1] / 0.40;
                tone.map(|c| c * (0.7 + 0.3 * light))
            }
            Self::Plain(tone) => tone.map(|c| c * (0.97 + 0.06 * noise(u, v, 16, 16, 41))),
            Self::Text { lines, ground, ink, aspect } => {
                let edge = u.min(1.0 - u).min(v.min(1.0 - v));
                if edge > 0.03 && edge < 0.05 || Lettering::fitted(lines, [0.1; 2], [0.9; 2], aspect).covers(u, v) {
                    ink
                } else {
                    ground.map(|c| c * (0.97 + 0.06 * noise(u, v, 24, 24, 42)))
                }
            }
        }
    }
}

/// The texture of a model, `side` texels wide and high.
pub fn swatch_picture(swatches: &[Swatch], side: usize) -> Picture<[u8; 4]> {
    let half = side / 2;
    Picture::from_fn(side, side, |x, y| {
        let Some(swatch) = swatches.get(x / half + 2 * (y / half)) else { return [128, 128, 128, 0] };
        let at = |texel: usize| (texel % half) as f64 / half as f64 + 0.5 / half as f64;
        let [r, g, b] = swatch.color(at(x), at(y)).map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8);
        [r, g, b, 255]
    })
}

/// The lower left corner and the width of a field in texture coordinates, v upwards, inset by two texels on every side.
pub fn swatch_field(number: usize, side: usize) -> ([f64; 2], f64) {
    let inset = 2.0 / side as f64;
    let (column, row) = ((number % 2) as f64, (number / 2) as f64);
    ([column / 2.0 + inset, 0.5 - row / 2.0 + inset], 0.5 - 2.0 * inset)
}

/// Dots from the left edge of a letter to that of the next.
const ADVANCE: usize = 6;
/// Dots from the top of a line to that of the next.
const LINE: usize = 9;

/// Characters and their rows from the top. Bit 4 of a row is the leftmost dot.
const GLYPHS: [(char, [u8; 7]); 29] = [
    ('A', [0x0e, 0x11, 0x11, 0x1f, 0x11, 0x11, 0x11]),
    ('B', [0x1e, 0x11, 0x11, 0x1e, 0x11, 0x11, 0x1e]),
    ('C', [0x0e, 0x11, 0x10, 0x10, 0x10, 0x11, 0x0e]),
    ('D', [0x1e, 0x11, 0x11, 0x11, 0x11, 0x11, 0x1e]),
    ('E', [0x1f, 0x10, 0x10, 0x1e, 0x10, 0x10, 0x1f]),
    ('F', [0x1f, 0x10, 0x10, 0x1e, 0x10, 0x10, 0x10]),
    ('G', [0x0e, 0x11, 0x10, 0x17, 0x11, 0x11, 0x0f]),
    ('H', [0x11, 0x11, 0x11, 0x1f, 0x11, 0x11, 0x11]),
    ('I', [0x0e, 0x04, 0x04, 0x04, 0x04, 0x04, 0x0e]),
    ('J', [0x07, 0x02, 0x02, 0x02, 0x02, 0x12, 0x0c]),
    ('K', [0x11, 0x12, 0x14, 0x18, 0x14, 0x12, 0x11]),
    ('L', [0x10, 0x10, 0x10, 0x10, 0x10, 0x10, 0x1f]),
    ('M', [0x11, 0x1b, 0x15, 0x15, 0x11, 0x11, 0x11]),
    ('N', [0x11, 0x11, 0x19, 0x15, 0x13, 0x11, 0x11]),
    ('O', [0x0e, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0e]),
    ('P', [0x1e, 0x11, 0x11, 0x1e, 0x10, 0x10, 0x10]),
    ('Q', [0x0e, 0x11, 0x11, 0x11, 0x15, 0x12, 0x0d]),
    ('R', [0x1e, 0x11, 0x11, 0x1e, 0x14, 0x12, 0x11]),
    ('S', [0x0f, 0x10, 0x10, 0x0e, 0x01, 0x01, 0x1e]),
    ('T', [0x1f, 0x04, 0x04, 0x04, 0x04, 0x04, 0x04]),
    ('U', [0x11, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0e]),
    ('V', [0x11, 0x11, 0x11, 0x11, 0x11, 0x0a, 0x04]),
    ('W', [0x11, 0x11, 0x11, 0x15, 0x15, 0x1b, 0x11]),
    ('X', [0x11, 0x11, 0x0a, 0x04, 0x0a, 0x11, 0x11]),
    ('Y', [0x11, 0x11, 0x0a, 0x04, 0x04, 0x04, 0x04]),
    ('Z', [0x1f, 0x01, 0x02, 0x04, 0x08, 0x10, 0x1f]),
    ('^', [0x04, 0x0e, 0x15, 0x04, 0x04, 0x04, 0x04]),
    ('>', [0x00, 0x04, 0x02, 0x1f, 0x02, 0x04, 0x00]),
    ('_', [0x04, 0x04, 0x04, 0x04, 0x15, 0x0e, 0x04]),
];

/// Whether the dot at `column`, `row` of a line of text is inked. `^`, `>` and `_` are arrows up, right and down. A
/// character without a glyph is blank.
fn is_inked(line: &str, column: usize, row: usize) -> bool {
    let glyph = line.chars().nth(column / ADVANCE).and_then(|letter| GLYPHS.iter().find(|(known, _)| *known == letter));
    let (dot, rows) = (column % ADVANCE, 7);
    glyph.is_some_and(|(_, bits)| dot < 5 && row < rows && bits[row] & (0x10 >> dot) != 0)
}

/// Text in a picture. Lengths are fractions of the picture, measured from its upper left corner.
#[derive(Clone, Copy, Debug)]
pub struct Lettering {
    /// Lines from the top down.
    pub lines: &'static [&'static str],
    /// Upper left corner of the first letter.
    pub at: [f64; 2],
    /// Width and height of a dot.
    pub dot: [f64; 2],
}

impl Lettering {
    /// Text in the middle of the rectangle from `low` to `high`, as large as fits with square dots. `aspect` is the
    /// width of the surface that shows the picture divided by its height.
    pub fn fitted(lines: &'static [&'static str], low: [f64; 2], high: [f64; 2], aspect: f64) -> Self {
        let longest = lines.iter().map(|line| line.chars().count()).max().unwrap_or(1);
        let columns = (longest * ADVANCE - 1) as f64;
        let rows = (lines.len() * LINE - 2) as f64;
        let size = ((high[0] - low[0]) / columns).min((high[1] - low[1]) / aspect / rows);
        let dot = [size, size * aspect];
        let left = (low[0] + high[0] - columns * dot[0]) / 2.0;
        let top = (low[1] + high[1] - rows * dot[1]) / 2.0;
        Self { lines, at: [left, top], dot }
    }

    /// Whether a point of the picture is inked.
    pub fn covers(&self, u: f64, v: f64) -> bool {
        let (x, y) = ((u - self.at[0]) / self.dot[0], (v - self.at[1]) / self.dot[1]);
        if x < 0.0 || y < 0.0 {
            return false;
        }
        let (column, row) = (x as usize, y as usize);
        self.lines.get(row / LINE).is_some_and(|line| is_inked(line, column, row % LINE))
    }
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

    #[test]
    fn letters_fill_their_rectangle() {
        let text = Lettering::fitted(&["L"], [0.0, 0.0], [1.0, 1.0], 5.0 / 7.0);
        // An L has a stroke down the left, a foot to the right, and nothing above the foot.
        assert!(text.covers(0.1, 0.1) && text.covers(0.9, 0.95) && !text.covers(0.9, 0.1));
        assert!(!text.covers(-0.1, 0.1) && !text.covers(0.1, 1.1));
    }

    /// A mirrored text differs from the text. The twin is a letter that is its own mirror image.
    #[test]
    fn asymmetric_words_change_under_a_mirror() {
        let differs = |lines: &'static [&'static str]| {
            let text = Lettering::fitted(lines, [0.0; 2], [1.0; 2], 1.0);
            (0..900).any(|i| {
                let (u, v) = (f64::from(i % 30) / 30.0 + 0.017, f64::from(i / 30) / 30.0 + 0.017);
                text.covers(u, v) != text.covers(1.0 - u, v)
            })
        };
        assert!([&["MATEVAL"], &["N"], &["BED ^"], &["X>"]].into_iter().all(|lines| differs(lines)));
        assert!(!differs(&["H"]));
    }
}
