//! Limits on an untrusted `.mtlx` file, checked before memory is taken.

/// Upper bounds. A file that exceeds one is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of the file.
    pub bytes: usize,
    /// Elements, texts and comments of the XML.
    pub xml_nodes: u32,
    /// Attributes of an element. Each is compared with all earlier ones of its element.
    pub attributes: usize,
    /// Namespaces of the XML. An element that declares one copies all those of its parent.
    pub namespaces: usize,
    /// Depth of nested elements. The elements that are supported nest four deep.
    pub xml_depth: usize,
    /// Nodes of the graph.
    pub nodes: usize,
    /// Parameters of the graph.
    pub parameters: usize,
    /// Findings. Further ones are only counted.
    pub findings: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            bytes: 4 << 20,
            xml_nodes: 1 << 16,
            attributes: 64,
            namespaces: 16,
            xml_depth: 8,
            nodes: 2048,
            parameters: 256,
            findings: 200,
        }
    }
}

/// The greatest number of octaves of a fractal, since each costs as much as a noise.
pub const MOST_OCTAVES: i32 = 16;
