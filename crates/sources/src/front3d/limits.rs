//! How much of a stranger's house is taken; checked before memory is.

/// Upper bounds of what is read. Beyond them a house is refused, a model is a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of a house's JSON. The largest house known to us has a twentieth of it.
    pub json_bytes: u64,
    /// Values in it: numbers, texts, lists, objects.
    pub json_values: usize,
    /// Lists and objects in it, each of which costs more than a number.
    pub json_containers: usize,
    /// Bytes of any other file.
    pub file_bytes: u64,
    /// Triangles of one model or mesh, and of all together.
    pub triangles: usize,
    /// Texels of all textures together.
    pub texels: usize,
    /// Rooms of a house.
    pub rooms: usize,
    /// Children of all rooms together.
    pub children: usize,
    /// Findings; the rest is only counted.
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
