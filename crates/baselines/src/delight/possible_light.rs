//! Lights that may shine in a room, and the radiance that was fitted to each.

use std::collections::BTreeMap;

use mateval_light::candidates::{Candidate, sky_extent_deg};
use mateval_light::light_stage::NamedLight;
use mateval_scene::dataset::Instance;
use serde::{Deserialize, Serialize};

/// A light that may shine, of radiance 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PossibleLight {
    /// The id of the instance, `ceilings`, `world`, `world_<sector>`, or the name of the light of the stage; unique in its
    /// scene.
    pub name: String,
    /// What shines.
    pub source: LightSource,
}

/// What shines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum LightSource {
    /// Both sides of all surfaces of an instance.
    Instance {
        /// Its id.
        instance: String,
    },
    /// Both sides of all ceilings.
    Ceilings {},
    /// The world around, alike in all directions.
    World {},
    /// A part of the world around.
    Sky {
        /// From and to: 0 is -Z, 90 is +X.
        azimuth_deg: [f32; 2],
        /// From and to: 90 is +Y, straight up.
        elevation_deg: [f32; 2],
    },
    /// The front of a quad of the light stage. It casts no shadow, and surfaces reflect it diffusely alone.
    Quad {
        /// World space, anticlockwise as seen from the front.
        corners_m: Vec<[f32; 3]>,
    },
}

/// A light with the radiance that was fitted to it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FittedLight {
    /// The light.
    #[serde(flatten)]
    pub light: PossibleLight,
    /// Linear Rec. 709, before the scene's exposure.
    pub radiance: [f64; 3],
}

impl PossibleLight {
    /// A candidate among the instances of a scene.
    pub(super) fn of_candidate(name: String, candidate: Candidate, instances: &[Instance]) -> Self {
        let source = match candidate {
            Candidate::Instance(at) => LightSource::Instance { instance: instances[at].id.to_string() },
            Candidate::Ceilings => LightSource::Ceilings {},
            Candidate::World => LightSource::World {},
            Candidate::Sky(sector) => {
                let [azimuth_deg, elevation_deg] = sky_extent_deg(sector);
                LightSource::Sky { azimuth_deg, elevation_deg }
            }
        };
        Self { name, source }
    }

    /// A light of the stage.
    pub(super) fn of_stage(light: &NamedLight) -> Self {
        let mesh = &light.light.mesh;
        // The front is where the corners of the first triangle run anticlockwise.
        let order = if mesh.triangles[0] == [0, 1, 2] { [0, 1, 2, 3] } else { [0, 3, 2, 1] };
        let corners_m = order.map(|corner| mesh.positions[corner].to_array()).to_vec();
        Self { name: light.name.clone(), source: LightSource::Quad { corners_m } }
    }
}

/// Numbers the lights that share a name with an earlier one: an instance may be called `camera`, as is a light of the
/// stage. The second `camera` becomes `camera#2`, which no id can be.
pub(super) fn make_names_distinct(lights: &mut [PossibleLight]) {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for light in lights {
        let count = counts.entry(light.name.clone()).or_default();
        *count += 1;
        if *count > 1 {
            light.name = format!("{}#{count}", light.name);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_distinct() {
        let light = |name: &str| PossibleLight { name: name.to_owned(), source: LightSource::World {} };
        let mut lights = ["camera", "world", "camera", "camera"].map(light);
        make_names_distinct(&mut lights);
        assert_eq!(lights.map(|light| light.name), ["camera", "world", "camera#2", "camera#3"]);
    }
}
