//! A de-lit photo: base colour from one photo of known geometry, by physics alone.
//!
//! In: the public geometry of a scene and its photo. Out: base colour, the light that falls on each pixel and the
//! radiance of each possible light. A few paths a pixel split the photo's light by lights ([`mateval_tracer::split`]);
//! a robust fit separates radiances from the colours of parts ([`mateval_light::joint_fit`]), with what the photo shows
//! of a lamp or of the sky as its radiance; the light, smooth once colours are taken out of it, is filtered; what
//! remains of the photo is base colour. Parts that are better explained with another roughness than the usual one get
//! it. All this changes what is assumed of surfaces that the photo does not show, so that the whole is repeated three
//! or four times. Where noise or reflections hide the base colour, it is drawn towards that of the part. Flat parts
//! that show what the photo shows elsewhere are mirrors.

mod files;
mod mirrors;
mod room;
mod surfaces;

use mateval_dataset::{Progress, Report};
use mateval_image::{LinearRgb, Mask, Picture};
use mateval_light::joint_fit::{JointFitRules, JointTarget, fit_jointly};
use mateval_tracer::noise_filter::{self, filtered_mean};
use mateval_tracer::{PhotoCache, split_light};

use crate::error::BaselineError;
use crate::estimate::Estimate;
use crate::geometry::SceneGeometry;
pub use files::{FittedLightsFile, write};
use mirrors::find_mirrors;
use room::PartRoom;
pub use room::{CandidateLights, FittedLight, LightSource, PossibleLight};
use surfaces::{Surfaces, USUAL_ROUGHNESS, choose_roughness, part_colors, settings};

/// How a photo is de-lit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DelightOptions {
    pub lights: CandidateLights,
    /// Paths per pixel of the rounds; the last one's number is that of further rounds.
    pub samples: [u32; 3],
    /// Whether radiance is read from the photo where a path meets what it shows. Without, colours are assumed there
    /// too.
    pub photo_cache: bool,
    /// The largest number of rounds.
    pub most_rounds: usize,
    /// How light and colour are separated.
    pub fit: JointFitRules,
}

impl Default for DelightOptions {
    fn default() -> Self {
        Self {
            lights: CandidateLights::Room,
            samples: [8, 16, 64],
            photo_cache: true,
            most_rounds: 4,
            fit: JointFitRules::default(),
        }
    }
}

/// A photo without its light. Pixels that are not valid are black; their roughness is 0.5 and their confidence 0.
#[derive(Clone, Debug)]
pub struct DelitPhoto {
    /// Linear, 0 to 1.
    pub base_color: Picture<LinearRgb>,
    /// Perceptual: the usual 0.5, another one that explains the part better, or a mirror's.
    pub roughness: Picture<f32>,
    /// 1 for mirrors, else 0.
    pub metallic: Picture<f32>,
    /// The radiance that a white surface would show, apart from what it mirrors, linear, before exposure. Divided by
    /// the base weight of the surface it is irradiance over pi.
    pub shading: Picture<LinearRgb>,
    /// The radiance that does not depend on base colour, linear, before exposure.
    pub gloss: Picture<LinearRgb>,
    /// How well the base colour is known, 0 to 1: a half where its standard error is 0.05.
    pub confidence: Picture<f32>,
    /// The possible lights: candidates of the room first, then those of the stage.
    pub lights: Vec<FittedLight>,
    /// The photo, linear, before exposure.
    pub photo: Picture<LinearRgb>,
    /// The pixels that are known.
    pub valid: Mask,
    /// Rounds of splitting and fitting.
    pub rounds: usize,
}

impl DelitPhoto {
    /// The photo as an estimate.
    pub fn estimate(self) -> Estimate {
        Estimate {
            base_color: Some(self.base_color),
            roughness: Some(self.roughness),
            metallic: Some(self.metallic),
            placement: None,
        }
    }
}

/// The change of a part's colour below which it is settled.
const SETTLED: f32 = 0.01;

/// De-lights the photo of a scene. Fails where the public files of the scene or its photo cannot be read. The bytes are
/// the same on any number of threads.
pub fn delight(
    geometry: &SceneGeometry<'_>,
    options: &DelightOptions,
    progress: Progress<'_>,
) -> Result<DelitPhoto, BaselineError> {
    let room = PartRoom::read(geometry, options.lights)?;
    run(&room, options, progress)
}

fn run(room: &PartRoom, options: &DelightOptions, progress: Progress<'_>) -> Result<DelitPhoto, BaselineError> {
    let nothing = room.valid.map(|_| false);
    let cached = if options.photo_cache { &room.valid } else { &nothing };
    let cache = PhotoCache::new(&room.world, &room.camera, &room.photo, cached)?;
    let mut surfaces = Surfaces::unknown(room.owners.len());
    let mut round = 0;
    let (fit, halves, light) = loop {
        let samples = options.samples[round.min(options.samples.len() - 1)];
        // Two independent halves, whose difference is the noise. The same paths in every round, so that a change is
        // none of noise.
        let half = |half: u64| {
            let settings = settings((samples / 2).max(1), half);
            let step = format!("round {}, half {}", round + 1, ["a", "b"][half as usize]);
            split_light(&room.world, &cache, &room.valid, surfaces.assumed(), &settings, &|done, total| {
                progress(Report::step(&step, done, total));
            })
        };
        let halves = [half(0)?, half(1)?];
        let (photo, valid, parts) = (&room.photo, &room.fitted, &room.parts);
        let target = JointTarget { photo, valid, parts, light: &halves, shown: &room.shown };
        let fit = fit_jointly(&options.fit, &target);
        // The weights of a basis: the radiances, and 1 for what the photo lights.
        let weights: Vec<[f64; 3]> = fit.radiances.iter().copied().chain([[1.0; 3]]).collect();
        let [a, b] = &halves;
        let halves = LightHalves {
            diffuse: [a.diffuse.weighted(&weights)?, b.diffuse.weighted(&weights)?],
            gloss: [a.gloss.weighted(&weights)?, b.gloss.weighted(&weights)?],
        };
        let light = fitted_light(room, &halves);
        let found = part_colors(room, &light.base_color);
        let changes = surfaces.colors.iter().flatten().zip(found.iter().flatten()).map(|(a, b)| (a - b).abs());
        let change = changes.fold(0.0, f32::max);
        surfaces.colors = found;
        round += 1;
        if round < options.samples.len() {
            surfaces.roughnesses = choose_roughness(room, &cache, &surfaces, &weights, progress)?;
        }
        if (round >= options.samples.len() && change <= SETTLED) || round >= options.most_rounds {
            break (fit, halves, light);
        }
    };
    // The pictures of the last round.
    let errors = standard_errors(room, &halves, &light);
    let mirrors = find_mirrors(room, &cache);
    let base_color = towards_parts(room, &light.base_color, &surfaces.colors, &errors);
    let part = |x: usize, y: usize| room.valid.get(x, y).then(|| room.parts.get(x, y));
    let mirror = |x: usize, y: usize| part(x, y).and_then(|part| mirrors.get(&part));
    let (width, height) = (room.photo.width(), room.photo.height());
    let lights = room.lights.iter().zip(&fit.radiances);
    Ok(DelitPhoto {
        base_color: Picture::from_fn(width, height, |x, y| {
            mirror(x, y).map_or(base_color.get(x, y), |mirror| LinearRgb(mirror.base_color))
        }),
        roughness: Picture::from_fn(width, height, |x, y| {
            let own = part(x, y).map_or(USUAL_ROUGHNESS, |part| surfaces.roughnesses[usize::from(part)]);
            mirror(x, y).map_or(own, |mirror| mirror.roughness)
        }),
        metallic: Picture::from_fn(width, height, |x, y| mirror(x, y).map_or(0.0, |_| 1.0)),
        photo: room.photo.clone(),
        valid: room.valid.clone(),
        shading: light.diffuse,
        gloss: light.gloss,
        confidence: errors.map(|error| 1.0 / (1.0 + (error / DOUBTFUL_ERROR).powi(2))),
        lights: lights.map(|(light, radiance)| FittedLight { light: light.clone(), radiance: *radiance }).collect(),
        rounds: round,
    })
}

/// The least shading, as a share of the photo's mean, that the photo is divided by.
const LEAST_SHADING: f32 = 1e-3;

/// Two independent halves of the light under fitted radiances: what a white surface would show, and what does not
/// depend on colour.
struct LightHalves {
    diffuse: [Picture<LinearRgb>; 2],
    gloss: [Picture<LinearRgb>; 2],
}

/// Their means, without noise, and the base colour that the photo has under this light.
struct RoundLight {
    diffuse: Picture<LinearRgb>,
    gloss: Picture<LinearRgb>,
    base_color: Picture<LinearRgb>,
}

/// The light without noise, and the photo divided by it.
fn fitted_light(room: &PartRoom, halves: &LightHalves) -> RoundLight {
    // The light does not depend on base colour.
    let surfaces =
        noise_filter::Surfaces { base_color: None, instances: &room.parts, normals: &room.normals, valid: &room.valid };
    let [diffuse, gloss] = [&halves.diffuse, &halves.gloss].map(|[a, b]| filtered_mean([a, b], &surfaces));
    let least = LEAST_SHADING * mean(room);
    let base_color = Picture::from_fn(room.photo.width(), room.photo.height(), |x, y| {
        if !room.valid.get(x, y) {
            return LinearRgb::default();
        }
        let [photo, diffuse, gloss] = [&room.photo, &diffuse, &gloss].map(|picture| picture.get(x, y).0);
        LinearRgb([0, 1, 2].map(|c| ((photo[c] - gloss[c]) / diffuse[c].max(least)).clamp(0.0, 1.0)))
    });
    RoundLight { diffuse, gloss, base_color }
}

/// The mean luminance of the photo's valid pixels, above 0.
fn mean(room: &PartRoom) -> f32 {
    /// Below it, squares of radiances would vanish in the numbers' precision.
    const LEAST: f64 = 1e-12;
    let valid = { room.photo.pixels().iter().zip(room.valid.pixels()) }.filter(|(_, valid)| **valid);
    let (sum, count) = valid.fold((0.0, 0.0), |(sum, count), (pixel, _)| (sum + pixel.luminance(), count + 1.0));
    (sum / f64::max(count, 1.0)).clamp(LEAST, f64::from(f32::MAX)) as f32
}

/// The standard error of base colour at which confidence is one half.
const DOUBTFUL_ERROR: f32 = 0.05;
/// The error of modelled light, as a share of the photo, and as a share of what is mirrored.
const MODEL_ERROR: f64 = 0.02;
const GLOSS_ERROR: f64 = 0.15;
/// The usual deviation of a pixel's colour from that of its part.
const PART_DEVIATION: f32 = 0.15;

/// The standard error of each pixel's base colour: from noise, estimated from the difference of both halves, and from
/// what the model of the light leaves out. Infinite where nothing is known.
fn standard_errors(room: &PartRoom, halves: &LightHalves, light: &RoundLight) -> Picture<f32> {
    /// Pixels on each side that the noise is averaged over.
    const REACH: usize = 2;
    let least = f64::from(LEAST_SHADING * mean(room));
    let halved = |[a, b]: &[Picture<LinearRgb>; 2], x, y| 0.5 * (a.get(x, y).luminance() - b.get(x, y).luminance());
    // Squares of the error, in f64: those of f32 vanish in dark photos.
    let noise = |x: usize, y: usize| {
        let shading = light.diffuse.get(x, y).luminance().max(least);
        let color = (room.photo.get(x, y).luminance() / shading).min(1.0);
        let difference = color * halved(&halves.diffuse, x, y) + halved(&halves.gloss, x, y);
        (difference / shading).powi(2)
    };
    let (width, height) = (room.photo.width(), room.photo.height());
    Picture::from_fn(width, height, |x, y| {
        if !room.valid.get(x, y) {
            return f32::INFINITY;
        }
        let columns = x.saturating_sub(REACH)..(x + REACH + 1).min(width);
        let (mut sum, mut count) = (0.0, 0.0);
        for row in y.saturating_sub(REACH)..(y + REACH + 1).min(height) {
            for column in columns.clone().filter(|&column| room.valid.get(column, row)) {
                sum += noise(column, row);
                count += 1.0;
            }
        }
        let [photo, shading, gloss] =
            [&room.photo, &light.diffuse, &light.gloss].map(|picture| picture.get(x, y).luminance());
        let model = (MODEL_ERROR * photo).powi(2) + (GLOSS_ERROR * gloss).powi(2);
        (sum / count + model / shading.max(least).powi(2)).sqrt() as f32
    })
}

/// Moves uncertain base colours towards the colour of their part: to the most likely ones, if the colours of a part
/// deviate from its own by [`PART_DEVIATION`].
fn towards_parts(
    room: &PartRoom,
    base_color: &Picture<LinearRgb>,
    parts: &[[f32; 3]],
    errors: &Picture<f32>,
) -> Picture<LinearRgb> {
    Picture::from_fn(room.photo.width(), room.photo.height(), |x, y| {
        if !room.valid.get(x, y) {
            return LinearRgb::default();
        }
        let (own, part) = (base_color.get(x, y).0, parts[usize::from(room.parts.get(x, y))]);
        // The share of what the pixel itself shows; no product of infinities.
        let share = 1.0 / (1.0 + (errors.get(x, y) / PART_DEVIATION).powi(2));
        LinearRgb([0, 1, 2].map(|c| share * own[c] + (1.0 - share) * part[c]))
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec2;
    use mateval_dataset::material::{
        ColorInput, Material, MaterialModel, PrincipledFlavour, ScalarInput, TextureIndex, UvTransform,
    };
    use mateval_dataset::reference::{
        Emission, LightGroup, MaterialIndex, ReferenceScene, SourceTexture, SurfaceIndex,
    };
    use mateval_dataset::{Camera, Intrinsics, TriangleMesh, splitmix64};
    use mateval_image::{Normal, Texels, Texture, Wrap};
    use mateval_testkit::scenes::{box_camera, box_quad, box_room};
    use mateval_tracer::{RenderSettings, World, aov, render};

    use super::room::NO_PART;
    use super::*;

    const SIZE: [u32; 2] = [96, 54];
    /// Lamps that bring less of the photo's light are not well known.
    const LEAST_SHARE: f64 = 0.05;

    /// Numbers in [0, 1) of a seed, one after the other.
    struct Numbers(u64, u64);

    impl Numbers {
        fn next(&mut self) -> f32 {
            self.1 += 1;
            (splitmix64::number(self.0, self.1) >> 40) as f32 / (1 << 24) as f32
        }

        fn between(&mut self, low: f32, high: f32) -> f32 {
            low + (high - low) * self.next()
        }
    }

    /// A room with its photo and what it is made of.
    struct Planted {
        room: PartRoom,
        truth: Picture<LinearRgb>,
        /// Of the lights of the room, in their order.
        radiances: Vec<[f32; 3]>,
    }

    /// A parallelogram with uvs in metres.
    fn textured(corner: [f32; 3], u: [f32; 3], v: [f32; 3]) -> TriangleMesh {
        let length = |side: [f32; 3]| side.iter().map(|v| v * v).sum::<f32>().sqrt();
        let mut mesh = box_quad(corner, u, v);
        let [w, h] = [length(u), length(v)];
        mesh.uvs = Some(vec![Vec2::ZERO, Vec2::new(w, 0.0), Vec2::new(w, h), Vec2::new(0.0, h)]);
        mesh
    }

    /// A block on the floor: its top and the four sides, one surface each.
    fn block(numbers: &mut Numbers) -> Vec<TriangleMesh> {
        let [w, h, d] = [numbers.between(0.4, 1.2), numbers.between(0.3, 1.0), numbers.between(0.4, 1.2)];
        let [x, z] = [numbers.between(0.2, 3.8 - w), numbers.between(0.3, 2.8)];
        vec![
            textured([x, h, z], [w, 0.0, 0.0], [0.0, 0.0, d]),
            textured([x, 0.0, z], [w, 0.0, 0.0], [0.0, h, 0.0]),
            textured([x, 0.0, z + d], [w, 0.0, 0.0], [0.0, h, 0.0]),
            textured([x, 0.0, z], [0.0, 0.0, d], [0.0, h, 0.0]),
            textured([x + w, 0.0, z], [0.0, 0.0, d], [0.0, h, 0.0]),
        ]
    }

    /// Tiles of 0.25 m about one colour, with a standard deviation of 20 %.
    fn texture(numbers: &mut Numbers) -> Texture {
        let color = [0, 1, 2].map(|_| numbers.between(0.15, 0.75));
        let mut texel = || {
            let tone = (0..4).map(|_| numbers.between(-1.0, 1.0)).sum::<f32>() * 0.17;
            color.map(|v| (v * libm::expf(tone)).clamp(0.02, 0.95))
        };
        Texture::new(16, 16, Texels::Linear((0..256).map(|_| texel()).collect()), Wrap::Repeat).unwrap()
    }

    /// The room of a seed, photographed with this many samples a pixel.
    fn planted(seed: u64, samples: u32) -> Planted {
        let mut numbers = Numbers(seed, 0);
        let mut more: Vec<TriangleMesh> = (0..4).flat_map(|_| block(&mut numbers)).collect();
        let lamps: Vec<usize> = (0..3).map(|k| 6 + more.len() + k).collect();
        for _ in &lamps {
            let [x, z] = [numbers.between(0.5, 3.0), numbers.between(0.5, 5.0)];
            more.push(textured([x, 2.2, z], [0.4, 0.0, 0.0], [0.0, 0.0, 0.4]));
        }
        let mut scene = box_room(more);
        scene.materials.clear();
        for (k, surface) in scene.surfaces.iter_mut().enumerate() {
            let mesh = &surface.mesh;
            let [a, b, _, d] = [0, 1, 2, 3].map(|k| mesh.positions[k].to_array());
            let side = |to: [f32; 3]| [0, 1, 2].map(|axis| to[axis] - a[axis]);
            surface.mesh = textured(a, side(b), side(d));
            surface.material = MaterialIndex(k);
            let uv = UvTransform([[0.25, 0.0, 0.0], [0.0, 0.25, 0.0]]);
            scene.textures.push(SourceTexture { name: k.to_string(), sha256: None, texture: texture(&mut numbers) });
            let model = MaterialModel::Principled {
                base_color: ColorInput::Texture { texture: TextureIndex(k), uv },
                roughness: ScalarInput::Constant(0.5),
                metallic: ScalarInput::Constant(0.0),
                specular: 0.5,
                flavour: PrincipledFlavour::Blender,
            };
            scene.materials.push(Material { name: String::new(), model, two_sided: true, opacity: None, bump: None });
        }
        // Lamps differ in radiance, and less in colour.
        let radiance = |numbers: &mut Numbers| {
            let all = numbers.between(2.0, 8.0);
            [0, 1, 2].map(|_| all * numbers.between(0.8, 1.25))
        };
        let radiances: Vec<[f32; 3]> = lamps.iter().map(|_| radiance(&mut numbers)).collect();
        let lit = |radiance: &dyn Fn(usize) -> [f32; 3], camera_visible| {
            let light = |(k, lamp): (usize, &usize)| LightGroup {
                name: format!("lamp_{k}"),
                emission: Emission::Area {
                    surfaces: vec![SurfaceIndex(*lamp)],
                    radiance: radiance(k),
                    map: None,
                    two_sided: true,
                },
                camera_visible,
            };
            let lights = lamps.iter().enumerate().map(light).collect();
            World::new(Arc::new(ReferenceScene { lights, ..scene.clone() })).unwrap()
        };
        // Photograph the room as it is, with lamps that the camera sees.
        let intrinsics = Intrinsics::from_fov_x(SIZE[0], SIZE[1], 60_f64.to_radians());
        let camera = Camera { intrinsics, ..box_camera() };
        let settings = RenderSettings { samples, seed, ..RenderSettings::default() };
        let photo = render(&lit(&|k| radiances[k], true), &camera, &settings, &|_, _| ()).unwrap().picture;
        let world = lit(&|_| [1.0; 3], false);
        let hit = |x: usize, y: usize| aov::hit_through(&world, &camera, aov::coarse_subpixels(x, y)[5]);
        let [width, height] = SIZE.map(|side| side as usize);
        let parts = Picture::from_fn(width, height, |x, y| hit(x, y).map_or(NO_PART, |hit| hit.surface.0 as u16));
        let normals = Picture::from_fn(width, height, |x, y| Normal(hit(x, y).unwrap().normal.to_array()));
        let valid = Mask::from_fn(width, height, |x, y| !lamps.contains(&usize::from(parts.get(x, y))));
        let truth = Picture::from_fn(width, height, |x, y| LinearRgb(mean_color(&scene, &world, &camera, x, y)));
        let light = |k: usize| PossibleLight {
            name: format!("lamp_{k}"),
            source: LightSource::Instance { instance: lamps[k].to_string() },
        };
        let lights = (0..lamps.len()).map(light).collect();
        let owners = (0..scene.surfaces.len()).collect();
        Planted {
            room: PartRoom {
                world,
                shown: vec![None; 3],
                lights,
                camera,
                photo,
                fitted: valid.clone(),
                valid,
                parts,
                normals,
                owners,
            },
            truth,
            radiances,
        }
    }

    fn mean_color(scene: &ReferenceScene, world: &World, camera: &Camera, x: usize, y: usize) -> [f32; 3] {
        let colors = aov::coarse_subpixels(x, y).map(|place| {
            let hit = aov::hit_through(world, camera, place).unwrap();
            let mesh = &scene.surfaces[hit.surface.0].mesh;
            let uv = mesh.uv_at(hit.triangle, hit.barycentrics).unwrap() * 0.25;
            scene.textures[hit.surface.0].texture.sample(uv.to_array())
        });
        [0, 1, 2].map(|c| colors.iter().map(|color| color[c]).sum::<f32>() / colors.len() as f32)
    }

    fn delit(planted: &Planted) -> DelitPhoto {
        run(&planted.room, &DelightOptions { samples: [4, 4, 16], ..DelightOptions::default() }, &|_| ()).unwrap()
    }

    /// PSNR over valid pixels of sRGB values, each channel at the linear scale that fits the truth best.
    fn aligned_psnr(found: &Picture<LinearRgb>, planted: &Planted) -> f64 {
        let valid = planted.room.valid.pixels();
        let pairs = || found.pixels().iter().zip(planted.truth.pixels()).zip(valid).filter(|(_, valid)| **valid);
        let scales = [0, 1, 2].map(|c| {
            let product: f64 = pairs().map(|((p, gt), _)| f64::from(p.0[c] * gt.0[c])).sum();
            product / pairs().map(|((p, _), _)| f64::from(p.0[c] * p.0[c])).sum::<f64>()
        });
        let shown = |color: LinearRgb, scales: [f64; 3]| {
            let scaled = [0, 1, 2].map(|c| ((f64::from(color.0[c]) * scales[c]) as f32).clamp(0.0, 1.0));
            Picture::filled(1, 1, LinearRgb(scaled)).to_srgb().get(0, 0).0
        };
        let errors = pairs().flat_map(|((p, gt), _)| {
            let (p, gt) = (shown(*p, scales), shown(*gt, [1.0; 3]));
            [0, 1, 2].map(|c| f64::from(p[c] - gt[c]).powi(2))
        });
        let errors: Vec<f64> = errors.collect();
        -10.0 * (errors.iter().sum::<f64>() / errors.len() as f64).log10()
    }

    fn median(mut values: Vec<f64>) -> f64 {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    }

    fn gain(found: &DelitPhoto, planted: &Planted) -> f64 {
        aligned_psnr(&found.base_color, planted) - aligned_psnr(&planted.room.photo, planted)
    }

    /// The share of each lamp in the light of the photo, if all surfaces were grey.
    fn shares(planted: &Planted) -> Vec<f64> {
        let room = &planted.room;
        let nothing = room.valid.map(|_| false);
        let cache = PhotoCache::new(&room.world, &room.camera, &room.photo, &nothing).unwrap();
        let surfaces = Surfaces::unknown(room.owners.len());
        let split =
            split_light(&room.world, &cache, &room.valid, surfaces.assumed(), &settings(8, 0), &|_, _| ()).unwrap();
        let brought = |(picture, radiance): (&Picture<LinearRgb>, &[f32; 3])| {
            f64::from(radiance.iter().sum::<f32>())
                * picture.pixels().iter().map(|pixel| pixel.luminance()).sum::<f64>()
        };
        let brought: Vec<f64> = split.diffuse.pictures().iter().zip(&planted.radiances).map(brought).collect();
        brought.iter().map(|one| one / brought.iter().sum::<f64>()).collect()
    }

    /// The base colour is at least 8 dB nearer to the truth than the photo is (the median), and no part is taken for a
    /// mirror. Radiances are less certain: lamps trade light with one another, and with the colours of what the photo
    /// does not show.
    #[test]
    fn planted_rooms_are_delit() {
        let (mut gains, mut errors) = (Vec::new(), Vec::new());
        for seed in 0..12 {
            let planted = planted(seed, 64);
            let found = delit(&planted);
            gains.push(gain(&found, &planted));
            let shares = shares(&planted);
            for (k, radiance) in planted.radiances.iter().enumerate().filter(|(k, _)| shares[*k] >= LEAST_SHARE) {
                let ratios = [0, 1, 2].map(|c| found.lights[k].radiance[c] / f64::from(radiance[c]));
                errors.push((ratios.iter().sum::<f64>() / 3.0 - 1.0).abs());
            }
            assert!(found.metallic.pixels().iter().all(|metallic| *metallic == 0.0), "a false mirror in room {seed}");
        }
        assert!(median(gains.clone()) >= 8.0, "{gains:?}");
        assert!(median(errors.clone()) <= 0.4, "{errors:?}");
    }

    /// Lamps that the photo shows are taken as they are shown; the base colour is then no worse than with fitted ones.
    #[test]
    fn shown_radiances_are_kept() {
        let mut planted = planted(1, 64);
        let fitted = gain(&delit(&planted), &planted);
        planted.room.shown = planted.radiances.iter().map(|radiance| Some(radiance.map(f64::from))).collect();
        let found = delit(&planted);
        for (k, radiance) in planted.radiances.iter().enumerate() {
            let found = &found.lights[k].radiance;
            let near = found.iter().zip(radiance).all(|(found, shown)| (found / f64::from(*shown) - 1.0).abs() < 0.1);
            assert!(near, "lamp {k}: {found:?} {radiance:?}");
        }
        let known = gain(&found, &planted);
        assert!(known >= fitted - 0.3, "{known} {fitted}");
    }

    /// A photo that shows no light, one that is far too bright, and one with nothing but its brightest values known.
    #[test]
    fn bad_photos_give_finite_colours() {
        // Any noise will do.
        let mut room = planted(2, 1).room;
        let sound = room.photo.clone();
        let photos: [(&str, &dyn Fn(f32) -> f32); 3] =
            [("black", &|_| 0.0), ("exposed a thousandfold", &|v| 1000.0 * v), ("clipped", &|v| v.min(0.2))];
        for (what, change) in photos {
            room.photo = sound.map(|LinearRgb(rgb)| LinearRgb(rgb.map(change)));
            let found = run(&room, &DelightOptions { samples: [2; 3], ..DelightOptions::default() }, &|_| ()).unwrap();
            for ((color, rest), _) in { found.base_color.pixels().iter().zip(found.roughness.pixels()) }
                .zip(room.valid.pixels())
                .filter(|(_, v)| **v)
            {
                assert!(color.0.iter().all(|v| (0.0..=1.0).contains(v)), "{what}: {color:?}");
                assert!((0.0..=1.0).contains(rest), "{what}: {rest}");
            }
            assert!(
                found.lights.iter().flat_map(|light| light.radiance).all(|v| v.is_finite() && v >= 0.0),
                "{what}: {:?}",
                found.lights
            );
            assert!(found.confidence.pixels().iter().all(|v| (0.0..=1.0).contains(v)), "{what}");
        }
    }
}
