//! OBJ files through tobj, behind a check of every index and count: tobj trusts the file's indices, and one that
//! overflows would end the program.

use glam::{Vec2, Vec3};
use mateval_scene::TriangleMesh;

use super::log::shortened;

/// What is read of a file at most.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ObjLimits {
    /// Triangles after polygons are split.
    pub(crate) triangles: usize,
    /// Corners of faces, so at least as many as vertices can come of it.
    pub(crate) corners: usize,
}

/// Why an OBJ was refused: the line, from 1 (0 where none is to blame), and what is wrong.
#[derive(Debug, PartialEq)]
pub(crate) struct ObjFault {
    pub(crate) line: usize,
    pub(crate) what: String,
    /// Whether it is sound but too large.
    pub(crate) limit: bool,
}

/// A mesh in the file's own space, and what had to be left out of it.
#[derive(Debug)]
pub(crate) struct ObjMesh {
    pub(crate) mesh: TriangleMesh,
    /// Its objects and groups in their order, and how many triangles each has.
    pub(crate) groups: Vec<(String, usize)>,
    /// Some faces have texture coordinates (normals) and some have none: then nobody keeps them.
    pub(crate) mixed_uvs: bool,
    pub(crate) mixed_normals: bool,
}

/// What a file's faces refer to.
#[derive(Debug, Default)]
struct Census {
    positions: i64,
    uvs: i64,
    normals: i64,
    triangles: usize,
    corners: usize,
    corners_with_uv: usize,
    corners_with_normal: usize,
}

/// Reads an OBJ: positions, texture coordinates, normals and faces of all its groups as one mesh; polygons as fans.
pub(crate) fn read(bytes: &[u8], limits: ObjLimits) -> Result<ObjMesh, ObjFault> {
    let text = std::str::from_utf8(bytes).map_or_else(|_| String::from_utf8_lossy(bytes), std::borrow::Cow::Borrowed);
    let census = check(&text, limits)?;
    let mixed = |some: usize| some != 0 && some != census.corners;
    let (mixed_uvs, mixed_normals) = (mixed(census.corners_with_uv), mixed(census.corners_with_normal));
    let (mesh, groups) =
        if mixed_uvs || mixed_normals { load(&without_mixed(&text, mixed_uvs, mixed_normals))? } else { load(&text)? };
    Ok(ObjMesh { mesh, groups, mixed_uvs, mixed_normals })
}

fn check(text: &str, limits: ObjLimits) -> Result<Census, ObjFault> {
    let mut census = Census::default();
    for (index, line) in text.lines().enumerate() {
        check_line(line, &mut census).map_err(|what| ObjFault { line: index + 1, what, limit: false })?;
        if census.triangles > limits.triangles || census.corners > limits.corners {
            let what = format!(
                "more than {} triangles or {} corners, which is what is left of the scene's limit",
                limits.triangles, limits.corners
            );
            return Err(ObjFault { line: index + 1, what, limit: true });
        }
    }
    Ok(census)
}

fn check_line(line: &str, census: &mut Census) -> Result<(), String> {
    let mut words = line.split_whitespace();
    match words.next() {
        Some("v") => census.positions += 1,
        Some("vt") => census.uvs += 1,
        Some("vn") => census.normals += 1,
        Some("f") => {
            let mut corners = 0;
            for corner in words {
                check_corner(corner, census)?;
                corners += 1;
            }
            if corners < 3 {
                return Err(format!("expected a face of 3 or more corners, found {corners}"));
            }
            census.corners += corners;
            census.triangles += corners - 2;
        }
        _ => {}
    }
    Ok(())
}

/// `position/uv/normal`, from 1, or negative from the end; uv and normal may be missing.
fn check_corner(corner: &str, census: &mut Census) -> Result<(), String> {
    let mut parts = corner.split('/');
    let mut index = |count: i64, what: &str, required: bool| match parts.next() {
        None | Some("") if !required => Ok(false),
        part => {
            let part = part.unwrap_or("");
            let number: i64 =
                part.parse().map_err(|_| format!("expected an index of a {what}, found '{}'", shortened(part)))?;
            let place = if number < 0 { number.saturating_add(count).saturating_add(1) } else { number };
            if (1..=count).contains(&place) {
                Ok(true)
            } else {
                Err(format!("the index {number} of a {what} is out of range: there are {count} so far"))
            }
        }
    };
    index(census.positions, "position", true)?;
    census.corners_with_uv += usize::from(index(census.uvs, "texture coordinate", false)?);
    census.corners_with_normal += usize::from(index(census.normals, "normal", false)?);
    if parts.next().is_some() {
        return Err(format!("expected position/uv/normal, found '{}'", shortened(corner)));
    }
    Ok(())
}

/// The text with the indices of what is mixed taken from every face.
fn without_mixed(text: &str, drop_uvs: bool, drop_normals: bool) -> String {
    let mut out = String::with_capacity(text.len());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        if words.next() != Some("f") {
            out.push_str(line);
        } else {
            out.push('f');
            for corner in words {
                let mut parts = corner.split('/');
                let mut part = |dropped: bool| parts.next().filter(|_| !dropped).unwrap_or("");
                let corner = format!(" {}/{}/{}", part(false), part(drop_uvs), part(drop_normals));
                out.push_str(corner.trim_end_matches('/'));
            }
        }
        out.push('\n');
    }
    out
}

fn load(text: &str) -> Result<(TriangleMesh, Vec<(String, usize)>), ObjFault> {
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ignore_points: true, ignore_lines: true };
    // Material libraries are never opened: Mitsuba does not use them, and their names come from a stranger.
    let no_materials = |_: &std::path::Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, no_materials).map_err(|error| ObjFault {
        line: 0,
        what: error.to_string(),
        limit: false,
    })?;
    let mut mesh = TriangleMesh { uvs: Some(Vec::new()), normals: Some(Vec::new()), ..Default::default() };
    let mut groups = Vec::new();
    for model in models.iter().filter(|model| !model.mesh.indices.is_empty()) {
        append(&mut mesh, &model.mesh);
        groups.push((model.name.clone(), model.mesh.indices.len() / 3));
    }
    let count = mesh.positions.len();
    mesh.uvs = mesh.uvs.filter(|uvs| uvs.len() == count);
    mesh.normals = mesh.normals.filter(|normals| normals.len() == count);
    Ok((mesh, groups))
}

fn append(mesh: &mut TriangleMesh, group: &tobj::Mesh) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(group.positions.chunks_exact(3).map(Vec3::from_slice));
    mesh.triangles.extend(group.indices.chunks_exact(3).map(|t| [first + t[0], first + t[1], first + t[2]]));
    if let Some(uvs) = &mut mesh.uvs {
        uvs.extend(group.texcoords.chunks_exact(2).map(Vec2::from_slice));
    }
    if let Some(normals) = &mut mesh.normals {
        normals.extend(group.normals.chunks_exact(3).map(Vec3::from_slice));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: ObjLimits = ObjLimits { triangles: 100, corners: 300 };
    const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n";

    fn read_text(faces: &str) -> Result<ObjMesh, ObjFault> {
        read(format!("{CORNERS}{faces}").as_bytes(), LIMITS)
    }

    #[test]
    fn polygons_groups_and_negative_indices() {
        let read = read_text("g a\nf 1/1/1 2/2/1 3/3/1 4/4/1\nusemtl x\ng b\nf  -4/-4/-1 -3/-3/-1 -2/-2/-1\n").unwrap();
        assert_eq!(read.groups, [("a".to_owned(), 2), ("b".to_owned(), 1)]);
        let mesh = read.mesh;
        assert_eq!((mesh.triangles.len(), mesh.positions.len()), (3, 7));
        assert_eq!(mesh.uvs.as_ref().map(Vec::len), Some(7));
        assert_eq!(mesh.corners(2), mesh.corners(0));
    }

    /// v is not flipped: OBJ's origin is the lower left, as ours.
    #[test]
    fn texture_coordinates_stay_as_they_are() {
        let mesh = read_text("f 1/1 2/2 3/3").unwrap().mesh;
        assert_eq!(mesh.uvs.unwrap()[2], Vec2::new(1.0, 1.0));
        assert!(mesh.normals.is_none());
    }

    #[test]
    fn faulty_indices_name_their_line() {
        for bad in [
            "f 1 2 5",
            "f 0 1 2",
            "f 1 2 -5",
            "f 1/5 2/1 3/1",
            "f 1//2 2//1 3//1",
            "f 1 2",
            "f 1 2 x",
            "f 1/1/1/1 2 3",
            "f 1 2 9223372036854775807",
            "f 1 2 -9223372036854775808",
            "f 1/9223372036854775807 2/1 3/1",
            "f 1 2 99999999999999999999999",
        ] {
            let fault = read_text(bad).unwrap_err();
            assert!(fault.line == 10 && !fault.limit, "{bad}: {fault:?}");
        }
        // Twin.
        assert!(read_text("f 1 2 4").is_ok());
    }

    #[test]
    fn mixed_faces_lose_what_only_some_have() {
        let read = read_text("f 1/1/1 2/2/1 3/3/1\nf 1//1 3//1 4//1").unwrap();
        assert!(read.mixed_uvs && !read.mixed_normals);
        assert!(read.mesh.uvs.is_none() && read.mesh.normals.is_some());
        assert_eq!(read.mesh.triangles.len(), 2);
    }

    #[test]
    fn too_many_triangles_are_refused_before_they_are_made() {
        let fault = read_text(&format!("f {}", "1 2 3 ".repeat(40))).unwrap_err();
        assert!(fault.limit, "{fault:?}");
    }

    #[test]
    fn rubbish_is_a_fault_or_nothing() {
        assert!(read(b"v 1 2\nf 1 1 1", LIMITS).is_err());
        assert!(read(b"v a b c", LIMITS).is_err());
        assert!(read(b"\xff\xfe\x00 v", LIMITS).unwrap().mesh.triangles.is_empty());
        assert!(read(b"", LIMITS).unwrap().mesh.triangles.is_empty());
    }
}
