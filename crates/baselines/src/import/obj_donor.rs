//! An OBJ with its MTL as a donor: `map_Kd` (sRGB) or else `Kd` (linear); `map_Pr` or `Pr`, `map_Pm` or `Pm`.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{Vec2, Vec3};
use mateval_image::texture_io::{Encoding, texture_of_bytes};
use mateval_image::{Texture, Wrap};
use mateval_scene::findings::shortened;
use mateval_scene::obj::{self, Materials, ObjLimits, ObjMaterial};
use mateval_scene::source_folder::SourceFolder;

use super::donor::{Donor, DonorGroup, DonorMaterial, DonorTriangle, MAX_TEXELS, MAX_TRIANGLES, Scalar};

/// Reads the file `name` of the folder; what is wrong in words.
pub fn read(folder: &mut SourceFolder, name: &str) -> Result<Donor, String> {
    let bytes = folder.read(name).map_err(|fault| fault.message)?;
    let limits = ObjLimits { triangles: MAX_TRIANGLES, corners: 3 * MAX_TRIANGLES };
    let read = obj::read(&bytes, limits, Materials::Split).map_err(|error| error.to_string())?;
    if read.mixed_uvs {
        return Err("some faces have texture coordinates and some have none".to_owned());
    }
    if read.mesh.uvs.iter().flatten().any(|uv| !uv.is_finite()) {
        return Err("a texture coordinate is not finite".to_owned());
    }
    let mut reader = Reader { folder, beside: name.rsplit_once('/').map_or("", |(beside, _)| beside), texels: 0 };
    let mut known = BTreeMap::new();
    for file in obj::material_files(&bytes) {
        let bytes = reader.material_file(&file)?;
        let materials = obj::read_materials(&bytes).map_err(|error| format!("'{}': {error}", shortened(&file)))?;
        known.extend(materials.into_iter().map(|material| (material.name.clone(), material)));
    }
    let (mut donor, mut numbers, mut first) = (Donor::default(), BTreeMap::new(), 0);
    for group in &read.groups {
        let named = group.material.as_ref().and_then(|material| known.get(material));
        let Some(described) = named else {
            let (group, material) = (shortened(&group.name), shortened(group.material.as_deref().unwrap_or("")));
            return Err(format!("group '{group}' has the material '{material}', which no mtllib of the file defines"));
        };
        let textured =
            described.diffuse_map.is_some() || described.roughness_map.is_some() || described.metallic_map.is_some();
        if textured && read.mesh.uvs.is_none() {
            return Err(format!("material '{}' has a texture, but the faces have no vt", shortened(&described.name)));
        }
        let material = match numbers.get(&described.name) {
            Some(number) => *number,
            None => {
                donor.materials.push(reader.material(described)?);
                numbers.insert(described.name.clone(), donor.materials.len() - 1);
                donor.materials.len() - 1
            }
        };
        for triangle in first..first + group.triangles {
            let corners = read.mesh.corners(triangle);
            if !corners.iter().all(|corner| corner.is_finite()) {
                return Err(format!("a corner of group '{}' is not finite", shortened(&group.name)));
            }
            let uv = |vertex: u32| read.mesh.uvs.as_ref().map_or(Vec2::ZERO, |uvs| uvs[vertex as usize]);
            let uvs = read.mesh.triangles[triangle].map(uv);
            donor.push(DonorTriangle { corners, uvs: [uvs; 2], colors: [Vec3::ONE; 3], material })?;
        }
        donor.groups.push(DonorGroup { names: vec![group.name.clone()], triangles: first..first + group.triangles });
        first += group.triangles;
    }
    Ok(donor)
}

struct Reader<'a> {
    folder: &'a mut SourceFolder,
    /// The folder of the file, which its names begin in.
    beside: &'a str,
    texels: usize,
}

impl Reader<'_> {
    fn relative(&self, name: &str) -> Result<String, String> {
        let name = if self.beside.is_empty() { name.to_owned() } else { format!("{}/{name}", self.beside) };
        SourceFolder::relative(&name).map_err(|fault| fault.message)
    }

    /// A name may hold blanks, or be several.
    fn material_file(&mut self, name: &str) -> Result<Vec<u8>, String> {
        let whole = self.relative(name)?;
        if name.contains(char::is_whitespace) && self.folder.path(&whole).is_err() {
            let mut all = Vec::new();
            for word in name.split_whitespace() {
                let relative = self.relative(word)?;
                all.extend(self.folder.read(&relative).map_err(|fault| fault.message)?);
                all.push(b'\n');
            }
            return Ok(all);
        }
        self.folder.read(&whole).map_err(|fault| fault.message)
    }

    fn material(&mut self, material: &ObjMaterial) -> Result<DonorMaterial, String> {
        let base_color = match &material.diffuse_map {
            Some(name) => ([1.0; 3], Some(self.texture(name, Encoding::Srgb)?)),
            None => {
                let missing = || format!("material '{}' has neither map_Kd nor Kd", shortened(&material.name));
                (material.diffuse.ok_or_else(missing)?, None)
            }
        };
        let mut scalar = |factor: Option<f32>, map: &Option<String>| match map {
            Some(name) => {
                let texture = self.texture(name, Encoding::Linear)?;
                Ok(Some(Scalar { factor: 1.0, texture: Some((texture, 0)) }))
            }
            None => Ok::<_, String>(factor.map(|factor| Scalar { factor, texture: None })),
        };
        let roughness = scalar(material.roughness, &material.roughness_map)?;
        let metallic = scalar(material.metallic, &material.metallic_map)?;
        Ok(DonorMaterial { base_color, roughness, metallic })
    }

    fn texture(&mut self, name: &str, encoding: Encoding) -> Result<Texture, String> {
        if name.starts_with('-') {
            return Err(format!(
                "'{}': options of a texture are not read; write its file's name alone",
                shortened(name)
            ));
        }
        let relative = self.relative(name)?;
        let bytes = self.folder.read(&relative).map_err(|fault| fault.message)?;
        let read = texture_of_bytes(Path::new(&relative), bytes, encoding, Wrap::Repeat);
        let read = read.map_err(|error| error.to_string())?;
        self.texels += read.width() * read.height();
        if self.texels > MAX_TEXELS {
            return Err(format!("its textures have more than {MAX_TEXELS} texels in all"));
        }
        Ok(read)
    }
}
