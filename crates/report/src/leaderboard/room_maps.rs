//! The maps of an instance as the 3D view loads them: small pictures, or one colour where a map is the same everywhere.

use std::collections::BTreeMap;
use std::ops::Range;

use mateval_image::jpeg_io::jpeg_bytes;
use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{Picture, Texture};
use mateval_scene::submission::Map;

/// The most pixels a side of a map's picture.
pub(super) const MOST_TEXELS: usize = 512;
/// JPEG quality: at 90, errors are hardly visible.
const QUALITY: u8 = 90;

/// For each map, by the stem of its files, a colour such as `#808080` or the `data:` address of a JPEG.
pub(super) type RoomMaps = BTreeMap<&'static str, String>;

/// The maps of a material, whose linear values `texture` gives. Their bytes are those that a screen shows: base colour
/// in sRGB, roughness and metallic as 255 times their value.
pub(super) fn room_maps<'a>(texture: impl Fn(Map) -> &'a Texture) -> RoomMaps {
    let shown = |map: Map| {
        let encode = |value: f32| match map {
            Map::BaseColor => byte_from_unit(srgb_from_linear(value)),
            Map::Roughness | Map::Metallic => byte_from_unit(value),
        };
        (map.stem(), address(&shrunk(texture(map)).map(|value| value.map(encode))))
    };
    Map::ALL.into_iter().map(shown).collect()
}

/// The picture with at most [`MOST_TEXELS`] a side; each pixel is the mean of the linear texels that it covers.
fn shrunk(texture: &Texture) -> Picture<[f32; 3]> {
    let [width, height] = [texture.width(), texture.height()];
    let mean = |columns: Range<usize>, rows: Range<usize>| {
        let texels = rows.clone().flat_map(|y| columns.clone().map(move |x| texture.texel(x, y)));
        let sum = texels.fold([0.0; 3], |sum, texel| std::array::from_fn(|c| sum[c] + f64::from(texel[c])));
        sum.map(|sum| (sum / (columns.len() * rows.len()) as f64) as f32)
    };
    let [across, down] = [width.min(MOST_TEXELS), height.min(MOST_TEXELS)];
    Picture::from_fn(across, down, |x, y| mean(covered(x, across, width), covered(y, down, height)))
}

/// The texels that pixel `at` covers, where `count` pixels share a row of `size` texels.
fn covered(at: usize, count: usize, size: usize) -> Range<usize> {
    (at * size / count)..((at + 1) * size).div_ceil(count)
}

/// The colour of a picture of one colour, else the address of the picture as a JPEG.
fn address(picture: &Picture<[u8; 3]>) -> String {
    let first = picture.get(0, 0);
    if picture.pixels().iter().all(|pixel| *pixel == first) {
        let [r, g, b] = first;
        return format!("#{r:02x}{g:02x}{b:02x}");
    }
    let jpeg = jpeg_bytes(picture, QUALITY).expect("the picture has 1 to MOST_TEXELS pixels a side");
    format!("data:image/jpeg;base64,{}", base64::encode(jpeg))
}

#[cfg(test)]
mod tests {
    use mateval_image::{Texels, Wrap};

    use super::*;

    fn grey(size: usize, value: impl Fn(usize, usize) -> f32) -> Texture {
        let texels = (0..size * size).map(|at| value(at % size, at / size)).collect();
        Texture::new(size, size, Texels::Grey(texels), Wrap::Clamp).unwrap()
    }

    #[test]
    fn a_map_of_one_value_is_a_colour() {
        let maps = room_maps(|map| {
            let texture = grey(64, |_, _| 0.5);
            Box::leak(Box::new(if map == Map::BaseColor { texture } else { texture.collapsed() }))
        });
        assert_eq!(maps["base_color"], "#bcbcbc");
        assert_eq!((maps["roughness"].as_str(), maps["metallic"].as_str()), ("#808080", "#808080"));
    }

    #[test]
    fn large_maps_shrink_to_means_and_small_ones_are_kept() {
        let large = shrunk(&grey(1024, |x, _| (x % 2) as f32));
        assert_eq!((large.width(), large.height()), (MOST_TEXELS, MOST_TEXELS));
        assert!(large.pixels().iter().all(|pixel| *pixel == [0.5; 3]));
        let small = grey(64, |x, y| (x * 64 + y) as f32 / 4096.0);
        assert_eq!(shrunk(&small), Picture::from_fn(64, 64, |x, y| small.texel(x, y)));
        // Sides that are no multiple: every texel is covered.
        let covered: Vec<Range<usize>> = (0..512).map(|at| covered(at, 512, 700)).collect();
        assert!(covered[0].start == 0 && covered[511].end == 700);
        assert!(covered.windows(2).all(|pair| pair[1].start <= pair[0].end && pair[1].start >= pair[0].start));
    }

    #[test]
    fn other_maps_are_jpegs_of_bounded_size() {
        let noise = |x: usize, y: usize| ((x * 7919 + y * 104_729 + x * y * 31) % 251) as f32 / 251.0;
        let texture = grey(2048, noise);
        let map = &room_maps(|_| &texture)["base_color"];
        assert!(map.starts_with("data:image/jpeg;base64,/9j/") && map.len() < 1 << 20, "{}", map.len());
    }
}
