//! Lights: what surfaces glow with, and what shines from outside.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_image::exr_io::{self, Precision};
use mateval_image::{ImageError, LinearRgb, Picture, Texture};
use mateval_scene::reference::{Emission, LightGroup, ReferenceScene, SurfaceIndex};

use super::element::Element;
use super::remarks::Remarks;

/// What a surface glows with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Glow {
    radiance: [f32; 3],
    pub(super) two_sided: bool,
}

impl Glow {
    /// The emitter of a shape; it glows on the shape's front.
    pub(super) fn element(&self) -> Element {
        Element::plugin("emitter", "area").rgb("radiance", self.radiance)
    }
}

/// Which surfaces glow, and with what.
pub(super) fn glows(scene: &ReferenceScene, remarks: &mut Remarks) -> BTreeMap<SurfaceIndex, Glow> {
    let mut glows = BTreeMap::new();
    for (index, group) in scene.lights.iter().enumerate() {
        let place = place(index, group);
        if !group.camera_visible {
            let message = "Mitsuba cannot hide one light from the camera alone";
            remarks.warn("camera_invisible", &place, message, "wrote it visible");
        }
        let Emission::Area { surfaces, radiance, two_sided } = &group.emission else { continue };
        for surface in surfaces {
            glows.insert(*surface, Glow { radiance: *radiance, two_sided: *two_sided });
            let material = &scene.materials[scene.surfaces[surface.0].material.0];
            if material.opacity.is_some() {
                let message = "a masked surface glows; in Mitsuba it glows where it is masked out too";
                remarks.warn("masked_light", &place, message, "wrote it as it is");
            }
        }
    }
    glows
}

/// The light from far outside: Mitsuba takes one.
pub(super) fn distant(
    folder: &Path,
    scene: &ReferenceScene,
    textures: &[Texture],
    remarks: &mut Remarks,
) -> Result<Option<Element>, ImageError> {
    let mut found = None;
    for (index, group) in scene.lights.iter().enumerate() {
        let is_area = matches!(group.emission, Emission::Area { .. });
        if !is_area && found.is_some() {
            let message = "a second light from outside; Mitsuba takes one";
            remarks.warn("second_environment", &place(index, group), message, "left it out");
            continue;
        }
        match &group.emission {
            Emission::Area { .. } => {}
            Emission::Constant { radiance } => {
                found = Some(Element::plugin("emitter", "constant").rgb("radiance", *radiance));
            }
            Emission::Environment { texture, scale, world_from_environment } => {
                let picture = stretched(&textures[texture.0]);
                exr_io::write_linear(&folder.join("textures/environment.exr"), &picture, Precision::Float)?;
                let rows = world_from_environment.map(|[a, b, c]| [a.into(), b.into(), c.into(), 0.0]);
                let emitter = Element::plugin("emitter", "envmap")
                    .string("filename", "textures/environment.exr")
                    .float("scale", *scale)
                    .matrix("to_world", [rows[0], rows[1], rows[2], [0.0, 0.0, 0.0, 1.0]]);
                found = Some(emitter);
            }
        }
    }
    Ok(found)
}

fn place(index: usize, group: &LightGroup) -> String {
    format!("light {index} '{}'", group.name)
}

/// The map as Mitsuba 3 looks it up. Its rows lie at i / (rows - 1) of the way from pole to pole, ours at
/// (i + 0.5) / rows: with 2 * rows + 1 of them, ours are its odd ones, the even ones lie halfway between (at the poles,
/// where ours are held, they repeat the nearest), and linear interpolation between them gives the same everywhere.
fn stretched(texture: &Texture) -> Picture<LinearRgb> {
    let (width, height) = (texture.width(), texture.height());
    // Mitsuba wants two columns at least.
    Picture::from_fn(width.max(2), 2 * height + 1, |x, y| {
        let x = x % width;
        let above = texture.texel(x, (y.max(1) - 1) / 2);
        let below = texture.texel(x, (y / 2).min(height - 1));
        LinearRgb(std::array::from_fn(|c| 0.5 * (above[c] + below[c])))
    })
}

#[cfg(test)]
mod tests {
    use mateval_image::{Texels, Wrap};

    use super::*;

    /// Linear interpolation at every height gives the same from both pictures.
    #[test]
    fn stretching_changes_no_lookup() {
        let texture = Texture::new(1, 3, Texels::Grey(vec![1.0, 5.0, 2.0]), Wrap::Clamp).unwrap();
        let picture = stretched(&texture);
        assert_eq!((picture.width(), picture.height()), (2, 7));
        for step in 0..=60 {
            let v = step as f32 / 60.0;
            let ours = texture.sample([0.0, 1.0 - v])[0];
            let row = v * 6.0;
            let upper = (row as usize).min(5);
            let value = |row: usize| picture.get(1, row).0[0];
            let theirs = value(upper) + (row - upper as f32) * (value(upper + 1) - value(upper));
            assert!((ours - theirs).abs() < 1e-5, "{v}: {ours} {theirs}");
        }
    }
}
