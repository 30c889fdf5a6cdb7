//! Reads an OBJ with its MTL as a donor: base colour from `map_Kd` (sRGB) or else `Kd` (linear), roughness from
//! `map_Pr` or `Pr`, metallic from `map_Pm` or `Pm`. Groups without a material, or with a `Kd` of 1 1 1 and no
//! `map_Kd`, take the colours of their vertices (sRGB, as trimesh and MeshLab write them).

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use mateval_dataset::obj::{self, Glow, Materials, ObjLimits, ObjMaterial};
use mateval_files::source_folder::SourceFolder;
use mateval_files::untrusted::shortened;
use mateval_image::texture_io::{Encoding, texture_of_bytes};
use mateval_image::transfer::linear_from_srgb;
use mateval_image::{Texture, Wrap};

use super::donor::{
    Donor, DonorGroup, DonorMaterial, DonorTriangle, ImportError, MAX_TRIANGLES, Scalar, count_texels, is_unit,
    out_of_range, shift_near,
};

/// Reads the file `name` of the folder. `shift` is subtracted from positions that lie near it.
pub fn read(folder: &mut SourceFolder, name: &str, shift: DVec3) -> Result<Donor, ImportError> {
    let bytes = folder.read(name)?;
    let limits = ObjLimits { triangles: MAX_TRIANGLES, corners: 3 * MAX_TRIANGLES };
    let read = obj::read(&bytes, limits, Materials::Split).map_err(|fault| ImportError::Invalid(fault.to_string()))?;
    let offset = read.base - shift_near(read.base, shift);
    let mut reader = Reader { folder, beside: name.rsplit_once('/').map_or("", |(beside, _)| beside), texels: 0 };
    let mut known = BTreeMap::new();
    for file in obj::material_files(&bytes) {
        let bytes = reader.material_file(&file)?;
        let in_file = |fault| ImportError::Invalid(format!("'{}': {fault}", shortened(&file)));
        let materials = obj::read_materials(&bytes).map_err(in_file)?;
        known.extend(materials.into_iter().map(|material| (material.name.clone(), material)));
    }
    let (mut donor, mut numbers, mut first) = (Donor::default(), BTreeMap::new(), 0);
    for group in &read.groups {
        let described = group.material.as_ref().and_then(|material| known.get(material));
        // Tools that write colours of the vertices often add a plain white material.
        let is_white = |material: &ObjMaterial| material.diffuse_map.is_none() && material.diffuse == Some([1.0; 3]);
        let is_painted = described.is_none_or(is_white) && !read.colors.is_empty();
        let key = described.map(|described| described.name.clone());
        let material = match (numbers.get(&key), described) {
            (Some(number), _) => *number,
            (None, None) if !is_painted => {
                return Err(undefined_material(&group.name, group.material.as_deref()));
            }
            (None, described) => {
                donor.materials.push(described.map_or_else(|| Ok(painted()), |described| reader.material(described))?);
                numbers.insert(key, donor.materials.len() - 1);
                donor.materials.len() - 1
            }
        };
        for triangle in first..first + group.triangles {
            let corners = read.mesh.corners(triangle);
            if !corners.iter().all(|corner| corner.is_finite()) {
                let name = shortened(&group.name);
                return Err(ImportError::Invalid(format!("a corner of group '{name}' is not finite")));
            }
            let corners = corners.map(|corner| (corner.as_dvec3() + offset).as_vec3());
            let uv = |vertex: u32| read.mesh.uvs.as_ref().map_or(Vec2::NAN, |uvs| uvs[vertex as usize]);
            let uvs = read.mesh.triangles[triangle].map(uv);
            let color = |vertex: u32| Vec3::from(read.colors[vertex as usize].map(linear_from_srgb));
            let colors = if is_painted { read.mesh.triangles[triangle].map(color) } else { [Vec3::ONE; 3] };
            donor.push(DonorTriangle { corners, uvs: [uvs; 2], colors, is_painted, material })?;
        }
        donor.groups.push(DonorGroup { names: vec![group.name.clone()], triangles: first..first + group.triangles });
        first += group.triangles;
    }
    if let Some(bad) = read.colors.iter().find(|rgb| !rgb.iter().all(|v| (0.0..=1.0).contains(v))) {
        return Err(out_of_range("a vertex colour", "vertex colours", bad));
    }
    donor.use_means();
    donor.check_base_color()?;
    Ok(donor)
}

/// The material of groups that have only the colours of their vertices.
fn painted() -> DonorMaterial {
    DonorMaterial {
        name: "vertex colours".to_owned(),
        states_base_color: true,
        glow: Glow::None,
        base_color: ([1.0; 3], None),
        roughness: None,
        metallic: None,
    }
}

/// The error about a group whose material no MTL file defines, or that has none.
fn undefined_material(group: &str, material: Option<&str>) -> ImportError {
    let group = shortened(group);
    ImportError::Invalid(match material {
        None | Some("") => format!(
            "group '{group}' has faces without `usemtl`; expected `usemtl` before them, with a material that an mtllib of \
             the file defines, or a colour of every vertex (v x y z r g b)"
        ),
        Some(material) => {
            format!("group '{group}' has the material '{}', which no mtllib of the file defines", shortened(material))
        }
    })
}

struct Reader<'a> {
    folder: &'a mut SourceFolder,
    /// The file's folder below the root, which its file names are relative to.
    beside: &'a str,
    /// Texels of all textures so far.
    texels: usize,
}

impl Reader<'_> {
    fn relative(&self, name: &str) -> Result<String, ImportError> {
        let name = if self.beside.is_empty() { name.to_owned() } else { format!("{}/{name}", self.beside) };
        Ok(SourceFolder::relative(&name)?)
    }

    /// The bytes of an `mtllib` line's file. Where no file has the unchanged name, blanks separate several files, whose
    /// bytes are joined.
    fn material_file(&mut self, name: &str) -> Result<Vec<u8>, ImportError> {
        let whole = self.relative(name)?;
        if name.contains(char::is_whitespace) && self.folder.path(&whole).is_err() {
            let mut all = Vec::new();
            for word in name.split_whitespace() {
                let relative = self.relative(word)?;
                all.extend(self.folder.read(&relative)?);
                all.push(b'\n');
            }
            return Ok(all);
        }
        Ok(self.folder.read(&whole)?)
    }

    fn material(&mut self, material: &ObjMaterial) -> Result<DonorMaterial, ImportError> {
        let base_color = match &material.diffuse_map {
            Some(name) => ([1.0; 3], Some(self.texture(name, Encoding::Srgb)?)),
            None => {
                let missing = || format!("material '{}' has neither map_Kd nor Kd", shortened(&material.name));
                let stated = material.diffuse.ok_or_else(|| ImportError::Invalid(missing()))?;
                (stated.map(|value| value.clamp(0.0, 1.0)), None)
            }
        };
        let mut scalar = |factor: Option<f32>, map: &Option<String>| match map {
            Some(name) => {
                let texture = self.texture(name, Encoding::Linear)?;
                Ok(Some(Scalar { factor: 1.0, texture: Some((texture, 0)) }))
            }
            None => {
                let clamped = |factor: f32| Scalar { factor: factor.clamp(0.0, 1.0), texture: None };
                Ok::<_, ImportError>(factor.map(clamped))
            }
        };
        let roughness = scalar(material.roughness, &material.roughness_map)?;
        let metallic = scalar(material.metallic, &material.metallic_map)?;
        let [diffuse, own_roughness, own_metallic] = [
            material.diffuse.as_ref().map_or(&[][..], |rgb| rgb),
            material.roughness.as_slice(),
            material.metallic.as_slice(),
        ];
        for (key, found) in [("Kd", diffuse), ("Pr", own_roughness), ("Pm", own_metallic)] {
            if !found.iter().all(is_unit) {
                return Err(out_of_range(key, &material.name, found));
            }
        }
        let (name, glow) = (material.name.clone(), material.glow);
        Ok(DonorMaterial { name, states_base_color: true, glow, base_color, roughness, metallic })
    }

    fn texture(&mut self, name: &str, encoding: Encoding) -> Result<Texture, ImportError> {
        if name.starts_with('-') {
            let why = "options of a texture are not read; write the file name alone";
            return Err(ImportError::Invalid(format!("'{}': {why}", shortened(name))));
        }
        let relative = self.relative(name)?;
        let bytes = self.folder.read(&relative)?;
        let read = texture_of_bytes(Path::new(&relative), bytes, encoding, Wrap::Repeat)?;
        count_texels(&mut self.texels, &read)?;
        Ok(read)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A triangle whose vertices are red, with this MTL text behind its `newmtl` line.
    fn red(material: &str) -> Donor {
        read_red(material).unwrap()
    }

    fn read_red(material: &str) -> Result<Donor, ImportError> {
        let folder = tempfile::tempdir().unwrap();
        let vertices = "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\n";
        std::fs::write(folder.path().join("a.obj"), format!("mtllib a.mtl\n{vertices}usemtl m\nf 1 2 3\n")).unwrap();
        std::fs::write(folder.path().join("a.mtl"), format!("newmtl m\n{material}\n")).unwrap();
        read(&mut SourceFolder::new(folder.path(), 1 << 20).unwrap(), "a.obj", DVec3::ZERO)
    }

    #[test]
    fn colours_baked_to_emission_are_refused_and_rounding_is_not() {
        for baked in ["Kd 0 0 0\nKe 0.8 0.2 0.1", "Kd 0 0 0\nmap_Ke a.png", "Kd 0 0 0\nKa 1 1 1\nmap_Ka a.png"] {
            let refused = read_red(baked).err().map(|error| error.to_string());
            assert!(refused.is_some_and(|error| error.contains("emits over black or white")), "{baked}");
        }
        for sound in ["Kd 0 0 0\nKe 0 0 0", "Kd 0.5 0 0\nKe 1 1 1", "Kd 1.0000001 0.5 0\nPr 1.0005", "Kd 0 0 0"] {
            assert!(read_red(sound).is_ok(), "{sound}");
        }
        assert!(read_red("Kd 1.01 0.5 0").is_err_and(|error| error.to_string().contains("expected 0 to 1")));
    }

    #[test]
    fn a_missing_usemtl_is_named() {
        assert!(undefined_material("g", None).to_string().contains("group 'g' has faces without `usemtl`"));
        assert!(undefined_material("g", Some("red")).to_string().contains("the material 'red', which no mtllib"));
    }

    #[test]
    fn colours_of_vertices_show_under_a_white_material() {
        let color = |material: &str| {
            let [r, g, b, ..] = red(material).values(0, DVec3::splat(1.0 / 3.0));
            Vec3::new(r, g, b)
        };
        assert!(color("Kd 1 1 1").abs_diff_eq(Vec3::X, 1e-5), "{}", color("Kd 1 1 1"));
        // Twin: another colour of the material is used alone.
        assert!(color("Kd 0.5 0.25 1").abs_diff_eq(Vec3::new(0.5, 0.25, 1.0), 1e-5), "{}", color("Kd 0.5 0.25 1"));
    }
}
