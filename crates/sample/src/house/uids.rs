//! The made-up ids of the house, its models and its textures. They are shaped as the data's and all begin with `cc`.

/// The id of the house.
pub(super) const HOUSE: &str = "cc000000-5a3b-4e00-8000-000000000001";

/// The id of a furniture model, which names its folder.
pub(super) fn model(number: u32) -> String {
    format!("cc0f0000-5a3b-4e00-8000-{number:012}")
}

/// The id of a texture of the architecture, which names its folder.
pub(super) fn texture(number: u32) -> String {
    format!("cc0a0000-5a3b-4e00-8000-{number:012}")
}
