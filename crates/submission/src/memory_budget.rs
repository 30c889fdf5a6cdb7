//! How much memory the maps of one scene may take together.

use mateval_image::Texture;

/// Most bytes that the texels of a scene's maps may take in memory together.
pub const MAX_SCENE_BYTES: usize = 8 << 30;

/// The memory that is left for the texels of a scene.
pub(crate) struct MemoryBudget {
    bytes_left: usize,
}

impl MemoryBudget {
    /// The budget of a scene, none of it used.
    pub(crate) fn of_scene() -> Self {
        Self { bytes_left: MAX_SCENE_BYTES }
    }

    /// Gives the texture back and counts its texels; none where they exceed the budget.
    pub(crate) fn holding(&mut self, texture: Texture) -> Option<Texture> {
        self.bytes_left = self.bytes_left.checked_sub(texture.bytes().len())?;
        Some(texture)
    }

    /// What is wrong where the budget is exceeded.
    pub(crate) fn exceeded() -> String {
        format!("the maps of its scene take more than {MAX_SCENE_BYTES} bytes together")
    }
}

#[cfg(test)]
mod tests {
    use mateval_image::{Texels, Wrap};

    use super::*;

    #[test]
    fn textures_are_counted_until_the_budget_is_used_up() {
        let texture = |side: usize| Texture::new(side, side, Texels::Grey8(vec![0; side * side]), Wrap::Clamp).unwrap();
        let mut budget = MemoryBudget { bytes_left: 150 };
        assert!(budget.holding(texture(10)).is_some() && budget.holding(texture(8)).is_none());
        assert!(budget.holding(texture(7)).is_some() && budget.bytes_left == 1);
    }
}
