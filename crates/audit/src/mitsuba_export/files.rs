//! Files as Mitsuba 3 reads them: XML with elements for plugins and their parameters, and meshes as binary PLY,
//! oriented so that Mitsuba takes the same side as the front as the built-in tracer does; and the findings about what
//! it cannot express.

use std::fmt::Write as _;

use glam::Vec3;
use mateval_dataset::{Finding, Severity, TriangleMesh};

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Element {
    tag: &'static str,
    attributes: Vec<(&'static str, String)>,
    children: Vec<Element>,
    /// Written before the element as a comment.
    remark: Option<String>,
}

impl Element {
    pub(super) fn new(tag: &'static str) -> Self {
        Self { tag, attributes: Vec::new(), children: Vec::new(), remark: None }
    }

    /// A plugin of the kind `tag` (`bsdf`, `shape`, ...) and the type `name`.
    pub(super) fn plugin(tag: &'static str, name: &'static str) -> Self {
        Self::new(tag).attribute("type", name)
    }

    pub(super) fn attribute(mut self, name: &'static str, value: impl Into<String>) -> Self {
        self.attributes.push((name, value.into()));
        self
    }

    /// Sets the name under which the element is a parameter of its parent.
    pub(super) fn named(self, name: &'static str) -> Self {
        self.attribute("name", name)
    }

    pub(super) fn child(mut self, child: Element) -> Self {
        self.children.push(child);
        self
    }

    pub(super) fn float(self, name: &'static str, value: impl Into<f64>) -> Self {
        self.child(value_element("float", name, number(value.into())))
    }

    pub(super) fn integer(self, name: &'static str, value: impl Into<u64>) -> Self {
        let value: u64 = value.into();
        self.child(value_element("integer", name, value.to_string()))
    }

    pub(super) fn boolean(self, name: &'static str, value: bool) -> Self {
        self.child(value_element("boolean", name, value.to_string()))
    }

    pub(super) fn string(self, name: &'static str, value: impl Into<String>) -> Self {
        self.child(value_element("string", name, value.into()))
    }

    pub(super) fn rgb(self, name: &'static str, value: [f32; 3]) -> Self {
        self.child(value_element("rgb", name, value.map(|v| number(v.into())).join(" ")))
    }

    /// A transform, row-major.
    pub(super) fn matrix(self, name: &'static str, rows: [[f64; 4]; 4]) -> Self {
        let value = rows.as_flattened().iter().map(|&v| number(v)).collect::<Vec<_>>().join(" ");
        self.child(Self::new("transform").named(name).child(Self::new("matrix").attribute("value", value)))
    }

    /// Sets a comment before the element that names what it was made from. Characters that could end the comment or
    /// control a terminal are replaced.
    pub(super) fn remark(mut self, name: &str) -> Self {
        let plain = |c: char| if c.is_alphanumeric() || " ._/()".contains(c) { c } else { '_' };
        self.remark = Some(name.chars().take(100).map(plain).collect());
        self
    }

    /// The text of the document whose root is this element.
    pub(super) fn document(&self) -> String {
        let mut text = "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n".to_owned();
        self.write(&mut text, 0);
        text
    }

    fn write(&self, text: &mut String, depth: usize) {
        let indent = "    ".repeat(depth);
        if let Some(remark) = &self.remark {
            // Writing to a String cannot fail, neither here nor below.
            let _ = writeln!(text, "{indent}<!-- {remark} -->");
        }
        let _ = write!(text, "{indent}<{}", self.tag);
        for (name, value) in &self.attributes {
            let _ = write!(text, " {name}=\"{}\"", escaped(value));
        }
        if self.children.is_empty() {
            text.push_str("/>\n");
            return;
        }
        text.push_str(">\n");
        self.children.iter().for_each(|child| child.write(text, depth + 1));
        let _ = writeln!(text, "{indent}</{}>", self.tag);
    }
}

fn value_element(tag: &'static str, name: &'static str, value: String) -> Element {
    Element::new(tag).named(name).attribute("value", value)
}

/// The shortest decimal that reads back as the same number; the shorter one where single precision suffices.
fn number(value: f64) -> String {
    // Turns -0 into 0.
    let value = value + 0.0;
    let single = value as f32;
    if f64::from(single) == value { format!("{single}") } else { format!("{value}") }
}

fn escaped(value: &str) -> String {
    value.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The name of the exported scene's file, which all findings refer to.
pub(super) const SCENE_FILE: &str = "scene.xml";

#[derive(Default)]
pub(super) struct Remarks(Vec<Finding>);

impl Remarks {
    /// Adds a warning: this part of the exported scene means something else in Mitsuba.
    pub(super) fn warn(&mut self, code: &str, place: &str, message: &str, action: &str) {
        self.add(Severity::Warning, code, place, message, action);
    }

    /// Adds a note: this part means the same in Mitsuba, or differs so little that only a very long render would show
    /// it.
    pub(super) fn note(&mut self, code: &str, place: &str, message: &str, action: &str) {
        self.add(Severity::Note, code, place, message, action);
    }

    /// All findings, sorted and without duplicates.
    pub(super) fn sorted(mut self) -> Vec<Finding> {
        self.0.sort();
        self.0.dedup();
        self.0
    }

    fn add(&mut self, severity: Severity, code: &str, place: &str, message: &str, action: &str) {
        self.0.push(Finding {
            severity,
            code: code.to_owned(),
            file: SCENE_FILE.to_owned(),
            place: place.to_owned(),
            message: message.to_owned(),
            action: action.to_owned(),
        });
    }
}

/// How a mesh is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sheet {
    /// The mesh as it is.
    Whole,
    /// Without vertex normals.
    Flat,
    /// Without vertex normals, front and back swapped and this far, in metres, behind the mesh.
    Behind(f32),
}

/// The mesh as a PLY file, and whether the file has vertex normals.
///
/// The built-in tracer takes the side of the vertex normals as the front, Mitsuba the side from which the corners run
/// counter-clockwise. Where the two disagree the order of the corners is reversed. uv are written as they are.
pub(super) fn ply_bytes(mesh: &TriangleMesh, sheet: Sheet) -> (Vec<u8>, bool) {
    let normals = mesh.normals.as_ref().filter(|_| sheet == Sheet::Whole);
    let mut vertices = Vec::new();
    let mut count = mesh.positions.len();
    let mut faces = Vec::with_capacity(mesh.triangles.len() * 13);
    let push = |vertices: &mut Vec<u8>, vertex: usize, position: Vec3, normal: Option<Vec3>| {
        put(vertices, &position.to_array());
        normal.iter().for_each(|normal| put(vertices, &normal.to_array()));
        mesh.uvs.iter().for_each(|uvs| put(vertices, &uvs[vertex].to_array()));
    };
    for (vertex, position) in mesh.positions.iter().enumerate() {
        push(&mut vertices, vertex, *position, normals.map(|normals| normals[vertex]));
    }
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let front = front(mesh, index);
        let mut corners = if front.turned { [triangle[0], triangle[2], triangle[1]] } else { *triangle };
        let needs_own = match sheet {
            Sheet::Behind(_) => true,
            // The vertex normals cancel out, and the built-in tracer takes the triangle's own normal.
            Sheet::Whole => normals.is_some() && front.sum == Vec3::ZERO,
            Sheet::Flat => false,
        };
        if needs_own {
            let shift = if let Sheet::Behind(distance) = sheet { -front.normal * distance } else { Vec3::ZERO };
            for (k, corner) in corners.into_iter().enumerate() {
                let vertex = corner as usize;
                push(&mut vertices, vertex, mesh.positions[vertex] + shift, normals.map(|_| front.normal));
                corners[k] = (count + k) as u32;
            }
            count += 3;
        }
        if matches!(sheet, Sheet::Behind(_)) {
            corners.swap(1, 2);
        }
        faces.push(3);
        corners.iter().for_each(|corner| faces.extend(corner.to_le_bytes()));
    }
    let mut bytes = ply_header(count, mesh.triangles.len(), normals.is_some(), mesh.uvs.is_some()).into_bytes();
    bytes.append(&mut vertices);
    bytes.append(&mut faces);
    (bytes, normals.is_some())
}

/// How many triangles have a vertex normal that points away from their front.
pub(super) fn bent_triangles(mesh: &TriangleMesh) -> usize {
    let Some(normals) = &mesh.normals else { return 0 };
    let bent = |index: &usize| {
        let front = front(mesh, *index);
        mesh.triangles[*index].iter().any(|&vertex| normals[vertex as usize].dot(front.normal) < 0.0)
    };
    (0..mesh.triangles.len()).filter(bent).count()
}

/// The side of a triangle that counts as its front.
struct Front {
    /// Normal of the triangle itself, on its front.
    normal: Vec3,
    /// Sum of the vertex normals.
    sum: Vec3,
    /// Whether the corners run clockwise, seen from the front.
    turned: bool,
}

fn front(mesh: &TriangleMesh, triangle: usize) -> Front {
    let [a, b, c] = mesh.corners(triangle).map(|corner| corner.as_dvec3());
    let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
    let of_vertices = |normals: &Vec<Vec3>| mesh.triangles[triangle].iter().map(|&v| normals[v as usize]).sum();
    let sum: Vec3 = mesh.normals.as_ref().map_or(Vec3::ZERO, of_vertices);
    let turned = sum.dot(normal) < 0.0;
    Front { normal: if turned { -normal } else { normal }, sum, turned }
}

fn put(bytes: &mut Vec<u8>, values: &[f32]) {
    values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
}

fn ply_header(vertices: usize, faces: usize, normals: bool, uvs: bool) -> String {
    let properties = |names: &str, present: bool| -> String {
        names.split(' ').filter(|_| present).map(|name| format!("property float {name}\n")).collect()
    };
    format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\n{}{}{}element face {faces}\n\
         property list uchar int vertex_indices\nend_header\n",
        properties("x y z", true),
        properties("nx ny nz", normals),
        properties("u v", uvs)
    )
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;

    #[test]
    fn a_document_reads_back() {
        let inner = Element::plugin("bsdf", "diffuse").float("a", 0.1_f32).rgb("b", [-0.0, 0.25, 1e-9]);
        let text =
            Element::new("scene").attribute("version", "3.0.0").child(inner.remark("x --> <y&\u{1b}z--")).document();
        let read = roxmltree::Document::parse(&text).unwrap();
        let values: Vec<_> = read.descendants().filter_map(|node| node.attribute("value")).collect();
        assert_eq!(values, ["0.1", "0 0.25 0.000000001"]);
        let comment = read.descendants().find(|node| node.is_comment()).unwrap();
        assert_eq!(comment.text(), Some(" x ___ _y__z__ "));
    }

    #[test]
    fn values_cannot_break_the_markup() {
        let value = "\"/><&evil;";
        let text = Element::new("scene").string("filename", value).document();
        let read = roxmltree::Document::parse(&text).unwrap();
        assert_eq!(read.descendants().find_map(|node| node.attribute("value")), Some(value));
    }

    fn square() -> TriangleMesh {
        TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y],
            normals: Some(vec![-Vec3::Z; 4]),
            uvs: Some(vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    /// The corners of each face, as positions.
    fn corners(bytes: &[u8]) -> Vec<[Vec3; 3]> {
        let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        let header = std::str::from_utf8(&bytes[..end]).unwrap();
        let number = |word: &str| -> usize {
            header.lines().find_map(|line| line.strip_prefix(word)).unwrap().trim().parse().unwrap()
        };
        let stride = 4 * header.lines().filter(|line| line.starts_with("property float")).count();
        let float = |at: usize| f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        let vertex = |k: usize| Vec3::from_array([0, 4, 8].map(|o| float(end + k * stride + o)));
        let faces = end + number("element vertex") * stride;
        assert_eq!(bytes.len(), faces + 13 * number("element face"));
        let index = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        (0..number("element face")).map(|f| [1, 5, 9].map(|o| vertex(index(faces + 13 * f + o)))).collect()
    }

    fn normal([a, b, c]: [Vec3; 3]) -> Vec3 {
        (b - a).cross(c - a).normalize()
    }

    #[test]
    fn corners_run_counter_clockwise_seen_from_the_front() {
        let (bytes, normals) = ply_bytes(&square(), Sheet::Whole);
        assert!(normals && corners(&bytes).into_iter().all(|face| normal(face) == -Vec3::Z));
        assert_eq!(bent_triangles(&square()), 0);
    }

    #[test]
    fn the_sheet_behind_faces_the_other_way() {
        let (bytes, normals) = ply_bytes(&square(), Sheet::Behind(0.01));
        assert!(!normals);
        for face in corners(&bytes) {
            assert!(normal(face) == Vec3::Z && face.iter().all(|corner| (corner.z - 0.01).abs() < 1e-9));
        }
    }

    #[test]
    fn a_triangle_whose_vertex_normals_are_zero_gets_its_own() {
        let mut mesh = square();
        mesh.normals = Some(vec![Vec3::ZERO; 4]);
        let (bytes, _) = ply_bytes(&mesh, Sheet::Whole);
        assert!(String::from_utf8_lossy(&bytes).contains("element vertex 10\n"));
        mesh.normals = Some(vec![Vec3::Z, Vec3::Z, -Vec3::Z, Vec3::Z]);
        assert_eq!(bent_triangles(&mesh), 2);
    }
}
