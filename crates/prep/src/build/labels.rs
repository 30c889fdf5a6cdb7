//! Labels of parts from another program, such as PartField: a further split of the instances into parts.
//!
//! They are a folder with files `<instance>.npy`, NumPy arrays of one integer for each triangle, in the order of
//! `instances.glb`. Each label of an instance is a part, whether its triangles are connected or not. An instance without a
//! file keeps the source's own parts, which is a finding. A file that does not fit its instance is an error.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use mateval_dataset::reference::ReferenceScene;
use mateval_dataset::{Finding, PartSetId, Severity};
use mateval_files::FileError;
use mateval_files::source_folder::{FileFault, SourceFolder};
use mateval_files::untrusted::shortened;
use mateval_image::limits::Malformed;
use mateval_image::npy_io;
use mateval_sources::surface_mesh::{MAX_PARTS, parts_of_labels};

use super::parts::{InstanceEntry, PartSplit, TooMany};

/// The largest file that is read, in bytes: more than the triangles of any instance need.
pub(crate) const MAX_LABEL_BYTES: u64 = 1 << 28;
/// The most unused files that a finding names.
const MAX_NAMES: usize = 10;

/// Why a folder of labels cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LabelFault {
    #[error("part_labels: '{folder}' has no file '<instance>.npy' for any instance")]
    NoFiles { folder: String },
    #[error("part_labels: {0}")]
    Unreadable(FileError),
    /// A file lies outside of the folder, cannot be read or is too large.
    #[error(transparent)]
    File(#[from] FileFault),
    /// A file has another number of bytes, labels or different labels than its instance may have.
    #[error("'{file}' has {found}; expected {expected}")]
    Count { file: String, found: String, expected: String },
    #[error("'{file}': {source}")]
    Array { file: String, source: Malformed },
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
    let names = file_names(&folder.root().join(labels));
    let names = names.map_err(FileError::io("list", labels)).map_err(LabelFault::Unreadable)?;
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
    let unfit = |found: String, expected: String| LabelFault::Count { file: file.to_owned(), found, expected };
    let relative = SourceFolder::relative(file)?;
    let most = npy_io::most_bytes(triangles);
    match folder.path(&relative) {
        Err(fault) if fault.code == "missing_file" => return Ok(None),
        Err(fault) => return Err(fault.into()),
        Ok(path) => {
            let found = path.metadata().map_err(FileError::io("read", file)).map_err(LabelFault::Unreadable)?.len();
            if found > most {
                let expected = format!("{triangles} labels, at most {most} bytes");
                return Err(unfit(format!("{found} bytes"), expected));
            }
        }
    }
    let bytes = folder.read(&relative)?;
    let labels = npy_io::whole_numbers(&bytes).map_err(|source| LabelFault::Array { file: file.to_owned(), source })?;
    if labels.len() != triangles {
        let expected = format!("{triangles}, one for each triangle in the order of instances.glb");
        return Err(unfit(format!("{} labels", labels.len()), expected));
    }
    let different: BTreeSet<i64> = labels.iter().copied().collect();
    if different.len() > MAX_PARTS {
        return Err(unfit(format!("{} different labels", different.len()), format!("at most {MAX_PARTS}")));
    }
    let number: BTreeMap<i64, usize> = different.into_iter().zip(0..).collect();
    let labels: Vec<usize> = labels.iter().map(|label| number[label]).collect();
    Ok(Some(parts_of_labels(mesh, &labels)))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use mateval_dataset::TriangleMesh;
    use mateval_testkit::npy;

    use super::*;

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
