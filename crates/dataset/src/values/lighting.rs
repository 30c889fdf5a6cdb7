//! Lightings: a scene's own light groups with other weights. Light is linear, so a picture under a lighting is the
//! weighted sum of the pictures under each group alone. Track `relit` and the photos of twins use them.

use std::fmt;
use std::str::FromStr;

use mateval_image::{LUMINANCE, LinearRgb, Mask, Picture};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::by_text;
use crate::ids::{BadId, SceneId};
use crate::word_enum::UnknownWord;

/// The rules by which the light groups of a scene are weighted. Groups are ordered by the luminance of the input view
/// under each alone, over valid pixels, brightest first; groups that bring less than [`Self::least_share`] of it are
/// left out of the order. Every lighting is then scaled so that the input view has the mean luminance that it has under
/// the scene's own lights. Track `relit` measures luminance in R, twins in the photo.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RelitRules {
    /// Lighting `warm_cool`: the weights of the first, third, ... group, by channel.
    pub warm: [f64; 3],
    /// Lighting `warm_cool`: the weights of the second, fourth, ... group.
    pub cool: [f64; 3],
    /// The number of lightings `alone_1`, `alone_2`, ..., in which one group has weight 1 and all others 0. Scenes of
    /// one group have none.
    pub alone_at_most: usize,
    /// The smallest share of the light of a group that takes part.
    pub least_share: f64,
}

impl RelitRules {
    /// The rules of the protocols, with this number of lightings of one group.
    pub const fn with_alone(alone_at_most: usize) -> Self {
        Self { warm: [1.3, 1.0, 0.6], cool: [0.6, 0.9, 1.3], alone_at_most, least_share: 0.05 }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum LightingName {
    /// `warm_cool`: alternately warm and cool groups.
    WarmCool,
    /// `alone_1`, `alone_2`, ...: one group alone, by its place among the brightest, from 1.
    Alone(usize),
}

const WARM_COOL: &str = "warm_cool";
const ALONE: &str = "alone_";
/// Between a scene's id and the lighting of its twin.
const TWIN: &str = "--";

impl fmt::Display for LightingName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WarmCool => f.write_str(WARM_COOL),
            Self::Alone(place) => write!(f, "{ALONE}{place}"),
        }
    }
}

impl FromStr for LightingName {
    type Err = UnknownWord;

    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        let alone = || word.strip_prefix(ALONE)?.parse().ok().filter(|place| *place > 0).map(Self::Alone);
        let known = [Some(Self::WarmCool), alone()];
        // Only the printed form is accepted: `alone_01` is not.
        known.into_iter().flatten().find(|name| name.to_string() == word).ok_or_else(|| UnknownWord {
            what: "lighting's name",
            word: word.to_owned(),
            expected: format!("{WARM_COOL}, {ALONE}1, {ALONE}2, ..."),
        })
    }
}

by_text!(LightingName, UnknownWord, "^(warm_cool|alone_[1-9][0-9]*)$");

impl LightingName {
    /// The id of a scene's twin under this lighting, as in `room--warm_cool`. Fails where that is too long for an id.
    pub fn twin_of(self, scene: &SceneId) -> Result<SceneId, BadId> {
        SceneId::new(format!("{scene}{TWIN}{self}"))
    }
}

/// The scene and the lighting that the id of a twin consists of; absent if it is no such id.
pub fn parse_twin(id: &str) -> Option<(SceneId, LightingName)> {
    let (scene, lighting) = id.rsplit_once(TWIN)?;
    Some((SceneId::new(scene).ok()?, lighting.parse().ok()?))
}

#[derive(Clone, Debug, PartialEq)]
pub struct RelitLighting {
    pub name: LightingName,
    /// The weight of each light group and channel.
    pub weights: Vec<[f64; 3]>,
}

/// The lightings of a scene, by the rule of [`RelitRules`].
///
/// `sums` holds [`light_of`] each light group, in the scene's order. A scene whose groups light nothing has no
/// lightings.
pub fn lightings(rules: &RelitRules, sums: &[[f64; 3]]) -> Vec<RelitLighting> {
    let order = by_brightness(rules, sums);
    if order.is_empty() {
        return Vec::new();
    }
    let mut warm_cool = vec![[1.0; 3]; sums.len()];
    for (place, &group) in order.iter().enumerate() {
        warm_cool[group] = if place % 2 == 0 { rules.warm } else { rules.cool };
    }
    let mut lightings = vec![RelitLighting { name: LightingName::WarmCool, weights: warm_cool }];
    if order.len() > 1 {
        lightings.extend(order.iter().take(rules.alone_at_most).enumerate().map(|(place, &alone)| {
            let weight = |group: usize| if group == alone { [1.0; 3] } else { [0.0; 3] };
            RelitLighting { name: LightingName::Alone(place + 1), weights: (0..sums.len()).map(weight).collect() }
        }));
    }
    lightings.iter_mut().for_each(|lighting| expose(&mut lighting.weights, sums));
    lightings
}

/// Scales the weights so that the input view is as bright as under the scene's own lights.
fn expose(weights: &mut [[f64; 3]], sums: &[[f64; 3]]) {
    let own: f64 = sums.iter().map(|sum| luminance(*sum)).sum();
    let pairs = sums.iter().zip(weights.iter());
    let lit: f64 = pairs.map(|(sum, weight)| weighted_luminance(sum, weight)).sum();
    let scale = own / lit;
    weights.iter_mut().flatten().for_each(|weight| *weight *= scale);
}

/// Groups that bring their share of the light, brightest first; equally bright groups keep their order.
fn by_brightness(rules: &RelitRules, sums: &[[f64; 3]]) -> Vec<usize> {
    let bright: Vec<f64> = sums.iter().map(|sum| luminance(*sum)).collect();
    let least = rules.least_share * bright.iter().sum::<f64>();
    let mut order: Vec<usize> = (0..bright.len()).filter(|&at| bright[at] > 0.0 && bright[at] >= least).collect();
    order.sort_by(|&a, &b| bright[b].total_cmp(&bright[a]).then(a.cmp(&b)));
    order
}

/// The linear light of a light group in a picture of the input view, summed over its valid pixels, by channel.
pub fn light_of(picture: &Picture<LinearRgb>, valid: &Mask) -> [f64; 3] {
    let lit = picture.pixels().iter().zip(valid.pixels()).filter(|(_, valid)| **valid);
    lit.fold([0.0; 3], |sum, (LinearRgb(rgb), _)| [0, 1, 2].map(|c| sum[c] + f64::from(rgb[c])))
}

/// A picture under weighted light groups, exposed.
pub fn weighted(
    groups: &[Picture<LinearRgb>],
    weights: &[[f64; 3]],
    exposure: f64,
    size: [usize; 2],
) -> Picture<LinearRgb> {
    let mut sums = vec![[0.0_f64; 3]; size[0] * size[1]];
    for (group, weight) in groups.iter().zip(weights) {
        for (sum, pixel) in sums.iter_mut().zip(group.pixels()) {
            (0..3).for_each(|c| sum[c] += weight[c] * f64::from(pixel.0[c]));
        }
    }
    Picture::from_fn(size[0], size[1], |x, y| LinearRgb(sums[y * size[0] + x].map(|v| (v * exposure) as f32)))
}

fn weighted_luminance(sum: &[f64; 3], weight: &[f64; 3]) -> f64 {
    luminance([0, 1, 2].map(|c| sum[c] * weight[c]))
}

fn luminance(rgb: [f64; 3]) -> f64 {
    LUMINANCE.iter().zip(rgb).map(|(weight, value)| weight * value).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(value: f32) -> Picture<LinearRgb> {
        Picture::filled(2, 1, LinearRgb([value; 3]))
    }

    fn rules() -> RelitRules {
        RelitRules::with_alone(3)
    }

    fn sums(groups: &[Picture<LinearRgb>], valid: &Mask) -> Vec<[f64; 3]> {
        groups.iter().map(|picture| light_of(picture, valid)).collect()
    }

    fn names(groups: &[Picture<LinearRgb>]) -> Vec<String> {
        lightings(&rules(), &sums(groups, &Mask::filled(2, 1, true)))
            .into_iter()
            .map(|lighting| lighting.name.to_string())
            .collect()
    }

    #[test]
    fn names_are_parsed_from_what_they_print() {
        for name in [LightingName::WarmCool, LightingName::Alone(1), LightingName::Alone(12)] {
            assert_eq!(name.to_string().parse(), Ok(name));
        }
        for word in ["", "dim", "alone", "alone_", "alone_01", "alone_+1", "Warm_cool"] {
            assert!(
                word.parse::<LightingName>().unwrap_err().to_string().contains("is not a lighting's name"),
                "{word}"
            );
        }
    }

    #[test]
    fn twins_are_named_after_scene_and_lighting() {
        let room = SceneId::new("room--east").unwrap();
        let twin = LightingName::Alone(2).twin_of(&room).unwrap();
        assert_eq!(twin.as_str(), "room--east--alone_2");
        assert_eq!(parse_twin(twin.as_str()), Some((room, LightingName::Alone(2))));
        for other in ["room", "room--east", "room--alone_0", "--warm_cool", "room-warm_cool"] {
            assert_eq!(parse_twin(other), None, "{other}");
        }
        assert!(LightingName::WarmCool.twin_of(&SceneId::new("a".repeat(54)).unwrap()).is_err());
    }

    /// Weights divided by their first positive one: exposure scales all alike.
    fn relative(lighting: &RelitLighting) -> Vec<[f64; 3]> {
        let unit = lighting.weights.iter().flatten().copied().find(|weight| *weight > 0.0).unwrap();
        lighting.weights.iter().map(|rgb| rgb.map(|weight| weight / unit)).collect()
    }

    #[test]
    fn groups_take_turns_by_brightness() {
        let groups = [flat(1.0), flat(4.0), flat(0.0), flat(2.0), flat(0.5)];
        let all = lightings(&rules(), &sums(&groups, &Mask::filled(2, 1, true)));
        assert_eq!(names(&groups), ["warm_cool", "alone_1", "alone_2", "alone_3"]);
        let RelitRules { warm, cool, .. } = rules();
        let expected = [warm, warm, [1.0; 3], cool, cool].map(|rgb| rgb.map(|weight| weight / warm[0]));
        for (found, expected) in relative(&all[0]).iter().flatten().zip(expected.as_flattened()) {
            assert!((found - expected).abs() < 1e-12);
        }
        assert_eq!(relative(&all[1]), [[0.0; 3], [1.0; 3], [0.0; 3], [0.0; 3], [0.0; 3]]);
        assert_eq!(relative(&all[3])[0], [1.0; 3]);
    }

    /// A group of 4 % of the light takes no turn and keeps weight 1 before exposure; one of 6 % does.
    #[test]
    fn faint_groups_take_no_turn() {
        assert_eq!(names(&[flat(96.0), flat(4.0)]), ["warm_cool"]);
        assert_eq!(names(&[flat(94.0), flat(6.0)]), ["warm_cool", "alone_1", "alone_2"]);
    }

    /// Every lighting shows the input view as bright as the scene's own lights do.
    #[test]
    fn lightings_are_as_bright_as_the_photo() {
        let groups = [flat(1.0), flat(4.0), Picture::filled(2, 1, LinearRgb([0.5, 2.0, 9.0]))];
        let mask = Mask::filled(2, 1, true);
        let brightness = |weights: &[[f64; 3]]| -> f64 {
            groups.iter().zip(weights).map(|(group, w)| weighted_luminance(&light_of(group, &mask), w)).sum()
        };
        let own = brightness(&[[1.0; 3]; 3]);
        let all = lightings(&rules(), &sums(&groups, &mask));
        assert_eq!(all.len(), 4);
        for lighting in &all {
            assert!((brightness(&lighting.weights) / own - 1.0).abs() < 1e-12, "{}", lighting.name);
        }
    }

    #[test]
    fn one_group_has_one_and_darkness_none() {
        assert_eq!(names(&[flat(1.0)]), ["warm_cool"]);
        assert_eq!(names(&[flat(0.0), flat(3.0)]), ["warm_cool"]);
        assert!(names(&[flat(0.0)]).is_empty() && names(&[]).is_empty());
        // What is not valid does not count.
        let groups = [flat(1.0), Picture::from_fn(2, 1, |x, _| LinearRgb([[9.0, 0.5][x]; 3]))];
        let valid = Mask::from_fn(2, 1, |x, _| x == 1);
        assert_eq!(relative(&lightings(&rules(), &sums(&groups, &valid))[1])[0], [1.0; 3]);
    }
}
