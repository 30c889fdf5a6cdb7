//! Reads a textured glTF as a donor: base colour, roughness and metallic of the default scene's triangles, with vertex
//! colours, `KHR_texture_transform` and `EXT_texture_webp`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::{DMat4, DVec3, Mat2, Vec2, Vec3};
use gltf::Semantic;
use gltf::material::PbrSpecularGlossiness;
use gltf::mesh::Mode;
use mateval_dataset::gltf_file::{GltfFile, INSTANCING, first_numbers, indices, numbers, parse, triangles, view_bytes};
use mateval_dataset::obj::Glow;
use mateval_dataset::specular_glossiness::{SpecularGlossiness, SpecularTextures, textures};
use mateval_files::source_folder::SourceFolder;
use mateval_files::untrusted::shortened;
use mateval_image::texture_io::{Encoding, texture_and_alpha_of_bytes, texture_of_bytes};
use mateval_image::{Texture, Wrap};

use super::donor::{
    Donor, DonorGroup, DonorMaterial, DonorTriangle, ImportError, MAX_FILE_BYTES, MAX_TRIANGLES, Scalar, check_most,
    count_texels, is_unit, out_of_range, shift_near,
};

/// Largest number of vertices in a file; a mesh that several nodes share counts for each of them.
const MAX_VERTICES: usize = 3 * MAX_TRIANGLES;
/// Largest depth of the tree of nodes.
const MAX_DEPTH: usize = 64;

/// Reads the file `name` of the folder. `shift` is subtracted from positions that lie near it.
pub fn read(folder: &mut SourceFolder, name: &str, shift: DVec3) -> Result<Donor, ImportError> {
    let bytes = folder.read(name)?;
    let file = parse(&bytes)?;
    let beside = name.rsplit_once('/').map_or("", |(beside, _)| beside);
    let mut reader = Reader { folder, beside, buffers: Vec::new(), textures: BTreeMap::new(), texels: 0 };
    let mut bytes = 0;
    for buffer in file.document.buffers() {
        let read = reader.buffer(&buffer, file.blob.as_deref())?;
        bytes += read.len();
        check_most(bytes, MAX_FILE_BYTES as usize, "bytes in its buffers")?;
        reader.buffers.push(read);
    }
    let mut donor = Donor::default();
    for material in file.document.materials() {
        donor.materials.push(reader.material(&material, &file)?);
    }
    // The material that glTF gives to primitives without one.
    donor.materials.push(DonorMaterial {
        name: "default".to_owned(),
        states_base_color: false,
        glow: Glow::None,
        base_color: ([1.0; 3], None),
        roughness: None,
        metallic: None,
    });
    reader.walk(&file, shift, &mut donor)?;
    donor.use_means();
    donor.check_base_color()?;
    Ok(donor)
}

struct Reader<'a> {
    folder: &'a mut SourceFolder,
    /// The file's folder below the root, which its uris are relative to.
    beside: &'a str,
    buffers: Vec<Vec<u8>>,
    /// By image, whether it is sRGB, and wrap.
    textures: BTreeMap<(usize, bool, u8), Texture>,
    /// Texels of all textures so far.
    texels: usize,
}

impl Reader<'_> {
    fn buffer(&mut self, buffer: &gltf::Buffer<'_>, blob: Option<&[u8]>) -> Result<Vec<u8>, ImportError> {
        match buffer.source() {
            gltf::buffer::Source::Bin => blob
                .map(<[u8]>::to_vec)
                .ok_or_else(|| invalid("the first buffer has no data; expected a uri or a binary chunk")),
            gltf::buffer::Source::Uri(uri) => self.file(uri),
        }
    }

    fn file(&mut self, uri: &str) -> Result<Vec<u8>, ImportError> {
        if uri.starts_with("data:") {
            return Err(invalid("data uris are not read; write a .glb, or files beside the .gltf"));
        }
        let decoded = percent_encoding::percent_decode_str(uri).decode_utf8();
        let not_utf8 = |source| invalid(format!("the uri '{}' is not UTF-8: {source}", shortened(uri)));
        let name = decoded.map_err(not_utf8)?;
        let name = if self.beside.is_empty() { name.into_owned() } else { format!("{}/{name}", self.beside) };
        let relative = SourceFolder::relative(&name)?;
        Ok(self.folder.read(&relative)?)
    }

    fn material(&mut self, material: &gltf::Material<'_>, file: &GltfFile) -> Result<DonorMaterial, ImportError> {
        let stated = material.index().and_then(|index| file.stated.get(index)).copied().unwrap_or_default();
        let name = material.name().map_or_else(|| format!("material {}", material.index().unwrap_or(0)), str::to_owned);
        let glow = match material.emissive_texture() {
            Some(_) => Glow::Textured,
            None if material.emissive_factor() == [0.0; 3] => Glow::None,
            None => Glow::Plain,
        };
        let pointer = format!("/materials/{}", material.index().unwrap_or(0));
        if let Some(extension) = material.pbr_specular_glossiness() {
            let pointer = format!("{pointer}/extensions/KHR_materials_pbrSpecularGlossiness");
            in_range(&format!("{pointer}/diffuseFactor"), &name, extension.diffuse_factor())?;
            in_range(&format!("{pointer}/specularFactor"), &name, extension.specular_factor())?;
            in_range(&format!("{pointer}/glossinessFactor"), &name, [extension.glossiness_factor()])?;
            let read = self.specular_glossiness(&extension, stated.metallic)?;
            let roughness = read.roughness.filter(|_| stated.roughness);
            let metallic = read.metallic.filter(|_| stated.metallic);
            return Ok(DonorMaterial { name, states_base_color: stated.base_color, glow, roughness, metallic, ..read });
        }
        let pbr = material.pbr_metallic_roughness();
        let base_color =
            pbr.base_color_texture().map(|info| self.texture(&info.texture(), Encoding::Srgb)).transpose()?;
        let both = pbr.metallic_roughness_texture();
        let both = both.map(|info| self.texture(&info.texture(), Encoding::Linear)).transpose()?;
        let pointer = format!("{pointer}/pbrMetallicRoughness");
        let [r, g, b, _] = in_range(&format!("{pointer}/baseColorFactor"), &name, pbr.base_color_factor())?;
        let [roughness] = in_range(&format!("{pointer}/roughnessFactor"), &name, [pbr.roughness_factor()])?;
        let [metallic] = in_range(&format!("{pointer}/metallicFactor"), &name, [pbr.metallic_factor()])?;
        let scalar = |factor, channel| Some(Scalar { factor, texture: both.clone().map(|texture| (texture, channel)) });
        // A metallic of 1 that nobody states is the default of most writers' plain meshes, and no metal.
        Ok(DonorMaterial {
            name,
            states_base_color: stated.base_color,
            glow,
            base_color: ([r, g, b], base_color),
            roughness: scalar(roughness, 1).filter(|_| stated.roughness),
            metallic: scalar(metallic, 2).filter(|_| stated.metallic),
        })
    }

    /// A material of `KHR_materials_pbrSpecularGlossiness`. Both textures are looked up where the diffuse one is.
    fn specular_glossiness(
        &mut self,
        material: &PbrSpecularGlossiness<'_>,
        states_specular: bool,
    ) -> Result<DonorMaterial, ImportError> {
        let factors = SpecularGlossiness::of(material, states_specular);
        let constant = factors.converted();
        let scalar = |factor, texture| Some(Scalar { factor, texture });
        let mut donor = DonorMaterial {
            name: String::new(),
            states_base_color: true,
            glow: Glow::None,
            base_color: (constant.base_color, None),
            roughness: scalar(constant.roughness, None),
            metallic: scalar(constant.metallic, None),
        };
        let (diffuse, specular) = (material.diffuse_texture(), material.specular_glossiness_texture());
        if diffuse.is_none() && specular.is_none() {
            return Ok(donor);
        }
        let diffuse = diffuse.map(|info| self.texture(&info.texture(), Encoding::Srgb)).transpose()?;
        let (specular, glossiness) = match specular {
            Some(info) => {
                let (name, bytes) = self.picture(&info.texture().source())?;
                let wrap = wrap(&info.texture().sampler())?;
                let (specular, glossiness) = texture_and_alpha_of_bytes(Path::new(&name), bytes, Encoding::Srgb, wrap)?;
                (Some(specular), glossiness)
            }
            None => (None, None),
        };
        let from = SpecularTextures {
            diffuse: diffuse.as_ref(),
            specular: specular.as_ref(),
            glossiness: glossiness.as_ref(),
        };
        let [base, numbers] = textures(factors, from)?;
        donor.base_color = ([1.0; 3], Some(base));
        donor.roughness = scalar(1.0, Some((numbers.clone(), 1)));
        donor.metallic = scalar(1.0, Some((numbers, 2)));
        Ok(donor)
    }

    /// The name and the bytes of an image.
    fn picture(&mut self, image: &gltf::Image<'_>) -> Result<(String, Vec<u8>), ImportError> {
        match image.source() {
            gltf::image::Source::Uri { uri, .. } => Ok((uri.to_owned(), self.file(uri)?)),
            gltf::image::Source::View { view, .. } => {
                Ok((format!("image {}", image.index()), view_bytes(&view, &self.buffers)?.to_vec()))
            }
        }
    }

    fn texture(&mut self, texture: &gltf::Texture<'_>, encoding: Encoding) -> Result<Texture, ImportError> {
        let image = texture.source();
        let wrap = wrap(&texture.sampler())?;
        let key = (image.index(), encoding == Encoding::Srgb, wrap as u8);
        if let Some(known) = self.textures.get(&key) {
            return Ok(known.clone());
        }
        let (name, bytes) = self.picture(&image)?;
        let read = texture_of_bytes(Path::new(&name), bytes, encoding, wrap)?;
        count_texels(&mut self.texels, &read)?;
        self.textures.insert(key, read.clone());
        Ok(read)
    }

    fn walk(&self, file: &GltfFile, shift: DVec3, donor: &mut Donor) -> Result<(), ImportError> {
        let document = &file.document;
        let scene = document.default_scene().or_else(|| document.scenes().next());
        let scene = scene.ok_or_else(|| invalid("the file has no scene"))?;
        let mut visited = BTreeSet::new();
        let mut open: Vec<(gltf::Node<'_>, DMat4, Vec<String>)> =
            scene.nodes().map(|node| (node, DMat4::IDENTITY, Vec::new())).collect();
        open.reverse();
        while let Some((node, world_from_parent, above)) = open.pop() {
            if !visited.insert(node.index()) {
                return Err(invalid(format!("node {} is the child of two nodes; expected a tree", node.index())));
            }
            if node.extension_value(INSTANCING).is_some() {
                return Err(invalid("EXT_mesh_gpu_instancing is not read here; write a node for each copy"));
            }
            if above.len() >= MAX_DEPTH {
                return Err(invalid(format!("node {} is nested more than {MAX_DEPTH} deep", node.index())));
            }
            let rounded = DMat4::from_cols_array_2d(&node.transform().matrix().map(|column| column.map(f64::from)));
            let world_from_node = world_from_parent * file.exact(&node, rounded);
            let own = node.name().unwrap_or_default().to_owned();
            let names: Vec<String> = std::iter::once(own).chain(above).collect();
            let first = donor.triangles.len();
            for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
                let in_node = |source: ImportError| {
                    invalid(format!("node {} '{}': {source}", node.index(), shortened(&names[0])))
                };
                self.primitive(&primitive, world_from_node, shift, donor).map_err(in_node)?;
            }
            donor.groups.push(DonorGroup { names: names.clone(), triangles: first..donor.triangles.len() });
            open.extend(node.children().map(|child| (child, world_from_node, names.clone())));
        }
        Ok(())
    }

    fn primitive(
        &self,
        primitive: &gltf::Primitive<'_>,
        world_from_node: DMat4,
        shift: DVec3,
        donor: &mut Donor,
    ) -> Result<(), ImportError> {
        match primitive.mode() {
            Mode::Triangles => {}
            Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => return Ok(()),
            Mode::TriangleStrip | Mode::TriangleFan => {
                return Err(invalid("strips and fans are not read; write triangles"));
            }
        }
        let positions = primitive.get(&Semantic::Positions);
        let positions = positions.ok_or_else(|| invalid("expected the attribute POSITION, found none"))?;
        donor.vertices += positions.count();
        check_most(donor.vertices, MAX_VERTICES, "vertices, counted for each node that has them")?;
        let world = |place: [f32; 3]| world_from_node.transform_point3(DVec3::from(place.map(f64::from)));
        let positions: Vec<DVec3> = numbers::<3>(&positions, &self.buffers)?.into_iter().map(world).collect();
        let shift = positions.first().map_or(DVec3::ZERO, |first| shift_near(*first, shift));
        let positions: Vec<Vec3> = positions.into_iter().map(|place| (place - shift).as_vec3()).collect();
        if !positions.iter().all(|place| place.is_finite()) {
            return Err(invalid("a position, once its node's transform is applied, is not finite"));
        }
        let corners = match primitive.indices() {
            Some(accessor) => {
                check_most(accessor.count().div_ceil(3), MAX_TRIANGLES, "triangles")?;
                indices(&accessor, &self.buffers)?
            }
            None => (0..positions.len() as u32).collect(),
        };
        let triangles = triangles(corners, positions.len())?;
        let same_count = |found: usize, attribute: &str| match positions.len() {
            expected if found == expected => Ok(()),
            expected => Err(invalid(format!("{attribute} has {found} entries; expected {expected}, as POSITION has"))),
        };
        let colors = match primitive.get(&Semantic::Colors(0)) {
            Some(accessor) => {
                same_count(accessor.count(), "COLOR_0")?;
                first_numbers::<3>(&accessor, &self.buffers)?
            }
            None => vec![[1.0; 3]; positions.len()],
        };
        let material = primitive.material();
        let colors = colors_in_range(colors, primitive.index(), material.name().unwrap_or("default"))?;
        // Many tools write white for every vertex of a mesh that nobody painted.
        let is_painted = colors.iter().any(|rgb| *rgb != [1.0; 3]);
        let pbr = material.pbr_metallic_roughness();
        let infos = match material.pbr_specular_glossiness() {
            Some(extension) => {
                let (diffuse, specular) = (extension.diffuse_texture(), extension.specular_glossiness_texture());
                let first = || diffuse.clone().or_else(|| specular.clone());
                [first(), first()]
            }
            None => [pbr.base_color_texture(), pbr.metallic_roughness_texture()],
        };
        // NaN marks what is absent.
        let mut uvs = [vec![Vec2::NAN; positions.len()], vec![Vec2::NAN; positions.len()]];
        for (uvs, info) in uvs.iter_mut().zip(infos) {
            let Some(info) = info else { continue };
            let transform = info.texture_transform();
            let set = transform.as_ref().and_then(|transform| transform.tex_coord()).unwrap_or(info.tex_coord());
            let Some(accessor) = primitive.get(&Semantic::TexCoords(set)) else { continue };
            same_count(accessor.count(), &format!("TEXCOORD_{set}"))?;
            let found = numbers::<2>(&accessor, &self.buffers)?;
            *uvs = found.into_iter().map(|uv| looked_up(Vec2::from(uv), transform.as_ref())).collect();
        }
        let material = material.index().unwrap_or(donor.materials.len() - 1);
        let mirrored = world_from_node.determinant() < 0.0;
        for mut corners in triangles.into_iter().map(|triangle| triangle.map(|vertex| vertex as usize)) {
            if mirrored {
                corners.swap(1, 2);
            }
            donor.push(DonorTriangle {
                corners: corners.map(|vertex| positions[vertex]),
                uvs: [0, 1].map(|set: usize| corners.map(|vertex| uvs[set][vertex])),
                colors: corners.map(|vertex| Vec3::from(colors[vertex])),
                is_painted,
                material,
            })?;
        }
        Ok(())
    }
}

fn invalid(why: impl Into<String>) -> ImportError {
    ImportError::Invalid(why.into())
}

/// The numbers, clamped to 0 to 1. Fails where one is further outside than by rounding; `pointer` is its place in the
/// file.
fn in_range<const N: usize>(pointer: &str, material: &str, found: [f32; N]) -> Result<[f32; N], ImportError> {
    if found.iter().all(is_unit) {
        return Ok(found.map(|value| value.clamp(0.0, 1.0)));
    }
    Err(out_of_range(pointer, material, &found))
}

/// The colours of a primitive's vertices, clamped to 0 to 1. The error shows the largest of those that are out of
/// range, which shows best whether they are bytes.
fn colors_in_range(colors: Vec<[f32; 3]>, primitive: usize, material: &str) -> Result<Vec<[f32; 3]>, ImportError> {
    let largest = |rgb: &[f32; 3]| rgb.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let outside = colors.iter().filter(|rgb| !rgb.iter().all(is_unit));
    match outside.max_by(|a, b| largest(a).total_cmp(&largest(b))) {
        Some(found) => {
            in_range(&format!("primitives/{primitive}/attributes/COLOR_0"), material, *found).map(|_| colors)
        }
        None => Ok(colors.into_iter().map(|rgb| rgb.map(|value| value.clamp(0.0, 1.0))).collect()),
    }
}

/// The texture coordinate after its transform, with v upwards; glTF's v points down.
fn looked_up(uv: Vec2, transform: Option<&gltf::texture::TextureTransform<'_>>) -> Vec2 {
    let uv = transform.map_or(uv, |transform| {
        let (offset, scale) = (Vec2::from(transform.offset()), Vec2::from(transform.scale()));
        // The extension's own matrix, column by column: counter-clockwise in a space whose v points down.
        let (sin, cos) = (libm::sinf(transform.rotation()), libm::cosf(transform.rotation()));
        offset + Mat2::from_cols(Vec2::new(cos, -sin), Vec2::new(sin, cos)) * (scale * uv)
    });
    Vec2::new(uv.x, 1.0 - uv.y)
}

fn wrap(sampler: &gltf::texture::Sampler<'_>) -> Result<Wrap, ImportError> {
    use gltf::texture::WrappingMode;
    if sampler.wrap_s() != sampler.wrap_t() {
        return Err(invalid("a sampler that wraps u and v in different ways is not read"));
    }
    Ok(match sampler.wrap_s() {
        WrappingMode::Repeat => Wrap::Repeat,
        WrappingMode::ClampToEdge => Wrap::Clamp,
        WrappingMode::MirroredRepeat => Wrap::Mirror,
    })
}

#[cfg(test)]
mod tests {
    use mateval_dataset::material::MaterialParameter;
    use mateval_dataset::{TriangleMesh, glb};

    use super::*;

    fn read_bytes(bytes: &[u8]) -> Result<Donor, ImportError> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.glb"), bytes).unwrap();
        read(&mut SourceFolder::new(folder.path(), 1 << 20).unwrap(), "a.glb", DVec3::ZERO)
    }

    fn sound() -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.glb");
        let mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            uvs: Some(vec![Vec2::ZERO, Vec2::X, Vec2::Y]),
            triangles: vec![[0, 1, 2]],
            ..Default::default()
        };
        glb::write(&path, &[glb::GlbNode { name: "a".to_owned(), mesh }]).unwrap();
        std::fs::read(path).unwrap()
    }

    #[test]
    fn a_mesh_whose_materials_state_no_colour_is_refused() {
        let (mut bytes, key) = (sound(), br#","material":0"#);
        let at = bytes.windows(key.len()).position(|window| window == key).unwrap();
        bytes[at..at + key.len()].fill(b' ');
        let refused = read_bytes(&bytes).err().unwrap().to_string();
        assert!(refused.contains("states a base colour, such as 'default': bake it to a texture"), "{refused}");
        // Twin: our own writer states everything.
        let donor = read_bytes(&sound()).unwrap();
        assert_eq!((donor.triangles.len(), donor.groups[0].names.as_slice()), (1, &["a".to_owned()][..]));
        assert_eq!(donor.unstated(), []);
    }

    /// A `.gltf` with one triangle, whose three vertices have this colour if there is one, and whose primitive has the
    /// material with this JSON if there is one.
    fn read_triangle(material: Option<&str>, color: Option<[f32; 3]>) -> Result<Donor, ImportError> {
        let folder = tempfile::tempdir().unwrap();
        let places = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let numbers = places.into_iter().chain([color.unwrap_or_default(); 3].into_iter().flatten());
        std::fs::write(folder.path().join("a.bin"), numbers.flat_map(f32::to_le_bytes).collect::<Vec<u8>>()).unwrap();
        let materials = material.map_or(String::new(), |text| format!(r#""materials":[{text}],"#));
        let used = material.map_or("", |_| r#","material":0"#);
        let colors = color.map_or("", |_| r#","COLOR_0":1"#);
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"name":"n","mesh":0}}],{materials}
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0{colors}}}{used}}}]}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
            {{"bufferView":1,"componentType":5126,"count":3,"type":"VEC3"}}],
            "bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":36}}],
            "buffers":[{{"uri":"a.bin","byteLength":72}}]}}"#
        );
        std::fs::write(folder.path().join("a.gltf"), text).unwrap();
        read(&mut SourceFolder::new(folder.path(), 1 << 20).unwrap(), "a.gltf", DVec3::ZERO)
    }

    #[test]
    fn factors_outside_0_to_1_are_refused() {
        let read = |factor: &str| {
            let material =
                format!(r#"{{"name":"m","pbrMetallicRoughness":{{"baseColorFactor":[0.5,0.5,0.5,1],{factor}}}}}"#);
            read_triangle(Some(&material), None)
        };
        let refused = |factor: &str| read(factor).err().unwrap().to_string();
        let metallic = refused(r#""metallicFactor":5"#);
        assert!(metallic.contains("/materials/0/pbrMetallicRoughness/metallicFactor of 'm'"), "{metallic}");
        assert!(metallic.contains("expected 0 to 1, found [5.0]"), "{metallic}");
        assert!(refused(r#""roughnessFactor":-1"#).contains("found [-1.0]"));
        let base_color = r#"{"pbrMetallicRoughness":{"baseColorFactor":[2,1,1,1]}}"#;
        let base_color = read_triangle(Some(base_color), None).err().unwrap().to_string();
        assert!(base_color.contains("/baseColorFactor") && !base_color.contains("255"), "{base_color}");
        // Twin: rounding is clamped.
        let donor = read(r#""roughnessFactor":1.0005"#).unwrap();
        assert_eq!(donor.materials[0].roughness.as_ref().map(|scalar| scalar.factor), Some(1.0));
    }

    #[test]
    fn colours_of_vertices_outside_0_to_1_are_refused() {
        let refused = |color| read_triangle(None, Some(color)).err().unwrap().to_string();
        let bytes = refused([255.0, 128.0, 0.0]);
        assert!(
            bytes.contains("node 0 'n': primitives/0/attributes/COLOR_0") && bytes.contains("divide by 255"),
            "{bytes}"
        );
        assert!(refused([f32::NAN, 0.5, 0.5]).contains("COLOR_0"));
    }

    #[test]
    fn colours_of_vertices_are_a_stated_base_colour() {
        for material in [None, Some(r#"{"pbrMetallicRoughness":{"metallicFactor":0}}"#)] {
            let donor = read_triangle(material, Some([0.5, 0.25, 1.0])).unwrap();
            assert!(!donor.unstated().contains(&MaterialParameter::BaseColor));
            let [r, g, b, ..] = donor.values(0, DVec3::splat(1.0 / 3.0));
            assert!(Vec3::new(r, g, b).abs_diff_eq(Vec3::new(0.5, 0.25, 1.0), 1e-5), "{r} {g} {b}");
            // Twin: white at every vertex states nothing.
            let refused = read_triangle(material, Some([1.0; 3])).err().unwrap().to_string();
            assert!(refused.contains("no material states a base colour"), "{refused}");
        }
    }

    /// Damaged bytes cause no panic.
    #[test]
    fn damage_is_an_error_or_another_mesh() {
        let sound = sound();
        let mut refused = 0;
        for at in 0..sound.len() {
            for byte in [0, b'9', 255] {
                let mut damaged = sound.clone();
                damaged[at] = byte;
                refused += usize::from(read_bytes(&damaged).is_err());
            }
            assert!(read_bytes(&sound[..at]).is_err());
        }
        assert!(refused > 1000, "{refused}");
    }

    /// As glTF defines it: counter-clockwise in a space whose v points down.
    #[test]
    fn a_quarter_turn_is_counter_clockwise() {
        let text = r#"{"asset":{"version":"2.0"},"images":[{"uri":"a"}],"textures":[{"source":0}],"materials":[{"pbrMetallicRoughness":
            {"baseColorTexture":{"index":0,"extensions":{"KHR_texture_transform":{"rotation":1.5707963267948966}}}}}]}"#;
        let file = parse(text.as_bytes()).unwrap();
        let info = file.document.materials().next().unwrap().pbr_metallic_roughness().base_color_texture().unwrap();
        let turned = looked_up(Vec2::new(1.0, 0.0), info.texture_transform().as_ref());
        // A step to the right becomes a step up, which is -1 in glTF's v.
        assert!((turned - Vec2::new(0.0, 2.0)).length() < 1e-6, "{turned}");
    }
}
