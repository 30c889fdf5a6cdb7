//! The name and version of this program, which datasets and results record.

/// As in `mateval 0.1.0`.
pub const TOOL: &str = concat!("mateval ", env!("CARGO_PKG_VERSION"));
