//! Where the roughness and metallic of a house come from, since the data states neither.

/// How roughness and metallic are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AppearanceRule {
    /// Roughness 0.5 and metallic 0 everywhere, as in BlenderProc.
    #[default]
    Constant,
    /// By the class of material that the data states, with a roughness drawn from the range of that class.
    Stated {
        /// The seed of the draws.
        seed: u64,
    },
}
