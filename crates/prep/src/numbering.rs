//! The numbers of instances and parts, which pictures hold in 16 bits.

use std::num::NonZeroU16;

/// More instances or parts than 16 bits can number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("more than {} instances or parts; split the scene", u16::MAX)]
pub struct TooMany;

/// The number as 16 bits. Fails for 0 and for numbers above 65535.
pub(crate) fn number(value: usize) -> Result<NonZeroU16, TooMany> {
    u16::try_from(value).ok().and_then(NonZeroU16::new).ok_or(TooMany)
}
