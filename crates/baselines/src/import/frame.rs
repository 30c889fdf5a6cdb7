//! Where an import's meshes lie: in the dataset's world space, or moved from it by a similarity, which is undone.

use std::collections::BTreeMap;

use glam::DVec3;
use mateval_scene::TriangleMesh;

use super::donor::Donor;
use super::report::ImportedFrame;
use super::similarity::{Fit, FoundBy, Search, Shape, Similarity, limit_m, search};

/// The frame of a mesh, and the similarity that undoes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// What is reported.
    pub report: ImportedFrame,
    /// The map from the mesh's space to the world; none where the mesh is used as it is.
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

/// The order of axes that fits most of the meshes, of equal ones the preferred; none where no mesh was moved by one. A
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

#[cfg(test)]
mod tests {
    use glam::DMat3;

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
}
