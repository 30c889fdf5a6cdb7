//! The largest files that are imported.

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
