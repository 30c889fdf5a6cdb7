//! A scanned mesh as a PLY file, text or binary: its triangles and the label of each face, where it has labels.

use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Header, Property, PropertyAccess, PropertyAccessResult};

use crate::open::Invalid;

/// The properties of a face that are labels. A file may have one of them.
const LABELS: [&str; 4] = ["label", "object_id", "objectId", "segment_id"];
/// The properties of a face that hold its corners.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];
const VERTEX: &str = "vertex";
const FACE: &str = "face";

/// Triangles in the file's own space and unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct PlyMesh {
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// For each triangle; empty where the file has no labels.
    pub(super) labels: Vec<i64>,
    /// Faces that were left out: they have fewer than three corners.
    pub(super) without_area: usize,
}

/// An element of any kind: a vertex has a position, a face corners and a label.
struct Element {
    position: [f64; 3],
    corners: Vec<i64>,
    label: i64,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self { position: [f64::NAN; 3], corners: Vec::new(), label: 0 }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = match name {
            "x" => Some(0),
            "y" => Some(1),
            "z" => Some(2),
            _ => None,
        };
        if let Some(axis) = axis {
            self.position[axis] = scalar(&property).unwrap_or(f64::NAN);
        } else if CORNERS.contains(&name) {
            self.corners = list(property);
        } else if LABELS.contains(&name) {
            self.label = scalar(&property).unwrap_or(0.0) as i64;
        }
        PropertyAccessResult::Set
    }
}

fn scalar(property: &Property) -> Option<f64> {
    match *property {
        Property::Char(v) => Some(v.into()),
        Property::UChar(v) => Some(v.into()),
        Property::Short(v) => Some(v.into()),
        Property::UShort(v) => Some(v.into()),
        Property::Int(v) => Some(v.into()),
        Property::UInt(v) => Some(v.into()),
        Property::Float(v) => Some(v.into()),
        Property::Double(v) => Some(v),
        _ => None,
    }
}

/// The whole numbers of a list; those of a list of other numbers count as none, and its face has no corners.
fn list(property: Property) -> Vec<i64> {
    fn all<T: Into<i64>>(values: Vec<T>) -> Vec<i64> {
        values.into_iter().map(Into::into).collect()
    }
    match property {
        Property::ListChar(values) => all(values),
        Property::ListUChar(values) => all(values),
        Property::ListShort(values) => all(values),
        Property::ListUShort(values) => all(values),
        Property::ListInt(values) => all(values),
        Property::ListUInt(values) => all(values),
        _ => Vec::new(),
    }
}

/// Reads a PLY file of at most `most_triangles`. Polygons become fans of triangles.
pub(super) fn read(bytes: &[u8], most_triangles: usize) -> Result<PlyMesh, Invalid> {
    let fault = |error: ply_rs_bw::parser::ParseError| {
        let what: String = error.to_string().chars().take(300).collect();
        Invalid(format!("not a valid PLY file: {}", what.replace(['\n', '\t'], " ")))
    };
    let (parser, mut reader) = (Parser::<Element>::new(), Reader::new(bytes));
    let header = parser.read_header(&mut reader).map_err(fault)?;
    let is_labelled = check(&header, bytes.len())?;
    let mut payload = parser.read_payload(&mut reader, &header).map_err(fault)?;

    let vertices = payload.swap_remove(VERTEX).unwrap_or_default();
    let mut mesh = PlyMesh { positions: vertices.iter().map(|vertex| vertex.position).collect(), ..PlyMesh::default() };
    for (at, face) in payload.swap_remove(FACE).unwrap_or_default().iter().enumerate() {
        let corner = |index: &i64| {
            let found = usize::try_from(*index).ok().filter(|index| *index < mesh.positions.len());
            let expected = mesh.positions.len();
            let fault = || Invalid(format!("face {at} has the corner {index}; expected 0 to {}", expected.max(1) - 1));
            found.map(|index| index as u32).ok_or_else(fault)
        };
        let corners = face.corners.iter().map(corner).collect::<Result<Vec<u32>, _>>()?;
        if corners.len() < 3 {
            mesh.without_area += 1;
            continue;
        }
        for pair in corners[1..].windows(2) {
            mesh.triangles.push([corners[0], pair[0], pair[1]]);
            mesh.labels.extend(is_labelled.then_some(face.label));
        }
        if mesh.triangles.len() > most_triangles {
            return Err(Invalid(format!("expected at most {most_triangles} triangles; decimate the mesh")));
        }
    }
    if mesh.triangles.is_empty() {
        return Err(Invalid(format!(
            "it holds {} vertices and no triangle: a cloud of points has no surface; make a mesh of it first",
            mesh.positions.len()
        )));
    }
    Ok(mesh)
}

/// Checks what a header states before memory is taken for it. Returns whether faces have labels.
fn check(header: &Header, bytes: usize) -> Result<bool, Invalid> {
    // Each element takes a byte or more, so that a larger count is a lie.
    for ElementDef { name, count, properties } in header.elements.values() {
        if *count > bytes || properties.is_empty() && *count > 0 {
            let properties = properties.len();
            let what = format!("it states {count} elements '{name}' of {properties} properties in {bytes} bytes");
            return Err(Invalid(what.chars().take(300).collect()));
        }
    }
    let expected = "expected 'vertex' with x, y and z, and 'face' with vertex_indices";
    let vertex = header.elements.get(VERTEX).ok_or_else(|| Invalid(format!("it has no vertices: {expected}")))?;
    if !["x", "y", "z"].iter().all(|axis| vertex.properties.contains_key(*axis)) {
        return Err(Invalid(format!("its vertices have no position: {expected}")));
    }
    let Some(face) = header.elements.get(FACE) else { return Ok(false) };
    if !CORNERS.iter().any(|name| face.properties.contains_key(*name)) {
        return Err(Invalid(format!("its faces have no corners: {expected}")));
    }
    let labels: Vec<&str> = LABELS.into_iter().filter(|name| face.properties.contains_key(*name)).collect();
    match labels[..] {
        [] => Ok(false),
        [_] => Ok(true),
        _ => Err(Invalid(format!("its faces have several labels, {}; leave one of them", labels.join(", ")))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "element vertex 4\nproperty float x\nproperty double y\nproperty float z\nproperty uchar red\n\
                        element face 2\nproperty list uchar int vertex_indices\nproperty int label\nend_header\n";

    fn text() -> String {
        format!("ply\nformat ascii 1.0\ncomment a\n{HEAD}0 0 0 9\n1 0 0 9\n1 1.5 0 9\n0 1 0 9\n4 0 1 2 3 7\n2 0 1 8\n")
    }

    fn binary(is_big: bool) -> Vec<u8> {
        let mut bytes =
            format!("ply\nformat binary_{}_endian 1.0\n{HEAD}", if is_big { "big" } else { "little" }).into_bytes();
        let mut put = |big: &[u8]| {
            let mut value = big.to_vec();
            if !is_big {
                value.reverse();
            }
            bytes.extend(value);
        };
        for [x, y, z] in [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.5, 0.0], [0.0, 1.0, 0.0]] {
            put(&x.to_be_bytes());
            put(&f64::from(y).to_be_bytes());
            put(&z.to_be_bytes());
            put(&[9]);
        }
        for (corners, label) in [(&[0_i32, 1, 2, 3][..], 7_i32), (&[0, 1], 8)] {
            put(&[corners.len() as u8]);
            corners.iter().for_each(|corner| put(&corner.to_be_bytes()));
            put(&label.to_be_bytes());
        }
        bytes
    }

    #[test]
    fn all_three_encodings_hold_the_same_mesh() {
        let mesh = read(text().as_bytes(), 10).unwrap();
        assert_eq!(mesh.positions, [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.5, 0.0], [0.0, 1.0, 0.0]]);
        assert_eq!((&mesh.triangles[..], &mesh.labels[..]), (&[[0, 1, 2], [0, 2, 3]][..], &[7, 7][..]));
        assert_eq!(mesh.without_area, 1);
        assert_eq!([read(&binary(false), 10).unwrap(), read(&binary(true), 10).unwrap()], [mesh.clone(), mesh]);
    }

    #[test]
    fn what_is_no_mesh_is_refused_with_the_reason() {
        let refused = |bytes: &[u8], words: &str| {
            let found = read(bytes, 10).unwrap_err().0;
            assert!(found.contains(words), "{found}");
        };
        refused(b"solid a", "not a valid PLY file");
        refused(&text().replace("0 1 2 3 7", "0 1 2 4 7").into_bytes(), "face 0 has the corner 4; expected 0 to 3");
        refused(&text().replace("0 1 2 3 7", "0 1 2 -1 7").into_bytes(), "corner -1");
        refused(&text().replace("vertex_indices", "corners").into_bytes(), "no corners");
        refused(&text().replace("float z", "float w").into_bytes(), "no position");
        refused(&text().replace("element vertex 4", "element vertex 4000000000").into_bytes(), "states 4000000000");
        let labels = "property int label\nproperty int object_id\n";
        refused(&text().replace("property int label\n", labels).into_bytes(), "several labels, label, object_id");
        let cloud = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                     end_header\n0 0 0\n";
        refused(cloud.as_bytes(), "a cloud of points has no surface");
        assert!(read(text().as_bytes(), 1).unwrap_err().0.contains("decimate"));
    }

    #[test]
    fn no_cut_off_file_is_a_mesh() {
        let whole = binary(false);
        for end in 0..whole.len() {
            assert!(read(&whole[..end], 10).is_err(), "{end}");
        }
    }
}
