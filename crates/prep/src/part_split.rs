//! A split of all instances of a scene into parts: the parts' ids and numbers, and the part of each triangle.

use std::num::NonZeroU16;

use mateval_scene::dataset::Part;
use mateval_scene::ids::PartIndex;
use mateval_scene::{PartId, PartSetId, TriangleMesh};

use mateval_scene::reference::{ReferenceScene, Surface};
use mateval_sources::parts::connected_parts;
use mateval_sources::source_scene::InstanceOrigin;

use crate::instances::InstanceEntry;
use crate::numbering::{TooMany, number};

/// A split of all instances into parts.
#[derive(Clone, Debug)]
pub struct PartSplit {
    /// Its id; none for the source's own parts.
    pub id: Option<PartSetId>,
    /// The parts of each instance.
    pub instances: Vec<InstanceParts>,
}

/// The parts of one instance.
#[derive(Clone, Debug)]
pub struct InstanceParts {
    /// The part of each of its triangles, as an index in `parts`.
    pub of_triangle: Vec<usize>,
    /// Its parts.
    pub parts: Vec<PartEntry>,
}

/// One part.
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

    /// Numbers the parts from 1 in the order of the instances. `of_triangles` holds for each instance the part (0, 1, ...)
    /// of each of its triangles.
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
