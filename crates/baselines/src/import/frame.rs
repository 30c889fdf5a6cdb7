//! Where an import's meshes lie: in the dataset's world space, or moved from it by a similarity (scale, turn, shift),
//! which is found and undone.
//!
//! Generators of textures centre a mesh, scale it to a unit box and often exchange its axes, and not all of them undo
//! this. Where the triangles are the same, three corners far apart give the similarity, and all others check it.
//! Otherwise the boxes of both meshes are matched, for every order and direction of the axes. In both cases the result
//! is accepted only if places of each surface lie near the other.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};
use mateval_dataset::TriangleMesh;

use super::donor::Donor;
use super::rebake::Correspondence;
use super::report::ImportedFrame;

/// The frame of a mesh, and the similarity that undoes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    pub report: ImportedFrame,
    /// The map from the mesh's space to the world; absent if the mesh is used as it is.
    world_from_donor: Option<Similarity>,
}

/// The frames that are possible for a mesh, before the other meshes of its scene decide between them.
pub struct Located {
    search: Search,
    limit_m: f64,
}

impl Located {
    /// Compares a donor's triangles with the meshes that they should cover.
    pub fn new<'a>(
        targets: impl Iterator<Item = &'a TriangleMesh>,
        donor: impl Iterator<Item = [DVec3; 3]>,
        max_distance_m: f64,
    ) -> Self {
        let corners = targets.flat_map(|mesh| (0..mesh.triangles.len()).map(|triangle| mesh.corners(triangle)));
        let target = Shape::new(corners.map(|corners| corners.map(|corner| corner.as_dvec3())).collect());
        match (target, Shape::new(donor.collect())) {
            (Some(target), Some(donor)) => {
                let limit_m = limit_m(&target, max_distance_m);
                Self { search: search(&target, &donor, max_distance_m), limit_m }
            }
            _ => Self { search: Search::Unexplained(None), limit_m: 0.0 },
        }
    }

    /// The frame. Of several orders of axes that fit, `preferred` is taken if it is one of them, else the first.
    pub fn frame(self, preferred: Option<usize>) -> Frame {
        let limit_m = self.limit_m;
        let fits = match self.search {
            Search::InPlace => return Frame { report: ImportedFrame::InPlace, world_from_donor: None },
            Search::Unexplained(best_residual_m) => {
                let report = ImportedFrame::Unexplained { best_residual_m, limit_m };
                return Frame { report, world_from_donor: None };
            }
            Search::Moved(fits) => fits,
        };
        let is_preferred = |fit: &&Fit| preferred.is_some_and(|order| fit.found_by == FoundBy::Boxes(order));
        let fit = fits.iter().find(is_preferred).unwrap_or(&fits[0]);
        let Similarity { scale, rotation, shift_m } = fit.similarity;
        let report = ImportedFrame::Moved {
            scale,
            rotation: rotation.transpose().to_cols_array_2d(),
            shift_m: shift_m.to_array(),
            residual_m: fit.residual_m,
            limit_m,
            other_turns: fits.len() - 1,
        };
        Frame { report, world_from_donor: Some(fit.similarity) }
    }
}

/// The order of axes that fits most of the meshes, of equal ones the preferred; absent if no mesh was moved by one. A
/// generator treats all meshes alike, so this decides the turn of symmetric meshes.
pub fn preferred_order<'a>(meshes: impl Iterator<Item = &'a Located>) -> Option<usize> {
    let mut votes: BTreeMap<usize, usize> = BTreeMap::new();
    for located in meshes {
        let Search::Moved(fits) = &located.search else { continue };
        for fit in fits {
            if let FoundBy::Boxes(order) = fit.found_by {
                *votes.entry(order).or_default() += 1;
            }
        }
    }
    let most = *votes.values().max()?;
    votes.into_iter().find(|(_, count)| *count == most).map(|(order, _)| order)
}

impl Frame {
    /// Moves the donor to the world.
    pub fn apply(&self, donor: &mut Donor) {
        let Some(world_from_donor) = &self.world_from_donor else { return };
        for triangle in &mut donor.triangles {
            triangle.corners = triangle.corners.map(|corner| world_from_donor.apply(corner.as_dvec3()).as_vec3());
            if world_from_donor.is_mirror() {
                triangle.corners.swap(1, 2);
                triangle.colors.swap(1, 2);
                triangle.uvs.iter_mut().for_each(|uvs| uvs.swap(1, 2));
            }
        }
    }
}

/// The most triangles of a mesh whose corners and centre are compared.
const MOST_TRIANGLES: usize = 128;
/// The largest residual, as a share of a mesh's longest side.
const TOLERANCE: f64 = 0.01;
/// A similarity fits as well as the best if its residual is at most this multiple of the best residual, apart from
/// [`ROUNDING`].
const AS_GOOD: f64 = 2.0;
/// Share of the longest side that residuals may differ by rounding.
const ROUNDING: f64 = 1e-4;

/// A map from a mesh's space to the world: `scale * rotation * place + shift_m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity {
    /// Metres for one unit of the mesh.
    pub scale: f64,
    /// An orthogonal matrix; a mirror if its determinant is -1.
    pub rotation: DMat3,
    /// In metres.
    pub shift_m: DVec3,
}

impl Similarity {
    const IDENTITY: Self = Self { scale: 1.0, rotation: DMat3::IDENTITY, shift_m: DVec3::ZERO };

    /// The place in the world of a place of the mesh.
    pub fn apply(&self, place: DVec3) -> DVec3 {
        self.scale * (self.rotation * place) + self.shift_m
    }

    /// The place of the mesh at a place in the world.
    fn undo(&self, world: DVec3) -> DVec3 {
        self.rotation.transpose() * (world - self.shift_m) / self.scale
    }

    /// Whether left and right are exchanged.
    pub fn is_mirror(&self) -> bool {
        self.rotation.determinant() < 0.0
    }

    /// With this rotation, the scale and shift that bring `from` nearest to `to`, by least squares.
    fn with_rotation(rotation: DMat3, from: &[DVec3], to: &[DVec3]) -> Option<Self> {
        let mean = |places: &[DVec3]| places.iter().sum::<DVec3>() / places.len() as f64;
        let (from_mean, to_mean) = (mean(from), mean(to));
        let pairs = || from.iter().zip(to).map(|(a, b)| (rotation * (*a - from_mean), *b - to_mean));
        let scale = pairs().map(|(a, b)| a.dot(b)).sum::<f64>() / pairs().map(|(a, _)| a.length_squared()).sum::<f64>();
        let shift_m = to_mean - scale * (rotation * from_mean);
        (scale.is_finite() && scale > 0.0).then_some(Self { scale, rotation, shift_m })
    }
}

/// How a similarity was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FoundBy {
    /// By triangles that correspond one by one.
    Triangles,
    /// By the boxes of both meshes, with this entry of [`orders_of_axes`].
    Boxes(usize),
}

/// A similarity that explains a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    pub similarity: Similarity,
    /// Root mean square distance between places of each surface and the other surface, in metres.
    pub residual_m: f64,
    pub found_by: FoundBy,
}

/// What is known about a mesh's frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Search {
    /// The mesh lies where it belongs.
    InPlace,
    /// Similarities that explain the mesh equally well, in the order in which they are preferred.
    Moved(Vec<Fit>),
    /// No similarity explains the mesh. Holds the smallest residual that was found, in metres; absent if no box has
    /// the right proportions.
    Unexplained(Option<f64>),
}

/// A mesh that is compared.
pub struct Shape {
    triangles: Vec<[DVec3; 3]>,
    tree: Correspondence,
    /// Corners and centres of at most [`MOST_TRIANGLES`] triangles.
    places: Vec<DVec3>,
    low: DVec3,
    high: DVec3,
}

impl Shape {
    /// The shape of these triangles; none if there are no triangles.
    pub fn new(triangles: Vec<[DVec3; 3]>) -> Option<Self> {
        let corners = || triangles.iter().flatten();
        let low = corners().copied().reduce(DVec3::min)?;
        let high = corners().copied().reduce(DVec3::max)?;
        let step = triangles.len().div_ceil(MOST_TRIANGLES);
        let places = triangles.iter().step_by(step).flat_map(|&[a, b, c]| [a, b, c, (a + b + c) / 3.0]).collect();
        let tree = Correspondence::of_triangles(triangles.iter().copied().enumerate());
        Some(Self { triangles, tree, places, low, high })
    }

    fn longest(&self) -> f64 {
        (self.high - self.low).max_element()
    }

    fn centre(&self) -> DVec3 {
        (self.low + self.high) / 2.0
    }
}

/// The largest residual of a similarity that is accepted, in metres: `max_distance_m`, but no more than a hundredth of
/// the target's longest side.
pub fn limit_m(target: &Shape, max_distance_m: f64) -> f64 {
    max_distance_m.min(TOLERANCE * target.longest())
}

/// Finds the similarities that map the donor to the target.
pub fn search(target: &Shape, donor: &Shape, max_distance_m: f64) -> Search {
    let in_place = residual_m(target, donor, &Similarity::IDENTITY);
    if in_place <= TOLERANCE * target.longest() {
        return Search::InPlace;
    }
    // Equal triangles give any similarity.
    let limit_m = limit_m(target, max_distance_m);
    let fit = |similarity, found_by| Fit { similarity, residual_m: residual_m(target, donor, &similarity), found_by };
    if let Some(similarity) = of_triangles(&target.triangles, &donor.triangles, limit_m) {
        let fit = fit(similarity, FoundBy::Triangles);
        if fit.residual_m <= limit_m {
            return Search::Moved(vec![fit]);
        }
    }
    // Equal boxes give one with axes in another order. A mirror image is considered only where no turn explains the
    // mesh.
    let mut best_m: Option<f64> = None;
    let orders = orders_of_axes();
    let (turns, mirrors) = orders.split_at(orders.len() / 2);
    for (first, orders) in [(0, turns), (turns.len(), mirrors)] {
        let fits = orders.iter().enumerate().filter_map(|(at, rotation)| {
            Some(fit(of_boxes(target, donor, *rotation, limit_m)?, FoundBy::Boxes(first + at)))
        });
        let fits: Vec<Fit> = fits.collect();
        let Some(smallest) = fits.iter().map(|fit| fit.residual_m).min_by(f64::total_cmp) else { continue };
        best_m = Some(best_m.map_or(smallest, |best| best.min(smallest)));
        if smallest <= limit_m {
            let largest = (AS_GOOD * smallest + ROUNDING * target.longest()).min(limit_m);
            return Search::Moved(fits.into_iter().filter(|fit| fit.residual_m <= largest).collect());
        }
    }
    Search::Unexplained(best_m)
}

/// Root mean square distance between places of each surface and the other surface, the larger of both directions, in
/// metres.
fn residual_m(target: &Shape, donor: &Shape, world_from_donor: &Similarity) -> f64 {
    let from_target = donor_distances(target, donor, world_from_donor);
    let from_donor = donor.places.iter().map(|place| target.tree.distance(world_from_donor.apply(*place)));
    root_mean_square(from_target).max(root_mean_square(from_donor))
}

/// The distances of the target's places from the donor, in metres.
fn donor_distances(target: &Shape, donor: &Shape, world_from_donor: &Similarity) -> impl Iterator<Item = Option<f64>> {
    let scale = world_from_donor.scale;
    target.places.iter().map(move |place| Some(scale * donor.tree.distance(world_from_donor.undo(*place))?))
}

fn root_mean_square(distances: impl Iterator<Item = Option<f64>>) -> f64 {
    let squares: Vec<f64> = distances.map(|distance| distance.map_or(f64::INFINITY, |d| d * d)).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// The similarity of meshes whose triangles and corners correspond one by one. None where it leaves a root mean square
/// distance above `limit_m` between the corners, or all corners lie on a line.
fn of_triangles(target: &[[DVec3; 3]], donor: &[[DVec3; 3]], limit_m: f64) -> Option<Similarity> {
    if target.len() != donor.len() {
        return None;
    }
    let (to, from) = (target.as_flattened(), donor.as_flattened());
    // Three corners far apart: the furthest from the first, and the furthest from the line through both.
    let furthest = |distance: &dyn Fn(DVec3) -> f64| {
        let all = from.iter().enumerate().map(|(at, place)| (at, distance(*place)));
        all.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(at, _)| at)
    };
    let a = furthest(&|place| place.distance_squared(from[0]))?;
    let b = furthest(&|place| place.distance_squared(from[a]))?;
    let along = (from[b] - from[a]).try_normalize()?;
    let c = furthest(&|place| (place - from[a]).reject_from_normalized(along).length_squared())?;
    let frame = |places: &[DVec3], handed: f64| {
        let x = (places[b] - places[a]).try_normalize()?;
        let y = (places[c] - places[a]).reject_from_normalized(x).try_normalize()?;
        Some(DMat3::from_cols(x, y, handed * x.cross(y)))
    };
    // The turn or the mirror image, whichever leaves the smaller error.
    let from_frame = frame(from, 1.0)?;
    let both = [1.0, -1.0].into_iter().filter_map(|handed| {
        let similarity = Similarity::with_rotation(frame(to, handed)? * from_frame.transpose(), from, to)?;
        let errors = from.iter().zip(to).map(|(a, b)| Some(similarity.apply(*a).distance(*b)));
        Some((root_mean_square(errors), similarity))
    });
    let (error_m, similarity) = both.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (error_m <= limit_m).then_some(similarity)
}

/// The similarity with this order of axes that maps the donor's box to the target's; absent if their proportions
/// differ.
fn of_boxes(target: &Shape, donor: &Shape, rotation: DMat3, limit_m: f64) -> Option<Similarity> {
    let scale = target.longest() / donor.longest();
    if !(scale.is_finite() && scale > 0.0) {
        return None;
    }
    let size = scale * (rotation * (donor.high - donor.low)).abs();
    let is_same_box = (size - (target.high - target.low)).abs().max_element() <= 2.0 * limit_m;
    is_same_box.then(|| Similarity { scale, rotation, shift_m: target.centre() - scale * (rotation * donor.centre()) })
}

/// All 24 turns by right angles, then their 24 mirror images, the preferred ones first: no turn, then the turns between
/// Z up and Y up, then the other turns about the vertical axis.
pub fn orders_of_axes() -> Vec<DMat3> {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let mut orders = vec![
        DMat3::IDENTITY,
        DMat3::from_cols(x, -z, y),
        DMat3::from_cols(x, z, -y),
        DMat3::from_cols(-x, y, -z),
        DMat3::from_cols(-z, y, x),
        DMat3::from_cols(z, y, -x),
    ];
    for [a, b, c] in [[x, y, z], [x, z, y], [y, x, z], [y, z, x], [z, x, y], [z, y, x]] {
        for signs in 0..8 {
            let sign = |bit: u32| if signs >> bit & 1 == 1 { -1.0 } else { 1.0 };
            let order = DMat3::from_cols(sign(0) * a, sign(1) * b, sign(2) * c);
            if order.determinant() > 0.0 && !orders.contains(&order) {
                orders.push(order);
            }
        }
    }
    let mirrors: Vec<DMat3> =
        orders.iter().map(|order| *order * DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0))).collect();
    orders.extend(mirrors);
    orders
}

#[cfg(test)]
mod tests {
    use mateval_dataset::splitmix64::number;

    use super::*;

    fn located(orders: &[usize]) -> Located {
        let similarity = |scale| Similarity { scale, rotation: DMat3::IDENTITY, shift_m: DVec3::ZERO };
        let fit = |order: &usize| Fit {
            similarity: similarity(*order as f64 + 1.0),
            residual_m: 0.0,
            found_by: FoundBy::Boxes(*order),
        };
        Located { search: Search::Moved(orders.iter().map(fit).collect()), limit_m: 0.01 }
    }

    /// A cube fits with several turns; the chairs beside it decide.
    #[test]
    fn meshes_without_symmetry_decide_for_the_others() {
        let scale = |frame: Frame| match frame.report {
            ImportedFrame::Moved { scale, other_turns, .. } => (scale, other_turns),
            other => panic!("{other:?}"),
        };
        let all = [located(&[0, 1, 2]), located(&[1]), located(&[1])];
        let order = preferred_order(all.iter());
        assert_eq!(order, Some(1));
        let [cube, ..] = all;
        assert_eq!(scale(cube.frame(order)), (2.0, 2));
        // Alone, it is not turned.
        let alone = located(&[0, 1, 2]);
        let order = preferred_order([&alone].into_iter());
        assert_eq!(scale(alone.frame(order)), (1.0, 2));
        assert_eq!(preferred_order([].into_iter()), None);
    }

    /// A blob without any symmetry: triangles between random places of a box.
    fn blob(seed: u64, triangles: usize) -> Vec<[DVec3; 3]> {
        let mut index = 0;
        let mut unit = || {
            index += 1;
            (number(seed, index) >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut place = || DVec3::new(2.0 * unit() + 3.0, unit() - 7.0, 0.5 * unit());
        (0..triangles).map(|_| [place(), place(), place()]).collect()
    }

    fn moved(triangles: &[[DVec3; 3]], donor_from_world: impl Fn(DVec3) -> DVec3) -> Vec<[DVec3; 3]> {
        triangles.iter().map(|corners| corners.map(&donor_from_world)).collect()
    }

    fn found(target: &[[DVec3; 3]], donor: Vec<[DVec3; 3]>) -> Search {
        search(&Shape::new(target.to_vec()).unwrap(), &Shape::new(donor).unwrap(), 0.01)
    }

    /// The largest distance that the similarity leaves.
    fn error(similarity: &Similarity, target: &[[DVec3; 3]], donor_from_world: impl Fn(DVec3) -> DVec3) -> f64 {
        let places = target.iter().flatten();
        places.map(|place| similarity.apply(donor_from_world(*place)).distance(*place)).fold(0.0, f64::max)
    }

    #[test]
    fn there_are_48_orders_of_axes() {
        let orders = orders_of_axes();
        assert_eq!(orders.len(), 48);
        for (at, order) in orders.iter().enumerate() {
            assert_eq!(
                (order.determinant() > 0.0, orders.iter().position(|other| other == order)),
                (at < 24, Some(at))
            );
        }
    }

    /// Any turn, scale and shift is found where the triangles are the same, even of a flat mesh.
    #[test]
    fn equal_triangles_give_any_similarity() {
        let turn = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7);
        let recentred = |place: DVec3| turn * (place * 0.37 - DVec3::new(1.0, 2.0, 3.0));
        let flat = moved(&blob(3, 40), |place| place * DVec3::new(1.0, 1.0, 0.0));
        for target in [blob(1, 60), flat, blob(2, 1)] {
            let Search::Moved(fits) = found(&target, moved(&target, recentred)) else { panic!("not found") };
            assert_eq!((fits.len(), fits[0].found_by), (1, FoundBy::Triangles));
            assert!(error(&fits[0].similarity, &target, recentred) < 1e-9);
            assert!((fits[0].similarity.scale - 1.0 / 0.37).abs() < 1e-9 && fits[0].residual_m < 1e-9);
        }
    }

    /// As TRELLIS.2 does: centred, longest side 0.99999, Z up; and with the triangles in another order.
    #[test]
    fn boxes_give_every_order_of_axes() {
        let target = blob(5, 80);
        let shape = Shape::new(target.clone()).unwrap();
        for (at, world_from_donor) in orders_of_axes().into_iter().enumerate() {
            let recentred =
                |place: DVec3| world_from_donor.transpose() * ((place - shape.centre()) * 0.99999 / shape.longest());
            let mut donor = moved(&target, recentred);
            donor.reverse();
            let Search::Moved(fits) = found(&target, donor) else { panic!("order {at} is not found") };
            assert_eq!((fits.len(), fits[0].found_by), (1, FoundBy::Boxes(at)));
            assert_eq!(fits[0].similarity.is_mirror(), at >= 24);
            assert!(error(&fits[0].similarity, &target, recentred) < 1e-9);
        }
    }

    #[test]
    fn what_lies_in_place_stays_there() {
        let target = blob(7, 50);
        assert_eq!(found(&target, target.clone()), Search::InPlace);
        assert_eq!(found(&target, moved(&target, |place| place + DVec3::X * 0.003)), Search::InPlace);
        // Twin: a shift by a tenth of its size is undone.
        assert!(matches!(found(&target, moved(&target, |place| place + DVec3::X * 0.2)), Search::Moved(_)));
    }

    /// A sheared mesh, another mesh of the same box, and a part of the mesh.
    #[test]
    fn what_no_similarity_explains_is_left_alone() {
        let target = blob(9, 50);
        let sheared = moved(&target, |place| place + DVec3::new(0.3 * place.y, 0.0, 0.0));
        assert!(matches!(found(&target, sheared), Search::Unexplained(_)));
        assert!(matches!(found(&target, moved(&target, |p| p * DVec3::new(1.0, 2.0, 1.0))), Search::Unexplained(None)));
        let part: Vec<[DVec3; 3]> = target[..20].to_vec();
        assert!(matches!(found(&target, part), Search::Unexplained(_)));
        let line = vec![[DVec3::ZERO, DVec3::X, DVec3::X * 2.0]; 50];
        assert!(matches!(found(&target, line), Search::Unexplained(_)));
        let point = vec![[DVec3::ONE; 3]; 50];
        assert!(matches!(found(&target, point), Search::Unexplained(None)));
        assert!(Shape::new(Vec::new()).is_none());
    }

    /// All 24 turns of a cube fit; the first is no turn.
    #[test]
    fn symmetry_leaves_several_fits() {
        let corner = |at: u32| DVec3::new(f64::from(at & 1), f64::from(at >> 1 & 1), f64::from(at >> 2 & 1));
        let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        let target: Vec<[DVec3; 3]> =
            faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]].map(|face| face.map(corner))).collect();
        let mut donor = moved(&target, |place| 0.5 * place + DVec3::X * 9.0);
        donor.rotate_left(5);
        let Search::Moved(fits) = found(&target, donor) else { panic!("not found") };
        assert_eq!((fits.len(), fits[0].found_by), (24, FoundBy::Boxes(0)));
    }
}
