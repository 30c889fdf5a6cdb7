//! Which parameters of the built-in graphs are periods.

/// How the sizes of a graph are found from waves.
#[derive(Clone, Copy, Debug)]
pub(super) enum Layout {
    /// One length, by which the whole pattern scales, and its whole-number parameter, of which all values are tried.
    Similar { length: &'static str, whole: Option<(&'static str, i32, i32)> },
    /// Rows of cells that begin anywhere.
    Rows { width: &'static str, length: &'static str, whole: Option<(&'static str, i32, i32)> },
    /// A length along u and one along v, the period in lengths, and the shift from row to row.
    Axes { u: &'static str, v: &'static str, periods: f64, shift: Option<&'static str> },
}

/// The layout of a built-in graph; `None` for those that are not fitted.
pub(super) fn layout(graph: &str) -> Option<Layout> {
    let similar = |length, whole| Some(Layout::Similar { length, whole });
    let axes = |u, v, periods| Some(Layout::Axes { u, v, periods, shift: None });
    let rows = |u, v, shift| Some(Layout::Axes { u, v, periods: 1.0, shift: Some(shift) });
    match graph {
        "stripes" => similar("period", None),
        "corduroy" => similar("rib_period", None),
        "hexagon" => similar("side", None),
        "houndstooth" => similar("size", None),
        "herringbone" => similar("width", Some(("ratio", 3, 7))),
        "weave" => similar("pitch", Some(("twill", 1, 3))),
        "basket_parquet" => similar("square", Some(("strips", 2, 6))),
        "mosaic" => similar("size", None),
        "concrete" => axes("panel_u", "panel_v", 1.0),
        "plank" => Some(Layout::Rows { width: "width", length: "length", whole: None }),
        "strip_parquet" => Some(Layout::Rows { width: "width", length: "length", whole: Some(("strips", 2, 4)) }),
        "tile" => axes("size_u", "size_v", 1.0),
        "brick" => rows("size_u", "size_v", "row_shift"),
        "dots" => rows("pitch_u", "pitch_v", "stagger"),
        "trellis" => axes("pitch_u", "pitch_v", 1.0),
        "plaid" => axes("period_u", "period_v", 1.0),
        "checks" => axes("size_u", "size_v", 2.0),
        _ => None,
    }
}
