//! Directional albedos of the facets of Blender's `principled`, integrated at start-up.
//!
//! Cycles compensates its single bounce off GGX facets (height-correlated masking) by tables of the light that remains
//! after that bounce, and weakens the base under the dielectric facets by a table of what those reflect. Lookups
//! interpolate linearly, and near grazing views the grid is coarse: what Blender shows there is the interpolation, not
//! the integral. So our grids have Blender's resolution (4.5: 32 x 32 over roughness and cosine, 16 x 16 x 16 with the
//! index of refraction); the values are our own. They take 5 KiB for any number of materials with the same index.

use std::array::from_fn;
use std::sync::OnceLock;

use glam::Vec3;
use mateval_dataset::material::Distribution;

use super::facets::{Facets, fresnel_dielectric, reflect};

/// The tables for one index of refraction.
#[derive(Clone, Debug)]
pub(crate) struct BlenderTables {
    facets: &'static FacetTables,
    /// See [`Self::rise`]; roughness varies fastest.
    rise: Grid<COARSE>,
    /// The reflectance at normal incidence.
    pub(crate) f0: f32,
    /// The Fresnel term averaged over all directions, weighted by their cosine.
    pub(crate) mean_fresnel: f32,
}

/// The tables that do not depend on the index.
#[derive(Debug)]
struct FacetTables {
    directional: Grid<FINE>,
    mean_albedo: [f32; FINE],
}

/// The light that facets keep after one bounce, if they reflect everything, for one incident direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FacetAlbedo {
    /// The fraction of light that leaves after one bounce.
    pub(crate) directional: f32,
    /// The same, averaged over all directions weighted by their cosine.
    pub(crate) mean: f32,
}

/// Row k is for the cosine k / (N - 1), entry k of a row for roughness k / (N - 1).
type Grid<const N: usize> = [[f32; N]; N];

const FINE: usize = 32;
const COARSE: usize = 16;

/// The position of the first entries of Blender's tables, in roughness and in cosine, instead of 0.
const FIRST: f32 = 1e-4;

impl BlenderTables {
    /// `eta` is at least 1.
    pub(crate) fn new(eta: f32) -> Self {
        static FACETS: OnceLock<FacetTables> = OnceLock::new();
        let f0 = f0_from_eta(eta);
        let mean = ((mean_fresnel(eta) - f0) / (1.0 - f0)).clamp(0.0, 1.0);
        let facets = FACETS.get_or_init(FacetTables::new);
        Self { facets, rise: rise(eta), f0, mean_fresnel: f0 + (1.0 - f0) * mean }
    }

    /// The light that facets keep after one bounce from the cosine `cos`.
    pub(crate) fn facet_albedo(&self, roughness: f32, cos: f32) -> FacetAlbedo {
        let FacetTables { directional, mean_albedo } = self.facets;
        let across = Step::new(roughness, FINE);
        FacetAlbedo { directional: look_up(directional, across, Step::new(cos, FINE)), mean: across.blend(mean_albedo) }
    }

    /// The mean rise of the dielectric Fresnel term from f0 (0) towards total reflection (1), over the facets visible
    /// from the cosine `cos`. Facets that reflect downwards count 0.
    pub(crate) fn rise(&self, roughness: f32, cos: f32) -> f32 {
        look_up(&self.rise, Step::new(roughness, COARSE), Step::new(cos, COARSE))
    }
}

impl FacetAlbedo {
    /// The factor on one bounce that adds the light of further bounces, for facets that reflect the fraction `fresnel`.
    /// Kulla and Conty, "Revisiting Physically Based Shading at Imageworks" (SIGGRAPH 2017 course), without a separate
    /// lobe for that light.
    pub(crate) fn gain(&self, fresnel: f32) -> f32 {
        let between = fresnel * self.mean / (1.0 - fresnel * (1.0 - self.mean));
        1.0 + between * (1.0 - self.directional) / self.directional
    }
}

/// A position between two entries of a row.
#[derive(Clone, Copy)]
struct Step {
    lower: usize,
    part: f32,
}

impl Step {
    /// The position of `value` (0 to 1) among `count` entries.
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

/// The position of entry `k` of `count`.
fn place(k: usize, count: usize) -> f32 {
    (k as f32 / (count - 1) as f32).clamp(FIRST, 1.0)
}

impl FacetTables {
    fn new() -> Self {
        let directional = from_fn(|row| from_fn(|column| directional_albedo(place(column, FINE), place(row, FINE))));
        Self { directional, mean_albedo: from_fn(|column| mean_albedo(place(column, FINE))) }
    }
}

/// The fraction of light from the cosine `cos` that leaves after one bounce.
fn directional_albedo(roughness: f32, cos: f32) -> f32 {
    let view = FacetView::new(roughness, cos);
    mean_over(POINTS, |k| view.reflect(lattice(k)).map_or(0.0, |(_, wi)| view.unmasked(wi)))
}

/// The integral of 2 mu kept(mu) over the cosine mu.
fn mean_albedo(roughness: f32) -> f32 {
    const CUBE_POINTS: u32 = 8192;
    mean_over(CUBE_POINTS, |k| {
        let cos = (k as f32 + 0.5) / CUBE_POINTS as f32;
        let view = FacetView::new(roughness, cos);
        let kept = view.reflect([part(k, PLASTIC), 0.5 * part(k, PLASTIC * PLASTIC)]);
        2.0 * cos * kept.map_or(0.0, |(_, wi)| view.unmasked(wi))
    })
}

/// Interpolates between the two indices around `eta` in Blender's table, which has F0 = z^4 for multiples z of 1/15.
fn rise(eta: f32) -> Grid<COARSE> {
    let slice = Step::new(((eta - 1.0) / (eta + 1.0)).sqrt(), COARSE);
    let eta_of = |k: usize| {
        let z = (k as f32 / (COARSE - 1) as f32).clamp(FIRST, 0.99);
        (1.0 + z * z) / (1.0 - z * z)
    };
    let (low, high) = (eta_of(slice.lower), eta_of(slice.lower + 1));
    let risen = |cos: f32| risen(cos, low) * (1.0 - slice.part) + risen(cos, high) * slice.part;
    let at = |roughness: f32, cos: f32| {
        let view = FacetView::new(roughness, cos);
        mean_over(POINTS, |k| view.reflect(lattice(k)).map_or(0.0, |(m, _)| risen(view.wo.dot(m))))
    };
    from_fn(|row| from_fn(|column| at(place(column, COARSE), place(row, COARSE))))
}

/// The rise of the Fresnel term from its value at normal incidence (0) towards total reflection (1).
fn risen(cos: f32, eta: f32) -> f32 {
    let f0 = f0_from_eta(eta);
    ((fresnel_dielectric(cos, eta).0 - f0) / (1.0 - f0)).clamp(0.0, 1.0)
}

fn f0_from_eta(eta: f32) -> f32 {
    let root = (eta - 1.0) / (eta + 1.0);
    root * root
}

/// The integral of 2 mu F(mu), by Kulla and Conty's fit for an index of at least 1.
fn mean_fresnel(eta: f32) -> f32 {
    (eta - 1.0) / (4.08567 + 1.00071 * eta)
}

/// Facets seen from one direction.
struct FacetView {
    alpha2: f32,
    facets: Facets,
    wo: Vec3,
}

impl FacetView {
    fn new(roughness: f32, cos: f32) -> Self {
        // Blender treats smoother surfaces as mirrors.
        let alpha = if roughness < SMOOTH { 0.0 } else { roughness * roughness };
        let facets = Facets::new(Distribution::Ggx, alpha);
        Self { alpha2: alpha * alpha, facets, wo: Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos) }
    }

    /// Samples a visible facet and the direction it reflects to, or `None` if that points downwards.
    fn reflect(&self, u: [f32; 2]) -> Option<(Vec3, Vec3)> {
        let m = if self.alpha2 == 0.0 { Vec3::Z } else { self.facets.sample(self.wo, u) };
        let wi = reflect(self.wo, m);
        (wi.z > 0.0).then_some((m, wi))
    }

    /// The fraction of the light towards `wi` that no other facet blocks: Smith's height-correlated G2 over G1 (Heitz,
    /// "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 2014, equations 43 and 99).
    fn unmasked(&self, wi: Vec3) -> f32 {
        let slope = |z: f32| (z * z + self.alpha2 * (1.0 - z * z)).sqrt() / z;
        (1.0 + slope(self.wo.z)) / (slope(self.wo.z) + slope(wi.z))
    }
}

/// Blender's limit on alpha^4, 2e-10, expressed as a roughness.
const SMOOTH: f32 = 3.76e-3;

/// Sample points per table entry.
const POINTS: u32 = 2048;

/// 1 over the golden ratio and 1 over the plastic number. The fractional parts of their multiples fill a line and a
/// square evenly (Weyl's theorem; the second after Roberts, 2018).
const GOLDEN: f64 = 0.618_033_988_749_895;
const PLASTIC: f64 = 0.754_877_666_246_693;

fn mean_over(points: u32, value: impl Fn(u32) -> f32) -> f32 {
    ((0..points).map(|k| f64::from(value(k))).sum::<f64>() / f64::from(points)) as f32
}

/// The fractional part of `k` steps.
fn part(k: u32, step: f64) -> f32 {
    (f64::from(k) * step).fract() as f32
}

/// Point `k` of an even lattice over half of the square; the facets in the other half are mirror images.
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
            assert_eq!(tables.facet_albedo(0.0, cos).directional, 1.0);
            assert_eq!(tables.facet_albedo(0.0, cos).gain(0.3), 1.0);
        }
        // At an entry of the table, between two of its indices.
        let expected = risen(0.6, 1.5);
        assert!((tables.rise(0.0, 0.6) / expected - 1.0).abs() < 0.01, "{} {expected}", tables.rise(0.0, 0.6));
        assert!(BlenderTables::new(1.0).rise(0.5, 0.3) < 1e-6, "without contrast nothing is reflected");
    }

    /// Facets that reflect everything lose nothing, whatever the first bounce keeps.
    #[test]
    fn gain_makes_white_facets_whole() {
        let kept = BlenderTables::new(1.5).facet_albedo(0.8, 0.6);
        assert!((kept.directional * kept.gain(1.0) - 1.0).abs() < 1e-6);
        assert!(kept.directional < 0.95 && kept.gain(0.5) < kept.gain(1.0) && kept.gain(0.0) == 1.0);
    }

    /// Sums and entries of Blender's own tables (`intern/cycles/scene/shader.tables`), as others report them.
    #[test]
    fn tables_are_blenders() {
        let tables = BlenderTables::new(1.5);
        let sum = total(tables.facets.directional.into_iter().flatten());
        assert!((sum - 849.736).abs() < 0.05, "{sum}");
        let sum = total(tables.facets.mean_albedo);
        assert!((sum - 25.8792).abs() < 3e-3, "{sum}");
        for (row, column, expected) in
            [(0, 1, 0.980_405), (0, 31, 0.999_079), (1, 2, 0.990_086), (1, 5, 0.891_678), (1, 31, 0.888_202)]
        {
            assert!((tables.facets.directional[row][column] - expected).abs() < 5e-4, "{row} {column}");
        }
        for (roughness, cos, expected) in
            [(0.0, 0.1, 0.5628), (0.25, 0.1, 0.4092), (0.25, 0.4, 0.0927), (0.5, 0.1, 0.1705), (1.0, 0.4, 0.0161)]
        {
            let found = tables.rise(roughness, cos);
            assert!((found - expected).abs() < 5e-4, "{roughness} {cos}: {found}");
        }
    }
}
