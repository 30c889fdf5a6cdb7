//! Errors of the reader of glTF. Places are JSON pointers (RFC 6901).

use gltf::json::validation;
use mateval_scene::findings::shortened;
use mateval_scene::gltf_error::GltfError;
use mateval_scene::source_folder::FileFault;

/// Why a file is not a glTF scene that can be read.
#[derive(Debug, thiserror::Error)]
pub enum GltfSceneError {
    /// The JSON is too large.
    #[error(
        "expected JSON of at most {most_bytes} bytes, {most_values} values and {most_containers} lists and objects, found \
         {bytes}, {values} and {containers}"
    )]
    TooLarge {
        /// Bytes of the JSON.
        bytes: usize,
        /// Its values.
        values: usize,
        /// Its lists and objects.
        containers: usize,
        /// The most bytes allowed.
        most_bytes: usize,
        /// The most values allowed.
        most_values: usize,
        /// The most lists and objects allowed.
        most_containers: usize,
    },
    /// The file cannot be read without an extension that is not supported, such as a compression of meshes.
    #[error("/extensionsRequired: '{name}' is not supported; {way_out}")]
    RequiredExtension {
        /// The extension's name, shortened.
        name: String,
        /// What to do.
        way_out: &'static str,
    },
    /// A mesh or a buffer view exists in a compressed form alone, which is not supported.
    #[error("{pointer}: its data are compressed ('{name}'), which is not supported; {way_out}")]
    OnlyCompressed {
        /// The primitive or buffer view.
        pointer: String,
        /// The extension's name.
        name: &'static str,
        /// What to do.
        way_out: &'static str,
    },
    /// The file breaks the rules of glTF.
    #[error("{pointer}: {reason}{}", and_more(*others))]
    NotValid {
        /// The first place that breaks them.
        pointer: String,
        /// How it breaks them.
        reason: validation::Error,
        /// The number of further places.
        others: usize,
    },
    /// The file is not glTF.
    #[error(transparent)]
    NotGltf(GltfError),
    /// The file has no scene.
    #[error("/scenes: expected a scene, found none")]
    NoScene,
    /// The bytes of a buffer cannot be had.
    #[error("/buffers/{buffer}/uri: {reason}")]
    Buffer {
        /// The buffer.
        buffer: usize,
        /// Why not.
        reason: FileFault,
    },
    /// A buffer without a file is not the binary part of a .glb.
    #[error("/buffers/{buffer}: expected a `uri`, or a .glb with a binary part")]
    BufferWithoutData {
        /// The buffer.
        buffer: usize,
    },
    /// The buffers are too large.
    #[error("/buffers: expected at most {most} bytes together, found more")]
    BuffersTooLarge {
        /// The most bytes allowed.
        most: u64,
    },
}

impl From<GltfError> for GltfSceneError {
    fn from(error: GltfError) -> Self {
        let GltfError::Unsound(gltf::Error::Validation(faults)) = &error else { return Self::NotGltf(error) };
        match faults.first() {
            Some((path, reason)) => {
                let pointer = shortened(&pointer(path.as_str()));
                Self::NotValid { pointer, reason: *reason, others: faults.len() - 1 }
            }
            None => Self::NotGltf(error),
        }
    }
}

/// A path of the gltf crate, as in `meshes[0].name`, as a JSON pointer: `/meshes/0/name`.
fn pointer(path: &str) -> String {
    format!("/{}", path.replace(['.', '['], "/").replace([']', '"'], ""))
}

fn and_more(others: usize) -> String {
    match others {
        0 => String::new(),
        1 => ", and 1 more fault".to_owned(),
        _ => format!(", and {others} more faults"),
    }
}

/// Why a primitive of a mesh is left out.
#[derive(Debug, thiserror::Error)]
pub(super) enum PrimitiveFault {
    /// An accessor cannot be read, or its content is not what is wanted.
    #[error(transparent)]
    Accessor(#[from] GltfError),
    /// The scene would exceed the limits.
    #[error("the scene has more than {triangles} triangles or {vertices} vertices")]
    TooLarge {
        /// The most triangles allowed.
        triangles: usize,
        /// The most vertices allowed.
        vertices: usize,
    },
    /// The primitive consists of points or lines.
    #[error("points or lines")]
    NotASurface,
}

impl PrimitiveFault {
    /// The code of its finding.
    pub(super) fn code(&self) -> &'static str {
        match self {
            Self::Accessor(_) => "bad_mesh",
            Self::TooLarge { .. } => "limit",
            Self::NotASurface => "not_a_surface",
        }
    }
}
