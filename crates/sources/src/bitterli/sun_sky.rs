//! Sun and sky, baked to a latitude-longitude map: the sky of Hosek and Wilkie, "An analytic model for full spectral
//! sky-dome radiance" (SIGGRAPH 2012, RGB data set, through the crate `hw-skymodel`), and a disc for the sun.

use std::f64::consts::PI;

use glam::{DMat3, DMat4, DVec3};
use hw_skymodel::rgb::{SkyParams, SkyState};
use mateval_image::{Texels, Texture, Wrap};
use mateval_scene::reference::Emission;

use super::parameters::Parameters;
use super::reader::Reader;
use super::sun::{self, CIE_Y_INTEGRAL, SUN_DIAMETER_DEG};
use super::transform::rotation;
use super::value;
use crate::primitives::{MapDisc, ROWS, texel_direction};

/// The parameters of the plugins `sunsky`, `sun` and `sky`.
#[derive(Clone, Copy, Debug)]
struct SunSky {
    /// Unit vector towards the sun in the map's frame (+y up), not below the horizon.
    sun: DVec3,
    turbidity: f64,
    albedo: [f64; 3],
    sky_scale: f64,
    sun_scale: f64,
    sun_diameter_deg: f64,
}

impl<'a> Reader<'a> {
    /// The environment of the plugin `sunsky`, `sun` or `sky`: radiance in Mitsuba's unit, black below the horizon.
    pub(super) fn sun_sky(&mut self, kind: &str, from: &mut Parameters<'a>) -> Option<(&'static str, Emission)> {
        let to_world = from.transform("to_world", &mut self.log);
        let world_from_map = self.world_from_map(to_world, &from.place);
        let sky = self.sun_sky_parameters(kind, from, world_from_map);
        from.ignore(&["resolution", "complex_sun", "extend"]);
        let message = format!("'{kind}' is approximated by a map of {}x{ROWS} texels", 2 * ROWS);
        let action = "used the sky of Hosek and Wilkie and, for the sun, a black body seen through the air of Preetham";
        self.log.note("approximated", &from.place, message, action);
        let texture = bake(&sky)?;
        let texture = self.add_texture("sunsky".to_owned(), texture);
        let world_from_environment = world_from_map.transpose().to_cols_array_2d().map(|row| row.map(|v| v as f32));
        Some(("sunsky", Emission::Environment { texture, scale: 1.0, world_from_environment }))
    }

    /// Up is +y in Mitsuba 0.x and +z in Mitsuba 3. The map's own up is always +y.
    fn world_from_map(&mut self, to_world: DMat4, place: &str) -> DMat3 {
        let rows = self.rotation(to_world, place);
        let world_from_local = DMat3::from_cols_array_2d(&rows.map(|row| row.map(f64::from))).transpose();
        if self.major_version == 0 { world_from_local } else { world_from_local * rotation(DVec3::X, PI / 2.0) }
    }

    fn sun_sky_parameters(&mut self, kind: &str, from: &mut Parameters<'a>, world_from_map: DMat3) -> SunSky {
        let log = &mut self.log;
        let mut within = |name, least, most| from.number_within(name, least, most, log);
        let turbidity = within("turbidity", 1.0, 10.0).unwrap_or(3.0);
        let scale = within("scale", 0.0, 1e6).unwrap_or(1.0);
        let mut part = |name, shines: bool| within(name, 0.0, 1e6).unwrap_or(1.0) * if shines { scale } else { 0.0 };
        let (sky_scale, sun_scale) = (part("sky_scale", kind != "sun"), part("sun_scale", kind != "sky"));
        let radius_scale = within("sun_radius_scale", 0.0, 100.0).unwrap_or(1.0);
        let aperture = within("sun_aperture", 1e-3, 60.0).unwrap_or(SUN_DIAMETER_DEG);
        if within("stretch", 1.0, 2.0).unwrap_or(1.0) != 1.0 {
            self.log.warn("unsupported", &from.place, "a stretched sky", "used stretch 1");
        }
        let albedo = self.ground_albedo(from);
        let sun = self.sun_direction(from, world_from_map);
        SunSky { sun, turbidity, albedo, sky_scale, sun_scale, sun_diameter_deg: aperture * radius_scale }
    }

    /// The default ground albedo is 0.15 in Mitsuba 0.x and 0.3 in Mitsuba 3.
    fn ground_albedo(&mut self, from: &mut Parameters<'a>) -> [f64; 3] {
        let default = if self.major_version == 0 { 0.15 } else { 0.3 };
        let Some(element) = from.take(&["albedo"]) else { return [default; 3] };
        let constant = self.constant(element, &from.place, super::color::ColorUse::Reflectance);
        constant.map_or([default; 3], |rgb| rgb.map(f64::from))
    }

    /// The direction towards the sun in the map's frame. A sun given by time and place is not supported.
    fn sun_direction(&mut self, from: &mut Parameters<'a>, world_from_map: DMat3) -> DVec3 {
        let given = from.take(&["sun_direction"]).map(|element| value::vector(element, 0.0));
        from.ignore(&["year", "month", "day", "hour", "minute", "second", "latitude", "longitude", "timezone"]);
        let fallback = DVec3::new(0.0, 1.0, 1.0).normalize();
        let direction = match given {
            Some(Ok(world)) => (world_from_map.transpose() * DVec3::from_array(world)).try_normalize(),
            _ => None,
        };
        let Some(direction) = direction else {
            let message = "expected a sunDirection, found none; a sun by time and place is not supported";
            self.log.warn("sun_by_time", &from.place, message, "put the sun 45 degrees high");
            return fallback;
        };
        if direction.y >= 0.0 {
            return direction;
        }
        self.log.warn("out_of_range", &from.place, "the sun is below the horizon", "put it on the horizon");
        direction.with_y(0.0).try_normalize().unwrap_or(DVec3::X)
    }
}

/// The map in linear Rec. 709, with rows from the zenith down and columns by u = atan2(x, -z) / (2 pi).
fn bake(sky: &SunSky) -> Option<Texture> {
    let columns = 2 * ROWS;
    let dome = Dome::new(sky)?;
    let mut texels = vec![[0.0_f32; 3]; columns * ROWS];
    for (index, texel) in texels.iter_mut().enumerate().take(columns * ROWS / 2) {
        *texel = dome.radiance(texel_direction(index % columns, index / columns, 0.5, 0.5)).map(|v| v as f32);
    }
    add_sun(&mut texels, sky);
    Texture::new(columns, ROWS, Texels::Linear(texels), Wrap::Repeat).ok()
}

/// Spreads the sun's power over the texels that its disc covers. As in Mitsuba, the power is that of a disc of the sun's
/// real size, whatever size is set.
fn add_sun(texels: &mut [[f32; 3]], sky: &SunSky) {
    let Some(disc) = MapDisc::new(sky.sun, sky.sun_diameter_deg) else { return };
    // Each covered texel takes its share of the power.
    let true_solid_angle = 2.0 * PI * (1.0 - libm::cos((SUN_DIAMETER_DEG / 2.0).to_radians()));
    let radiance = sun::radiance(libm::asin(sky.sun.y.clamp(0.0, 1.0)), sky.turbidity);
    for (index, share) in disc.shares {
        let factor = sky.sun_scale * share * true_solid_angle / disc.solid_angle;
        texels[index].iter_mut().zip(radiance).for_each(|(texel, value)| *texel += (value * factor) as f32);
    }
}

/// The sky without the sun.
struct Dome {
    parameters: [f32; 27],
    radiances: [f32; 3],
    sun: DVec3,
    scale: f64,
}

impl Dome {
    fn new(sky: &SunSky) -> Option<Self> {
        let elevation = libm::asin(sky.sun.y.clamp(0.0, 1.0)) as f32;
        let state = SkyState::new(&SkyParams {
            elevation: elevation.clamp(0.0, std::f32::consts::FRAC_PI_2),
            turbidity: sky.turbidity as f32,
            albedo: sky.albedo.map(|v| v as f32),
        });
        let (parameters, radiances) = state.ok()?.raw();
        Some(Self { parameters, radiances, sun: sky.sun, scale: sky.sky_scale / CIE_Y_INTEGRAL })
    }

    /// Formula 8 of the paper, in f64 and without the system's libm, so that every machine makes the same map.
    fn radiance(&self, direction: DVec3) -> [f64; 3] {
        let cos_theta = direction.y.max(0.0);
        let cos_gamma = direction.dot(self.sun).clamp(-1.0, 1.0);
        let gamma = libm::acos(cos_gamma);
        std::array::from_fn(|channel| {
            let p: [f64; 9] = std::array::from_fn(|i| f64::from(self.parameters[9 * channel + i]));
            let mie =
                (1.0 + cos_gamma * cos_gamma) / libm::pow((1.0 + p[8] * p[8] - 2.0 * p[8] * cos_gamma).max(1e-9), 1.5);
            let horizon = 1.0 + p[0] * libm::exp(p[1] / (cos_theta + 0.01));
            let rest = p[2]
                + p[3] * libm::exp(p[4] * gamma)
                + p[5] * cos_gamma * cos_gamma
                + p[6] * mie
                + p[7] * cos_theta.sqrt();
            (horizon * rest * f64::from(self.radiances[channel]) * self.scale).max(0.0)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::primitives::texel_solid_angle;

    fn sky(elevation_deg: f64) -> SunSky {
        let (sin, cos) = elevation_deg.to_radians().sin_cos();
        SunSky {
            sun: DVec3::new(0.0, sin, cos),
            turbidity: 3.0,
            albedo: [0.15; 3],
            sky_scale: 1.0,
            sun_scale: 1.0,
            sun_diameter_deg: SUN_DIAMETER_DEG,
        }
    }

    /// Radiance of Mitsuba 3.9.1's `sunsky` with the sun towards (0, cos, sin) of its z-up frame, here (0, sin, cos).
    #[test]
    fn the_sky_matches_mitsuba() {
        for (elevation, direction, expected) in [
            (30.0, [0.0, 1.0, 0.0], [0.01537107, 0.02916951, 0.05835234]),
            (30.0, [1.0, 0.3, 0.0], [0.04989075, 0.08438515, 0.13316135]),
            (30.0, [0.0, 1.0, 1.0], [0.09200407, 0.11382768, 0.1427064]),
            (60.0, [0.0, 0.5, -1.0], [0.03588565, 0.06781327, 0.131292]),
        ] {
            let found = Dome::new(&sky(elevation)).unwrap().radiance(DVec3::from_array(direction).normalize());
            for (found, expected) in found.into_iter().zip(expected) {
                assert!((found / expected - 1.0_f64).abs() < 0.05, "{elevation} {direction:?}: {found} {expected}");
            }
        }
    }

    #[test]
    fn the_map_is_finite_and_black_below() {
        for elevation in [0.0, 0.001, 30.0, 90.0] {
            let texture = bake(&sky(elevation)).unwrap();
            let Texels::Linear(texels) = texture.texels() else { panic!("expected floats") };
            assert!(texels.iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
            if elevation > 1.0 {
                assert!(texels[texels.len() / 2..].iter().all(|t| *t == [0.0; 3]));
            }
        }
    }

    /// The sun's power does not depend on its size in the map, and its centre is in the given direction.
    #[test]
    fn the_sun_has_its_power_and_direction() {
        for (elevation, diameter) in [(30.0, SUN_DIAMETER_DEG), (30.0, 4.0), (80.0, 0.0), (0.5, 3.0)] {
            let sky = SunSky { sky_scale: 0.0, sun_diameter_deg: diameter, ..sky(elevation) };
            let texture = bake(&sky).unwrap();
            let mut power = 0.0;
            let mut centre = DVec3::ZERO;
            for row in 0..ROWS {
                for column in 0..2 * ROWS {
                    let value = f64::from(texture.texel(column, row)[1]) * texel_solid_angle(row);
                    power += value;
                    centre += texel_direction(column, row, 0.5, 0.5) * value;
                }
            }
            let solid_angle = 2.0 * PI * (1.0 - (SUN_DIAMETER_DEG / 2.0).to_radians().cos());
            let expected = sun::radiance(elevation.to_radians(), 3.0)[1] * solid_angle;
            assert!((power / expected - 1.0).abs() < 1e-5, "{elevation} {diameter}: {power} {expected}");
            assert!(centre.normalize().dot(sky.sun) > 0.999_99, "{elevation} {diameter}");
        }
    }
}
