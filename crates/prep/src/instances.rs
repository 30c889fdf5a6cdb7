//! Instances and parts of a scene: ids, numbers, and which triangle is of which part.

use std::collections::BTreeSet;
use std::num::NonZeroU16;

use mateval_scene::ids::{PartIndex, id_text_from};
use mateval_scene::reference::{ReferenceScene, Surface};
use mateval_scene::{InstanceId, InstanceIndex, PartId};

use crate::parts::connected_parts;
use crate::source::InstanceOrigin;

/// One instance: instance k is surface k of the reference scene.
#[derive(Clone, Debug)]
pub struct InstanceEntry {
    /// Its id, unique in the scene.
    pub id: InstanceId,
    /// Its value in `instance.png`.
    pub index: InstanceIndex,
    /// What it is, where the source says so.
    pub category: Option<String>,
    /// The broader category, where the source says so.
    pub super_category: Option<String>,
    /// The part of each of its triangles, as a place in `parts`.
    pub part_of_triangle: Vec<usize>,
    /// Its parts.
    pub parts: Vec<PartEntry>,
}

/// One part.
#[derive(Clone, Debug)]
pub struct PartEntry {
    /// Its id, unique in the scene.
    pub id: PartId,
    /// Its value in `part.png`.
    pub index: PartIndex,
}

/// Too many instances or parts for 16 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("more than 65535 instances or parts; split the scene")]
pub struct TooMany;

/// Numbers instances and parts in the order of the surfaces, from 1 on; `origins` holds one a surface.
pub fn list(scene: &ReferenceScene, origins: &[InstanceOrigin]) -> Result<Vec<InstanceEntry>, TooMany> {
    let mut taken = BTreeSet::new();
    let mut next_part = 1_usize;
    scene
        .surfaces
        .iter()
        .zip(origins)
        .enumerate()
        .map(|(at, (surface, origin))| {
            let id = unique_id(surface, &mut taken);
            let part_of_triangle = origin.part_of_triangle.clone().unwrap_or_else(|| connected_parts(&surface.mesh));
            let count = part_of_triangle.iter().max().map_or(0, |last| last + 1);
            let parts = (0..count)
                .map(|part| {
                    let text = format!("{id}-p{part}");
                    let id = PartId::new(text).expect("an id of 58 characters at most and a suffix is an id");
                    Ok(PartEntry { id, index: PartIndex(number(next_part + part)?) })
                })
                .collect::<Result<Vec<_>, TooMany>>()?;
            next_part += count;
            Ok(InstanceEntry {
                id,
                index: InstanceIndex(number(at + 1)?),
                category: origin.category.clone(),
                super_category: origin.super_category.clone(),
                part_of_triangle,
                parts,
            })
        })
        .collect()
}

fn number(value: usize) -> Result<NonZeroU16, TooMany> {
    u16::try_from(value).ok().and_then(NonZeroU16::new).ok_or(TooMany)
}

/// The surface's name as an id; a number behind it where it is taken.
fn unique_id(surface: &Surface, taken: &mut BTreeSet<String>) -> InstanceId {
    let stem = id_text_from(&surface.name, "object");
    let mut text = stem.clone();
    let mut copy = 2;
    while !taken.insert(text.clone()) {
        text = format!("{stem}-{copy}");
        copy += 1;
    }
    InstanceId::new(text).expect("a stem of 48 characters at most and a number is an id")
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use mateval_scene::TriangleMesh;
    use mateval_scene::reference::MaterialIndex;

    use super::*;

    fn scene(names: &[&str]) -> ReferenceScene {
        let mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z * 9.0, Vec3::X * 9.0, Vec3::Y * 9.0],
            triangles: vec![[0, 1, 2], [3, 4, 5]],
            ..Default::default()
        };
        let surface =
            |name: &&str| Surface { name: (*name).to_owned(), mesh: mesh.clone(), material: MaterialIndex(0) };
        ReferenceScene { surfaces: names.iter().map(surface).collect(), ..Default::default() }
    }

    #[test]
    fn ids_are_unique_and_numbers_run_on() {
        let scene = scene(&["Mesh 1", "mesh-1", "mesh-1-2", "椅子", ""]);
        let list = list(&scene, &vec![InstanceOrigin::default(); 5]).unwrap();
        let ids: Vec<&str> = list.iter().map(|entry| entry.id.as_str()).collect();
        assert_eq!(ids, ["mesh-1", "mesh-1-2", "mesh-1-2-2", "object", "object-2"]);
        assert_eq!(list[2].index.0.get(), 3);
        assert_eq!(list[1].part_of_triangle, [1, 0]);
        let parts: Vec<u16> = list.iter().flat_map(|e| e.parts.iter().map(|p| p.index.0.get())).collect();
        assert_eq!(parts, (1..=10).collect::<Vec<u16>>());
    }
}
