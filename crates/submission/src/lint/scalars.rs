//! Roughness and metallic that are probably mistakes, and base colours without information.

use std::collections::BTreeMap;

use mateval_scene::Finding;

use super::finding::warning;
use super::instance_facts::InstanceFacts;
use super::looks::{Look, ScalarLook};
use super::statistics::Pairs;

/// Fewest pixels that allow a judgement.
const FEWEST: usize = 400;
/// A surface smoother and more metallic than this is a mirror of some kind.
const MIRROR: (f32, f32) = (0.1, 0.3);
/// No room is a hall of mirrors: if more than this share of the pixels shows one, the two maps are exchanged.
const MOST_MIRRORS: f64 = 0.6;
/// Roughness and metallic of a pixel that differ by at most this much count as equal.
const SAME: f32 = 1.0 / 255.0;
/// Fewest neighbourhoods of an instance whose hues are compared, and fewest pixels of each, which keeps noise out of
/// its mean.
const FEWEST_TILES: usize = 4;
const FEWEST_OF_TILE: f64 = 16.0;
/// Darker values hold more noise than hue.
const DARKEST: f32 = 0.01;
/// How much the picture's hues must differ between the neighbourhoods of an instance for a single base colour to be
/// wrong.
const MOST_HUE: f64 = 0.3;

/// Findings about a scene.
pub(super) fn check(place: &str, all: &[InstanceFacts]) -> Vec<Finding> {
    let scalars: Vec<ScalarLook> = all.iter().flat_map(|facts| facts.scalars.iter().copied()).collect();
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
        let action = "write each into its own file; in an ORM map, green is roughness";
        warning("swapped_roughness_metallic", place, message, action)
    })
}

/// The same map written as both.
fn same(place: &str, looks: &[ScalarLook]) -> Option<Finding> {
    let same = looks.iter().all(|look| (look.roughness - look.metallic).abs() <= SAME);
    (looks.len() >= FEWEST && same).then(|| {
        let message = format!("roughness and metallic are the same at all {} pixels", looks.len());
        warning("same_roughness_metallic", place, message, "write each into its own file")
    })
}

/// The same base colour for every instance.
fn one_for_all(place: &str, all: &[InstanceFacts]) -> Option<Finding> {
    let hashes: Vec<&String> = all.iter().filter_map(|facts| facts.base_color.as_ref().map(|(hash, _)| hash)).collect();
    (hashes.len() > 2 && hashes.iter().all(|hash| *hash == hashes[0])).then(|| {
        let message = format!("all {} base colours are the same file", hashes.len());
        warning("same_base_color", place, message, "bake a map of its own for each instance, unless this is a baseline")
    })
}

/// A single colour where the picture shows several. Light and shadow change brightness, and hues only a little.
fn one_colour(facts: &InstanceFacts) -> Option<Finding> {
    let first = facts.looks.first()?.own();
    let is_first = |look: &Look| look.own().iter().zip(first).all(|(a, b)| (a - b).abs() < 1e-4);
    if !facts.looks.iter().all(is_first) {
        return None;
    }
    let (hue, tiles) =
        [1, 2].map(|channel| hues(&facts.looks, channel)).into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    (tiles >= FEWEST_TILES && hue > MOST_HUE).then(|| {
        let message = format!(
            "a single colour where the input picture shows several: its hue differs by {hue:.2} between {tiles} tiles"
        );
        warning("one_colour", &facts.folder, message, "bake what the picture shows, unless this is a baseline")
    })
}

/// The standard deviation of log(red / `channel`) of the picture between neighbourhoods, and the number of
/// neighbourhoods.
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

    /// An instance of one colour, seen in eight tiles of 40 pixels; `photo` is the picture's colour of a tile.
    fn facts(photo: impl Fn(usize) -> [f32; 3]) -> InstanceFacts {
        let look = |at: usize| Look {
            instance: 0,
            tile: at / 40,
            photo: Some(photo(at / 40)),
            base_color: [[0.5, 0.4, 0.3]; 5],
        };
        InstanceFacts { looks: (0..320).map(look).collect(), ..InstanceFacts::default() }
    }

    #[test]
    fn one_colour_is_reported_where_hues_differ_and_not_where_light_does() {
        let lit = facts(|tile| [0.1, 0.08, 0.06].map(|value| value * (1 + tile) as f32));
        assert_eq!(one_colour(&lit), None);
        let striped = facts(|tile| if tile % 2 == 0 { [0.5, 0.1, 0.1] } else { [0.1, 0.1, 0.5] });
        assert_eq!(one_colour(&striped).map(|found| found.code), Some("one_colour".to_owned()));
        // Several colours are no finding.
        let mut painted = striped;
        painted.looks[7].base_color[0] = [0.1; 3];
        assert_eq!(one_colour(&painted), None);
    }
}
