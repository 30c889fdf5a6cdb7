//! Fills the texels that the input view does not show from the points that it shows.

use glam::DVec2;
use mateval_scene::TriangleMesh;
use rayon::prelude::*;

use crate::estimate::Values;
use crate::lift::{PartialAtlas, Texel, place_of};
use crate::seen_cloud::SeenCloud;

/// Gives every unseen texel the values of the seen points nearest to it. Returns false where no point is seen.
pub fn fill(cloud: &SeenCloud, known: &mut PartialAtlas, mesh: &TriangleMesh) -> bool {
    if cloud.is_empty() {
        return false;
    }
    let size = known.atlas.size();
    let found: Vec<Option<Values>> = {
        let known = &*known;
        let unseen = |at: usize| match (known.texels.pixels()[at], known.atlas.owner(at % size, at / size)) {
            (Texel::Unseen, Some((triangle, _))) => {
                let centre = DVec2::new((at % size) as f64 + 0.5, (at / size) as f64 + 0.5);
                cloud.values_at(place_of(&known.atlas, mesh, triangle, centre), mesh.geometric_normal(triangle))
            }
            _ => None,
        };
        (0..size * size).into_par_iter().map(unseen).collect()
    };
    for (texel, value) in known.texels.pixels_mut().iter_mut().zip(found) {
        if let Some(value) = value {
            *texel = Texel::Seen(value);
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use std::num::NonZero;

    use glam::{DVec3, Vec3};
    use mateval_image::Picture;
    use mateval_scene::uv_atlas::UvAtlas;

    use super::*;
    use crate::seen::SeenPoint;
    use crate::seen_cloud::FillRule;

    /// A wall of 2 m x 2 m along an axis; its uv are the unit square.
    fn wall() -> TriangleMesh {
        TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X * 2.0, Vec3::new(2.0, 2.0, 0.0), Vec3::Y * 2.0],
            normals: None,
            uvs: Some([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(glam::Vec2::from).into()),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
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
        let mut known = known();
        assert!(fill(&SeenCloud::new(rule, seen()), &mut known, &wall()));
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
        assert!(!fill(&SeenCloud::new(FillRule::default(), []), &mut known(), &wall()));
        // Many points at one place.
        let (point, value) = seen()[0];
        let many = std::iter::repeat_n((point, value), 100_000);
        assert!(fill(&SeenCloud::new(FillRule::default(), many), &mut known(), &wall()));
    }
}
