//! The instances of a scene and their parts: ids, roles, categories, and the numbers that pictures hold in 16 bits.
//!
//! The source states parts of its own, or they are the connected pieces of a mesh. Labels from another program, such as
//! PartField, are a further split: a folder with files `<instance>.npy`, NumPy arrays of one integer for each triangle,
//! in the order of `instances.glb`. Each label of an instance is a part, whether its triangles are connected or not. An
//! instance without a file keeps the source's own parts, which is a finding. A file that does not fit its instance is
//! an error.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroU16;
use std::path::Path;

use mateval_dataset::dataset::Part;
use mateval_dataset::ids::{PartIndex, id_text_from};
use mateval_dataset::reference::{ReferenceScene, Surface};
use mateval_dataset::{Finding, InstanceId, InstanceIndex, PartId, PartSetId, Role, Severity, TriangleMesh};
use mateval_files::source_folder::{FileFault, SourceFolder};
use mateval_files::untrusted::shortened;
use mateval_image::limits::Malformed;
use mateval_image::npy_io;
use mateval_sources::source_scene::InstanceOrigin;
use mateval_sources::surface_mesh::{MAX_PARTS, connected_parts, parts_of_labels};

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

/// The largest file that is read, in bytes: more than the triangles of any instance need.
pub(crate) const MAX_LABEL_BYTES: u64 = 1 << 28;
/// The most unused files that a finding names.
const MAX_NAMES: usize = 10;

/// Why a folder of labels cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LabelFault {
    #[error("part_labels: '{folder}' has no file '<instance>.npy' for any instance")]
    NoFiles { folder: String },
    #[error("part_labels: cannot list '{folder}': {source}")]
    Unlistable { folder: String, source: std::io::Error },
    /// A file lies outside of the folder, cannot be read or is too large.
    #[error(transparent)]
    File(#[from] FileFault),
    #[error("cannot read '{file}': {source}")]
    Unreadable { file: String, source: std::io::Error },
    /// A file is larger than the instance's labels can be.
    #[error("'{file}' has {found} bytes; expected {triangles} labels, at most {most} bytes")]
    TooLarge {
        file: String,
        /// Its size in bytes.
        found: u64,
        /// The largest size allowed, in bytes.
        most: u64,
        triangles: usize,
    },
    #[error("'{file}': {source}")]
    Array { file: String, source: Malformed },
    /// A file has another number of labels than its instance has triangles.
    #[error("'{file}' has {found} labels; expected {expected}, one for each triangle in the order of instances.glb")]
    Count { file: String, found: usize, expected: usize },
    #[error("'{file}' has {found} different labels; expected at most {MAX_PARTS}")]
    TooManyLabels { file: String, found: usize },
    /// All labels together are more parts than pictures can hold.
    #[error(transparent)]
    TooMany(#[from] TooMany),
}

/// Reads the labels in the folder `labels`, relative to `folder`. An error lists every file that does not fit.
pub(crate) fn read_labels(
    id: &PartSetId,
    labels: &Path,
    folder: &mut SourceFolder,
    scene: &ReferenceScene,
    own: (&[InstanceEntry], &PartSplit),
    findings: &mut Vec<Finding>,
) -> Result<PartSplit, Vec<LabelFault>> {
    let labels = labels.to_string_lossy();
    let (mut faults, mut of_triangles, mut found) = (Vec::new(), Vec::new(), 0);
    for ((instance, own), surface) in own.0.iter().zip(&own.1.instances).zip(&scene.surfaces) {
        match labels_of_instance(folder, &format!("{labels}/{}.npy", instance.id), &surface.mesh) {
            Ok(Some(of_triangle)) => {
                found += 1;
                of_triangles.push(of_triangle);
            }
            Ok(None) => {
                findings.push(unlabelled(id, instance, &labels));
                of_triangles.push(own.of_triangle.clone());
            }
            Err(fault) => faults.push(fault),
        }
    }
    if found == 0 && faults.is_empty() {
        faults.push(LabelFault::NoFiles { folder: labels.to_string() });
    }
    if !faults.is_empty() {
        return Err(faults);
    }
    findings.extend(unused(id, &labels, folder, own.0).map_err(|fault| vec![fault])?);
    PartSplit::new(Some(id.clone()), own.0, of_triangles).map_err(|error| vec![error.into()])
}

fn unlabelled(id: &PartSetId, instance: &InstanceEntry, folder: &str) -> Finding {
    Finding::new(
        Severity::Note,
        "unlabelled",
        folder,
        "",
        format!("'{id}' has no labels of '{}'", instance.id),
        "kept its own parts",
    )
}

/// A finding that names the files of the folder that match no instance, as those of another scene or with a mistyped
/// name.
fn unused(
    id: &PartSetId,
    labels: &str,
    folder: &SourceFolder,
    instances: &[InstanceEntry],
) -> Result<Option<Finding>, LabelFault> {
    let used: BTreeSet<String> = instances.iter().map(|instance| format!("{}.npy", instance.id)).collect();
    let unlistable = |source| LabelFault::Unlistable { folder: labels.to_owned(), source };
    let names = file_names(&folder.root().join(labels)).map_err(unlistable)?;
    let unused: Vec<String> = names.difference(&used).map(|name| format!("'{}'", shortened(name))).collect();
    let shown = unused[..unused.len().min(MAX_NAMES)].join(", ");
    let rest = unused.len().saturating_sub(MAX_NAMES);
    let more = if rest > 0 { format!(" and {rest} more") } else { String::new() };
    Ok((!unused.is_empty()).then(|| {
        Finding::new(
            Severity::Warning,
            "unused_labels",
            labels,
            "",
            format!("{} files of '{id}' match no instance: {shown}{more}", unused.len()),
            "ignored them",
        )
    }))
}

/// The names of the arrays in a folder.
pub(crate) fn file_names(folder: &Path) -> std::io::Result<BTreeSet<String>> {
    let names = std::fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
    names.filter(|name: &std::io::Result<String>| name.as_ref().map_or(true, |name| name.ends_with(".npy"))).collect()
}

/// The part of each triangle, or none if the file does not exist.
fn labels_of_instance(
    folder: &mut SourceFolder,
    file: &str,
    mesh: &mateval_dataset::TriangleMesh,
) -> Result<Option<Vec<usize>>, LabelFault> {
    let triangles = mesh.triangles.len();
    let named = || file.to_owned();
    let relative = SourceFolder::relative(file)?;
    let most = npy_io::most_bytes(triangles);
    match folder.path(&relative) {
        Err(fault) if fault.code == "missing_file" => return Ok(None),
        Err(fault) => return Err(fault.into()),
        Ok(path) => {
            let unreadable = |source| LabelFault::Unreadable { file: named(), source };
            let found = path.metadata().map_err(unreadable)?.len();
            if found > most {
                return Err(LabelFault::TooLarge { file: named(), found, most, triangles });
            }
        }
    }
    let bytes = folder.read(&relative)?;
    let labels = npy_io::whole_numbers(&bytes).map_err(|source| LabelFault::Array { file: named(), source })?;
    if labels.len() != triangles {
        return Err(LabelFault::Count { file: named(), found: labels.len(), expected: triangles });
    }
    let different: BTreeSet<i64> = labels.iter().copied().collect();
    if different.len() > MAX_PARTS {
        return Err(LabelFault::TooManyLabels { file: named(), found: different.len() });
    }
    let number: BTreeMap<i64, usize> = different.into_iter().zip(0..).collect();
    let labels: Vec<usize> = labels.iter().map(|label| number[label]).collect();
    Ok(Some(parts_of_labels(mesh, &labels)))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use mateval_dataset::reference::MaterialIndex;
    use mateval_sources::front3d::{AppearanceRule, HouseFiles, Limits, furnish};
    use npyz::WriterBuilder as _;

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

    /// A row of triangles, each larger than the previous one.
    fn row(triangles: usize) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for at in 0..triangles {
            let corner = at as u32 * 3;
            let size = 1.0 + at as f32;
            mesh.positions.extend([Vec3::X * 1000.0 * size, Vec3::X * (1000.0 * size + size), Vec3::Y * size]);
            mesh.triangles.push([corner, corner + 1, corner + 2]);
        }
        mesh
    }

    fn npy<T: npyz::AutoSerialize + Copy>(labels: &[T], shape: &[u64]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut writer = npyz::WriteOptions::new().default_dtype().shape(shape).writer(&mut bytes).begin_nd().unwrap();
        writer.extend(labels.iter().copied()).unwrap();
        writer.finish().unwrap();
        bytes
    }

    fn parts_of(bytes: &[u8], triangles: usize) -> Result<Option<Vec<usize>>, LabelFault> {
        let root = tempfile::tempdir().unwrap();
        std::fs::write(root.path().join("sofa.npy"), bytes).unwrap();
        let mut folder = SourceFolder::new(root.path(), 1 << 20).unwrap();
        labels_of_instance(&mut folder, "sofa.npy", &row(triangles))
    }

    #[test]
    fn labels_of_every_integer_type_and_shape_are_parts() {
        let expected = Some(vec![1, 0, 1, 0]);
        assert_eq!(parts_of(&npy(&[7_i64, -1, 7, -1], &[4]), 4).unwrap(), expected);
        assert_eq!(parts_of(&npy(&[7_i32, -1, 7, -1], &[4, 1]), 4).unwrap(), expected);
        assert_eq!(parts_of(&npy(&[9_u8, 200, 9, 200], &[1, 4]), 4).unwrap(), expected);
        assert_eq!(parts_of(&npy(&[u64::MAX, 0, u64::MAX, 0], &[4]), 4).unwrap(), expected);
    }

    #[test]
    fn arrays_that_do_not_fit_are_refused_with_both_counts() {
        let refused = |bytes: &[u8], words: &str| {
            let fault = parts_of(bytes, 4).unwrap_err().to_string();
            assert!(fault.contains("sofa.npy") && fault.contains(words), "{fault}");
        };
        refused(&npy(&[1_i64, 2, 3], &[3]), "has 3 labels; expected 4");
        refused(&npy(&[1_i64; 5], &[5]), "has 5 labels; expected 4");
        refused(&npy(&[1.0_f32; 4], &[4]), "expected integers");
        refused(&npy(&[1_i64; 4], &[4])[..150], "expected 32 bytes of numbers, found 22");
        refused(b"PK", "found 2 bytes");
        refused(&vec![0; 5000], "at most 4140 bytes");
        let many: Vec<i64> = (0..100).collect();
        assert!(parts_of(&npy(&many, &[100]), 100).unwrap_err().to_string().contains("100 different labels"));
    }
}
