//! Ids and OBJ files of single instances, for projects that process one object at a time.

use std::fmt::Write as _;

use mateval_scene::dataset::Instance;
use mateval_scene::{SceneId, TriangleMesh};

/// An object's id: the scene's id and the instance's index, such as `living-00012`.
pub fn object_id(scene: &SceneId, instance: &Instance) -> String {
    format!("{scene}-{:05}", instance.index.0)
}

/// A mesh as OBJ, in world space; the faces are in the order of its triangles.
pub fn obj_text(mesh: &TriangleMesh) -> String {
    let mut text = String::new();
    let mut line = |words: std::fmt::Arguments<'_>| {
        text.write_fmt(words).expect("writing to a String cannot fail");
        text.push('\n');
    };
    for p in &mesh.positions {
        line(format_args!("v {} {} {}", p.x, p.y, p.z));
    }
    for uv in mesh.uvs.iter().flatten() {
        line(format_args!("vt {} {}", uv.x, uv.y));
    }
    for [a, b, c] in mesh.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + 1)) {
        line(format_args!("f {a}/{a} {b}/{b} {c}/{c}"));
    }
    text
}
