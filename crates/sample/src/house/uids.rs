//! The ids of the house, its models and its textures: made up, shaped as the data's, all beginning with `cc0`.

/// The house's.
pub(super) const HOUSE: &str = "cc000000-5a3b-4e00-8000-000000000001";

/// A furniture model's, the name of its folder.
pub(super) fn model(number: u32) -> String {
    format!("cc0f0000-5a3b-4e00-8000-{number:012}")
}

/// A layout texture's, the name of its folder.
pub(super) fn texture(number: u32) -> String {
    format!("cc0a0000-5a3b-4e00-8000-{number:012}")
}
