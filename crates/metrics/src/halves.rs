//! A render in two independent halves.

use mateval_image::Picture;

/// One picture rendered twice, with the same number of samples and different seeds.
#[derive(Clone, Copy, Debug)]
pub struct Halves<'a, P> {
    /// One half.
    pub a: &'a Picture<P>,
    /// The other half.
    pub b: &'a Picture<P>,
}
