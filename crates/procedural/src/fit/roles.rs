//! What a fit does with a parameter, by the names that the built-in graphs use.

use crate::graph::{FOOTPRINT, Graph};
use crate::value::Type;

/// What a parameter is to a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The turn of the pattern.
    Turn,
    /// The place of the pattern.
    Shift,
    /// A colour at places that can be predicted.
    Color,
    /// A colour at places that are random.
    RandomColor,
    /// How strong something random is; at its least value there is none of it.
    Amplitude,
    /// The size of something random, in metres or relative to another size.
    RandomSize,
    /// A length or a share of what can be predicted.
    Shape,
    /// Not visible in colours, or chosen by the fit in other ways.
    Kept,
}

/// Sizes of what is random.
const RANDOM_SIZES: [&str; 17] = [
    "grain_size",
    "stone_size",
    "cloud_size",
    "pore_size",
    "chip_size",
    "large_size",
    "small_size",
    "vein_scale",
    "warp",
    "sharpness",
    "band_period",
    "stretch",
    "pile_size",
    "cell_size",
    "streak_length",
    "streak_width",
    "ring_period",
];

/// The role of a parameter.
pub fn role(graph: &Graph, parameter: usize) -> Role {
    let name = graph.parameters[parameter].name.as_str();
    match (name, graph.parameters[parameter].value.kind()) {
        ("theta", _) => Role::Turn,
        ("t_u" | "t_v", _) => Role::Shift,
        (FOOTPRINT | "softness" | "surface_roughness" | "row_random", _) => Role::Kept,
        (_, Type::Color3) if is_random_color(&graph.name, name) => Role::RandomColor,
        (_, Type::Color3) => Role::Color,
        // Ribs and threads are nothing but their tone.
        ("depth_tone", Type::Float) if matches!(graph.name.as_str(), "corduroy" | "weave") => Role::Shape,
        ("contrast" | "tone" | "grain" | "pile" | "clouds" | "edge_wear" | "pore_density", Type::Float)
        | ("depth_tone" | "crease_tone", Type::Float) => Role::Amplitude,
        (_, Type::Float) if RANDOM_SIZES.contains(&name) => Role::RandomSize,
        ("melange" | "coverage" | "small_share", Type::Float) => Role::RandomSize,
        (_, Type::Float) => Role::Shape,
        _ => Role::Kept,
    }
}

/// Whether a parameter is a length: graphs state units in the parameter's `doc`, the only place for them.
pub(crate) fn is_length(graph: &Graph, parameter: usize) -> bool {
    graph.parameters[parameter].doc.as_ref().is_some_and(|doc| doc.contains("in metres"))
}

/// Colours of cells, chips, veins and the like.
fn is_random_color(graph: &str, name: &str) -> bool {
    match graph {
        "terrazzo" | "granite" | "marble" | "travertine" | "veneer" | "carpet" => true,
        "mosaic" => name != "joint_color",
        _ => false,
    }
}
