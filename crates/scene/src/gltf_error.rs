//! What can be wrong with a glTF file.

use gltf::accessor::DataType;

/// Why a glTF file, or a part of it, cannot be read. Accessors and buffer views are named by their index in the file.
#[derive(Debug, thiserror::Error)]
pub enum GltfError {
    /// The `gltf` crate refuses it.
    #[error("not valid glTF: {0}")]
    Unsound(#[from] gltf::Error),
    /// It is not the JSON of a glTF.
    #[error("not valid glTF: {reason}{hint}")]
    NotJson {
        /// The parser's reason.
        reason: serde_json::Error,
        /// What the file is instead, and what to do; empty where that is not known.
        hint: String,
    },
    /// The picture of a texture exists in a format that is not read.
    #[error(
        "/textures/{texture}: its only picture is KTX2 (KHR_texture_basisu), which is not read; convert the file with \
         `gltf-transform ktxdecompress`"
    )]
    OnlyKtx2 {
        /// The texture.
        texture: usize,
    },
    /// A binary file states a length that cannot hold its own header.
    #[error("not valid glTF: a binary file that states a length of {length} bytes; its header alone has 12")]
    StatedLength {
        /// The length that the file states.
        length: u32,
    },
    /// An attribute of a mesh names an accessor that the file does not have.
    #[error("not valid glTF: an attribute names an accessor that does not exist")]
    NoAccessor,
    /// An image has neither a file nor a buffer view with its type.
    #[error("/images/{image}: expected `uri`, or `bufferView` and `mimeType`")]
    NoImageSource {
        /// The image.
        image: usize,
    },
    /// A camera lacks the projection of its type.
    #[error("/cameras/{camera}: expected a projection of the camera's type")]
    NoProjection {
        /// The camera.
        camera: usize,
    },
    /// The entries of an accessor hold another number of numbers.
    #[error("accessor {accessor}: expected {expected} numbers an entry, found {found}")]
    OtherNumbers {
        /// The accessor.
        accessor: usize,
        /// Numbers an entry that are needed.
        expected: usize,
        /// Numbers an entry that it has.
        found: usize,
    },
    /// An accessor states too many entries.
    #[error("accessor {accessor}: expected at most {most} bytes, found more")]
    AccessorTooLarge {
        /// The accessor.
        accessor: usize,
        /// The most bytes of its contents.
        most: usize,
    },
    /// An entry of an accessor is NaN or infinite.
    #[error("accessor {accessor}: entry {entry} is not finite")]
    NotFinite {
        /// The accessor.
        accessor: usize,
        /// The entry.
        entry: usize,
    },
    /// An accessor that should hold indices holds something else.
    #[error("accessor {accessor}: expected indices, found {found:?}")]
    NotIndices {
        /// The accessor.
        accessor: usize,
        /// The type of its numbers.
        found: DataType,
    },
    /// An accessor of indices holds several an entry.
    #[error("accessor {accessor}: expected one index an entry")]
    NotOneIndex {
        /// The accessor.
        accessor: usize,
    },
    /// An index names a vertex that the mesh does not have.
    #[error("index {at} is {index}, expected less than {vertices}")]
    IndexOutOfRange {
        /// Its place among the indices.
        at: usize,
        /// The index.
        index: u32,
        /// Vertices of the mesh.
        vertices: usize,
    },
    /// The number of indices is not a multiple of three.
    #[error("{indices} indices, expected three a triangle")]
    NotTriangles {
        /// The number of indices.
        indices: usize,
    },
    /// A buffer view reaches outside its buffer.
    #[error("buffer view {view} reaches outside its buffer")]
    ViewOutside {
        /// The buffer view.
        view: usize,
    },
    /// An accessor reaches outside its buffer.
    #[error("accessor {accessor} reaches outside its buffer")]
    AccessorOutside {
        /// The accessor.
        accessor: usize,
    },
    /// A mesh of no primitive, or of several.
    #[error("expected one primitive per mesh, found {found}")]
    NotOnePrimitive {
        /// How many it has.
        found: usize,
    },
    /// A mesh lacks an attribute or its indices.
    #[error("expected {attribute}")]
    Missing {
        /// As in `POSITION`.
        attribute: &'static str,
    },
    /// The attributes of a mesh differ in length.
    #[error("expected as many entries of NORMAL and TEXCOORD_0 as of POSITION")]
    CountsDiffer,
}
