//! Limits on an untrusted house, checked before memory is taken.

/// Upper bounds. A house that exceeds them is refused; a model or texture that does is a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of a house's JSON. The largest known house has a twentieth of it.
    pub json_bytes: u64,
    /// Values in the JSON: numbers, texts, lists, objects.
    pub json_values: usize,
    /// Lists and objects in the JSON, each of which takes more memory than a number.
    pub json_containers: usize,
    /// Bytes of any other file.
    pub file_bytes: u64,
    /// Triangles of all models and meshes.
    pub triangles: usize,
    /// Texels of all textures.
    pub texels: usize,
    /// Number of rooms.
    pub rooms: usize,
    /// Children of all rooms.
    pub children: usize,
    /// Number of findings. Further ones are only counted.
    pub findings: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            json_bytes: 128 << 20,
            json_values: 16 << 20,
            json_containers: 1 << 20,
            file_bytes: 256 << 20,
            triangles: 20_000_000,
            texels: 512 << 20,
            rooms: 1_000,
            children: 50_000,
            findings: 5_000,
        }
    }
}
