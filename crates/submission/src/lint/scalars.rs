//! Roughness and metallic that cannot be meant, and base colours that say nothing.

use std::collections::BTreeMap;

use mateval_image::Texture;
use mateval_scene::Finding;

use super::finding::warning;
use super::looks::{Look, Turn, mean};
use super::scene::Seen;
use super::sight::SeenPixel;
use super::statistics::Pairs;

/// Fewest pixels that say anything.
const FEWEST: usize = 400;
/// What is smoother and more metallic than this is a mirror of some kind.
const MIRROR: (f32, f32) = (0.1, 0.3);
/// No room is a hall of mirrors: from this share of pixels on the two maps were exchanged.
const MOST_MIRRORS: f64 = 0.6;
/// Roughness and metallic of a pixel that are no further apart than this are the same.
const SAME: f32 = 1.0 / 255.0;
/// Fewest neighbourhoods of an instance whose hues are compared, and fewest pixels of each: a mean of them is hardly noise.
const FEWEST_TILES: usize = 4;
const FEWEST_OF_TILE: f64 = 16.0;
/// Darker values say more of noise than of hues.
const DARKEST: f32 = 0.01;
/// How much the picture's hues must differ over an instance, from neighbourhood to neighbourhood, before one colour cannot be all
/// of it.
const MOST_HUE: f64 = 0.3;

/// Roughness and metallic that a pixel shows.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScalarLook {
    roughness: f32,
    metallic: f32,
}

/// What both maps have at each pixel; nothing where one of them is missing.
pub(super) fn scalar_looks(
    pixels: &[SeenPixel],
    roughness: Option<Texture>,
    metallic: Option<Texture>,
) -> Vec<ScalarLook> {
    let (Some(roughness), Some(metallic)) = (roughness, metallic) else { return Vec::new() };
    let look = |pixel: &SeenPixel| {
        let [roughness, metallic] = [&roughness, &metallic].map(|map| mean(map, pixel, Turn::None)[0]);
        ScalarLook { roughness, metallic }
    };
    pixels.iter().map(look).collect()
}

/// Findings about a scene.
pub(super) fn check(place: &str, all: &[Seen]) -> Vec<Finding> {
    let scalars: Vec<ScalarLook> = all.iter().flat_map(|seen| seen.scalars.iter().copied()).collect();
    let mut findings: Vec<Finding> = exchanged(place, &scalars).or_else(|| same(place, &scalars)).into_iter().collect();
    findings.extend(one_for_all(place, all));
    findings.extend(all.iter().filter_map(one_colour));
    findings
}

fn exchanged(place: &str, looks: &[ScalarLook]) -> Option<Finding> {
    let mirrors = looks.iter().filter(|look| look.roughness < MIRROR.0 && look.metallic > MIRROR.1).count();
    let share = mirrors as f64 / looks.len().max(1) as f64;
    (looks.len() >= FEWEST && share >= MOST_MIRRORS).then(|| {
        let message = format!(
            "roughness and metallic seem exchanged: {:.0} % of {} pixels are smooth metal (roughness under {}, metallic \
             above {})",
            100.0 * share,
            looks.len(),
            MIRROR.0,
            MIRROR.1
        );
        warning("swapped_roughness_metallic", place, message, "write each into its own file; of ORM maps green is roughness")
    })
}

/// One map written twice.
fn same(place: &str, looks: &[ScalarLook]) -> Option<Finding> {
    let same = looks.iter().all(|look| (look.roughness - look.metallic).abs() <= SAME);
    (looks.len() >= FEWEST && same).then(|| {
        let message = format!("roughness and metallic are the same at all {} pixels", looks.len());
        warning("same_roughness_metallic", place, message, "write each into its own file")
    })
}

/// The same file for every instance.
fn one_for_all(place: &str, all: &[Seen]) -> Option<Finding> {
    let hashes: Vec<&String> = all.iter().filter_map(|seen| seen.base_color.as_ref().map(|(hash, _)| hash)).collect();
    (hashes.len() > 2 && hashes.iter().all(|hash| *hash == hashes[0])).then(|| {
        let message = format!("all {} base colours are one and the same file", hashes.len());
        warning("same_base_color", place, message, "write each instance's own, if this is no baseline")
    })
}

/// One colour where the picture shows several: light and shadow change brightness, and hues a little.
fn one_colour(seen: &Seen) -> Option<Finding> {
    let first = seen.looks.first()?.own();
    let is_first = |look: &Look| look.own().iter().zip(first).all(|(a, b)| (a - b).abs() < 1e-4);
    if !seen.looks.iter().all(is_first) {
        return None;
    }
    let (hue, tiles) =
        [1, 2].map(|channel| hues(&seen.looks, channel)).into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    (tiles >= FEWEST_TILES && hue > MOST_HUE).then(|| {
        let message = format!(
            "one colour all over, where the input picture shows several: its hue differs by {hue:.2} between {tiles} tiles"
        );
        warning("one_colour", &seen.folder, message, "bake what the picture shows, if this is no baseline")
    })
}

/// How much log(red / `channel`) of the picture differs between neighbourhoods, as a standard deviation, and how many there are.
fn hues(looks: &[Look], channel: usize) -> (f64, usize) {
    let mut tiles: BTreeMap<usize, (f64, f64)> = BTreeMap::new();
    for look in looks {
        let Some(photo) = look.photo.filter(|photo| photo[0] > DARKEST && photo[channel] > DARKEST) else { continue };
        let tile = tiles.entry(look.tile).or_default();
        *tile = (tile.0 + f64::from(photo[0] / photo[channel]).ln(), tile.1 + 1.0);
    }
    let mut means = Pairs::default();
    tiles.values().filter(|(_, count)| *count >= FEWEST_OF_TILE).for_each(|(sum, count)| means.add(sum / count, 0.0));
    (means.deviations()[0], means.count() as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eight tiles of 40 pixels each that an instance of one colour shows; `photo` tells a tile's colour in the picture.
    fn seen(photo: impl Fn(usize) -> [f32; 3]) -> Seen {
        let look = |at: usize| Look {
            instance: 0,
            tile: at / 40,
            photo: Some(photo(at / 40)),
            base_color: [[0.5, 0.4, 0.3]; 5],
        };
        Seen { looks: (0..320).map(look).collect(), ..Seen::default() }
    }

    #[test]
    fn one_colour_is_told_where_hues_differ_and_not_where_light_does() {
        let lit = seen(|tile| [0.1, 0.08, 0.06].map(|value| value * (1 + tile) as f32));
        assert_eq!(one_colour(&lit), None);
        let striped = seen(|tile| if tile % 2 == 0 { [0.5, 0.1, 0.1] } else { [0.1, 0.1, 0.5] });
        assert_eq!(one_colour(&striped).map(|found| found.code), Some("one_colour".to_owned()));
        // Of several colours nothing is said.
        let mut painted = striped;
        painted.looks[7].base_color[0] = [0.1; 3];
        assert_eq!(one_colour(&painted), None);
    }
}
