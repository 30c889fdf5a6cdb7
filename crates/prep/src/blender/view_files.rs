//! Reads the pictures that Blender made of a view from its multi-layer EXR files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_image::{ImageError, LinearRgb, Normal, Picture, exr_io};

/// Pictures of light: under all lights together, and under each light group alone.
#[derive(Clone, Debug, PartialEq)]
pub struct LightPictures {
    /// Linear radiance under all lights.
    pub rgb: Picture<LinearRgb>,
    /// One picture per group of `lights.json`. They add up to `rgb`, except where each was denoised on its own.
    pub groups: Vec<Picture<LinearRgb>>,
}

/// The pictures that Blender makes of a view.
#[derive(Clone, Debug, PartialEq)]
pub struct BlenderView {
    /// Distance along the camera's axis at pixel centres, in metres; 0 for the background.
    pub depth: Picture<f32>,
    /// World-space shading normal at pixel centres; 0 for the background.
    pub normal: Picture<Normal>,
    /// Instance index at pixel centres; 0 for the background.
    pub instance: Picture<u16>,
    /// Part index at pixel centres; 0 for the background.
    pub part: Picture<u16>,
    /// base_color at pixel centres, linear, taken from the materials that are lit; 0 where a material has none.
    pub base_color: Picture<LinearRgb>,
    /// Two halves, rendered independently.
    pub halves: [LightPictures; 2],
    /// The mean of the halves, denoised.
    pub denoised: LightPictures,
}

/// Reads the files in the view's folder. Fails where a number is not finite.
pub fn read(folder: &Path, groups: usize) -> Result<BlenderView, ImageError> {
    let geometry = Passes::read(folder.join("geometry.exr"))?;
    let [a, b] = ["a.exr", "b.exr"].map(|name| Passes::read(folder.join(name)));
    let (a, b) = (a?, b?);
    let denoised = Passes::read(folder.join("denoised.exr"))?;
    let instance = geometry.ids("instance")?;
    Ok(BlenderView {
        depth: without_background(&geometry.number("Depth")?, &instance),
        normal: without_background(&geometry.triple("Normal", ["X", "Y", "Z"])?, &instance).map(Normal),
        part: geometry.ids("part")?,
        instance,
        base_color: Passes::read(folder.join("centre.exr"))?.color("base_color")?,
        halves: [a.light(groups)?, b.light(groups)?],
        denoised: denoised.light(groups)?,
    })
}

/// The picture with 0 for the background, where Blender's depth is 10^10.
fn without_background<T: Copy + Default>(picture: &Picture<T>, instance: &Picture<u16>) -> Picture<T> {
    Picture::from_fn(picture.width(), picture.height(), |x, y| match instance.get(x, y) {
        0 => T::default(),
        _ => picture.get(x, y),
    })
}

/// The passes of one file.
struct Passes {
    path: PathBuf,
    channels: BTreeMap<String, Picture<f32>>,
}

impl Passes {
    fn read(path: PathBuf) -> Result<Self, ImageError> {
        let channels = exr_io::read_channels(&path)?;
        Ok(Self { path, channels })
    }

    /// A channel of a pass. Its name in the file may be prefixed with that of the view layer.
    fn channel(&self, pass: &str, channel: &str) -> Result<&Picture<f32>, ImageError> {
        let wanted = format!("{pass}.{channel}");
        let is_it = |name: &str| name == wanted || name.strip_suffix(&wanted).is_some_and(|rest| rest.ends_with('.'));
        let found = self.channels.iter().find(|(name, _)| is_it(name)).map(|(_, picture)| picture);
        let fault = |what: String| ImageError::Invalid { path: self.path.clone(), what };
        let Some(found) = found else {
            let names: Vec<&str> = self.channels.keys().map(String::as_str).collect();
            return Err(fault(format!("expected a channel {wanted}, found {}", names.join(", "))));
        };
        match found.pixels().iter().position(|value| !value.is_finite()) {
            None => Ok(found),
            Some(at) => {
                let (x, y) = (at % found.width(), at / found.width());
                Err(fault(format!("{wanted}: pixel ({x}, {y}) is NaN or infinite; expected finite numbers")))
            }
        }
    }

    fn triple(&self, pass: &str, names: [&str; 3]) -> Result<Picture<[f32; 3]>, ImageError> {
        let [a, b, c] = names.map(|name| self.channel(pass, name));
        let (a, b, c) = (a?, b?, c?);
        Ok(Picture::from_fn(a.width(), a.height(), |x, y| [a.get(x, y), b.get(x, y), c.get(x, y)]))
    }

    fn color(&self, pass: &str) -> Result<Picture<LinearRgb>, ImageError> {
        Ok(self.triple(pass, ["R", "G", "B"])?.map(LinearRgb))
    }

    /// A pass with one channel. Its name depends on the kind of pass: `V`, `Z` or `X`.
    fn number(&self, pass: &str) -> Result<Picture<f32>, ImageError> {
        let first = self.channel(pass, "V");
        let found =
            first.or_else(|error| self.channel(pass, "Z").or_else(|_| self.channel(pass, "X")).map_err(|_| error));
        found.cloned()
    }

    fn ids(&self, pass: &str) -> Result<Picture<u16>, ImageError> {
        // Integers of 16 bits are exact as floats; the cast clamps any other number to 16 bits.
        Ok(self.number(pass)?.map(|value| value.round() as u16))
    }

    fn light(&self, groups: usize) -> Result<LightPictures, ImageError> {
        let group = |at: usize| self.color(&format!("Combined_group_{at:02}"));
        Ok(LightPictures { rgb: self.color("Combined")?, groups: (0..groups).map(group).collect::<Result<_, _>>()? })
    }
}
