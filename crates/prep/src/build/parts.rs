//! The instances of a scene and their parts: ids, roles, categories, and the numbers that pictures hold in 16 bits.
//!
//! The source states parts of its own, or they are the connected pieces of a mesh.

use std::collections::BTreeSet;
use std::num::NonZeroU16;

use mateval_dataset::dataset::Part;
use mateval_dataset::ids::{PartIndex, id_text_from, unused_name};
use mateval_dataset::reference::{ReferenceScene, Surface};
use mateval_dataset::{InstanceId, InstanceIndex, PartId, PartSetId, Role, TriangleMesh};
use mateval_sources::source_scene::InstanceOrigin;
use mateval_sources::surface_mesh::connected_parts;

/// More instances or parts than 16 bits can number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("more than {} instances or parts; split the scene", u16::MAX)]
pub struct TooMany;

/// The number as 16 bits. Fails for 0 and for numbers above 65535.
pub(crate) fn number(value: usize) -> Result<NonZeroU16, TooMany> {
    u16::try_from(value).ok().and_then(NonZeroU16::new).ok_or(TooMany)
}

/// One instance. Instances have the order of the reference scene's surfaces.
#[derive(Clone, Debug)]
pub struct InstanceEntry {
    /// Its id, unique in the scene.
    pub id: InstanceId,
    /// Its value in `instance.png`.
    pub index: InstanceIndex,
    pub role: Role,
    /// Its category, where the source states one.
    pub category: Option<String>,
    /// Its broader category, where the source states one.
    pub super_category: Option<String>,
}

/// The instances of a scene, numbered from 1 in the order of its surfaces. `origins` holds one entry for each surface.
pub fn list_instances(scene: &ReferenceScene, origins: &[InstanceOrigin]) -> Result<Vec<InstanceEntry>, TooMany> {
    let mut taken = BTreeSet::new();
    scene
        .surfaces
        .iter()
        .zip(origins)
        .enumerate()
        .map(|(at, (surface, origin))| {
            let id = unused_name(&id_text_from(&surface.name, "object"), '-', &mut taken);
            Ok(InstanceEntry {
                id: InstanceId::new(id).expect("a stem of 48 characters at most and a number is an id"),
                index: InstanceIndex(number(at + 1)?),
                role: origin.role.clone(),
                category: origin.category.clone(),
                super_category: origin.super_category.clone(),
            })
        })
        .collect()
}

/// A split of all instances into parts.
#[derive(Clone, Debug)]
pub struct PartSplit {
    /// Its id; none for the source's own parts.
    pub id: Option<PartSetId>,
    pub instances: Vec<InstanceParts>,
}

#[derive(Clone, Debug)]
pub struct InstanceParts {
    /// The part of each of its triangles, as an index in `parts`.
    pub of_triangle: Vec<usize>,
    pub parts: Vec<PartEntry>,
}

#[derive(Clone, Debug)]
pub struct PartEntry {
    /// Its id, unique in its set.
    pub id: PartId,
    /// Its value in the set's `part.png`.
    pub index: PartIndex,
}

impl PartSplit {
    /// The source's own parts of `instances`, which were made from the same surfaces and origins.
    pub fn own(
        scene: &ReferenceScene,
        origins: &[InstanceOrigin],
        instances: &[InstanceEntry],
    ) -> Result<Self, TooMany> {
        let of_triangle = |(surface, origin): (&Surface, &InstanceOrigin)| {
            origin.part_of_triangle.clone().unwrap_or_else(|| connected_parts(&surface.mesh))
        };
        Self::new(None, instances, scene.surfaces.iter().zip(origins).map(of_triangle).collect())
    }

    /// Numbers the parts from 1 in the order of the instances. `of_triangles` holds for each instance the part (0, 1,
    /// ...) of each of its triangles.
    pub fn new(
        id: Option<PartSetId>,
        instances: &[InstanceEntry],
        of_triangles: Vec<Vec<usize>>,
    ) -> Result<Self, TooMany> {
        let mut next_part = 1_usize;
        let mut numbered = |instance: &InstanceEntry, of_triangle: Vec<usize>| {
            let count = of_triangle.iter().max().map_or(0, |last| last + 1);
            let parts = (0..count)
                .map(|part| {
                    let text = format!("{}-p{part}", instance.id);
                    let id = PartId::new(text).expect("an id of 58 characters at most and a suffix is an id");
                    Ok(PartEntry { id, index: PartIndex(number(next_part + part)?) })
                })
                .collect::<Result<Vec<_>, TooMany>>()?;
            next_part += count;
            Ok(InstanceParts { of_triangle, parts })
        };
        let instances = instances.iter().zip(of_triangles).map(|(instance, of)| numbered(instance, of));
        Ok(Self { id, instances: instances.collect::<Result<_, _>>()? })
    }

    /// The value in `part.png` of every triangle of every instance.
    pub fn values(&self) -> Vec<Vec<u16>> {
        let value = |instance: &InstanceParts, part: &usize| NonZeroU16::get(instance.parts[*part].index.0);
        let of = |instance: &InstanceParts| instance.of_triangle.iter().map(|part| value(instance, part)).collect();
        self.instances.iter().map(of).collect()
    }

    /// The parts as `scene.json` lists them. `instances` are those that the split was made from.
    pub fn listed(&self, instances: &[InstanceEntry]) -> Vec<Part> {
        let of_instance = |(split, instance): (&InstanceParts, &InstanceEntry)| {
            let instance = instance.id.clone();
            let part = |(at, part): (usize, &PartEntry)| Part {
                id: part.id.clone(),
                index: part.index,
                instance: instance.clone(),
                triangles: split.of_triangle.iter().filter(|of| **of == at).count(),
            };
            split.parts.iter().enumerate().map(part).collect::<Vec<_>>()
        };
        self.instances.iter().zip(instances).flat_map(of_instance).collect()
    }

    /// The ids and meshes of the parts, in the order of their numbers. `meshes` holds the mesh of each instance.
    pub fn meshes(&self, meshes: &[TriangleMesh]) -> Vec<(PartId, TriangleMesh)> {
        let of_instance = |(split, mesh): (&InstanceParts, &TriangleMesh)| {
            let part = |(at, part): (usize, &PartEntry)| {
                (part.id.clone(), mesh.picked(|triangle| split.of_triangle[triangle] == at))
            };
            split.parts.iter().enumerate().map(part).collect::<Vec<_>>()
        };
        self.instances.iter().zip(meshes).flat_map(of_instance).collect()
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use mateval_dataset::reference::MaterialIndex;
    use mateval_sources::front3d::{AppearanceRule, HouseFiles, Limits, furnish};

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
    fn ids_are_unique_and_parts_are_numbered_across_instances() {
        let scene = scene(&["Mesh 1", "mesh-1", "mesh-1-2", "椅子", ""]);
        let origins = vec![InstanceOrigin::default(); 5];
        let list = list_instances(&scene, &origins).unwrap();
        let split = PartSplit::own(&scene, &origins, &list).unwrap();
        let ids: Vec<&str> = list.iter().map(|entry| entry.id.as_str()).collect();
        assert_eq!(ids, ["mesh-1", "mesh-1-2", "mesh-1-2-2", "object", "object-2"]);
        assert_eq!(list[2].index.0.get(), 3);
        assert_eq!(split.instances[1].of_triangle, [1, 0]);
        let parts: Vec<u16> = split.instances.iter().flat_map(|e| e.parts.iter().map(|p| p.index.0.get())).collect();
        assert_eq!(parts, (1..=10).collect::<Vec<u16>>());
    }

    /// In a whole house the ids of instances and parts are unique, and every instance has the parts that its source
    /// states.
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
        let list = list_instances(&house.scene, &origins).unwrap();
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
