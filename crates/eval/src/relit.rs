//! Lightings that no method has seen: the reference's own emitters with other weights.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use mateval_image::{LinearRgb, Mask, Picture};
use mateval_tracer::LightMix;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::light_rules::RelitRules;
use crate::word_enum::UnknownWord;

/// The name of a lighting of track `relit`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum LightingName {
    /// `dim`: all groups dimmed.
    Dim,
    /// `warm_cool`: alternately warm and cool groups.
    WarmCool,
    /// `alone_1`, `alone_2`, ...: one group alone, by its place among the brightest, from 1.
    Alone(usize),
}

const DIM: &str = "dim";
const WARM_COOL: &str = "warm_cool";
const ALONE: &str = "alone_";

impl fmt::Display for LightingName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Dim => f.write_str(DIM),
            Self::WarmCool => f.write_str(WARM_COOL),
            Self::Alone(place) => write!(f, "{ALONE}{place}"),
        }
    }
}

impl FromStr for LightingName {
    type Err = UnknownWord;

    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        let alone = || word.strip_prefix(ALONE)?.parse().ok().map(Self::Alone);
        let known = [Some(Self::Dim), Some(Self::WarmCool), alone()];
        // Only the printed form is accepted: `alone_01` is not.
        known.into_iter().flatten().find(|name| name.to_string() == word).ok_or_else(|| UnknownWord {
            what: "lighting's name",
            word: word.to_owned(),
            expected: format!("{DIM}, {WARM_COOL}, {ALONE}1, {ALONE}2, ..."),
        })
    }
}

impl TryFrom<String> for LightingName {
    type Error = UnknownWord;

    fn try_from(word: String) -> Result<Self, UnknownWord> {
        word.parse()
    }
}

impl From<LightingName> for String {
    fn from(name: LightingName) -> Self {
        name.to_string()
    }
}

impl JsonSchema for LightingName {
    fn schema_name() -> Cow<'static, str> {
        "LightingName".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": "^(dim|warm_cool|alone_[1-9][0-9]*)$" })
    }
}

/// A lighting of track `relit`.
#[derive(Clone, Debug, PartialEq)]
pub struct RelitLighting {
    /// Its name.
    pub name: LightingName,
    /// The weight of each light group and channel.
    pub weights: LightMix,
}

/// The lightings of a scene, by the rule of [`RelitRules`].
///
/// `groups` are the truth's pictures of the input view, linear, one for each light group in the scene's order; `valid` is
/// that view's mask. A scene whose groups light nothing there has no lightings.
pub fn lightings(rules: &RelitRules, groups: &[Picture<LinearRgb>], valid: &Mask) -> Vec<RelitLighting> {
    let order = by_brightness(groups, valid);
    if order.is_empty() {
        return Vec::new();
    }
    let mut warm_cool = vec![[1.0; 3]; groups.len()];
    for (place, &group) in order.iter().enumerate() {
        warm_cool[group] = if place % 2 == 0 { rules.warm } else { rules.cool };
    }
    let mut lightings = vec![
        RelitLighting { name: LightingName::Dim, weights: vec![[rules.dim; 3]; groups.len()] },
        RelitLighting { name: LightingName::WarmCool, weights: warm_cool },
    ];
    if order.len() > 1 {
        lightings.extend(order.iter().take(rules.alone_at_most).enumerate().map(|(place, &alone)| {
            let weight = |group: usize| if group == alone { [1.0; 3] } else { [0.0; 3] };
            RelitLighting { name: LightingName::Alone(place + 1), weights: (0..groups.len()).map(weight).collect() }
        }));
    }
    lightings
}

/// Groups that light anything, brightest first; equally bright groups keep their order.
fn by_brightness(groups: &[Picture<LinearRgb>], valid: &Mask) -> Vec<usize> {
    let luminance = |picture: &Picture<LinearRgb>| -> f64 {
        let lit = picture.pixels().iter().zip(valid.pixels()).filter(|(_, valid)| **valid);
        lit.map(|(pixel, _)| pixel.luminance()).sum()
    };
    let mut order: Vec<(f64, usize)> = groups.iter().map(luminance).zip(0..).filter(|(sum, _)| *sum > 0.0).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    order.into_iter().map(|(_, group)| group).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::Protocol;

    fn flat(value: f32) -> Picture<LinearRgb> {
        Picture::filled(2, 1, LinearRgb([value; 3]))
    }

    fn rules() -> RelitRules {
        Protocol::named("mateval-1").unwrap().light.relit
    }

    fn names(groups: &[Picture<LinearRgb>]) -> Vec<String> {
        lightings(&rules(), groups, &Mask::filled(2, 1, true))
            .into_iter()
            .map(|lighting| lighting.name.to_string())
            .collect()
    }

    #[test]
    fn names_are_parsed_from_what_they_print() {
        for name in [LightingName::Dim, LightingName::WarmCool, LightingName::Alone(1), LightingName::Alone(12)] {
            assert_eq!(name.to_string().parse(), Ok(name));
        }
        for word in ["", "dimmer", "alone", "alone_", "alone_01", "alone_+1", "Dim"] {
            assert!(
                word.parse::<LightingName>().unwrap_err().to_string().contains("is not a lighting's name"),
                "{word}"
            );
        }
    }

    #[test]
    fn groups_take_turns_by_brightness() {
        let groups = [flat(1.0), flat(4.0), flat(0.0), flat(2.0), flat(0.5)];
        let all = lightings(&rules(), &groups, &Mask::filled(2, 1, true));
        assert_eq!(names(&groups), ["dim", "warm_cool", "alone_1", "alone_2", "alone_3"]);
        assert_eq!(all[0].weights, [[0.3; 3]; 5]);
        let RelitRules { warm, cool, .. } = rules();
        assert_eq!(all[1].weights, [warm, warm, [1.0; 3], cool, cool]);
        assert_eq!(all[2].weights, [[0.0; 3], [1.0; 3], [0.0; 3], [0.0; 3], [0.0; 3]]);
        assert_eq!(all[4].weights[0], [1.0; 3]);
    }

    #[test]
    fn one_group_has_two_and_darkness_none() {
        assert_eq!(names(&[flat(1.0)]), ["dim", "warm_cool"]);
        assert_eq!(names(&[flat(0.0), flat(3.0)]), ["dim", "warm_cool"]);
        assert!(names(&[flat(0.0)]).is_empty() && names(&[]).is_empty());
        // What is not valid does not count.
        let groups = [flat(1.0), Picture::from_fn(2, 1, |x, _| LinearRgb([[9.0, 0.5][x]; 3]))];
        let valid = Mask::from_fn(2, 1, |x, _| x == 1);
        assert_eq!(lightings(&rules(), &groups, &valid)[2].weights[0], [1.0; 3]);
    }
}
