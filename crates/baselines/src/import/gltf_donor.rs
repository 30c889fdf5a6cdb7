//! Reads a textured glTF as a donor: base colour, roughness and metallic of the default scene's triangles, with vertex
//! colours, `KHR_texture_transform` and `EXT_texture_webp`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::{DMat4, DVec3, Mat2, Vec2, Vec3};
use gltf::Semantic;
use gltf::mesh::Mode;
use mateval_image::texture_io::{Encoding, texture_of_bytes};
use mateval_image::{Texture, Wrap};
use mateval_scene::gltf_accessor::{floats, floats_or_shares, indices, parse, triangles, view_bytes};
use mateval_scene::gltf_webp::with_own_pictures;
use mateval_scene::source_folder::SourceFolder;

use super::donor::{Donor, DonorGroup, DonorMaterial, DonorTriangle, Scalar};
use super::error::{ImportError, Limited, Place, Unsupported};
use super::limits::{MAX_DEPTH, MAX_FILE_BYTES, MAX_TEXELS, MAX_TRIANGLES, MAX_VERTICES};

/// Reads the file `name` of the folder.
pub fn read(folder: &mut SourceFolder, name: &str) -> Result<Donor, ImportError> {
    let bytes = folder.read(name)?;
    let file = parse(&with_own_pictures(&bytes))?;
    let beside = name.rsplit_once('/').map_or("", |(beside, _)| beside);
    let mut reader = Reader { folder, beside, buffers: Vec::new(), textures: BTreeMap::new(), texels: 0 };
    let mut bytes = 0;
    for buffer in file.buffers() {
        let read = reader.buffer(&buffer, file.blob.as_deref())?;
        bytes += read.len() as u64;
        if bytes > MAX_FILE_BYTES {
            return Err(ImportError::TooLarge { what: Limited::BufferBytes, limit: MAX_FILE_BYTES });
        }
        reader.buffers.push(read);
    }
    let mut donor = Donor::default();
    for material in file.materials() {
        donor.materials.push(reader.material(&material)?);
    }
    // The material that glTF gives to primitives without one.
    let plain = Scalar { factor: 1.0, texture: None };
    let default = DonorMaterial { base_color: ([1.0; 3], None), roughness: Some(plain.clone()), metallic: Some(plain) };
    donor.materials.push(default);
    reader.walk(&file, &mut donor)?;
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
            gltf::buffer::Source::Bin => blob.map(<[u8]>::to_vec).ok_or(ImportError::BufferWithoutData),
            gltf::buffer::Source::Uri(uri) => self.file(uri),
        }
    }

    fn file(&mut self, uri: &str) -> Result<Vec<u8>, ImportError> {
        if uri.starts_with("data:") {
            return Err(ImportError::Unsupported(Unsupported::DataUri));
        }
        let decoded = percent_encoding::percent_decode_str(uri).decode_utf8();
        let name = decoded.map_err(|source| ImportError::Uri { uri: uri.to_owned(), source })?;
        let name = if self.beside.is_empty() { name.into_owned() } else { format!("{}/{name}", self.beside) };
        let relative = SourceFolder::relative(&name)?;
        Ok(self.folder.read(&relative)?)
    }

    fn material(&mut self, material: &gltf::Material<'_>) -> Result<DonorMaterial, ImportError> {
        let pbr = material.pbr_metallic_roughness();
        let base_color =
            pbr.base_color_texture().map(|info| self.texture(&info.texture(), Encoding::Srgb)).transpose()?;
        let both = pbr.metallic_roughness_texture();
        let both = both.map(|info| self.texture(&info.texture(), Encoding::Linear)).transpose()?;
        let [r, g, b, _] = pbr.base_color_factor();
        let scalar = |factor, channel| Some(Scalar { factor, texture: both.clone().map(|texture| (texture, channel)) });
        Ok(DonorMaterial {
            base_color: ([r, g, b], base_color),
            roughness: scalar(pbr.roughness_factor(), 1),
            metallic: scalar(pbr.metallic_factor(), 2),
        })
    }

    fn texture(&mut self, texture: &gltf::Texture<'_>, encoding: Encoding) -> Result<Texture, ImportError> {
        let image = texture.source();
        let wrap = wrap(&texture.sampler())?;
        let key = (image.index(), encoding == Encoding::Srgb, wrap as u8);
        if let Some(known) = self.textures.get(&key) {
            return Ok(known.clone());
        }
        let (name, bytes) = match image.source() {
            gltf::image::Source::Uri { uri, .. } => (uri.to_owned(), self.file(uri)?),
            gltf::image::Source::View { view, .. } => {
                let buffer = &self.buffers[view.buffer().index()];
                (format!("image {}", image.index()), view_bytes(&view, buffer)?.to_vec())
            }
        };
        let read = texture_of_bytes(Path::new(&name), bytes, encoding, wrap)?;
        self.texels += read.width() * read.height();
        if self.texels > MAX_TEXELS {
            return Err(ImportError::TooLarge { what: Limited::Texels, limit: MAX_TEXELS as u64 });
        }
        self.textures.insert(key, read.clone());
        Ok(read)
    }

    fn walk(&self, file: &gltf::Gltf, donor: &mut Donor) -> Result<(), ImportError> {
        let scene = file.default_scene().or_else(|| file.scenes().next()).ok_or(ImportError::NoScene)?;
        let mut visited = BTreeSet::new();
        let mut open: Vec<(gltf::Node<'_>, DMat4, Vec<String>)> =
            scene.nodes().map(|node| (node, DMat4::IDENTITY, Vec::new())).collect();
        open.reverse();
        while let Some((node, world_from_parent, above)) = open.pop() {
            if !visited.insert(node.index()) {
                return Err(ImportError::NotATree { node: node.index() });
            }
            if above.len() >= MAX_DEPTH {
                return Err(ImportError::TooDeep { node: node.index() });
            }
            let world_from_node =
                world_from_parent * DMat4::from_cols_array_2d(&node.transform().matrix().map(|c| c.map(f64::from)));
            let own = node.name().unwrap_or_default().to_owned();
            let names: Vec<String> = std::iter::once(own).chain(above).collect();
            let first = donor.triangles.len();
            for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
                let in_node = |source| ImportError::Node {
                    node: node.index(),
                    name: names.first().cloned().unwrap_or_default(),
                    source: Box::new(source),
                };
                self.primitive(&primitive, world_from_node, donor).map_err(in_node)?;
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
        donor: &mut Donor,
    ) -> Result<(), ImportError> {
        match primitive.mode() {
            Mode::Triangles => {}
            Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => return Ok(()),
            Mode::TriangleStrip | Mode::TriangleFan => {
                return Err(ImportError::Unsupported(Unsupported::StripsAndFans));
            }
        }
        let bytes = |accessor: &gltf::Accessor<'_>| {
            let view = accessor.view().ok_or(ImportError::Unsupported(Unsupported::SparseAccessor))?;
            Ok::<_, ImportError>(self.buffers[view.buffer().index()].as_slice())
        };
        let missing = |attribute: String| ImportError::MissingAttribute { attribute };
        let positions = primitive.get(&Semantic::Positions).ok_or_else(|| missing("POSITION".to_owned()))?;
        donor.vertices += positions.count();
        if donor.vertices > MAX_VERTICES {
            return Err(ImportError::TooLarge { what: Limited::Vertices, limit: MAX_VERTICES as u64 });
        }
        let positions: Vec<Vec3> = floats::<3>(&positions, bytes(&positions)?)?
            .into_iter()
            .map(|place| world_from_node.transform_point3(DVec3::from(place.map(f64::from))).as_vec3())
            .collect();
        if !positions.iter().all(|place| place.is_finite()) {
            return Err(ImportError::NotFinite(Place::WorldPosition));
        }
        let numbers = match primitive.indices() {
            Some(accessor) if accessor.count() > 3 * MAX_TRIANGLES => {
                return Err(ImportError::TooLarge { what: Limited::Triangles, limit: MAX_TRIANGLES as u64 });
            }
            Some(accessor) => indices(&accessor, bytes(&accessor)?)?,
            None => (0..positions.len() as u32).collect(),
        };
        let triangles = triangles(numbers, positions.len())?;
        let same_count = |found: usize, attribute: String| match found == positions.len() {
            true => Ok(()),
            false => Err(ImportError::Count { attribute, found, expected: positions.len() }),
        };
        let colors = match primitive.get(&Semantic::Colors(0)) {
            Some(accessor) => floats_or_shares::<3>(&accessor, bytes(&accessor)?)?,
            None => vec![[1.0; 3]; positions.len()],
        };
        same_count(colors.len(), "COLOR_0".to_owned())?;
        let pbr = primitive.material().pbr_metallic_roughness();
        let mut uvs = [vec![Vec2::ZERO; positions.len()], vec![Vec2::ZERO; positions.len()]];
        for (uvs, info) in uvs.iter_mut().zip([pbr.base_color_texture(), pbr.metallic_roughness_texture()]) {
            let Some(info) = info else { continue };
            let transform = info.texture_transform();
            let set = transform.as_ref().and_then(|transform| transform.tex_coord()).unwrap_or(info.tex_coord());
            let accessor =
                primitive.get(&Semantic::TexCoords(set)).ok_or_else(|| missing(format!("TEXCOORD_{set}")))?;
            let found = floats_or_shares::<2>(&accessor, bytes(&accessor)?)?;
            same_count(found.len(), format!("TEXCOORD_{set}"))?;
            *uvs = found.into_iter().map(|uv| looked_up(Vec2::from(uv), transform.as_ref())).collect();
        }
        let material = primitive.material().index().unwrap_or(donor.materials.len() - 1);
        let mirrored = world_from_node.determinant() < 0.0;
        for mut corners in triangles.into_iter().map(|triangle| triangle.map(|vertex| vertex as usize)) {
            if mirrored {
                corners.swap(1, 2);
            }
            donor.push(DonorTriangle {
                corners: corners.map(|vertex| positions[vertex]),
                uvs: [0, 1].map(|set: usize| corners.map(|vertex| uvs[set][vertex])),
                colors: corners.map(|vertex| Vec3::from(colors[vertex])),
                material,
            })?;
        }
        Ok(())
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
        return Err(ImportError::Unsupported(Unsupported::MixedWrap));
    }
    Ok(match sampler.wrap_s() {
        WrappingMode::Repeat => Wrap::Repeat,
        WrappingMode::ClampToEdge => Wrap::Clamp,
        WrappingMode::MirroredRepeat => Wrap::Mirror,
    })
}

#[cfg(test)]
mod tests {
    use mateval_scene::{TriangleMesh, glb};

    use super::*;

    fn read_bytes(bytes: &[u8]) -> Result<Donor, ImportError> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.glb"), bytes).unwrap();
        read(&mut SourceFolder::new(folder.path(), 1 << 20).unwrap(), "a.glb")
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
    fn a_primitive_without_a_material_has_the_default_of_gltf() {
        let (mut bytes, key) = (sound(), br#","material":0"#);
        let at = bytes.windows(key.len()).position(|window| window == key).unwrap();
        bytes[at..at + key.len()].fill(b' ');
        let donor = read_bytes(&bytes).unwrap();
        assert_eq!((donor.triangles.len(), donor.groups[0].names.as_slice()), (1, &["a".to_owned()][..]));
        assert_eq!(donor.values(0, DVec3::new(1.0, 0.0, 0.0)), [1.0; 5]);
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
        let info = file.materials().next().unwrap().pbr_metallic_roughness().base_color_texture().unwrap();
        let turned = looked_up(Vec2::new(1.0, 0.0), info.texture_transform().as_ref());
        // A step to the right becomes a step up, which is -1 in glTF's v.
        assert!((turned - Vec2::new(0.0, 2.0)).length() < 1e-6, "{turned}");
    }
}
