//! Redresses a scene: gives every part another material, drawn with a key, so that nobody can rebuild the truth from
//! public files.
//!
//! In: a scene as its reader gives it, and a [`RedressKey`]. Out: the same scene with other materials, textures and uv,
//! and [`Redressed`], which lists the surfaces whose truth follows from public files. Everything after it (conversion,
//! baking, rendering) sees an ordinary scene.
//!
//! [`surfaces`] finds what each surface is and how it is treated. Parts that look alike and are of one class share a
//! material, as the legs of a table do; [`materials`] draws it with numbers of [`secret`]. [`charts`] lays the parts of a
//! surface out in metres, and here their materials are evaluated there and become the surface's texture.

mod charts;
mod materials;
pub(crate) mod secret;
mod surfaces;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::Vec3;
use mateval_dataset::dataset::{Redressed, WeakReason, WeakSecret};
use mateval_dataset::material::{
    ColorInput, Material, MaterialClass, MaterialModel, PrincipledFlavour, ScalarInput, StatedParameters, TextureIndex,
    UvTransform,
};
use mateval_dataset::reference::{Emission, MaterialIndex, ReferenceScene, SourceTexture};
use mateval_dataset::{Finding, InstanceId, SceneId, Severity, TriangleMesh};
use mateval_image::transfer::{byte_from_unit, linear_from_srgb, srgb_from_linear};
use mateval_image::{ImageError, Texels, Texture, Wrap};
use mateval_sources::source_scene::{InstanceOrigin, SourceScene};
use mateval_sources::surface_mesh::connected_parts;
use mateval_tracer::repaint::SPECULAR;
use rayon::prelude::*;

use charts::{Block, Layout, Parts, texel_of};
use materials::{Drawn, Recoloring, Values};
pub(crate) use secret::RedressKey;
use surfaces::{Place, Treatment, class_of, is_leaf, lamps, place, treatment};

/// Colours of parts that differ by less, in sRGB, look alike.
const ALIKE: f32 = 0.12;
/// The most different materials for parts of one class and look.
const MOST_UNITS: usize = 4;
/// Roughness of opaque glass, within the range of its class (0.05 to 0.1).
const GLASS_ROUGHNESS: f64 = 0.08;

/// Parts that share a material.
struct Unit {
    /// The first source material that has the same parameters.
    look: usize,
    class: MaterialClass,
    place: Place,
    is_leaf: bool,
    /// Mean colour of its first part, sRGB.
    color: [f32; 3],
    drawn: Drawn,
}

/// A surface that has been laid out, for copies of it.
struct Laid {
    mesh: TriangleMesh,
    look: usize,
    /// Absent if one value is everywhere.
    layout: Option<Layout>,
    material: MaterialIndex,
}

struct Redresser<'a> {
    id: &'a SceneId,
    secret: &'a RedressKey,
    scene: &'a mut ReferenceScene,
    /// The source's materials and textures.
    materials: Vec<Material>,
    textures: Vec<Texture>,
    units: Vec<Unit>,
    laid: Vec<Laid>,
    /// New materials without a layout, by the source's and whether they are plain.
    others: BTreeMap<(usize, bool), MaterialIndex>,
    weak: WeakAreas,
    texel_m: f64,
}

/// Redresses the scene `id`. Fails where a picture of the private folder cannot be read.
pub(crate) fn redress(source: &mut SourceScene, id: &SceneId, secret: &RedressKey) -> Result<WeakAreas, ImageError> {
    let texel_m = texel_of(&source.camera);
    let read = &mut source.read;
    let lamps = lamps(&read.scene, &read.origins);
    let (materials, textures) = (read.scene.materials.clone(), read.scene.texture_list());
    let mut redresser = Redresser {
        id,
        secret,
        scene: &mut read.scene,
        materials,
        textures,
        units: Vec::new(),
        laid: Vec::new(),
        others: BTreeMap::new(),
        weak: WeakAreas::default(),
        texel_m,
    };
    for (at, origin) in read.origins.iter_mut().enumerate() {
        redresser.surface(at, origin, &lamps)?;
    }
    let weak = redresser.weak;
    keep_used(&mut read.scene);
    (source.states_roughness, source.states_metallic) = (true, true);
    Ok(weak)
}

/// Areas of surfaces whose truth follows, at least in part, from public files; in square metres.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct WeakAreas {
    /// The area of all surfaces with a base colour.
    total: f64,
    of: BTreeMap<(usize, WeakReason), f64>,
}

impl WeakAreas {
    fn add(&mut self, surface: usize, reason: WeakReason, area: f64) {
        *self.of.entry((surface, reason)).or_insert(0.0) += area;
    }

    /// The entry of `scene.json`. `ids` are those of all surfaces' instances.
    pub(crate) fn listed(&self, ids: &[InstanceId]) -> Redressed {
        let share = |area: f64| area / self.total.max(f64::MIN_POSITIVE);
        let weak = self.of.iter().map(|((surface, reason), area)| WeakSecret {
            instance: ids[*surface].clone(),
            reason: *reason,
            area_share: share(*area),
        });
        Redressed { weak_area_share: share(self.of.values().fold(0.0, |sum, area| sum + area)), weak: weak.collect() }
    }

    /// A note on every weak secret.
    pub(crate) fn findings(&self, file: &str, ids: &[InstanceId]) -> Vec<Finding> {
        let finding = |WeakSecret { instance, reason, area_share }: WeakSecret| {
            let why = match reason {
                WeakReason::Motif => "its picture is its point, so it has the source's in other colours",
                WeakReason::CutOut => "its picture also cuts it out, so it has the source's in other colours",
                WeakReason::Glass => "it is glass, so it has the source's colour",
                WeakReason::Kept => "it is a mirror, so it has the source's material",
            };
            let place = format!("instance '{instance}'");
            let action = format!("counted {:.1} % of the scene's area as a weak secret", 100.0 * area_share);
            Finding::new(Severity::Note, "weak_secret", file, place, why, action)
        };
        self.listed(ids).weak.into_iter().map(finding).collect()
    }
}

impl Redresser<'_> {
    fn surface(&mut self, at: usize, origin: &mut InstanceOrigin, lamps: &BTreeSet<usize>) -> Result<(), ImageError> {
        let surface = &self.scene.surfaces[at];
        let (material, area) = (surface.material.0, surface.mesh.area());
        let has_appearance = self.materials[material].has_appearance();
        self.weak.total += if has_appearance { area } else { 0.0 };
        match treatment(surface, &self.materials[material], &self.textures, origin, lamps.contains(&at)) {
            Treatment::Kept if has_appearance => self.weak.add(at, WeakReason::Kept, area),
            Treatment::Kept => {}
            Treatment::Recolored(reason) => {
                self.weak.add(at, reason, area);
                self.scene.surfaces[at].material = self.recolored(material);
            }
            Treatment::Plain => {
                self.scene.surfaces[at].material = self.plain(material);
                origin.stated = StatedParameters::default();
            }
            Treatment::Dressed => {
                self.dress(at, origin)?;
                origin.stated = StatedParameters::default();
            }
        }
        Ok(())
    }

    /// The material with its own picture in other colours.
    fn recolored(&mut self, material: usize) -> MaterialIndex {
        if let Some(known) = self.others.get(&(material, false)) {
            return *known;
        }
        let mut draw = self.secret.draw(self.id, &format!("recolored {material}"));
        let mut new = Material { name: self.new_name(), ..self.materials[material].clone() };
        if let Some(color) = main_color(&mut new) {
            match color {
                ColorInput::Constant(rgb) => *rgb = Recoloring::drawn(&[*rgb], &mut draw).of(*rgb),
                ColorInput::Texture { texture, .. } => {
                    let own = &self.textures[texture.0];
                    let colors: Vec<[f32; 3]> = own.linear_texels().collect();
                    let other = Recoloring::drawn(&colors, &mut draw);
                    let texels: Vec<[u8; 3]> = colors.iter().map(|rgb| other.of(*rgb).map(srgb_byte)).collect();
                    *texture = self.add_texture(own.width(), own.height(), Texels::Srgb8(texels), own.wrap());
                }
            }
        }
        let index = self.scene.add_material(new);
        self.others.insert((material, false), index);
        index
    }

    /// One drawn colour for a lamp.
    fn plain(&mut self, material: usize) -> MaterialIndex {
        if let Some(known) = self.others.get(&(material, true)) {
            return *known;
        }
        let mut draw = self.secret.draw(self.id, &format!("plain {material}"));
        let drawn = Drawn::plain(MaterialClass::Lacquer, Place::Thing, &mut draw);
        let source = self.materials[material].clone();
        let values = drawn.as_constant().expect("a plain material has one value");
        let index = self.add_constant(&source, values);
        self.others.insert((material, true), index);
        index
    }

    /// Gives each part of a surface the material of its unit.
    fn dress(&mut self, at: usize, origin: &mut InstanceOrigin) -> Result<(), ImageError> {
        let surface = self.scene.surfaces[at].clone();
        let source = self.materials[surface.material.0].clone();
        // Sources list a material again for each of its uses.
        let look = self.materials.iter().position(|other| other.model == source.model);
        let look = look.unwrap_or(surface.material.0);
        let of_triangle = origin.part_of_triangle.clone().unwrap_or_else(|| connected_parts(&surface.mesh));
        let place = place(&surface.name, origin);
        let mut units = Vec::new();
        for (part, (color, area)) in
            mean_colors(&surface.mesh, &of_triangle, &source, &self.textures).iter().enumerate()
        {
            let class = class_of(origin, part, &surface.name, &source);
            if class == MaterialClass::Glass {
                self.weak.add(at, WeakReason::Glass, *area);
            }
            units.push(self.unit(look, class, place, *color, &format!("{at}\0{}\0{part}", surface.name))?);
        }
        // Copies of a model have the layout of the first, made before it was moved.
        let shape = origin.shape.take().filter(|shape| shape.triangles == surface.mesh.triangles);
        let own = shape.as_deref().unwrap_or(&surface.mesh);
        let known = self.laid.iter().position(|laid| laid.look == look && laid.mesh == *own);
        let known = match known {
            Some(known) => known,
            None => {
                let is_constant: Vec<bool> =
                    units.iter().map(|unit| self.units[*unit].drawn.as_constant().is_some()).collect();
                let parts = Parts {
                    of_triangle: &of_triangle,
                    is_constant: &is_constant,
                    is_one_frame: matches!(place, Place::Floor | Place::Ceiling),
                    is_upright: place == Place::Wall,
                    texel_m: self.texel_m,
                };
                self.lay(own.clone(), &source, look, &units, &parts)?
            }
        };
        let laid = &self.laid[known];
        let dressed = &mut self.scene.surfaces[at];
        dressed.material = laid.material;
        if let Some(layout) = &laid.layout {
            dressed.mesh = layout.mesh(&surface.mesh);
        }
        origin.shape = match &laid.layout {
            Some(layout) => shape.map(|shape| Arc::new(layout.mesh(&shape))),
            None => shape,
        };
        Ok(())
    }

    /// The unit of a part that looks like this; a new one if there is none.
    fn unit(
        &mut self,
        look: usize,
        class: MaterialClass,
        place: Place,
        color: [f32; 3],
        part: &str,
    ) -> Result<usize, ImageError> {
        let is_leaf = is_leaf(class, color);
        let apart = |unit: &Unit| (0..3).map(|c| (unit.color[c] - color[c]).abs()).fold(0.0, f32::max);
        let same = (0..self.units.len()).filter(|at| {
            let unit = &self.units[*at];
            (unit.look, unit.class, unit.place, unit.is_leaf) == (look, class, place, is_leaf)
        });
        let same: Vec<usize> = same.collect();
        let nearest = same.iter().copied().min_by(|a, b| apart(&self.units[*a]).total_cmp(&apart(&self.units[*b])));
        if let Some(at) = nearest.filter(|at| apart(&self.units[*at]) < ALIKE || same.len() >= MOST_UNITS) {
            return Ok(at);
        }
        let mut draw = self.secret.draw(self.id, part);
        let drawn = match class {
            // What is seen through it is in its picture.
            MaterialClass::Glass => {
                let [red, green, blue] = color.map(|value| f64::from(linear_from_srgb(value)));
                Drawn::constant([red, green, blue, GLASS_ROUGHNESS, 0.0])
            }
            _ if is_leaf => Drawn::leaf(&mut draw),
            _ => Drawn::new(class, place, &self.secret.tiles, &mut draw)?,
        };
        self.units.push(Unit { look, class, place, is_leaf, color, drawn });
        Ok(self.units.len() - 1)
    }

    /// Lays out a surface and evaluates its materials there.
    fn lay(
        &mut self,
        mesh: TriangleMesh,
        source: &Material,
        look: usize,
        units: &[usize],
        parts: &Parts<'_>,
    ) -> Result<usize, ImageError> {
        let drawn: Vec<&Drawn> = units.iter().map(|unit| &self.units[*unit].drawn).collect();
        let first = drawn.first().and_then(|drawn| drawn.as_constant());
        let (layout, material) = match first.filter(|first| drawn.iter().all(|d| d.as_constant() == Some(*first))) {
            Some(values) => (None, self.add_constant(source, values)),
            None => {
                let layout = Layout::new(&mesh, parts);
                let Painted { colors, finishes, finish } = painted(&layout, &drawn);
                let [width, height] = layout.size;
                let uv = UvTransform::default();
                let texture = self.add_texture(width, height, Texels::Srgb8(colors), Wrap::Clamp);
                let base_color = ColorInput::Texture { texture, uv };
                let [roughness, metallic] = match finish {
                    Some(finish) => finish.map(ScalarInput::Constant),
                    None => {
                        let texture = self.add_texture(width, height, Texels::Linear8(finishes), Wrap::Clamp);
                        [0, 1].map(|channel| ScalarInput::Texture { texture, channel, uv })
                    }
                };
                (Some(layout), self.add_material(source, base_color, roughness, metallic))
            }
        };
        self.laid.push(Laid { mesh, look, layout, material });
        Ok(self.laid.len() - 1)
    }

    fn add_constant(&mut self, source: &Material, values: Values) -> MaterialIndex {
        let [red, green, blue, roughness, metallic] = values.map(|value| value as f32);
        let color = ColorInput::Constant([red, green, blue]);
        self.add_material(source, color, ScalarInput::Constant(roughness), ScalarInput::Constant(metallic))
    }

    /// A material of the scored model in place of `source`, whose bumps belong to its own uv.
    fn add_material(
        &mut self,
        source: &Material,
        base_color: ColorInput,
        roughness: ScalarInput,
        metallic: ScalarInput,
    ) -> MaterialIndex {
        let flavour = PrincipledFlavour::Blender;
        let model = MaterialModel::Principled { base_color, roughness, metallic, specular: SPECULAR, flavour };
        let name = self.new_name();
        self.scene.add_material(Material { name, model, bump: None, ..source.clone() })
    }

    /// A name that says nothing of the material.
    fn new_name(&self) -> String {
        format!("redressed {}", self.scene.materials.len() - self.materials.len())
    }

    fn add_texture(&mut self, width: usize, height: usize, texels: Texels, wrap: Wrap) -> TextureIndex {
        let name = format!("redressed {}", self.scene.textures.len() - self.textures.len());
        let texture = Texture::new(width, height, texels, wrap).expect("a layout has a texel for each of its places");
        self.scene.add_texture(SourceTexture::computed(name, texture))
    }
}

/// The colour that a material's picture is of.
fn main_color(material: &mut Material) -> Option<&mut ColorInput> {
    match &mut material.model {
        MaterialModel::Diffuse { reflectance, .. } => Some(reflectance),
        MaterialModel::Plastic { diffuse_reflectance, .. } => Some(diffuse_reflectance),
        MaterialModel::Principled { base_color, .. } => Some(base_color),
        _ => None,
    }
}

fn srgb_byte(linear: f32) -> u8 {
    byte_from_unit(srgb_from_linear(linear))
}

/// Mean colour, sRGB, and area of each part.
fn mean_colors(
    mesh: &TriangleMesh,
    of_triangle: &[usize],
    material: &Material,
    textures: &[Texture],
) -> Vec<([f32; 3], f64)> {
    let count = of_triangle.iter().max().map_or(0, |last| last + 1);
    let mut sums = vec![([0.0; 3], 0.0); count];
    let inside = [Vec3::new(4.0, 1.0, 1.0), Vec3::new(1.0, 4.0, 1.0), Vec3::new(1.0, 1.0, 4.0)].map(|w| w / 6.0);
    for (at, part) in of_triangle.iter().enumerate() {
        // Parts without an area have a colour too.
        let area = mesh.triangle_area(at).max(1e-12);
        let (sum, total) = &mut sums[*part];
        for uv in inside.map(|weights| mesh.uv_at(at, weights).unwrap_or_default()) {
            let Some(seen) = material.appearance(textures, uv) else { continue };
            (0..3).for_each(|c| sum[c] += area / 3.0 * f64::from(seen.base_color[c]));
        }
        *total += area;
    }
    let mean = |(sum, area): ([f64; 3], f64)| (sum.map(|sum| srgb_from_linear((sum / area.max(1e-12)) as f32)), area);
    sums.into_iter().map(mean).collect()
}

/// The texels of a layout.
struct Painted {
    /// sRGB.
    colors: Vec<[u8; 3]>,
    /// Roughness, metallic, 0.
    finishes: Vec<[u8; 3]>,
    /// Roughness and metallic, where they are the same everywhere.
    finish: Option<[f32; 2]>,
}

/// Rows of a block that one thread evaluates.
const ROWS: usize = 16;

fn painted(layout: &Layout, drawn: &[&Drawn]) -> Painted {
    let [width, height] = layout.size;
    let (mut colors, mut finishes) = (vec![[0; 3]; width * height], vec![[0; 3]; width * height]);
    let mut finish: Option<Option<[f32; 2]>> = None;
    for block in &layout.blocks {
        let Block { at: [x, y], size: [columns, rows], .. } = *block;
        let numbers: Vec<usize> = (0..rows).collect();
        let values = numbers.par_chunks(ROWS).map(|rows| {
            let row =
                |row: &usize| (0..columns).map(|column| block.place(column, *row, layout.texel_m)).collect::<Vec<_>>();
            drawn[block.part].at(&rows.iter().flat_map(row).collect::<Vec<_>>(), block.is_turned)
        });
        for (at, [red, green, blue, roughness, metallic]) in values.collect::<Vec<_>>().concat().into_iter().enumerate()
        {
            let texel = (y + at / columns) * width + x + at % columns;
            colors[texel] = [red, green, blue].map(|value| srgb_byte(value as f32));
            let own = [roughness as f32, metallic as f32];
            finishes[texel] = [byte_from_unit(own[0]), byte_from_unit(own[1]), 0];
            finish = Some(finish.unwrap_or(Some(own)).filter(|other| *other == own));
        }
    }
    Painted { colors, finishes, finish: finish.flatten() }
}

/// Drops materials and textures that nothing uses any more, so that none of the source's stay that were replaced.
fn keep_used(scene: &mut ReferenceScene) {
    let (old_materials, old_textures) = (std::mem::take(&mut scene.materials), std::mem::take(&mut scene.textures));
    let mut materials: BTreeMap<usize, MaterialIndex> = BTreeMap::new();
    for surface in &mut scene.surfaces {
        surface.material = *materials.entry(surface.material.0).or_insert_with(|| {
            scene.materials.push(old_materials[surface.material.0].clone());
            MaterialIndex(scene.materials.len() - 1)
        });
    }
    let mut textures: BTreeMap<usize, TextureIndex> = BTreeMap::new();
    let of_lights = scene.lights.iter_mut().filter_map(|light| match &mut light.emission {
        Emission::Area { map: Some(map), .. } => Some(&mut map.texture),
        Emission::Environment { texture, .. } => Some(texture),
        Emission::Area { map: None, .. } | Emission::Constant { .. } => None,
    });
    for index in scene.materials.iter_mut().flat_map(Material::texture_indices_mut).chain(of_lights) {
        // Readers check indices: one that leads nowhere stays so.
        let Some(texture) = old_textures.get(index.0) else { continue };
        *index = *textures.entry(index.0).or_insert_with(|| {
            scene.textures.push(texture.clone());
            TextureIndex(scene.textures.len() - 1)
        });
    }
}
