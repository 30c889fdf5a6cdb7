//! How much of a stranger's scene is taken; checked before memory is.

/// Upper bounds of what is read. What goes beyond is a finding, or an error where it is the XML itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of the XML, before and after its variables are put in.
    pub xml_bytes: u64,
    /// Elements within elements.
    pub xml_depth: usize,
    /// Bytes of any other file.
    pub file_bytes: u64,
    /// Bytes of all OBJ files together, each counted as often as it is named; none is read once they are more.
    pub mesh_bytes: u64,
    /// Shapes.
    pub shapes: usize,
    /// Triangles of all shapes together.
    pub triangles: usize,
    /// Vertices of all shapes together.
    pub vertices: usize,
    /// Texels of all textures together.
    pub texels: usize,
    /// Findings; the rest is only counted.
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
