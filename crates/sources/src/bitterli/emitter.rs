//! Emitters: area lights on shapes, environment maps, constant environments, sun and sky.
//!
//! Sun and sky are baked to a latitude-longitude map: the sky of Hosek and Wilkie, "An analytic model for full spectral
//! sky-dome radiance" (SIGGRAPH 2012, RGB data set, through the crate `hw-skymodel`), and a disc for the sun. The sun's
//! radiance through the atmosphere is that of Preetham, Shirley and Smits, "A practical analytic model for daylight"
//! (SIGGRAPH 1999), appendix 2; its water vapour and mixed gases, which matter beyond 690 nm, are left out.

use std::f64::consts::PI;

use glam::{DMat3, DMat4, DVec3};
use hw_skymodel::rgb::{SkyParams, SkyState};
use mateval_dataset::material::{ColorInput, TextureIndex};
use mateval_dataset::reference::{Emission, EmissionMap, LightGroup, SurfaceIndex};
use mateval_files::untrusted::shortened;
use mateval_image::{Texels, Texture, Wrap};

use super::color::{CIE_Y_INTEGRAL, ColorUse, black_body, rec709_from_xyz};
use super::document::Element;
use super::reader::{COLORS, Parameters, Reader, rotation, vector};
use crate::primitives::{MapDisc, ROWS, texel_direction};

/// The mean angular diameter of the sun in degrees, seen from the Earth.
const SUN_DIAMETER_DEG: f64 = 0.5358;

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
    /// Adds the emitter of a shape, which emits on its front side. Returns whether its radiance could be read.
    pub(super) fn area_light(&mut self, element: &'a Element, surface: SurfaceIndex, owner: &str) -> bool {
        let mut from = self.parameters(element, format!("emitter of '{}'", shortened(owner)));
        let is_area = element.kind() == "area";
        let mut is_stated = is_area;
        if is_area {
            from.ignore(&["sampling_weight"]);
            let (radiance, map) = self.area_radiance(&mut from);
            is_stated &= !from.is_replaced(&["radiance"]) && !from.has_untaken(&COLORS);
            let emission = Emission::Area { surfaces: vec![surface], radiance, map, two_sided: false };
            self.add_light(LightGroup { name: owner.to_owned(), emission, camera_visible: true });
        } else {
            let message = format!("line {}: the emitter '{}' on a shape", element.line, shortened(element.kind()));
            self.log.warn("unknown_plugin", &from.place, message, "the shape does not emit");
            from.take_all();
        }
        from.finish(&mut self.log);
        is_stated
    }

    /// Adds an emitter that belongs to the scene and not to a shape.
    pub(super) fn scene_emitter(&mut self, element: &'a Element) {
        let mut from = self.parameters(element, element.place());
        from.ignore(&["sampling_weight"]);
        let is_environment = matches!(element.kind(), "envmap" | "constant" | "sunsky" | "sun" | "sky");
        if is_environment && self.has_environment {
            let message = format!("line {}: a second environment, '{}'", element.line, element.kind());
            self.log.warn("unsupported", &from.place, message, "left it out");
            return;
        }
        self.has_environment |= is_environment;
        let light = match element.kind() {
            "envmap" => self.environment_map(element, &mut from),
            "constant" => {
                let radiance = self.radiance(&mut from, "radiance", [1.0; 3]);
                Some(("constant", Emission::Constant { radiance }))
            }
            kind @ ("sunsky" | "sun" | "sky") => self.sun_sky(kind, &mut from),
            other => {
                let message = format!("line {}: the emitter '{}' is not supported", element.line, shortened(other));
                self.log.warn("unknown_plugin", &from.place, message, "left it out");
                from.take_all();
                None
            }
        };
        if let Some((name, emission)) = light {
            self.add_light(LightGroup { name: name.to_owned(), emission, camera_visible: true });
        }
        from.finish(&mut self.log);
    }

    /// The radiance of a shape: a constant, or 1 times a bitmap.
    fn area_radiance(&mut self, from: &mut Parameters<'a>) -> ([f32; 3], Option<EmissionMap>) {
        let Some(element) = from.take(&["radiance"]) else { return ([1.0; 3], None) };
        if element.tag != "texture" {
            let radiance = self.constant(element, &from.place, ColorUse::Emission);
            if radiance.is_none() {
                from.mark_replaced("radiance");
            }
            return (radiance.unwrap_or([1.0; 3]), None);
        }
        match self.color_bitmap(element, from, "radiance") {
            ColorInput::Constant(rgb) => (rgb, None),
            ColorInput::Texture { texture, uv } if self.is_not_negative(texture) => {
                ([1.0; 3], Some(EmissionMap { texture, uv }))
            }
            ColorInput::Texture { texture, .. } => {
                let message = format!("line {}: a texture with values below 0 as radiance", element.line);
                self.log.warn("out_of_range", &from.place, message, "used its mean colour, clamped at 0");
                from.mark_replaced("radiance");
                (self.mean_of(texture).map(|v| v.max(0.0)), None)
            }
        }
    }

    fn is_not_negative(&self, texture: TextureIndex) -> bool {
        self.scene.textures[texture.0].texture.linear_texels().flatten().all(|v| v >= 0.0)
    }

    fn mean_of(&self, texture: TextureIndex) -> [f32; 3] {
        self.scene.textures[texture.0].texture.mean().map(|v| v as f32)
    }

    /// The radiance of a constant environment.
    fn radiance(&mut self, from: &mut Parameters<'a>, name: &str, default: [f32; 3]) -> [f32; 3] {
        let Some(element) = from.take(&[name]) else { return default };
        if element.tag != "texture" {
            return self.constant(element, &from.place, ColorUse::Emission).unwrap_or(default);
        }
        let message = format!("line {}: a texture as radiance", element.line);
        self.log.warn("unsupported", &from.place, message, "used its mean colour");
        match self.color_bitmap(element, from, name) {
            ColorInput::Constant(rgb) => rgb,
            ColorInput::Texture { texture, .. } => self.mean_of(texture).map(|v| v.max(0.0)),
        }
    }

    fn environment_map(&mut self, element: &'a Element, from: &mut Parameters<'a>) -> Option<(&'static str, Emission)> {
        let name = from.string("filename").unwrap_or("");
        let scale = from.number_within("scale", 0.0, 1e9, &mut self.log).unwrap_or(1.0) as f32;
        let to_world = from.transform("to_world", &mut self.log);
        let world_from_environment = self.rotation(to_world, &from.place);
        from.ignore(&["cache", "gamma", "mis_compensation"]);
        let picture =
            self.file(name).and_then(|file| Ok((self.read_picture(&file, false, Wrap::Repeat, false)?, file)));
        match picture {
            Ok((texture, file)) => {
                let texture = self.add_texture(file, texture);
                Some(("environment", Emission::Environment { texture, scale, world_from_environment }))
            }
            Err(fault) => {
                self.report_file(name, &from.place, element.line, &fault, "left the environment out");
                None
            }
        }
    }

    /// The rotation of a transform, row-major. Scale and shear are reported.
    fn rotation(&mut self, transform: DMat4, place: &str) -> [[f32; 3]; 3] {
        let linear = DMat3::from_mat4(transform);
        let x = linear.x_axis.normalize_or(DVec3::X);
        let y = (linear.y_axis - x * x.dot(linear.y_axis)).try_normalize().unwrap_or(x.any_orthonormal_vector());
        let z = x.cross(y);
        // A reflection is kept, since its axes are orthonormal too.
        let rotation = DMat3::from_cols(x, y, if z.dot(linear.z_axis) < 0.0 { -z } else { z });
        let miss = (rotation - linear).to_cols_array().iter().fold(0.0_f64, |worst, v| worst.max(v.abs()));
        if miss > 1e-4 {
            let message = "the emitter's to_world contains scale or shear";
            self.log.warn("not_a_rotation", place, message, "used its rotation alone");
        }
        rotation.transpose().to_cols_array_2d().map(|row| row.map(|v| v as f32))
    }

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
        let constant = self.constant(element, &from.place, ColorUse::Reflectance);
        constant.map_or([default; 3], |rgb| rgb.map(f64::from))
    }

    /// The direction towards the sun in the map's frame. A sun given by time and place is not supported.
    fn sun_direction(&mut self, from: &mut Parameters<'a>, world_from_map: DMat3) -> DVec3 {
        let given = from.take(&["sun_direction"]).map(|element| vector(element, 0.0));
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

/// Spreads the sun's power over the texels that its disc covers. As in Mitsuba, the power is that of a disc of the
/// sun's real size, whatever size is set.
fn add_sun(texels: &mut [[f32; 3]], sky: &SunSky) {
    let Some(disc) = MapDisc::new(sky.sun, sky.sun_diameter_deg) else { return };
    // Each covered texel takes its share of the power.
    let true_solid_angle = 2.0 * PI * (1.0 - libm::cos((SUN_DIAMETER_DEG / 2.0).to_radians()));
    let radiance = sun_radiance(libm::asin(sky.sun.y.clamp(0.0, 1.0)), sky.turbidity);
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

const SUN_KELVIN: f64 = 5778.0;

/// Ozone absorption in 1/cm every 20 nm from 440 nm (Preetham's table 2).
const OZONE: [f64; 18] = [
    0.003, 0.009, 0.014, 0.021, 0.04, 0.063, 0.08, 0.103, 0.12, 0.115, 0.12, 0.09, 0.067, 0.048, 0.028, 0.018, 0.011,
    0.009,
];

/// Linear Rec. 709 radiance of the sun's disc `elevation` radians above the horizon, in Mitsuba's unit: W/(m^2 sr nm)
/// weighted by the CIE curves and divided by [`CIE_Y_INTEGRAL`]. Not negative.
fn sun_radiance(elevation: f64, turbidity: f64) -> [f64; 3] {
    let zenith_deg = 90.0 - elevation.max(0.0).to_degrees();
    // Kasten's relative optical mass.
    let mass = 1.0 / (libm::sin(elevation.max(0.0)) + 0.15 * libm::pow(93.885 - zenith_deg, -1.253)).max(1e-4);
    let mut xyz = [0.0; 3];
    for step in 0..=40 {
        let nanometres = 380.0 + 10.0 * f64::from(step);
        let value = black_body(nanometres, SUN_KELVIN) * transmittance(nanometres, mass, turbidity);
        xyz.iter_mut().zip(cie_1931(nanometres)).for_each(|(sum, weight)| *sum += value * weight * 10.0);
    }
    rec709_from_xyz(xyz.map(|v| v / CIE_Y_INTEGRAL)).map(|v| v.max(0.0))
}

fn transmittance(nanometres: f64, mass: f64, turbidity: f64) -> f64 {
    let micrometres = nanometres / 1000.0;
    let rayleigh = 0.008735 * libm::pow(micrometres, -4.08);
    let aerosol = (0.04608 * turbidity - 0.04586).max(0.0) * libm::pow(micrometres, -1.3);
    let ozone = 0.35 * ozone(nanometres);
    libm::exp(-mass * (rayleigh + aerosol + ozone))
}

fn ozone(nanometres: f64) -> f64 {
    let at = (nanometres - 440.0) / 20.0;
    if at < 0.0 || at >= (OZONE.len() - 1) as f64 {
        return 0.0;
    }
    let (lower, part) = (at.floor() as usize, at.fract());
    OZONE[lower] * (1.0 - part) + OZONE[lower + 1] * part
}

/// The CIE 1931 colour matching functions, after Wyman, Sloan and Shirley, "Simple analytic approximations to the CIE
/// XYZ color matching functions" (JCGT 2013).
fn cie_1931(nanometres: f64) -> [f64; 3] {
    let bump = |height: f64, centre: f64, below: f64, above: f64| {
        let t = (nanometres - centre) * if nanometres < centre { below } else { above };
        height * libm::exp(-0.5 * t * t)
    };
    [
        bump(0.362, 442.0, 0.0624, 0.0374) + bump(1.056, 599.8, 0.0264, 0.0323) - bump(0.065, 501.1, 0.0490, 0.0382),
        bump(0.821, 568.8, 0.0213, 0.0247) + bump(0.286, 530.9, 0.0613, 0.0322),
        bump(1.217, 437.0, 0.0845, 0.0278) + bump(0.681, 459.0, 0.0385, 0.0725),
    ]
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
            let expected = sun_radiance(elevation.to_radians(), 3.0)[1] * solid_angle;
            assert!((power / expected - 1.0).abs() < 1e-5, "{elevation} {diameter}: {power} {expected}");
            assert!(centre.normalize().dot(sky.sun) > 0.999_99, "{elevation} {diameter}");
        }
    }

    /// The radiance at the centre of the disc in Mitsuba 3.9.1's `sunsky`, which uses a newer, measured sun.
    #[test]
    fn near_mitsubas_newer_model() {
        for (elevation, turbidity, expected) in [
            (30.0_f64, 3.0, [20274.0, 15950.0, 10618.0]),
            (60.0, 3.0, [21873.0, 18316.0, 14106.0]),
            (90.0, 2.0, [22524.0, 19106.0, 15102.0]),
            (45.0, 1.0, [22129.0, 18244.0, 13410.0]),
        ] {
            let found = sun_radiance(elevation.to_radians(), turbidity);
            for (found, expected) in found.into_iter().zip(expected) {
                assert!((found / expected - 1.0).abs() < 0.4, "{elevation} {turbidity}: {found} {expected}");
            }
        }
    }

    #[test]
    fn the_sun_reddens_and_dims_towards_the_horizon() {
        let [high, low] = [60.0_f64, 5.0].map(|deg| sun_radiance(deg.to_radians(), 3.0));
        assert!(low[1] < high[1] && low[2] / low[0] < high[2] / high[0]);
        for elevation in [-1.0, 0.0, f64::EPSILON, 1.0, 2.0] {
            for turbidity in [1.0, 10.0] {
                assert!(sun_radiance(elevation, turbidity).iter().all(|v| v.is_finite() && *v >= 0.0));
            }
        }
    }

    #[test]
    fn curves_have_the_integral_that_spectra_are_divided_by() {
        let sum: f64 = (0..=400).map(|step| cie_1931(380.0 + f64::from(step))[1]).sum();
        assert!((sum / CIE_Y_INTEGRAL - 1.0).abs() < 0.01, "{sum}");
    }
}
