//! Emitters: area lights on shapes, environment maps, constant environments, sun and sky.

use glam::{DMat3, DMat4};
use mateval_image::Wrap;
use mateval_scene::material::{ColorInput, TextureIndex};
use mateval_scene::reference::{Emission, EmissionMap, LightGroup, SurfaceIndex};

use super::color::ColorUse;
use super::document::Element;
use super::parameters::{COLORS, Parameters};
use super::reader::Reader;
use super::texture::all_texels;
use crate::missing_uv::mean_color;
use mateval_scene::findings::shortened;

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
        all_texels(&self.scene.textures[texture.0].texture, |texel| texel.iter().all(|v| *v >= 0.0))
    }

    fn mean_of(&self, texture: TextureIndex) -> [f32; 3] {
        mean_color(&self.scene.textures[texture.0].texture).map(|v| v as f32)
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
    pub(super) fn rotation(&mut self, transform: DMat4, place: &str) -> [[f32; 3]; 3] {
        let linear = DMat3::from_mat4(transform);
        let x = linear.x_axis.normalize_or(glam::DVec3::X);
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
}
