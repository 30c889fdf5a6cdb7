//! Lights of `KHR_lights_punctual`: points as small spheres, spots as small discs, suns as discs in a map of the light
//! from outside.
//!
//! The extension's intensities are photometric, those of a scene are radiometric. They are converted as Blender's
//! importer and exporter do by default ("Standard" lighting mode of io_scene_gltf2 4.5): 683 lumens are one watt.

use std::f64::consts::PI;

use glam::{DMat3, DMat4, DVec3};
use gltf::khr_lights_punctual::{Kind, Light};
use mateval_dataset::material::{Material, MaterialModel, TextureIndex};
use mateval_dataset::reference::{Emission, LightGroup, MaterialIndex, SourceTexture, Surface, SurfaceIndex};
use mateval_dataset::{Role, TriangleMesh};
use mateval_image::{Texels, Texture, Wrap};

use super::reader::{LEFT_OUT, Omission, Reader};
use crate::primitives::{MapDisc, ROWS, disk, sphere};
use crate::source_scene::InstanceOrigin;
use crate::surface_mesh::to_world;

/// Luminous efficacy of green light of 540 THz (the SI's definition of the candela), which glTF's writers use for light
/// of any colour.
const LUMENS_PER_WATT: f64 = 683.0;

/// The radius of the spheres and discs in metres: that of an A60 bulb, so that shadows are as soft as a real lamp's.
const RADIUS: f64 = 0.03;

/// The diameter of a sun in degrees: one that covers some texels of the map.
const SUN_DEG: f64 = 1.0;

/// The name of the suns' light group.
const SUN: &str = "sun";

impl Reader<'_> {
    /// Adds the light of a node.
    pub(super) fn punctual(&mut self, light: &Light<'_>, world_from_node: DMat4, name: &str, pointer: &str) {
        let intensity = light.color().map(|channel| f64::from(channel) * f64::from(light.intensity()));
        if !intensity.iter().all(|value| (0.0..=1e12).contains(value)) {
            return self.omit(Omission::Visible, "lights that are negative or brighter than 1e12", LEFT_OUT, pointer);
        }
        if intensity == [0.0; 3] {
            return;
        }
        let message = "lights in photometric units, and emission of materials in a unit that writers disagree on";
        let action = "took 683 lm as 1 W, and emission of strength 1 as radiance 1, as Blender's exporter does";
        self.log.note("light_units", "/extensions/KHR_lights_punctual", message, action);
        if light.range().is_some() {
            self.omit(Omission::Slight, "ranges of lights", "let them shine on", pointer);
        }
        let radiant = intensity.map(|value| value / LUMENS_PER_WATT);
        let towards = -DMat3::from_mat4(world_from_node).z_axis.normalize_or_zero();
        match light.kind() {
            Kind::Point => {
                let power = radiant.map(|value| 4.0 * PI * value);
                let mesh = sphere(world_from_node.w_axis.truncate(), RADIUS);
                self.lamp(name, to_world(mesh, DMat4::IDENTITY, false).0, power, pointer);
            }
            Kind::Spot { inner_cone_angle, outer_cone_angle } => {
                let action = "made each a disc of equal power, which shines to one side";
                self.omit(Omission::Visible, "cones of spot lights", action, pointer);
                let solid_angle = spot_solid_angle(f64::from(inner_cone_angle), f64::from(outer_cone_angle));
                let power = radiant.map(|value| value * solid_angle);
                self.lamp(name, facing_disc(world_from_node.w_axis.truncate(), towards), power, pointer);
            }
            Kind::Directional => self.sun(-towards, radiant, pointer),
        }
    }

    /// Adds a surface that emits this power, in watts, on its front. The camera does not see it, and light passes
    /// through.
    fn lamp(&mut self, name: &str, mesh: TriangleMesh, power: [f64; 3], pointer: &str) {
        let area = mesh.area();
        if area <= 0.0 || !area.is_finite() {
            return self.omit(Omission::Visible, "lights without a place", LEFT_OUT, pointer);
        }
        let surface = SurfaceIndex(self.scene.surfaces.len());
        // A Lambertian surface emits pi times its radiance times its area.
        let radiance = power.map(|value| (value / (PI * area)) as f32);
        let emission = Emission::Area { surfaces: vec![surface], radiance, map: None, two_sided: false };
        if self.add_light(name, emission, false, pointer) {
            let material = self.clear_material();
            self.scene.surfaces.push(Surface { name: name.to_owned(), mesh, material });
            self.origins.push(InstanceOrigin { role: Role::LightFixture {}, ..InstanceOrigin::default() });
        }
    }

    fn clear_material(&mut self) -> MaterialIndex {
        let clear = Material::new("light", MaterialModel::clear());
        // The last material is that of the lamp before, if any.
        if self.scene.materials.last() != Some(&clear) {
            self.scene.materials.push(clear);
        }
        MaterialIndex(self.scene.materials.len() - 1)
    }

    /// Adds a sun in the direction `to_sun`, which lights a surface that faces it with `irradiance` in W/m^2. All suns
    /// share one map.
    fn sun(&mut self, to_sun: DVec3, irradiance: [f64; 3], pointer: &str) {
        let action = format!("spread each over {SUN_DEG} degree of a map of {}x{ROWS} texels", 2 * ROWS);
        self.omit(Omission::Slight, "suns without an extent", &action, pointer);
        let Some(disc) = MapDisc::new(to_sun, SUN_DEG) else {
            return self.omit(Omission::Visible, "suns without a direction", LEFT_OUT, pointer);
        };
        let Some(texture) = self.sun_map(pointer) else { return };
        let map = &mut self.scene.textures[texture.0].texture;
        let mut texels = match map.texels() {
            Texels::Linear(texels) => texels.clone(),
            _ => return,
        };
        for (index, share) in disc.shares {
            let values = irradiance.map(|value| (value * share / disc.solid_angle) as f32);
            texels[index].iter_mut().zip(values).for_each(|(texel, value)| *texel += value);
        }
        if let Ok(brighter) = Texture::new(map.width(), map.height(), Texels::Linear(texels), map.wrap()) {
            *map = brighter;
        }
    }

    /// The map of all suns, added to the scene with the first of them; absent if there are too many lights.
    fn sun_map(&mut self, pointer: &str) -> Option<TextureIndex> {
        let known = self.scene.lights.iter().find_map(|light| match light {
            LightGroup { emission: Emission::Environment { texture, .. }, .. } => Some(*texture),
            _ => None,
        });
        if known.is_some() {
            return known;
        }
        let dark = Texels::Linear(vec![[0.0; 3]; 2 * ROWS * ROWS]);
        let map = Texture::new(2 * ROWS, ROWS, dark, Wrap::Repeat).ok()?;
        let texture = TextureIndex(self.scene.textures.len());
        let world_from_environment = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let emission = Emission::Environment { texture, scale: 1.0, world_from_environment };
        if !self.add_light(SUN, emission, false, pointer) {
            return None;
        }
        Some(self.scene.add_texture(SourceTexture::computed(SUN, map)))
    }
}

/// The disc at `center` that faces `towards`.
fn facing_disc(center: DVec3, towards: DVec3) -> TriangleMesh {
    let (x, y) = towards.try_normalize().unwrap_or(DVec3::NEG_Z).any_orthonormal_pair();
    let world_from_disc = DMat4::from_cols(
        (x * RADIUS).extend(0.0),
        (y * RADIUS).extend(0.0),
        (x.cross(y) * RADIUS).extend(0.0),
        center.extend(1.0),
    );
    to_world(disk(), world_from_disc, false).0
}

/// The solid angle that a spot would light with its full intensity at the same power: the integral of the extension's
/// recommended attenuation, the square of a ramp in the cosine between both cones.
fn spot_solid_angle(inner: f64, outer: f64) -> f64 {
    let outer = outer.clamp(0.0, PI / 2.0);
    let (cos_inner, cos_outer) = (libm::cos(inner.clamp(0.0, outer)), libm::cos(outer));
    2.0 * PI * ((1.0 - cos_inner) + (cos_inner - cos_outer) / 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hard cone has the solid angle of its cap; with a ramp, the sum over thin rings agrees.
    #[test]
    fn power_of_spots() {
        assert!((spot_solid_angle(PI / 2.0, PI / 2.0) - 2.0 * PI).abs() < 1e-12);
        assert_eq!(spot_solid_angle(0.0, 0.0), 0.0);
        let (inner, outer) = (0.3_f64, 0.8_f64);
        let rings = 100_000;
        let ring = |at: u32| {
            let angle = (f64::from(at) + 0.5) * outer / f64::from(rings);
            let ramp = ((angle.cos() - outer.cos()) / (inner.cos() - outer.cos())).clamp(0.0, 1.0);
            2.0 * PI * angle.sin() * ramp * ramp * outer / f64::from(rings)
        };
        let sum: f64 = (0..rings).map(ring).sum();
        assert!((spot_solid_angle(inner, outer) - sum).abs() < 1e-6, "{sum}");
    }

    #[test]
    fn discs_face_their_direction() {
        for towards in [DVec3::NEG_Y, DVec3::X, DVec3::new(0.6, -0.8, 0.0)] {
            let mesh = facing_disc(DVec3::ONE, towards);
            assert!(mesh.geometric_normal(0).dot(towards) > 0.999_999);
            assert!((mesh.area() - PI * RADIUS * RADIUS).abs() < 1e-6);
        }
    }
}
