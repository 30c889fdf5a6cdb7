//! Possible lights of a room whose lamps are unknown, from its public files.
//!
//! In: `scene.json`, the surfaces of the room and the instance that each belongs to, and which instances glow in a
//! picture. Out: light groups of radiance 1: one for each light fixture and each instance that glows, one for all
//! ceilings, and the world around. The true lamps of `lights.json` are not read.

use std::collections::BTreeMap;
use std::f32::consts::{PI, TAU};

use mateval_dataset::Role;
use mateval_dataset::dataset::SceneFile;
use mateval_dataset::material::TextureIndex;
use mateval_dataset::reference::{Emission, LightGroup, ReferenceScene, SourceTexture, SurfaceIndex};
use mateval_image::{Texels, Texture, Wrap};

/// The name of the group of all ceilings.
pub const CEILINGS: &str = "ceilings";
/// The name of the group of a world of one radiance; parts of a sky are numbered.
pub const WORLD: &str = "world";

/// Sectors of the sky: around, and above the horizon.
const SKY_SECTORS: [usize; 2] = [6, 2];
/// Texels of a quarter turn in the pictures of the sky.
const QUARTER: usize = 12;

/// What may glow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Candidate {
    /// An instance, by its place in the scene.
    Instance(usize),
    /// All ceilings.
    Ceilings,
    /// The world around, of one radiance.
    World,
    /// A sector of the sky.
    Sky(usize),
}

impl Candidate {
    /// Whether it is what one sees of the world in this direction.
    pub fn is_seen_towards(self, direction: [f32; 3]) -> bool {
        match self {
            Self::Instance(_) | Self::Ceilings => false,
            Self::World => true,
            Self::Sky(sector) => sector == sky_sector(direction),
        }
    }
}

/// Adds the possible lights to `room`, whose surface k belongs to instance `owners[k]` of the scene. `glows` says for
/// each instance whether a picture shows that it glows.
///
/// In houses, whose ceilings are known, the world has one radiance. Elsewhere the sky, which may be the only light, is
/// cut into sectors. Returns what each added light is.
pub fn add_candidates(
    room: &mut ReferenceScene,
    scene: &SceneFile,
    owners: &[usize],
    glows: &[bool],
) -> Vec<Candidate> {
    let mut candidates = Vec::new();
    let mut surfaces_of: BTreeMap<usize, Vec<SurfaceIndex>> = BTreeMap::new();
    for (surface, owner) in owners.iter().enumerate() {
        surfaces_of.entry(*owner).or_default().push(SurfaceIndex(surface));
    }
    let mut ceilings = Vec::new();
    for (owner, surfaces) in surfaces_of {
        let instance = &scene.instances[owner];
        if instance.role.is_ceiling() {
            ceilings.extend(surfaces);
        } else if matches!(instance.role, Role::LightFixture {}) || glows[owner] {
            room.lights.push(group(instance.id.as_str(), glowing(surfaces)));
            candidates.push(Candidate::Instance(owner));
        }
    }
    let is_house = scene.instances.iter().any(|instance| instance.role.is_architecture());
    if !ceilings.is_empty() {
        room.lights.push(group(CEILINGS, glowing(ceilings)));
        candidates.push(Candidate::Ceilings);
    }
    if is_house {
        room.lights.push(group(WORLD, Emission::Constant { radiance: [1.0; 3] }));
        candidates.push(Candidate::World);
        return candidates;
    }
    for (number, texture) in sky().into_iter().enumerate() {
        let emission = Emission::Environment {
            texture: TextureIndex(room.textures.len()),
            scale: 1.0,
            world_from_environment: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        };
        let name = format!("{WORLD}_{number}");
        room.textures.push(SourceTexture { name: name.clone(), sha256: None, texture });
        room.lights.push(group(&name, emission));
        candidates.push(Candidate::Sky(number));
    }
    candidates
}

/// The camera sees no candidate's emission: pixels that show emission are not valid.
fn group(name: &str, emission: Emission) -> LightGroup {
    LightGroup { name: name.to_owned(), emission, camera_visible: false }
}

fn glowing(surfaces: Vec<SurfaceIndex>) -> Emission {
    Emission::Area { surfaces, radiance: [1.0; 3], map: None, two_sided: true }
}

/// Pictures of the sphere of directions, each 1 in its sector and 0 elsewhere: everything below the horizon first.
fn sky() -> Vec<Texture> {
    let [width, height] = [4 * QUARTER, 2 * QUARTER];
    let [around, above] = SKY_SECTORS;
    (0..=around * above)
        .map(|number| {
            let sectors = (0..width * height).map(|k| sector_of_texel(k % width, k / width));
            let texels = Texels::Grey(sectors.map(|sector| f32::from(u8::from(sector == number))).collect());
            Texture::new(width, height, texels, Wrap::Repeat).expect("the number of texels is that of the size")
        })
        .collect()
}

fn sector_of_texel(x: usize, y: usize) -> usize {
    let [around, above] = SKY_SECTORS;
    if y >= QUARTER { 0 } else { 1 + y * above / QUARTER * around + x * around / (4 * QUARTER) }
}

/// The azimuth of a sector of the sky in degrees, from and to (0 is -Z, 90 is +X), and its elevation.
pub fn sky_extent_deg(sector: usize) -> [[f32; 2]; 2] {
    let [around, above] = SKY_SECTORS;
    let Some(place) = sector.checked_sub(1) else { return [[0.0, 360.0], [-90.0, 0.0]] };
    let (column, row) = ((place % around) as f32, (place / around) as f32);
    let [width, height] = [360.0 / around as f32, 90.0 / above as f32];
    [[column * width, (column + 1.0) * width], [90.0 - (row + 1.0) * height, 90.0 - row * height]]
}

/// The sector that a unit vector points to; see [`Emission::Environment`].
fn sky_sector([x, y, z]: [f32; 3]) -> usize {
    let turns = (libm::atan2f(x, -z) / TAU).rem_euclid(1.0);
    let down = libm::acosf(y.clamp(-1.0, 1.0)) / PI;
    let texel = |share: f32, count: usize| ((share * count as f32) as usize).min(count - 1);
    sector_of_texel(texel(turns, 4 * QUARTER), texel(down, 2 * QUARTER))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every direction is in one sector, and the sector's picture is 1 there, where the tracer looks it up.
    #[test]
    fn sectors_and_their_pictures_agree() {
        let sky = sky();
        assert_eq!(sky.len(), 13);
        for step in 0..500 {
            // Off the edges of texels, which are blended.
            let (turns, down) = (f64::from(step) * 0.618_034 % 1.0, (f64::from(step) + 0.5) / 500.0);
            let near_edge = |v: f64, texels: f64| (v * texels - (v * texels).round()).abs() < 0.02;
            let (azimuth, polar) = (turns * std::f64::consts::TAU, down * std::f64::consts::PI);
            if near_edge(turns, 4.0 * QUARTER as f64) || near_edge(down, 2.0 * QUARTER as f64) {
                continue;
            }
            let direction = [polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos()].map(|v| v as f32);
            let texel = |v: f64, texels: usize| (((v * texels as f64) as usize) as f32 + 0.5) / texels as f32;
            // Textures begin at the bottom.
            let uv = [texel(turns, 4 * QUARTER), 1.0 - texel(down, 2 * QUARTER)];
            for (number, picture) in sky.iter().enumerate() {
                let [azimuth_deg, elevation_deg] = sky_extent_deg(number);
                let holds = |[from, to]: [f32; 2], v: f64| (f64::from(from)..f64::from(to)).contains(&v.to_degrees());
                let is_inside =
                    holds(azimuth_deg, azimuth) && holds(elevation_deg, std::f64::consts::FRAC_PI_2 - polar);
                let expected = if number == sky_sector(direction) { 1.0 } else { 0.0 };
                assert_eq!(is_inside, expected > 0.0, "{turns} {down} sector {number}");
                let found = picture.sample(uv)[0];
                assert!((found - expected).abs() < 1e-4, "{turns} {down} sector {number}: {found}, not {expected}");
            }
        }
    }
}
