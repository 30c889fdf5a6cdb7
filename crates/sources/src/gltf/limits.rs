//! Limits on an untrusted glTF, checked before memory is taken.

/// Upper bounds. The file is refused where its JSON or its buffers exceed them; anything else is left out, which is a
/// finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of the glTF, of any other file, and of all buffers together.
    pub file_bytes: u64,
    /// Bytes of the JSON.
    pub json_bytes: usize,
    /// Values in the JSON: numbers, texts, lists, objects.
    pub json_values: usize,
    /// Lists and objects in the JSON, each of which takes more memory than a number.
    pub json_containers: usize,
    /// Primitives of all nodes; a mesh counts as often as nodes show it.
    pub primitives: usize,
    /// Triangles of all instances; a mesh counts as often as nodes show it, even if it turns out to be faulty.
    pub triangles: usize,
    /// Vertices of all instances, counted like triangles.
    pub vertices: usize,
    /// Texels of all textures.
    pub texels: usize,
    /// Number of lights. Each is rendered apart, so that the light of a view can be weighted anew.
    pub lights: usize,
    /// Number of findings. Further ones are only counted.
    pub findings: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            file_bytes: 2 << 30,
            json_bytes: 64 << 20,
            json_values: 4 << 20,
            json_containers: 1 << 20,
            primitives: 200_000,
            triangles: 20_000_000,
            vertices: 30_000_000,
            texels: 512 << 20,
            lights: 128,
            findings: 5_000,
        }
    }
}
