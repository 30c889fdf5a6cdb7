//! The parts of a BSDF that light of different kinds sees.

/// The part of a BSDF to evaluate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BsdfPart {
    /// All of it.
    All,
    /// The part that reflects stage lights ([`crate::StageLight`]), without highlights. Of principled materials this is the
    /// base and, in place of metal facets, a diffuse part with the light that they keep; of others, all but delta lobes.
    Stage,
}
