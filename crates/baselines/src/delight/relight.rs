//! A room lit anew: the de-lit photo under its fitted lights, which may be dimmed one by one.
//!
//! In: the public geometry of a scene, its photo, and the pictures and lights that [`super::write`] has written. Out:
//! the room under all lights, and under each of the strongest alone. Light that reaches a place by way of other
//! surfaces is traced with the colours of their parts; nothing is read from the photo but the glow of lamps, what is
//! seen through windows, and pixels without a known surface, such as glass.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::open::Dataset;
use mateval_dataset::{Progress, Report, SceneError, json};
use mateval_files::FileError;
use mateval_files::work_folder::WorkFolder;
use mateval_image::exr_io::{Precision, read_linear, read_scalar, write_linear};
use mateval_image::png_io::jpeg_bytes;
use mateval_image::png_io::write_srgb;
use mateval_image::{LinearRgb, Picture};
use mateval_pages::{figure, plain};
use mateval_tracer::{PhotoCache, SplitLight, split_light};

use super::files::{LIGHTS_FORMAT, LightsFile, exposed};
use super::room::{LightSource, PartRoom, PossibleLight};
use super::surfaces::{Surfaces, part_colors, settings};
use super::{filtered, weighted};
use crate::error::BaselineError;
use crate::geometry::SceneGeometry;
use crate::submission::check_new_place;

/// A light that shines more or less than it was fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct Dimmed {
    /// Its name in `lights.json`.
    pub name: String,
    /// The factor of its radiance, 0 or more.
    pub factor: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub struct RelightOptions {
    /// The lights that are dimmed; of two entries of one name, the last one counts.
    pub dimmed: Vec<Dimmed>,
    /// Paths per pixel, in two halves: an odd number is rounded down.
    pub samples: u32,
}

impl Default for RelightOptions {
    fn default() -> Self {
        Self { dimmed: Vec::new(), samples: 64 }
    }
}

/// Lights every scene whose folder exists in `pictures`, the output of [`super::write`]. `out` receives
/// `index.html` and for each scene `relit.exr`, the same as PNG, and `photo.png`. Returns the number of scenes.
///
/// Fails where `pictures` holds no scene of the dataset, or where no scene has a light of a name in `options`.
pub fn write(
    dataset: &Dataset,
    pictures: &Path,
    out: &Path,
    options: &RelightOptions,
    progress: Progress<'_>,
) -> Result<usize, BaselineError> {
    check_new_place(dataset, out)?;
    let scenes = scenes(dataset, pictures)?;
    check_names(pictures, &scenes, &options.dimmed)?;
    let work = WorkFolder::start(out)?;
    let mut shown = Vec::new();
    let count = scenes.len();
    for (at, (scene, lights)) in scenes.into_iter().enumerate() {
        progress(Report::part(&format!("scene {}", scene.id), at, count));
        let delit = DelitPictures::read(&pictures.join(scene.id.as_str()), lights)?;
        let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene)?;
        let room = PartRoom::read(&geometry, delit.lights.candidates)?;
        let factors: Vec<f64> = delit.lights.names().map(|name| factor(&options.dimmed, name)).collect();
        let relit = relight(&room, &delit, &factors, options.samples, progress)?;
        let folder = work.path().join(scene.id.as_str());
        std::fs::create_dir_all(&folder).map_err(FileError::io("make", &folder))?;
        let exposure = scene.exposure as f32;
        write_linear(&folder.join("relit.exr"), &relit.whole, Precision::Float)?;
        write_srgb(&folder.join("relit.png"), &exposed(&relit.whole, exposure))?;
        write_srgb(&folder.join("photo.png"), &exposed(&room.photo, exposure))?;
        shown.push(section(scene, &relit, &delit, &factors));
    }
    let index = work.path().join("index.html");
    std::fs::write(&index, html(&shown)).map_err(FileError::io("write", &index))?;
    work.finish()?;
    Ok(shown.len())
}

/// The scenes of the dataset that were de-lit, with their lights.
fn scenes<'a>(dataset: &'a Dataset, pictures: &Path) -> Result<Vec<(&'a SceneFile, LightsFile)>, BaselineError> {
    let folder = |scene: &SceneFile| pictures.join(scene.id.as_str());
    let delit = dataset.scenes.iter().filter(|scene| folder(scene).is_dir());
    let scenes: Vec<_> =
        delit.map(|scene| Ok((scene, read_lights(&folder(scene))?))).collect::<Result<_, BaselineError>>()?;
    if scenes.is_empty() { Err(BaselineError::NothingDelit(pictures.to_owned())) } else { Ok(scenes) }
}

fn check_names(pictures: &Path, scenes: &[(&SceneFile, LightsFile)], dimmed: &[Dimmed]) -> Result<(), BaselineError> {
    let known: BTreeSet<&str> = scenes.iter().flat_map(|(_, lights)| lights.names()).collect();
    let unknown: Vec<String> = dimmed
        .iter()
        .filter(|dimmed| !known.contains(dimmed.name.as_str()))
        .map(|dimmed| dimmed.name.clone())
        .collect();
    if unknown.is_empty() {
        return Ok(());
    }
    let known = known.into_iter().map(str::to_owned).collect();
    Err(BaselineError::NoLight { folder: pictures.to_owned(), unknown, known })
}

fn factor(dimmed: &[Dimmed], name: &str) -> f64 {
    dimmed.iter().rev().find(|dimmed| dimmed.name == name).map_or(1.0, |dimmed| dimmed.factor)
}

/// The scene on the page. Lights without a slider shine as their factors state.
fn section(scene: &SceneFile, relit: &RelitPhoto, delit: &DelitPictures, factors: &[f64]) -> Shown {
    let exposure = scene.exposure as f32;
    let sliders = relit.strongest.iter().map(|lit| Slider {
        light: delit.lights.lights[lit.light].light.clone(),
        factor: factors[lit.light],
        picture: ScaledPicture::new(&lit.picture, exposure),
    });
    Shown {
        id: scene.id.to_string(),
        size: [relit.whole.width(), relit.whole.height()],
        lights: sliders.collect(),
        rest: ScaledPicture::new(&relit.rest, exposure),
    }
}

/// The pictures of the input view, and the lights.
struct DelitPictures {
    /// Linear, 0 to 1.
    base_color: Picture<LinearRgb>,
    roughness: Picture<f32>,
    metallic: Picture<f32>,
    lights: LightsFile,
    /// The folder of the scene.
    folder: PathBuf,
}

fn read_lights(folder: &Path) -> Result<LightsFile, BaselineError> {
    Ok(json::read_format(&folder.join("lights.json"), LIGHTS_FORMAT)?)
}

impl DelitPictures {
    /// Reads the pictures of a scene's folder. Values are brought into 0 to 1.
    fn read(folder: &Path, lights: LightsFile) -> Result<Self, BaselineError> {
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
    fn check(&self, room: &PartRoom) -> Result<(), BaselineError> {
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
    fn surfaces(&self, room: &PartRoom) -> Surfaces {
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

/// The number of lights that get a picture of their own.
const MOST_PICTURES: usize = 8;

/// A light's share of the picture.
struct LitPicture {
    /// The light's place in `lights.json`.
    light: usize,
    /// Linear radiance, before exposure.
    picture: Picture<LinearRgb>,
}

/// A room under its lights.
struct RelitPhoto {
    /// The lights that bring most to the valid pixels, as they were fitted; the strongest first.
    strongest: Vec<LitPicture>,
    /// The sum of the other lights, each times its factor, and the photo where a pixel shows neither a known surface
    /// nor a light's emission, such as glass.
    rest: Picture<LinearRgb>,
    /// The room with each light times its factor.
    whole: Picture<LinearRgb>,
}

/// Lights the room anew. `factors` holds one factor for each light. Fails if `delit` does not belong to the room.
fn relight(
    room: &PartRoom,
    delit: &DelitPictures,
    factors: &[f64],
    samples: u32,
    progress: Progress<'_>,
) -> Result<RelitPhoto, BaselineError> {
    delit.check(room)?;
    let lit = LitRoom { room, base_color: &delit.base_color, halves: halves(room, delit, samples, progress)? };
    let fitted: Vec<[f64; 3]> = delit.lights.lights.iter().map(|light| light.radiance).collect();
    // Find the lights that bring most.
    let mut shares: Vec<(usize, f64)> =
        (0..fitted.len()).map(|light| (light, lit.share(light, fitted[light]))).collect();
    shares.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    shares.retain(|(_, share)| *share > 0.0);
    let strongest: Vec<usize> = shares.iter().take(MOST_PICTURES).map(|(light, _)| *light).collect();
    // Draw each of them alone, the others together, and all of them dimmed.
    let picture_of = |shines: &dyn Fn(usize) -> f64| {
        let factors: Vec<f64> = (0..fitted.len()).map(shines).collect();
        lit.picture(&fitted, &factors)
    };
    let alone = |light: usize| picture_of(&|other| f64::from(u8::from(other == light)));
    let others = picture_of(&|light| if strongest.contains(&light) { 0.0 } else { factors[light] })?;
    let dimmed = picture_of(&|light| factors[light])?;
    let strongest = strongest.into_iter().map(|light| Ok(LitPicture { light, picture: alone(light)? }));
    let strongest = strongest.collect::<Result<_, BaselineError>>()?;
    Ok(RelitPhoto { strongest, rest: lit.with_unknown(&others), whole: lit.with_unknown(&dimmed) })
}

/// Two independent halves of the room's light, each light at radiance 1. Nothing is read from the photo.
fn halves(
    room: &PartRoom,
    delit: &DelitPictures,
    samples: u32,
    progress: Progress<'_>,
) -> Result<[SplitLight; 2], BaselineError> {
    let nothing = room.valid.map(|_| false);
    let cache = PhotoCache::new(&room.world, &room.camera, &room.photo, &nothing)?;
    let surfaces = delit.surfaces(room);
    let half = |seed: u64| {
        let settings = settings((samples / 2).max(1), seed);
        split_light(&room.world, &cache, &room.valid, surfaces.assumed(), &settings, &|done, total| {
            progress(Report::step(["light, half a", "light, half b"][seed as usize], done, total));
        })
    };
    Ok([half(0)?, half(1)?])
}

/// A room with its light and base colours.
struct LitRoom<'a> {
    room: &'a PartRoom,
    base_color: &'a Picture<LinearRgb>,
    halves: [SplitLight; 2],
}

impl LitRoom<'_> {
    /// The sum over pixels of the luminance that a light brings.
    fn share(&self, light: usize, radiance: [f64; 3]) -> f64 {
        let [half, _] = &self.halves;
        let [diffuse, gloss] = [&half.diffuse, &half.gloss].map(|basis| basis.pictures()[light].pixels());
        let lit = diffuse.iter().zip(gloss).zip(self.base_color.pixels());
        let brought = lit.map(|((diffuse, gloss), color)| {
            let by = |c: usize| radiance[c] as f32 * (color.0[c] * diffuse.0[c] + gloss.0[c]);
            LinearRgb([by(0), by(1), by(2)]).luminance()
        });
        brought.sum()
    }

    /// The room under lights of these radiances, each times its factor, and their glow where the photo shows it.
    fn picture(&self, radiances: &[[f64; 3]], factors: &[f64]) -> Result<Picture<LinearRgb>, BaselineError> {
        let room = self.room;
        let weights = radiances.iter().zip(factors).map(|(radiance, factor)| radiance.map(|v| v * factor));
        // The last picture would be that of the photo as a light, which this room lacks.
        let weights: Vec<[f64; 3]> = weights.chain([[0.0; 3]]).collect();
        let halves = weighted(&self.halves, &weights)?;
        let (diffuse, gloss) = (filtered(room, &halves.diffuse), filtered(room, &halves.gloss));
        Ok(Picture::from_fn(room.photo.width(), room.photo.height(), |x, y| {
            if room.valid.get(x, y) {
                let [color, diffuse, gloss] = [self.base_color, &diffuse, &gloss].map(|picture| picture.get(x, y).0);
                return LinearRgb([0, 1, 2].map(|c| (color[c] * diffuse[c] + gloss[c]).max(0.0)));
            }
            let factor = room.emission.get(x, y).map_or(0.0, |light| factors[light] as f32);
            LinearRgb(room.photo.get(x, y).0.map(|v| v * factor))
        }))
    }

    /// A picture of known pixels, completed by the photo.
    fn with_unknown(&self, known: &Picture<LinearRgb>) -> Picture<LinearRgb> {
        let room = self.room;
        Picture::from_fn(known.width(), known.height(), |x, y| {
            let is_known = room.valid.get(x, y) || room.emission.get(x, y).is_some();
            if is_known { known.get(x, y) } else { room.photo.get(x, y) }
        })
    }
}

/// Mixes the pictures of the lights.
const MIX: &str = include_str!("mix_lights.js");
const QUALITY: u8 = 90;
/// The largest value that a picture of the page holds, times exposure; 1 is white. Brighter pixels stay white until
/// their light is dimmed to an eighth.
const BRIGHTEST: f32 = 8.0;

/// A scene on the page.
struct Shown {
    id: String,
    /// The size of the pictures in pixels.
    size: [usize; 2],
    /// The lights with a slider.
    lights: Vec<Slider>,
    /// The picture of what no slider changes.
    rest: ScaledPicture,
}

struct Slider {
    light: PossibleLight,
    /// Where it stands at first.
    factor: f64,
    picture: ScaledPicture,
}

/// A picture as a `data:` address, divided by a number.
struct ScaledPicture {
    address: String,
    divisor: f32,
}

impl ScaledPicture {
    /// A linear picture, whose brightest value is stored as 1. It has 1 to 65,535 pixels a side.
    fn new(picture: &Picture<LinearRgb>, exposure: f32) -> Self {
        let largest = picture.pixels().iter().flat_map(|pixel| pixel.0).fold(0.0, f32::max);
        let divisor = (largest * exposure).clamp(f32::MIN_POSITIVE, BRIGHTEST);
        let stored = picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| (v * exposure / divisor).clamp(0.0, 1.0))));
        let bytes = stored.to_srgb().map(|pixel| pixel.0.map(|v| (v * 255.0).round() as u8));
        let jpeg = jpeg_bytes(&bytes, QUALITY).expect("pictures of views have 1 to 65,535 pixels a side");
        Self { address: format!("data:image/jpeg;base64,{}", base64::encode(jpeg)), divisor }
    }

    fn img(&self, role: &str) -> String {
        format!("<img hidden alt=\"\" data-{role}=\"{}\" src=\"{}\">", self.divisor, self.address)
    }
}

/// The page. Ids and names of lights contain no characters that are special in HTML.
fn html(scenes: &[Shown]) -> String {
    let introduction = "Each slider multiplies the radiance of one light; 1 is as it was fitted.";
    plain("Rooms lit anew", introduction, &scenes.iter().map(room_section).collect::<String>(), MIX)
}

fn room_section(Shown { id, size: [width, height], lights, rest }: &Shown) -> String {
    let mut text = format!("<section class=\"relit\"><h2>{id}</h2><div class=\"row\">\n");
    text.push_str(&figure(&format!("{id}/photo.png"), id, "The photo"));
    text.extend([
        format!(
            "<figure><canvas width=\"{width}\" height=\"{height}\" role=\"img\" aria-label=\"The room lit anew, {id}\">"
        ),
        format!("</canvas><noscript><img src=\"{id}/relit.png\" alt=\"The room lit anew, {id}\"></noscript>"),
        "<figcaption>The room lit anew</figcaption></figure></div>\n<div class=\"lights\">\n".to_owned(),
        rest.img("rest"),
    ]);
    text.extend(lights.iter().map(|Slider { light, factor, picture }| {
        let most = factor.max(2.0);
        let input = format!("<input type=\"range\" min=\"0\" max=\"{most}\" step=\"any\" value=\"{factor}\">");
        let label = label(light);
        format!("{}<label><span>{label}</span>{input}<output>{factor:.2}</output></label>\n", picture.img("light"))
    }));
    text.push_str("</div><button type=\"button\">All sliders to 1</button></section>\n");
    text
}

/// The light's name, and what shines where the name does not state it.
fn label(PossibleLight { name, source }: &PossibleLight) -> String {
    match source {
        LightSource::Instance { .. } | LightSource::Ceilings {} | LightSource::World {} => name.clone(),
        LightSource::Sky { azimuth_deg: [from, to], elevation_deg: [low, high] } => {
            format!("{name}: sky, azimuth {from}° to {to}°, elevation {low}° to {high}°")
        }
        LightSource::Quad { .. } => format!("{name}: light stage"),
    }
}
