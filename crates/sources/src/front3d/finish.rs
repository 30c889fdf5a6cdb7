//! The classes of material over one surface, whose material is one for all of its triangles.
//!
//! A model has one texture for all of its groups, and a surface has one material. Where groups have different classes,
//! roughness and metallic are a texture with a block of texels for each class, and the uv of the triangles of class k
//! move by a whole number, which leaves the lookup of the repeated base colour as it was.

use std::collections::BTreeMap;

use glam::Vec2;
use mateval_scene::TriangleMesh;
use mateval_scene::material::UvTransform;
use mateval_scene::material_class::MaterialClass;

/// Texels of a class's block. Lookups stay in the middle half of the block, so that all four texels of a bilinear
/// lookup belong to it, also a little beyond a triangle's edge.
pub(super) const BLOCK: usize = 4;

/// The most units of u over which a model's uv may spread. Beyond them a shifted u would lose precision.
const MOST_SPREAD: f32 = 64.0;

/// The classes of a surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Finish {
    /// The distinct classes; each has a block of the texture, in this order.
    pub(super) classes: Vec<MaterialClass>,
    /// The map from the surface's uv to that texture's.
    pub(super) uv: UvTransform,
    /// The class of each part; none where its triangles belong to several.
    pub(super) of_parts: Vec<Option<MaterialClass>>,
}

impl Finish {
    /// One class for a surface of `parts` parts.
    pub(super) fn uniform(class: MaterialClass, parts: usize) -> Self {
        Self { classes: vec![class], uv: UvTransform::default(), of_parts: vec![Some(class); parts] }
    }

    /// The class `of_triangle` of each triangle, whose part is `parts`. Moves the uv of the mesh as the texture needs,
    /// and duplicates vertices that triangles of different classes share. None, with the mesh unchanged, where the uv
    /// spread over more than [`MOST_SPREAD`] units.
    pub(super) fn laid_out(mesh: &mut TriangleMesh, of_triangle: &[MaterialClass], parts: &[usize]) -> Option<Self> {
        let mut classes = of_triangle.to_vec();
        classes.sort_unstable();
        classes.dedup();
        let mut of_parts = vec![None; parts.iter().max().map_or(0, |last| last + 1)];
        for (part, of_part) in of_parts.iter_mut().enumerate() {
            let mut own = parts.iter().zip(of_triangle).filter(|(of, _)| **of == part).map(|(_, class)| *class);
            let first = own.next();
            *of_part = first.filter(|class| own.all(|other| other == *class));
        }
        if classes.len() == 1 {
            return Some(Self { classes, uv: UvTransform::default(), of_parts });
        }
        // The range of u in whole units. Each class's is moved to the middle of its own range of twice that width.
        let uvs = mesh.uvs.get_or_insert_with(|| vec![Vec2::ZERO; mesh.positions.len()]);
        let low = uvs.iter().map(|uv| uv.x).fold(f32::INFINITY, f32::min).floor();
        let high = uvs.iter().map(|uv| uv.x).fold(f32::NEG_INFINITY, f32::max).ceil();
        let spread = (high - low).max(1.0);
        if spread > MOST_SPREAD {
            return None;
        }
        let blocks: Vec<usize> =
            of_triangle.iter().map(|class| classes.binary_search(class).expect("classes holds them all")).collect();
        shift(mesh, &blocks, 2.0 * spread);
        let scale = 1.0 / (2.0 * spread * classes.len() as f32);
        let offset = 0.25 / classes.len() as f32 - low * scale;
        Some(Self { classes, uv: UvTransform([[scale, 0.0, offset], [0.0, 1.0, 0.0]]), of_parts })
    }
}

/// Adds `blocks[triangle] * step` to the u of every triangle's corners.
fn shift(mesh: &mut TriangleMesh, blocks: &[usize], step: f32) {
    let uvs = mesh.uvs.as_mut().expect("the caller has given the mesh uv");
    // The first block that uses a vertex keeps it, others get a copy.
    let mut owner: Vec<Option<usize>> = vec![None; mesh.positions.len()];
    let mut copies: BTreeMap<(u32, usize), u32> = BTreeMap::new();
    for (triangle, block) in mesh.triangles.iter_mut().zip(blocks) {
        for vertex in triangle {
            let at = *vertex as usize;
            if *owner[at].get_or_insert(*block) == *block {
                continue;
            }
            *vertex = *copies.entry((*vertex, *block)).or_insert_with(|| {
                mesh.positions.push(mesh.positions[at]);
                uvs.push(uvs[at]);
                if let Some(normals) = &mut mesh.normals {
                    normals.push(normals[at]);
                }
                owner.push(Some(*block));
                mesh.positions.len() as u32 - 1
            });
        }
    }
    for (uv, block) in uvs.iter_mut().zip(owner) {
        uv.x += step * block.unwrap_or(0) as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Two triangles that share an edge.
    fn square(uvs: Option<Vec<Vec2>>) -> TriangleMesh {
        TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y],
            normals: Some(vec![Vec3::Z; 4]),
            uvs,
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    fn corner_uvs() -> Vec<Vec2> {
        vec![Vec2::new(-0.5, 0.0), Vec2::new(1.0, 0.0), Vec2::ONE, Vec2::new(0.25, 1.0)]
    }

    /// Corners stay where they are, the base colour's lookup moves by whole numbers, and each class stays inside the
    /// middle half of its block.
    #[test]
    fn every_class_is_looked_up_in_its_block() {
        for uvs in [Some(corner_uvs()), None] {
            let mut mesh = square(uvs);
            let before = mesh.clone();
            let finish = Finish::laid_out(&mut mesh, &[MaterialClass::Metal, MaterialClass::Glass], &[1, 0]).unwrap();
            assert_eq!(finish.classes, [MaterialClass::Glass, MaterialClass::Metal]);
            assert_eq!(finish.of_parts, [Some(MaterialClass::Glass), Some(MaterialClass::Metal)]);
            assert_eq!(mesh.positions.len(), 6);
            assert_eq!(mesh.normals.as_ref().unwrap().len(), 6);
            for (triangle, block) in [(0, 1.0), (1, 0.0)] {
                assert_eq!(mesh.corners(triangle), before.corners(triangle));
                for corner in 0..3 {
                    let now = mesh.uvs.as_ref().unwrap()[mesh.triangles[triangle][corner] as usize];
                    let old = before.triangles[triangle][corner] as usize;
                    let old = before.uvs.as_ref().map_or(Vec2::ZERO, |uvs| uvs[old]);
                    assert_eq!((now - old).y, 0.0);
                    assert_eq!((now - old).x.fract(), 0.0);
                    let place = finish.uv.apply(now).x * 2.0 - block;
                    assert!((0.25..=0.75).contains(&place), "{place}");
                }
            }
        }
    }

    #[test]
    fn one_class_leaves_the_mesh_alone() {
        let mut mesh = square(None);
        let finish = Finish::laid_out(&mut mesh, &[MaterialClass::Wood; 2], &[0, 0]).unwrap();
        assert_eq!(finish, Finish::uniform(MaterialClass::Wood, 1));
        assert_eq!(mesh, square(None));
    }

    #[test]
    fn a_part_of_two_classes_has_none() {
        let mut mesh = square(None);
        let finish = Finish::laid_out(&mut mesh, &[MaterialClass::Wood, MaterialClass::Glass], &[0, 0]).unwrap();
        assert_eq!(finish.of_parts, [None]);
    }

    #[test]
    fn uv_that_spread_too_far_are_refused() {
        let mut mesh = square(Some(corner_uvs().into_iter().map(|uv| uv * 1e6).collect()));
        let before = mesh.clone();
        assert_eq!(Finish::laid_out(&mut mesh, &[MaterialClass::Wood, MaterialClass::Glass], &[0, 0]), None);
        assert_eq!(mesh, before);
    }
}
