//! The instances of a scene: their ids, numbers, roles and categories.

use std::collections::BTreeSet;

use mateval_scene::ids::id_text_from;
use mateval_scene::reference::{ReferenceScene, Surface};
use mateval_scene::{InstanceId, InstanceIndex, Role};

use crate::numbering::{TooMany, number};
use mateval_sources::source_scene::InstanceOrigin;

/// One instance. Instances have the order of the reference scene's surfaces.
#[derive(Clone, Debug)]
pub struct InstanceEntry {
    /// Its id, unique in the scene.
    pub id: InstanceId,
    /// Its value in `instance.png`.
    pub index: InstanceIndex,
    /// Its role in the scene.
    pub role: Role,
    /// Its category, where the source states one.
    pub category: Option<String>,
    /// Its broader category, where the source states one.
    pub super_category: Option<String>,
}

/// The instances of a scene, numbered from 1 in the order of its surfaces. `origins` holds one entry for each surface.
pub fn list(scene: &ReferenceScene, origins: &[InstanceOrigin]) -> Result<Vec<InstanceEntry>, TooMany> {
    let mut taken = BTreeSet::new();
    scene
        .surfaces
        .iter()
        .zip(origins)
        .enumerate()
        .map(|(at, (surface, origin))| {
            let id = unique_id(surface, &mut taken);
            Ok(InstanceEntry {
                id,
                index: InstanceIndex(number(at + 1)?),
                role: origin.role.clone(),
                category: origin.category.clone(),
                super_category: origin.super_category.clone(),
            })
        })
        .collect()
}

/// The surface's name as an id. If the id is taken, a number is appended.
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
    use mateval_sources::front3d::{AppearanceRule, HouseFiles, Limits, furnish};

    use super::*;
    use crate::part_split::PartSplit;

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
    fn ids_are_unique_and_parts_are_numbered_across_instances() {
        let scene = scene(&["Mesh 1", "mesh-1", "mesh-1-2", "椅子", ""]);
        let origins = vec![InstanceOrigin::default(); 5];
        let list = list(&scene, &origins).unwrap();
        let split = PartSplit::own(&scene, &origins, &list).unwrap();
        let ids: Vec<&str> = list.iter().map(|entry| entry.id.as_str()).collect();
        assert_eq!(ids, ["mesh-1", "mesh-1-2", "mesh-1-2-2", "object", "object-2"]);
        assert_eq!(list[2].index.0.get(), 3);
        assert_eq!(split.instances[1].of_triangle, [1, 0]);
        let parts: Vec<u16> = split.instances.iter().flat_map(|e| e.parts.iter().map(|p| p.index.0.get())).collect();
        assert_eq!(parts, (1..=10).collect::<Vec<u16>>());
    }

    /// In a whole house the ids of instances and parts are unique, and every instance has the parts that its source states.
    #[test]
    fn ids_of_a_whole_house_are_unique() {
        let folder = tempfile::tempdir().unwrap();
        mateval_testkit::faulty_house::write_without_pictures(folder.path());
        let files = HouseFiles {
            root: folder.path().to_owned(),
            house: "house/3D-FRONT/cc000000-5a3b-4e00-8000-000000000001.json".into(),
            models: "house/3D-FUTURE-model".into(),
            textures: None,
            cameras: None,
            blenderproc_compat: false,
            appearance: AppearanceRule::Constant,
        };
        let house = furnish(&files, &Limits::default()).unwrap();
        let origins: Vec<_> = house.placed.iter().map(|placed| placed.origin.clone()).collect();
        let list = list(&house.scene, &origins).unwrap();
        let split = PartSplit::own(&house.scene, &origins, &list).unwrap();
        let mut ids: Vec<&str> = list.iter().map(|entry| entry.id.as_str()).collect();
        ids.extend(split.instances.iter().flat_map(|entry| entry.parts.iter().map(|part| part.id.as_str())));
        let count = ids.len();
        assert!(count > 100, "only {count} ids");
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), count);
        assert!(split.instances.iter().all(|entry| entry.parts.len() == 1 + entry.of_triangle.iter().max().unwrap()));
    }
}
