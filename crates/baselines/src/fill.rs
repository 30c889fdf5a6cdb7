//! Fills the texels that the input view does not show from the points that it shows.
//!
//! The pixels of an estimate are points in space (the paper's partial point cloud), with nearest-point queries. The
//! tree is an R*-tree and not a k-d tree: a view shows flat pieces of a room, and for a query above such a piece a k-d
//! tree, which bounds points by planes and not by boxes, visits many points beside it (`benches/lifting.rs`).

use std::num::NonZero;

use glam::{DVec2, DVec3};
use mateval_dataset::TriangleMesh;
use mateval_dataset::uv_atlas::UvAtlas;
use rstar::primitives::GeomWithData;
use rstar::{Point, PointDistance, RTree};

use crate::estimate::Values;
use crate::geometry::SeenPoint;
use crate::lift::{Texel, place_of};

/// The search for the point of a texel between two others ends at the distance of the nearer of their points if those
/// two are at most this many texels apart. If they are farther apart, a sphere of that radius may hold more points than
/// a search without a bound visits.
const NEAR: usize = 16;

/// How the values of an unseen texel are computed from seen points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FillRule {
    /// Number of nearest points: 1 in the paper. Several are averaged with the inverse square of the distance as
    /// weight; Point-UV Diffusion uses 3.
    pub neighbours: NonZero<usize>,
    /// Distance that opposite normals count as, in metres; normals at right angles count 0.71 of it. 0 ignores normals.
    pub normal_weight_m: f64,
}

impl Default for FillRule {
    fn default() -> Self {
        Self { neighbours: NonZero::<usize>::MIN, normal_weight_m: 0.0 }
    }
}

/// Seen points with the values of the estimate at each.
pub struct SeenCloud {
    rule: FillRule,
    tree: Tree,
}

/// A search in three dimensions is faster, so normals are stored only where they count.
enum Tree {
    Places(RTree<Known<[f32; 3]>>),
    WithNormals(RTree<Known<[f32; 6]>>),
}

/// A seen point with the values of the estimate.
type Known<P> = GeomWithData<P, Values>;

impl SeenCloud {
    /// Builds the tree of these points and values.
    pub fn new(rule: FillRule, seen: impl IntoIterator<Item = (SeenPoint, Values)>) -> Self {
        let seen = seen.into_iter();
        let tree = if rule.normal_weight_m > 0.0 {
            let point = |(seen, values): (SeenPoint, Values)| {
                GeomWithData::new(with_normal(rule, seen.place, seen.normal), values)
            };
            Tree::WithNormals(RTree::bulk_load(seen.map(point).collect()))
        } else {
            let point =
                |(seen, values): (SeenPoint, Values)| GeomWithData::new(seen.place.as_vec3().to_array(), values);
            Tree::Places(RTree::bulk_load(seen.map(point).collect()))
        };
        Self { rule, tree }
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        match &self.tree {
            Tree::Places(tree) => tree.size() == 0,
            Tree::WithNormals(tree) => tree.size() == 0,
        }
    }

    /// Gives every unseen texel of row `y` of an atlas the values of the seen points nearest to it. Changes nothing
    /// without any points.
    pub fn fill_row(&self, atlas: &UvAtlas, mesh: &TriangleMesh, y: usize, row: &mut [Texel]) {
        let owner = |x: usize| atlas.owner(x, y);
        let place =
            |x: usize, triangle: usize| place_of(atlas, mesh, triangle, DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
        match &self.tree {
            Tree::Places(tree) => {
                let point = |x: usize, triangle: usize| place(x, triangle).as_vec3().to_array();
                fill_row(tree, self.rule.neighbours, row, owner, point);
            }
            Tree::WithNormals(tree) => {
                let point = |x: usize, triangle: usize| {
                    with_normal(self.rule, place(x, triangle), mesh.geometric_normal(triangle))
                };
                fill_row(tree, self.rule.neighbours, row, owner, point);
            }
        }
    }
}

fn with_normal(rule: FillRule, place: DVec3, normal: DVec3) -> [f32; 6] {
    // Opposite unit normals have distance 2.
    let (place, normal) = (place.as_vec3(), (normal * (rule.normal_weight_m / 2.0)).as_vec3());
    [place.x, place.y, place.z, normal.x, normal.y, normal.z]
}

/// Fills the unseen texels of a row. `owner` returns the triangle of a texel and whether the texel's centre lies inside
/// it; `point` returns the place of a texel, given its triangle, in the tree's space.
fn fill_row<P: Point<Scalar = f32>>(
    tree: &RTree<Known<P>>,
    neighbours: NonZero<usize>,
    row: &mut [Texel],
    owner: impl Fn(usize) -> Option<(usize, bool)>,
    point: impl Fn(usize, usize) -> P,
) {
    // The nearest point of the texel before, if that was filled too.
    let mut before = None;
    let mut first = 0;
    while first < row.len() {
        let Some((triangle, inside)) = owner(first).filter(|_| row[first] == Texel::Unseen) else {
            (before, first) = (None, first + 1);
            continue;
        };
        // The run of unseen texels of one triangle. A texel whose centre lies outside has the triangle's nearest place,
        // which need not lie in line with those of its neighbours.
        let in_line = |x: &usize| row[*x] == Texel::Unseen && owner(*x) == Some((triangle, true));
        let more = if inside { (first + 1..row.len()).take_while(in_line).count() } else { 0 };
        let run = &mut row[first..=first + more];
        let at = |x: usize| point(first + x, triangle);
        if neighbours.get() == 1 {
            before = fill_run(tree, run, &at, before);
        } else {
            for (x, texel) in run.iter_mut().enumerate() {
                *texel = mean_of_nearest(tree, &at(x), neighbours).map_or(*texel, Texel::Seen);
            }
        }
        first += more + 1;
    }
}

/// Gives each texel of a run the values of the point nearest to it. The texels lie in line in the tree's space.
/// `before` is the nearest point of the texel before the run, if known. Returns that of the run's last texel.
fn fill_run<'t, P: Point<Scalar = f32>>(
    tree: &'t RTree<Known<P>>,
    run: &mut [Texel],
    at: &impl Fn(usize) -> P,
    before: Option<&'t Known<P>>,
) -> Option<&'t Known<P>> {
    let last = run.len() - 1;
    let of_first = nearest(tree, &at(0), before)?;
    run[0] = Texel::Seen(of_first.data);
    if last == 0 {
        return Some(of_first);
    }
    let of_last = nearest(tree, &at(last), (last <= NEAR).then_some(of_first))?;
    run[last] = Texel::Seen(of_last.data);
    fill_between(tree, run, at, [(0, of_first), (last, of_last)]);
    Some(of_last)
}

/// Fills the texels of a run between two, which are given with their nearest points.
///
/// The places to which one point is nearest form a convex set (a cell of the Voronoi diagram). Where both ends have the
/// same point, all texels between have it, up to the rounding of places to `f32`; otherwise the point of the middle is
/// searched for and both halves are filled. This holds with normals, too: a triangle has a single one, so that its
/// texels also lie in line in six dimensions.
fn fill_between<'t, P: Point<Scalar = f32>>(
    tree: &'t RTree<Known<P>>,
    run: &mut [Texel],
    at: &impl Fn(usize) -> P,
    [(first, of_first), (last, of_last)]: [(usize, &'t Known<P>); 2],
) {
    if last - first < 2 {
        return;
    }
    if of_first.geom() == of_last.geom() {
        run[first + 1..last].fill(Texel::Seen(of_first.data));
        return;
    }
    let middle = first.midpoint(last);
    let point = at(middle);
    let nearer = if of_last.distance_2(&point) < of_first.distance_2(&point) { of_last } else { of_first };
    let of_middle = nearest(tree, &point, (last - first <= NEAR).then_some(nearer)).unwrap_or(nearer);
    run[middle] = Texel::Seen(of_middle.data);
    fill_between(tree, run, at, [(first, of_first), (middle, of_middle)]);
    fill_between(tree, run, at, [(middle, of_middle), (last, of_last)]);
}

/// The nearest point of the tree; none without any points. With `known`, one of its points, the search reaches no
/// further than that.
fn nearest<'t, P: Point<Scalar = f32>>(
    tree: &'t RTree<Known<P>>,
    point: &P,
    known: Option<&'t Known<P>>,
) -> Option<&'t Known<P>> {
    let Some(known) = known else { return tree.nearest_neighbor(point) };
    let apart = |other: &Known<P>| other.distance_2(point);
    let near = tree.locate_within_distance(point.clone(), apart(known));
    near.min_by(|a, b| apart(a).total_cmp(&apart(b)))
}

/// The mean of the nearest points' values with the inverse square of the distance as weight; none without any points.
fn mean_of_nearest<P: Point<Scalar = f32>>(
    tree: &RTree<Known<P>>,
    point: &P,
    neighbours: NonZero<usize>,
) -> Option<Values> {
    let (mut sum, mut weights) = ([0.0_f64; 5], 0.0);
    for (near, distance2) in tree.nearest_neighbor_iter_with_distance_2(point).take(neighbours.get()) {
        // The bound keeps the weight finite at a seen point, whose values then outweigh all others.
        let weight = 1.0 / f64::from(distance2).max(1e-12);
        sum.iter_mut().zip(near.data).for_each(|(sum, value)| *sum += weight * f64::from(value));
        weights += weight;
    }
    (weights > 0.0).then(|| sum.map(|sum| (sum / weights) as f32))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use mateval_dataset::splitmix64;
    use mateval_image::Picture;
    use mateval_testkit::scenes::quad;

    use super::*;
    use crate::lift::PartialAtlas;

    /// A wall of 2 m x 2 m along an axis; its uv are the unit square.
    fn wall() -> TriangleMesh {
        quad(Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0)
    }

    /// The left third is seen; the values of a texel are its column and row.
    fn known() -> PartialAtlas {
        let atlas = UvAtlas::new(&wall(), 48);
        let texels = Picture::from_fn(48, 48, |x, y| match x {
            0..16 => Texel::Seen([x as f32, y as f32, 0.0, 0.0, 0.0]),
            _ => Texel::Unseen,
        });
        PartialAtlas { atlas, texels }
    }

    fn seen() -> Vec<(SeenPoint, Values)> {
        let point = |x: usize, y: usize| {
            let place = DVec3::new((x as f64 + 0.3) / 24.0, 2.0 - (y as f64 + 0.6) / 24.0, 0.0);
            (SeenPoint { instance: 0, pixel: (x, y), place, normal: DVec3::Z }, [x as f32, y as f32, 1.0, 0.0, 0.0])
        };
        (0..48).flat_map(|y| (0..16).map(move |x| point(x, y))).collect()
    }

    fn filled(neighbours: usize, normal_weight_m: f64) -> PartialAtlas {
        let rule = FillRule { neighbours: NonZero::new(neighbours).unwrap(), normal_weight_m };
        fill(&SeenCloud::new(rule, seen()), known())
    }

    fn fill(cloud: &SeenCloud, mut known: PartialAtlas) -> PartialAtlas {
        let rows = known.texels.pixels_mut().chunks_mut(48).enumerate();
        rows.for_each(|(y, row)| cloud.fill_row(&known.atlas, &wall(), y, row));
        known
    }

    #[test]
    fn the_nearest_point_is_that_of_an_exhaustive_search() {
        for weight in [0.0, 0.3] {
            let (filled, all) = (filled(1, weight), seen());
            for (x, y) in (16..48).flat_map(|x| (0..48).map(move |y| (x, y))) {
                let centre = DVec3::new((x as f64 + 0.5) / 24.0, 2.0 - (y as f64 + 0.5) / 24.0, 0.0);
                let apart = |(point, _): &(SeenPoint, Values)| point.place.distance_squared(centre);
                let nearest = all.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)));
                assert_eq!(filled.texels.get(x, y), Texel::Seen(nearest.unwrap().1));
            }
        }
    }

    /// The points lie in no order before and behind the wall, so that their cells end anywhere in a row.
    #[test]
    fn each_texel_of_a_run_has_its_own_nearest_point() {
        for (count, weight) in [(3, 0.0), (60, 0.0), (60, 0.3), (2_000, 0.0)] {
            let mut next = 0;
            let mut number = || {
                next += 1;
                (splitmix64::number(7, next) >> 40) as f64 / f64::from(1 << 24)
            };
            let point = |at: usize| {
                let place = DVec3::new(2.0 * number(), 2.0 * number(), number() - 0.5);
                let normal = if at.is_multiple_of(2) { DVec3::Z } else { DVec3::X };
                (SeenPoint { instance: 0, pixel: (at, 0), place, normal }, [at as f32, 0.0, 0.0, 0.0, 0.0])
            };
            let all: Vec<(SeenPoint, Values)> = (0..count).map(point).collect();
            let rule = FillRule { normal_weight_m: weight, ..FillRule::default() };
            let atlas = UvAtlas::new(&wall(), 48);
            let texels = Picture::filled(48, 48, Texel::Unseen);
            let filled = fill(&SeenCloud::new(rule, all.iter().copied()), PartialAtlas { atlas, texels });
            for (x, y) in (0..48).flat_map(|x| (0..48).map(move |y| (x, y))) {
                let centre = DVec3::new((x as f64 + 0.5) / 24.0, 2.0 - (y as f64 + 0.5) / 24.0, 0.0);
                let apart = |(point, _): &(SeenPoint, Values)| {
                    let of_normal = (point.normal - DVec3::Z).length() * weight / 2.0;
                    (point.place.distance_squared(centre) + of_normal * of_normal).sqrt()
                };
                let least = all.iter().map(apart).fold(f64::INFINITY, f64::min);
                let Texel::Seen(found) = filled.texels.get(x, y) else { panic!("not filled") };
                let of_found = apart(&all[found[0] as usize]);
                // Places up to 2 m from the origin are rounded to f32.
                assert!(of_found - least < 1e-5, "{count} points, texel ({x}, {y}): {of_found} m, not {least} m");
            }
        }
    }

    #[test]
    fn three_are_weighted_by_the_inverse_square() {
        let (filled, mut all) = (filled(3, 0.0), seen());
        for (x, y) in (16..48).flat_map(|x| (0..48).map(move |y| (x, y))) {
            let centre = DVec3::new((x as f64 + 0.5) / 24.0, 2.0 - (y as f64 + 0.5) / 24.0, 0.0);
            let apart = |(point, _): &(SeenPoint, Values)| point.place.distance_squared(centre);
            all.sort_by(|a, b| apart(a).total_cmp(&apart(b)));
            let weights = [0, 1, 2].map(|at| 1.0 / apart(&all[at]));
            let mean = |c: usize| {
                let sum: f64 = all[..3].iter().zip(&weights).map(|((_, v), weight)| weight * f64::from(v[c])).sum();
                (sum / weights.iter().sum::<f64>()) as f32
            };
            let Texel::Seen(found) = filled.texels.get(x, y) else { panic!("not filled") };
            assert!((found[0] - mean(0)).abs() < 2e-3 && (found[1] - mean(1)).abs() < 2e-3, "{x} {y}: {found:?}");
        }
    }

    #[test]
    fn seen_texels_are_unchanged() {
        for neighbours in [1, 3] {
            let filled = filled(neighbours, 0.0);
            for (before, after) in known().texels.pixels().iter().zip(filled.texels.pixels()) {
                assert!(*before == Texel::Unseen || before == after);
                assert!(*after != Texel::Unseen);
            }
        }
    }

    #[test]
    fn without_points_nothing_is_filled() {
        let none = SeenCloud::new(FillRule::default(), []);
        assert!(none.is_empty());
        assert_eq!(fill(&none, known()).texels, known().texels);
    }

    #[test]
    fn many_points_at_one_place_fill_too() {
        let many = SeenCloud::new(FillRule::default(), std::iter::repeat_n(seen()[0], 100_000));
        assert!(fill(&many, known()).texels.pixels().iter().all(|texel| *texel != Texel::Unseen));
    }
}
