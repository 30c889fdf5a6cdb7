//! What `mateval baseline delight` has written for a scene.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_image::exr_io::{read_linear, read_scalar};
use mateval_image::{LinearRgb, Picture};
use mateval_scene::{SceneError, json};

use super::super::lights_file::{LIGHTS_FORMAT, LightsFile};
use super::super::part_room::PartRoom;
use super::super::surfaces::{Surfaces, part_colors};
use crate::error::BaselineError;

/// The pictures of the input view, and the lights.
pub(super) struct DelitPictures {
    /// Linear, 0 to 1.
    pub(super) base_color: Picture<LinearRgb>,
    roughness: Picture<f32>,
    metallic: Picture<f32>,
    pub(super) lights: LightsFile,
    /// The folder of the scene.
    folder: PathBuf,
}

/// Reads the lights alone.
pub(super) fn read_lights(folder: &Path) -> Result<LightsFile, BaselineError> {
    Ok(json::read_format(&folder.join("lights.json"), LIGHTS_FORMAT)?)
}

impl DelitPictures {
    /// Reads the pictures of a scene's folder. Values are brought into 0 to 1.
    pub(super) fn read(folder: &Path, lights: LightsFile) -> Result<Self, BaselineError> {
        let share = |v: f32| v.clamp(0.0, 1.0);
        let scalar = |name: &str| read_scalar(&folder.join(name)).map(|picture| picture.map(share));
        Ok(Self {
            base_color: read_linear(&folder.join("base_color.exr"))?.map(|color| LinearRgb(color.0.map(share))),
            roughness: scalar("roughness.exr")?,
            metallic: scalar("metallic.exr")?,
            lights,
            folder: folder.to_owned(),
        })
    }

    /// Fails unless the pictures and lights are those of `room`.
    pub(super) fn check(&self, room: &PartRoom) -> Result<(), BaselineError> {
        let other = |file: &str, what: String| {
            let what = format!("{what}; expected the output of `mateval baseline delight` for this dataset");
            Err(SceneError::Unsupported { path: self.folder.join(file), what }.into())
        };
        let size = [room.photo.width(), room.photo.height()];
        let sizes = [
            ("base_color.exr", [self.base_color.width(), self.base_color.height()]),
            ("roughness.exr", [self.roughness.width(), self.roughness.height()]),
            ("metallic.exr", [self.metallic.width(), self.metallic.height()]),
        ];
        if let Some((file, found)) = sizes.into_iter().find(|(_, found)| *found != size) {
            return other(file, format!("it has {}x{} pixels, the photo {}x{}", found[0], found[1], size[0], size[1]));
        }
        if !self.lights.names().eq(room.lights.iter().map(|light| light.name.as_str())) {
            return other("lights.json", "its lights are not those of the scene".to_owned());
        }
        if self.lights.lights.iter().flat_map(|fitted| fitted.radiance).any(|v| !(0.0..=1e30).contains(&v)) {
            return other("lights.json", "a radiance is negative or too large".to_owned());
        }
        Ok(())
    }

    /// The surfaces of the room: each with the median colour of its pixels, their roughness, and whether it is a metal.
    pub(super) fn surfaces(&self, room: &PartRoom) -> Surfaces {
        let colors = part_colors(room, &self.base_color);
        let mut surfaces = Surfaces { colors, ..Surfaces::unknown(room.owners.len()) };
        // All pixels of a part have one value.
        let known: BTreeMap<usize, (f32, f32)> = { room.parts.pixels().iter().zip(room.valid.pixels()) }
            .zip(self.roughness.pixels().iter().zip(self.metallic.pixels()))
            .filter(|((_, valid), _)| **valid)
            .map(|((part, _), (roughness, metallic))| (usize::from(*part), (*roughness, *metallic)))
            .collect();
        for (surface, (roughness, metallic)) in known {
            surfaces.roughnesses[surface] = roughness;
            surfaces.metals[surface] = metallic > 0.5;
        }
        surfaces
    }
}
