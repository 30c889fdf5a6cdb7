//! Why a file of an import was refused, and the largest files that are imported.

use mateval_dataset::gltf_file::GltfError;
use mateval_dataset::obj::ObjError;
use mateval_files::source_folder::FileFault;
use mateval_files::untrusted::shortened;
use mateval_image::ImageError;

/// Largest number of triangles in a file.
pub const MAX_TRIANGLES: usize = 5_000_000;
/// Largest number of vertices in a file; a mesh that several nodes share counts for each of them.
pub const MAX_VERTICES: usize = 3 * MAX_TRIANGLES;
/// Largest number of texels in all textures of a file.
pub const MAX_TEXELS: usize = 1 << 28;
/// Largest depth of a glTF's tree of nodes.
pub const MAX_DEPTH: usize = 64;
/// Largest size of a file, and of all buffers of a glTF together, in bytes.
pub const MAX_FILE_BYTES: u64 = 1 << 31;

/// Why a file was refused. The caller adds the file's path.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The file, or one that it names, is missing, unreadable, too large or outside the folder.
    #[error("{}", .0.message)]
    File(FileFault),
    /// The glTF or one of its accessors is unsound.
    #[error(transparent)]
    Gltf(#[from] GltfError),
    /// The OBJ, or the MTL file of this name, is unsound.
    #[error("{}{fault}", file_prefix(.file))]
    Obj {
        /// The MTL file; none for the OBJ itself.
        file: Option<String>,
        /// The line and what is wrong.
        fault: ObjError,
    },
    /// A texture cannot be decoded.
    #[error(transparent)]
    Texture(#[from] ImageError),
    /// A uri is not UTF-8 once it is percent-decoded.
    #[error("the uri '{}' is not UTF-8: {source}", shortened(.uri))]
    Uri {
        /// The uri as the file has it.
        uri: String,
        /// Where its bytes are not UTF-8.
        source: std::str::Utf8Error,
    },
    /// The file has more of something than is read.
    #[error("the file has more than {limit} {what}")]
    TooLarge {
        what: Limited,
        /// The largest number that is read.
        limit: u64,
    },
    /// A part of glTF that is not read.
    #[error("{0}")]
    Unsupported(Unsupported),
    /// The first buffer of a .gltf has no uri, or that of a .glb has no chunk.
    #[error("the first buffer has no data; expected a uri or a binary chunk")]
    BufferWithoutData,
    /// A glTF without a scene.
    #[error("the file has no scene")]
    NoScene,
    /// A node is the child of two others, or of itself.
    #[error("node {node} is the child of two nodes; expected a tree")]
    NotATree { node: usize },
    /// A node has too many ancestors.
    #[error("node {node} is nested more than {MAX_DEPTH} deep")]
    TooDeep { node: usize },
    /// A primitive of a node was refused.
    #[error("node {node} '{}': {source}", shortened(.name))]
    Node {
        node: usize,
        /// The node's name; empty where it has none.
        name: String,
        source: Box<ImportError>,
    },
    /// A primitive lacks an attribute.
    #[error("expected the attribute {attribute}, found none")]
    MissingAttribute { attribute: String },
    /// An attribute has another number of entries than the positions.
    #[error("{attribute} has {found} entries; expected {expected}, as POSITION has")]
    Count { attribute: String, found: usize, expected: usize },
    /// A number is infinite or NaN.
    #[error("{0} is not finite")]
    NotFinite(Place),
    /// No material states a base colour.
    #[error(
        "no material states a base colour, such as '{}'{}", shortened(.material), if *.glows {
            ", which has an emissive texture over black or white: baked colours belong into baseColorTexture"
        } else { ": bake it to a texture, or state baseColorFactor or COLOR_0" }
    )]
    NoBaseColor {
        /// A material of the file.
        material: String,
        /// Whether it has an emissive texture.
        glows: bool,
    },
    /// A colour that is out of range.
    #[error("{key} of '{}': expected 0 to 1, found {found:?}{}", shortened(.material), range_hint(.found))]
    OutOfRange {
        /// Such as `Kd`, or the JSON pointer of a glTF.
        key: String,
        material: String,
        found: Vec<f32>,
    },
    /// A group has a material that no MTL file defines.
    #[error("{}", undefined(.group, .material))]
    UndefinedMaterial {
        group: String,
        /// The material's name; empty where `usemtl` is missing.
        material: String,
    },
    /// A material without base colour.
    #[error("material '{}' has neither map_Kd nor Kd", shortened(.material))]
    MissingColor { material: String },
    /// Entries of `<scene>.json` that are wrong, all of them.
    #[error("{}", listed(.0))]
    Materials(Vec<MaterialFault>),
}

/// A quantity whose number in a file is limited.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Limited {
    /// Bytes of all buffers of a glTF together.
    #[error("bytes in its buffers")]
    BufferBytes,
    /// Texels of all textures together.
    #[error("texels in its textures")]
    Texels,
    /// Triangles of all meshes together.
    #[error("triangles")]
    Triangles,
    /// Vertices of all meshes together. A mesh that several nodes share counts for each of them.
    #[error("vertices, counted for each node that has them")]
    Vertices,
}

/// A feature that is not read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unsupported {
    #[error("data uris are not read; write a .glb, or files beside the .gltf")]
    DataUri,
    #[error("strips and fans are not read; write triangles")]
    StripsAndFans,
    /// Copies of a node's mesh by `EXT_mesh_gpu_instancing`.
    #[error("EXT_mesh_gpu_instancing is not read here; write a node for each copy")]
    Instancing,
    /// A sampler that wraps u and v in different ways.
    #[error("a sampler that wraps u and v in different ways is not read")]
    MixedWrap,
    /// Options before the file name of an MTL texture.
    #[error("'{}': options of a texture are not read; write the file name alone", shortened(.0))]
    TextureOptions(String),
}

/// A number of a file that is not finite.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Place {
    /// A corner of the OBJ's group of this name.
    #[error("a corner of group '{}'", shortened(.0))]
    GroupCorner(String),
    /// A position of a glTF, in world space.
    #[error("a position, once its node's transform is applied,")]
    WorldPosition,
}

/// What is wrong with an entry of `<scene>.json`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MaterialFault {
    /// No part or instance has this id.
    #[error("/{}: expected the id of a part or an instance", shortened(.0))]
    UnknownId(String),
    /// A number of the entry with this id is out of range.
    #[error("/{}: expected numbers from 0 to 1", shortened(.0))]
    OutOfRange(String),
}

impl From<FileFault> for ImportError {
    fn from(fault: FileFault) -> Self {
        Self::File(fault)
    }
}

fn file_prefix(file: &Option<String>) -> String {
    file.as_ref().map_or_else(String::new, |file| format!("'{}': ", shortened(file)))
}

/// A group whose material no MTL file defines, or that has none.
fn undefined(group: &str, material: &str) -> String {
    let group = shortened(group);
    if material.is_empty() {
        format!(
            "group '{group}' has faces without `usemtl`; expected `usemtl` before them, with a material that an mtllib of \
             the file defines, or a colour of every vertex (v x y z r g b)"
        )
    } else {
        format!("group '{group}' has the material '{}', which no mtllib of the file defines", shortened(material))
    }
}

/// What the range of a colour may be. Numbers that end little above 1 are not those of bytes.
fn range_hint(found: &[f32]) -> &'static str {
    if found.iter().any(|v| *v > 2.0) && found.iter().all(|v| (0.0..=255.0).contains(v)) {
        "; divide by 255"
    } else {
        ""
    }
}

fn listed(faults: &[MaterialFault]) -> String {
    faults.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_numbers_of_bytes_are_to_be_divided() {
        let text = |found: &[f32]| {
            let (key, material) = ("Kd".to_owned(), "m".to_owned());
            ImportError::OutOfRange { key, material, found: found.to_vec() }.to_string()
        };
        assert!(text(&[255.0, 128.0, 0.0]).ends_with("found [255.0, 128.0, 0.0]; divide by 255"));
        assert!(text(&[1.5, 1.0, 1.0]).ends_with("expected 0 to 1, found [1.5, 1.0, 1.0]"));
        assert!(text(&[-1.0, 3.0, 0.0]).ends_with("found [-1.0, 3.0, 0.0]"));
    }

    #[test]
    fn a_missing_usemtl_is_named() {
        let text = |material: &str| {
            ImportError::UndefinedMaterial { group: "g".to_owned(), material: material.to_owned() }.to_string()
        };
        assert!(text("").contains("group 'g' has faces without `usemtl`"));
        assert!(text("red").contains("the material 'red', which no mtllib"));
    }
}
