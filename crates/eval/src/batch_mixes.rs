//! The lightings under which a batch of predictions is rendered together with its companions.

use mateval_tracer::LightMix;

/// The weights of the lights in each picture of a batch's render. Every prediction and every companion is rendered under
/// all of them, so that a prediction's pictures always have companions of the same lighting.
#[derive(Clone, Debug)]
pub(crate) struct BatchMixes {
    pub(crate) all: Vec<LightMix>,
    /// The number of pictures of each prediction.
    of_each: usize,
    /// Whether all predictions have the same pictures.
    shared: bool,
}

impl BatchMixes {
    /// All predictions have pictures under the same weights.
    pub(crate) fn shared(mixes: Vec<LightMix>) -> Self {
        let of_each = mixes.len();
        Self { all: mixes, of_each, shared: true }
    }

    /// Every prediction has pictures under weights of its own, equally many each.
    pub(crate) fn own(mixes: Vec<Vec<LightMix>>) -> Self {
        let of_each = mixes.first().map_or(0, Vec::len);
        Self { all: mixes.into_iter().flatten().collect(), of_each, shared: false }
    }

    /// The number of pictures of each prediction.
    pub(crate) fn pictures(&self) -> usize {
        self.of_each
    }

    /// The place of a picture of prediction `at` among those of the render.
    pub(crate) fn place(&self, at: usize, picture: usize) -> usize {
        if self.shared { picture } else { at * self.of_each + picture }
    }

    /// The weights of a picture of prediction `at`.
    pub(crate) fn mix(&self, at: usize, picture: usize) -> &LightMix {
        &self.all[self.place(at, picture)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_a_render_are_shared_or_apart() {
        let mix = |weight: f64| vec![[weight; 3]];
        let shared = BatchMixes::shared(vec![mix(1.0), mix(2.0)]);
        assert_eq!((shared.pictures(), shared.all.len()), (2, 2));
        assert_eq!(shared.mix(3, 1), &mix(2.0));
        let own = BatchMixes::own(vec![vec![mix(1.0), mix(2.0)], vec![mix(3.0), mix(4.0)]]);
        assert_eq!((own.pictures(), own.all.len()), (2, 4));
        assert_eq!((own.mix(0, 1), own.mix(1, 0)), (&mix(2.0), &mix(3.0)));
    }
}
