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
use crate::parts::{MAX_PARTS, parts_of_labels};
use crate::source::folder::SourceFolder;

/// Largest header of an array: NumPy's own are below 200 bytes.
const MAX_HEADER_BYTES: u64 = 4096;
/// Most digits in a header: so few that the product of any numbers written with them is below 10^15.
const MAX_HEADER_DIGITS: usize = 15;
/// Largest file that is read: more than any instance's triangles need.
pub(crate) const MAX_FILE_BYTES: u64 = 1 << 28;
/// The widest whole number.
const MAX_LABEL_BYTES: u64 = 8;

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

/// The part of each triangle; none where there is no file.
fn of_instance(
    folder: &mut SourceFolder,
    file: &str,
    mesh: &mateval_scene::TriangleMesh,
) -> Result<Option<Vec<usize>>, String> {
    let triangles = mesh.triangles.len();
    let relative = SourceFolder::relative(file).map_err(|fault| fault.message)?;
    let most = MAX_HEADER_BYTES + MAX_LABEL_BYTES * triangles as u64;
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
    let labels = labels_of(&bytes).map_err(|what| format!("'{file}': {what}"))?;
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

/// The numbers of an array of any shape.
fn labels_of(bytes: &[u8]) -> Result<Vec<i64>, String> {
    check_header(bytes)?;
    let file = npyz::NpyFile::new(bytes).map_err(|error| format!("no sound NumPy array: {error}"))?;
    let descr = file.dtype().descr();
    macro_rules! read_as {
        ($file:expr; $($number:ty),*) => {{
            let file = $file;
            $(let file = match file.try_data::<$number>() {
                Ok(numbers) => return whole(numbers.map(|n| n.map(|n| n as i64))),
                Err(file) => file,
            };)*
            drop(file);
        }};
    }
    read_as!(file; i64, i32, i16, i8, u64, u32, u16, u8);
    Err(format!("an array of {descr}; expected whole numbers"))
}

fn whole(numbers: impl Iterator<Item = std::io::Result<i64>>) -> Result<Vec<i64>, String> {
    numbers.collect::<Result<_, _>>().map_err(|error| format!("it ends early: {error}"))
}

/// Refuses headers that no plain array has, before anything interprets them: the reader takes memory for the length that
/// the file tells, follows brackets as deep as they go and multiplies the shape's numbers unchecked.
fn check_header(bytes: &[u8]) -> Result<(), String> {
    let from = if bytes.get(6) == Some(&1) { 10 } else { 12 };
    let length = bytes.get(8..from).ok_or("no NumPy array: it is too short")?;
    let length = length.iter().rev().fold(0_usize, |sum, byte| sum << 8 | usize::from(*byte));
    if length > MAX_HEADER_BYTES as usize {
        return Err(format!("its header is {length} bytes long; expected at most {MAX_HEADER_BYTES}"));
    }
    let text = bytes.get(from..from + length).ok_or("no NumPy array: its header is cut off")?;
    let brackets = text.iter().filter(|byte| b"{[(".contains(byte)).count();
    let digits = text.iter().filter(|byte| byte.is_ascii_digit()).count();
    if brackets > 2 || digits > MAX_HEADER_DIGITS {
        return Err("expected an array of whole numbers, one a triangle; found another kind".to_owned());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use mateval_scene::TriangleMesh;
    use npyz::WriterBuilder as _;
    use proptest::prelude::*;

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
        refused(&npy(&[1.0_f32; 4], &[4]), "expected whole numbers");
        refused(&npy(&[1_i64; 4], &[4])[..150], "it ends early");
        refused(b"PK", "too short");
        refused(&vec![0; 5000], "at most 4128 bytes");
        let many: Vec<i64> = (0..100).collect();
        assert!(parts_of(&npy(&many, &[100]), 100).unwrap_err().contains("100 different labels"));
    }

    /// What would make the reader take 4 GB, overflow its stack or multiply beyond 64 bits.
    #[test]
    fn hostile_headers() {
        let with_header = |text: &str, version: u8, length: usize| {
            let mut bytes = b"\x93NUMPY".to_vec();
            bytes.extend([version, 0]);
            bytes.extend(&length.to_le_bytes()[..if version == 1 { 2 } else { 4 }]);
            bytes.extend(text.as_bytes());
            bytes
        };
        let huge = "{'descr': '<i8', 'fortran_order': False, 'shape': (4294967296, 4294967296), }";
        for bytes in [
            with_header("{}", 2, u32::MAX as usize),
            with_header(&"[".repeat(4000), 1, 4000),
            with_header(huge, 1, huge.len()),
        ] {
            labels_of(&bytes).unwrap_err();
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_an_answer(mut bytes in prop::collection::vec(any::<u8>(), 0..300), whole in any::<bool>()) {
            if whole {
                let sound = npy(&[1_i64; 4], &[4]);
                bytes = sound.iter().zip(bytes.iter().chain(std::iter::repeat(&0))).map(|(a, b)| a ^ (b & b >> 4)).collect();
            }
            let _ = labels_of(&bytes);
        }
    }
}
