//! Limits on an untrusted scene, checked before memory is taken.

/// Upper bounds. Exceeding one is an error for the XML itself, and a finding for anything else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of the XML, before and after variables are substituted.
    pub xml_bytes: u64,
    /// Depth of nested elements.
    pub xml_depth: usize,
    /// Bytes of any other file.
    pub file_bytes: u64,
    /// Bytes of all OBJ files, each counted as often as it is named. Once exceeded, no further file is read.
    pub mesh_bytes: u64,
    /// Number of shapes.
    pub shapes: usize,
    /// Triangles of all shapes.
    pub triangles: usize,
    /// Vertices of all shapes.
    pub vertices: usize,
    /// Texels of all textures.
    pub texels: usize,
    /// Number of findings. Further ones are only counted.
    pub findings: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            xml_bytes: 64 << 20,
            xml_depth: 64,
            file_bytes: 512 << 20,
            mesh_bytes: 4 << 30,
            shapes: 100_000,
            triangles: 50_000_000,
            vertices: 50_000_000,
            texels: 512 << 20,
            findings: 5_000,
        }
    }
}
