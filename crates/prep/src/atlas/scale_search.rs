//! Searches the largest scale at which charts fit into a square, by packing them at few scales.

/// The share of the square's side beyond which a packing that fits is dense enough.
const DENSE: f64 = 0.96;
/// The share of the square's side that a packing aims at.
const AIM: f64 = 0.985;
/// The factor on the scale after a packing that overflowed, since xatlas does not report by how much it overflowed.
pub(super) const OVERFLOW_STEP: f64 = 0.7;
/// How often a packing that fits is made denser. Each takes as long as the first.
const MAX_REFINEMENTS: u32 = 4;
/// How many packings must be too large before charts count as ones that never fit.
const LEAST_TRIES: u32 = 8;

/// The result of packing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packed {
    /// The longer side in texels.
    Side(u32),
    /// Larger than the square that xatlas was given: at least one chart was made smaller or is in another atlas.
    Overflow,
}

impl Packed {
    /// Whether it fits into a square of this size.
    pub(super) fn fits(self, size: u32) -> bool {
        matches!(self, Self::Side(side) if side <= size)
    }
}

/// A packing: its scale and its side in texels.
type Packing = (f64, f64);

/// The packings so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Search {
    /// The last two that fit, the last one first, which is the densest.
    fits: [Option<Packing>; 2],
    /// The last two that do not, the last one first.
    too_large: [Option<Packing>; 2],
    refinements: u32,
    /// Number of packings that were too large.
    too_large_count: u32,
}

impl Search {
    /// The scale to try after a packing. None where one is dense enough or no other is worth a try, or where the charts fit at no
    /// scale.
    pub(super) fn next(&mut self, scale: f64, packed: Packed, wanted: f64) -> Option<f64> {
        let packing = match packed {
            // Its side is not known.
            Packed::Overflow => return self.fits[0].is_none().then_some(scale * OVERFLOW_STEP),
            Packed::Side(side) => (scale, f64::from(side.max(1))),
        };
        if packing.1 <= wanted {
            self.fits = [Some(packing), self.fits[0]];
        } else {
            self.too_large = [Some(packing), self.too_large[0]];
            self.too_large_count += 1;
        }
        self.refinements += u32::from(self.fits[0].is_some());
        match (self.fits, self.too_large) {
            ([Some(fits), _], _) if fits.1 >= DENSE * wanted || self.refinements > MAX_REFINEMENTS => None,
            ([Some(fits), None], [None, _]) => Some(fits.0 * AIM * wanted / fits.1),
            ([Some(fits), Some(before)], [None, _]) => Some(larger(before, fits, wanted)),
            ([Some(fits), _], [Some(large), _]) => between(fits, large, wanted),
            ([None, _], [Some(last), None]) => Some(last.0 * AIM * AIM * wanted / last.1),
            ([None, _], [Some(last), Some(before)]) => {
                smaller(before, last, wanted, self.too_large_count < LEAST_TRIES)
            }
            ([None, _], [None, _]) => unreachable!("a packing fits or is too large"),
        }
    }
}

/// The scale to try after two packings that fit, the second of which was not dense enough: on the line through both, since
/// gutters do not grow with the scale, but at most twice the last.
fn larger(before: Packing, last: Packing, wanted: f64) -> f64 {
    let slope = (last.1 - before.1) / (last.0 - before.0);
    let (on_line, proportional) = (last.0 + (AIM * wanted - last.1) / slope, last.0 * AIM * wanted / last.1);
    if slope > 0.0 { on_line.clamp(proportional, (2.0 * last.0).max(proportional)) } else { proportional }
}

/// The scale between one that fits and one that is too large at which the side would be right, if it grew evenly.
fn between(fits: Packing, large: Packing, wanted: f64) -> Option<f64> {
    let next = fits.0 + (large.0 - fits.0) * (AIM * wanted - fits.1) / (large.1 - fits.1);
    // A gain of less than a hundredth is not worth a packing.
    (next > 1.01 * fits.0 && next < large.0).then_some(next)
}

/// The scale to try after two packings that were too large. None where the charts do not fit at any scale, which is not
/// believed if it is `early`: sides of packings are not smooth.
///
/// At small scales gutters take most of the square. The square root of the area of charts and gutters is a convex function
/// of the scale, so that the line through two packings lies below it beyond them.
fn smaller(before: Packing, last: Packing, wanted: f64, early: bool) -> Option<f64> {
    let slope = (before.1 - last.1) / (before.0 - last.0);
    let at_zero = last.1 - slope * last.0;
    let (on_line, proportional) = ((AIM * wanted - at_zero) / slope, last.0 * AIM * AIM * wanted / last.1);
    let next = if on_line > 0.0 { on_line.min(proportional).max(proportional / 2.0) } else { proportional / 2.0 };
    (at_zero < wanted || early).then_some(next)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Charts whose sides sum up to 2 units, and gutters of `gutters` texels.
    fn search(wanted: u32, mut scale: f64, gutters: f64) -> (Option<f64>, usize) {
        let (mut search, mut densest, mut count) = (Search::default(), None, 0);
        loop {
            count += 1;
            let side = ((2.0 * scale).powi(2) + gutters.powi(2)).sqrt().ceil() as u32;
            let packed = if side > 4 * wanted { Packed::Overflow } else { Packed::Side(side) };
            if packed.fits(wanted) {
                densest = Some(scale);
            }
            match search.next(scale, packed, f64::from(wanted)) {
                Some(next) => scale = next,
                None => return (densest, count),
            }
        }
    }

    #[test]
    fn few_packings_find_a_dense_one_from_any_scale() {
        for gutters in [0.0, 200.0, 800.0] {
            let best = ((1000.0_f64.powi(2) - gutters * gutters).sqrt()) / 2.0;
            for first in [0.1, 0.5, 0.9, 1.0, 1.2, 3.0, 20.0] {
                let (found, count) = search(1000, first * best, gutters);
                let found = found.unwrap();
                assert!(found <= best && found > 0.8 * best, "{found} for {best} from {first}");
                assert!(count <= 12, "{count} packings");
            }
        }
    }

    #[test]
    fn gutters_that_fill_the_square_are_noticed() {
        let (found, count) = search(1000, 500.0, 1100.0);
        assert!(found.is_none() && count <= 8, "{count} packings");
    }
}
