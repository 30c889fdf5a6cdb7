//! Labels made elsewhere (as by PartField), read as a second way to split the instances into parts.
//!
//! In: a folder with `<instance>.npy`, a NumPy array of one whole number a triangle, in the order of `instances.glb`. Out:
//! a [`PartSplit`] in which each label of an instance is a part, whether it hangs together or not. An instance without a
//! file keeps the source's own parts, which is a finding; a file that does not fit its instance is an error.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use mateval_scene::reference::ReferenceScene;
use mateval_scene::{Finding, PartSetId, Severity};

use crate::instances::InstanceEntry;
use crate::part_split::PartSplit;
use mateval_scene::findings::shortened;
use mateval_scene::source_folder::SourceFolder;
use mateval_sources::npy;
use mateval_sources::parts::{MAX_PARTS, parts_of_labels};

/// Largest file that is read: more than any instance's triangles need.
pub(crate) const MAX_FILE_BYTES: u64 = 1 << 28;
/// Most labels that fit nothing and are told by name.
const MAX_NAMES: usize = 10;

/// Reads the labels in the folder `labels`, relative to `folder`. In words what is wrong with every file that is.
pub(crate) fn read(
    id: &PartSetId,
    labels: &Path,
    folder: &mut SourceFolder,
    scene: &ReferenceScene,
    own: (&[InstanceEntry], &PartSplit),
    findings: &mut Vec<Finding>,
) -> Result<PartSplit, Vec<String>> {
    let labels = labels.to_string_lossy();
    let (mut faults, mut of_triangles, mut found) = (Vec::new(), Vec::new(), 0);
    for ((instance, own), surface) in own.0.iter().zip(&own.1.instances).zip(&scene.surfaces) {
        match of_instance(folder, &format!("{labels}/{}.npy", instance.id), &surface.mesh) {
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
        faults.push(format!("part_labels: there is no '{labels}/<instance>.npy' of any instance"));
    }
    if !faults.is_empty() {
        return Err(faults);
    }
    findings.extend(unused(id, &labels, folder, own.0).map_err(|fault| vec![fault])?);
    PartSplit::new(Some(id.clone()), own.0, of_triangles).map_err(|error| vec![error.to_string()])
}

fn unlabelled(id: &PartSetId, instance: &InstanceEntry, folder: &str) -> Finding {
    Finding {
        severity: Severity::Note,
        code: "unlabelled".to_owned(),
        file: folder.to_owned(),
        place: String::new(),
        message: format!("'{id}' has no labels of '{}'", instance.id),
        action: "kept its own parts".to_owned(),
    }
}

/// Files of the folder that are named after no instance: of another scene, or with a name that was mistyped.
fn unused(
    id: &PartSetId,
    labels: &str,
    folder: &SourceFolder,
    instances: &[InstanceEntry],
) -> Result<Option<Finding>, String> {
    let used: BTreeSet<String> = instances.iter().map(|instance| format!("{}.npy", instance.id)).collect();
    let names = file_names(&folder.root().join(labels)).map_err(|error| format!("cannot list '{labels}': {error}"))?;
    let unused: Vec<String> = names.difference(&used).map(|name| format!("'{}'", shortened(name))).collect();
    let shown = unused[..unused.len().min(MAX_NAMES)].join(", ");
    let rest = unused.len().saturating_sub(MAX_NAMES);
    let more = if rest > 0 { format!(" and {rest} more") } else { String::new() };
    Ok((!unused.is_empty()).then(|| Finding {
        severity: Severity::Warning,
        code: "unused_labels".to_owned(),
        file: labels.to_owned(),
        place: String::new(),
        message: format!("{} files of '{id}' are named after no instance: {shown}{more}", unused.len()),
        action: "ignored them".to_owned(),
    }))
}

/// The arrays in a folder.
pub(crate) fn file_names(folder: &Path) -> std::io::Result<BTreeSet<String>> {
    let names = std::fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()));
    names.filter(|name: &std::io::Result<String>| name.as_ref().map_or(true, |name| name.ends_with(".npy"))).collect()
}

/// The part of each triangle; none where there is no file.
fn of_instance(
    folder: &mut SourceFolder,
    file: &str,
    mesh: &mateval_scene::TriangleMesh,
) -> Result<Option<Vec<usize>>, String> {
    let triangles = mesh.triangles.len();
    let relative = SourceFolder::relative(file).map_err(|fault| fault.message)?;
    let most = (npy::MAX_PREFIX_BYTES + npy::MAX_HEADER_BYTES + npy::MAX_NUMBER_BYTES * triangles) as u64;
    match folder.path(&relative) {
        Err(fault) if fault.code == "missing_file" => return Ok(None),
        Err(fault) => return Err(fault.message),
        Ok(path) => {
            let size = path.metadata().map_err(|error| format!("'{file}' cannot be read: {error}"))?.len();
            if size > most {
                return Err(format!("'{file}' has {size} bytes; expected {triangles} labels, at most {most} bytes"));
            }
        }
    }
    let bytes = folder.read(&relative).map_err(|fault| fault.message)?;
    let labels = npy::whole_numbers(&bytes).map_err(|what| format!("'{file}': {what}"))?;
    if labels.len() != triangles {
        let (found, id) = (labels.len(), "as in instances.glb");
        return Err(format!("'{file}' has {found} labels; expected {triangles}, one a triangle, {id}"));
    }
    let different: BTreeSet<i64> = labels.iter().copied().collect();
    if different.len() > MAX_PARTS {
        return Err(format!("'{file}' has {} different labels; expected at most {MAX_PARTS}", different.len()));
    }
    let number: BTreeMap<i64, usize> = different.into_iter().zip(0..).collect();
    let labels: Vec<usize> = labels.iter().map(|label| number[label]).collect();
    Ok(Some(parts_of_labels(mesh, &labels)))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use mateval_scene::TriangleMesh;
    use npyz::WriterBuilder as _;

    use super::*;

    /// A row of triangles, each larger than the one before.
    fn mesh(triangles: usize) -> TriangleMesh {
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

    fn parts_of(bytes: &[u8], triangles: usize) -> Result<Option<Vec<usize>>, String> {
        let root = tempfile::tempdir().unwrap();
        std::fs::write(root.path().join("sofa.npy"), bytes).unwrap();
        let mut folder = SourceFolder::new(root.path(), 1 << 20).unwrap();
        of_instance(&mut folder, "sofa.npy", &mesh(triangles))
    }

    #[test]
    fn a_label_is_a_part_whatever_its_number_type_and_shape() {
        let expected = Ok(Some(vec![1, 0, 1, 0]));
        assert_eq!(parts_of(&npy(&[7_i64, -1, 7, -1], &[4]), 4), expected);
        assert_eq!(parts_of(&npy(&[7_i32, -1, 7, -1], &[4, 1]), 4), expected);
        assert_eq!(parts_of(&npy(&[9_u8, 200, 9, 200], &[1, 4]), 4), expected);
        assert_eq!(parts_of(&npy(&[u64::MAX, 0, u64::MAX, 0], &[4]), 4), expected);
    }

    #[test]
    fn what_does_not_fit_is_refused_with_both_counts() {
        let refused = |bytes: &[u8], words: &str| {
            let fault = parts_of(bytes, 4).unwrap_err();
            assert!(fault.contains("sofa.npy") && fault.contains(words), "{fault}");
        };
        refused(&npy(&[1_i64, 2, 3], &[3]), "has 3 labels; expected 4");
        refused(&npy(&[1_i64; 5], &[5]), "has 5 labels; expected 4");
        refused(&npy(&[1.0_f32; 4], &[4]), "expected integers");
        refused(&npy(&[1_i64; 4], &[4])[..150], "expected 32 bytes of numbers, found 22");
        refused(b"PK", "found 2 bytes");
        refused(&vec![0; 5000], "at most 4140 bytes");
        let many: Vec<i64> = (0..100).collect();
        assert!(parts_of(&npy(&many, &[100]), 100).unwrap_err().contains("100 different labels"));
    }
}
