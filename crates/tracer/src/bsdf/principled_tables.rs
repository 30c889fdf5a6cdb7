//! What the facets of Blender's `principled` reflect in all directions together, integrated by us at start-up.
//!
//! Cycles compensates its single bounce off GGX facets (height-correlated masking) by tables of what that bounce keeps,
//! and weakens the base under the dielectric facets by a table of what those reflect. A lookup interpolates linearly, and
//! near grazing views its grid is coarse: what Blender shows there is the interpolation, not the integral. So our grids
//! are Blender's (4.5: 32 x 32 over roughness and cosine, 16 x 16 x 16 with the index of refraction), with values of our
//! own. 5 KiB in all, for any number of materials of one index.

use std::array::from_fn;
use std::sync::OnceLock;

use glam::Vec3;
use mateval_scene::material::Distribution;

use super::facets::{Facets, reflect};
use super::fresnel;

/// What every lookup begins with, for one index of refraction.
#[derive(Clone, Debug)]
pub(crate) struct BlenderTables {
    facets: &'static FacetTables,
    /// See [`Self::rise`]; roughness runs fastest.
    rise: Grid<COARSE>,
    f0: f32,
    /// The mean Fresnel term that light meets between facets.
    mean: f32,
}

/// What does not depend on the index.
#[derive(Debug)]
struct FacetTables {
    kept: Grid<FINE>,
    mean_kept: [f32; FINE],
}

/// What facets do with light from one direction, as far as it does not depend on what they are made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kept {
    /// The share of light that leaves after one bounce.
    pub(crate) share: f32,
    /// The same, averaged over all directions by their cosine.
    pub(crate) mean: f32,
}

/// Row k is for the cosine k / (N - 1), entry k of a row for that roughness.
type Grid<const N: usize> = [[f32; N]; N];

const FINE: usize = 32;
const COARSE: usize = 16;

/// Where the first entries of Blender's tables lie, roughness and cosine alike, instead of at 0.
const FIRST: f32 = 1e-4;

impl BlenderTables {
    /// `eta` is at least 1.
    pub(crate) fn new(eta: f32) -> Self {
        static FACETS: OnceLock<FacetTables> = OnceLock::new();
        let f0 = f0_from_eta(eta);
        let mean = ((mean_fresnel(eta) - f0) / (1.0 - f0)).clamp(0.0, 1.0);
        let facets = FACETS.get_or_init(FacetTables::new);
        Self { facets, rise: rise(eta), f0, mean: f0 + (1.0 - f0) * mean }
    }

    /// What facets do with light from the cosine `cos`.
    pub(crate) fn kept(&self, roughness: f32, cos: f32) -> Kept {
        let FacetTables { kept, mean_kept } = self.facets;
        let across = Step::new(roughness, FINE);
        Kept { share: look_up(kept, across, Step::new(cos, FINE)), mean: across.blend(mean_kept) }
    }

    /// How far the reflection of the dielectric facets has risen from f0 (0) towards everything (1), averaged over the
    /// facets that are seen from the cosine `cos`; those that reflect downwards count 0.
    pub(crate) fn rise(&self, roughness: f32, cos: f32) -> f32 {
        look_up(&self.rise, Step::new(roughness, COARSE), Step::new(cos, COARSE))
    }

    /// The share of light that is reflected head on.
    pub(crate) fn f0(&self) -> f32 {
        self.f0
    }

    /// The Fresnel term averaged over all directions by their cosine.
    pub(crate) fn mean_fresnel(&self) -> f32 {
        self.mean
    }
}

impl Kept {
    /// What one bounce is multiplied by so that the light which more bounces bring is there too, for facets that reflect
    /// `fresnel` of it on the way: Kulla and Conty, "Revisiting Physically Based Shading at Imageworks" (SIGGRAPH 2017
    /// course), without the part that has a shape of its own.
    pub(crate) fn gain(&self, fresnel: f32) -> f32 {
        let between = fresnel * self.mean / (1.0 - fresnel * (1.0 - self.mean));
        1.0 + between * (1.0 - self.share) / self.share
    }
}

/// A place between two entries of a row.
#[derive(Clone, Copy)]
struct Step {
    lower: usize,
    part: f32,
}

impl Step {
    /// `value` from 0 to 1, of `count` entries.
    fn new(value: f32, count: usize) -> Self {
        let position = value.clamp(0.0, 1.0) * (count - 1) as f32;
        let lower = (position as usize).min(count - 2);
        Self { lower, part: position - lower as f32 }
    }

    fn blend<const N: usize>(&self, row: &[f32; N]) -> f32 {
        row[self.lower] + self.part * (row[self.lower + 1] - row[self.lower])
    }
}

fn look_up<const N: usize>(grid: &Grid<N>, across: Step, along: Step) -> f32 {
    let (a, b) = (across.blend(&grid[along.lower]), across.blend(&grid[along.lower + 1]));
    a + along.part * (b - a)
}

/// Entry `k` of `count` lies here.
fn place(k: usize, count: usize) -> f32 {
    (k as f32 / (count - 1) as f32).clamp(FIRST, 1.0)
}

impl FacetTables {
    fn new() -> Self {
        let kept = from_fn(|row| from_fn(|column| kept_share(place(column, FINE), place(row, FINE))));
        Self { kept, mean_kept: from_fn(|column| mean_kept(place(column, FINE))) }
    }
}

/// The share of light from the cosine `cos` that leaves after one bounce.
fn kept_share(roughness: f32, cos: f32) -> f32 {
    let sight = Sight::new(roughness, cos);
    mean_over(POINTS, |k| sight.reflect(lattice(k)).map_or(0.0, |(_, wi)| sight.unmasked(wi)))
}

/// The integral of 2 mu kept(mu).
fn mean_kept(roughness: f32) -> f32 {
    const CUBE_POINTS: u32 = 8192;
    mean_over(CUBE_POINTS, |k| {
        let cos = (k as f32 + 0.5) / CUBE_POINTS as f32;
        let sight = Sight::new(roughness, cos);
        let kept = sight.reflect([part(k, PLASTIC), 0.5 * part(k, PLASTIC * PLASTIC)]);
        2.0 * cos * kept.map_or(0.0, |(_, wi)| sight.unmasked(wi))
    })
}

/// Between the two indices around `eta` that Blender's table has: at F0 = z^4 with z a multiple of 1/15.
fn rise(eta: f32) -> Grid<COARSE> {
    let slice = Step::new(((eta - 1.0) / (eta + 1.0)).sqrt(), COARSE);
    let eta_of = |k: usize| {
        let z = (k as f32 / (COARSE - 1) as f32).clamp(FIRST, 0.99);
        (1.0 + z * z) / (1.0 - z * z)
    };
    let (low, high) = (eta_of(slice.lower), eta_of(slice.lower + 1));
    let risen = |cos: f32| risen(cos, low) * (1.0 - slice.part) + risen(cos, high) * slice.part;
    let at = |roughness: f32, cos: f32| {
        let sight = Sight::new(roughness, cos);
        mean_over(POINTS, |k| sight.reflect(lattice(k)).map_or(0.0, |(m, _)| risen(sight.wo.dot(m))))
    };
    from_fn(|row| from_fn(|column| at(place(column, COARSE), place(row, COARSE))))
}

/// How far the reflection has risen from that at right angles (0) to everything (1).
fn risen(cos: f32, eta: f32) -> f32 {
    let f0 = f0_from_eta(eta);
    ((fresnel::dielectric(cos, eta).0 - f0) / (1.0 - f0)).clamp(0.0, 1.0)
}

fn f0_from_eta(eta: f32) -> f32 {
    let root = (eta - 1.0) / (eta + 1.0);
    root * root
}

/// The integral of 2 mu F(mu): Kulla and Conty's fit, for an index of at least 1.
fn mean_fresnel(eta: f32) -> f32 {
    (eta - 1.0) / (4.08567 + 1.00071 * eta)
}

/// Facets and a direction from which they are seen.
struct Sight {
    alpha2: f32,
    facets: Facets,
    wo: Vec3,
}

impl Sight {
    fn new(roughness: f32, cos: f32) -> Self {
        // Below this Blender takes the surface for a mirror.
        let alpha = if roughness < SMOOTH { 0.0 } else { roughness * roughness };
        let facets = Facets::new(Distribution::Ggx, alpha);
        Self { alpha2: alpha * alpha, facets, wo: Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos) }
    }

    /// One of the facets that are seen, and where it reflects; none if that is downwards.
    fn reflect(&self, u: [f32; 2]) -> Option<(Vec3, Vec3)> {
        let m = if self.alpha2 == 0.0 { Vec3::Z } else { self.facets.sample(self.wo, u) };
        let wi = reflect(self.wo, m);
        (wi.z > 0.0).then_some((m, wi))
    }

    /// The share of the light to `wi` that no other facet stops: Smith's G2 over G1, with heights (Heitz, "Understanding
    /// the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 2014, equations 43 and 99).
    fn unmasked(&self, wi: Vec3) -> f32 {
        let slope = |z: f32| (z * z + self.alpha2 * (1.0 - z * z)).sqrt() / z;
        (1.0 + slope(self.wo.z)) / (slope(self.wo.z) + slope(wi.z))
    }
}

/// Blender's limit on alpha^4, 2e-10, as a roughness.
const SMOOTH: f32 = 3.76e-3;

/// For each entry of the tables over two parameters.
const POINTS: u32 = 2048;

/// 1 over the golden ratio and 1 over the plastic number, whose multiples' fractions fill a line and a square evenly
/// (Weyl's theorem; the second after Roberts, 2018).
const GOLDEN: f64 = 0.618_033_988_749_895;
const PLASTIC: f64 = 0.754_877_666_246_693;

fn mean_over(points: u32, value: impl Fn(u32) -> f32) -> f32 {
    ((0..points).map(|k| f64::from(value(k))).sum::<f64>() / f64::from(points)) as f32
}

/// The fraction of `k` steps.
fn part(k: u32, step: f64) -> f32 {
    (f64::from(k) * step).fract() as f32
}

/// Point `k` of an even lattice over half of the square: the other half of the facets mirrors it.
fn lattice(k: u32) -> [f32; 2] {
    [(k as f32 + 0.5) / POINTS as f32, 0.5 * part(k, GOLDEN)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn total(values: impl IntoIterator<Item = f32>) -> f64 {
        values.into_iter().map(f64::from).sum()
    }

    #[test]
    fn smooth_facets_keep_everything_and_rise_as_fresnel_says() {
        let tables = BlenderTables::new(1.5);
        for cos in [1e-3, 0.2, 0.7, 1.0] {
            assert_eq!(tables.kept(0.0, cos).share, 1.0);
            assert_eq!(tables.kept(0.0, cos).gain(0.3), 1.0);
        }
        // At an entry of the table, between its two indices.
        let expected = risen(0.6, 1.5);
        assert!((tables.rise(0.0, 0.6) / expected - 1.0).abs() < 0.01, "{} {expected}", tables.rise(0.0, 0.6));
        assert!(BlenderTables::new(1.0).rise(0.5, 0.3) < 1e-6, "without contrast nothing is reflected");
    }

    /// Facets that reflect everything lose nothing, whatever they keep at first.
    #[test]
    fn gain_makes_white_facets_whole() {
        let kept = BlenderTables::new(1.5).kept(0.8, 0.6);
        assert!((kept.share * kept.gain(1.0) - 1.0).abs() < 1e-6);
        assert!(kept.share < 0.95 && kept.gain(0.5) < kept.gain(1.0) && kept.gain(0.0) == 1.0);
    }

    /// Sums and entries of Blender's own tables (`intern/cycles/scene/shader.tables`), as others report them.
    #[test]
    fn tables_are_blenders() {
        let tables = BlenderTables::new(1.5);
        let sum = total(tables.facets.kept.into_iter().flatten());
        assert!((sum - 849.736).abs() < 0.05, "{sum}");
        let sum = total(tables.facets.mean_kept);
        assert!((sum - 25.8792).abs() < 3e-3, "{sum}");
        for (row, column, expected) in
            [(0, 1, 0.980_405), (0, 31, 0.999_079), (1, 2, 0.990_086), (1, 5, 0.891_678), (1, 31, 0.888_202)]
        {
            assert!((tables.facets.kept[row][column] - expected).abs() < 5e-4, "{row} {column}");
        }
        for (roughness, cos, expected) in
            [(0.0, 0.1, 0.5628), (0.25, 0.1, 0.4092), (0.25, 0.4, 0.0927), (0.5, 0.1, 0.1705), (1.0, 0.4, 0.0161)]
        {
            let found = tables.rise(roughness, cos);
            assert!((found - expected).abs() < 5e-4, "{roughness} {cos}: {found}");
        }
    }
}
