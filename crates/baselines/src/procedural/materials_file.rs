//! `materials.mtlx`: the graphs of a scene's parts with their parameters.

use std::collections::BTreeSet;
use std::path::Path;

use mateval_procedural::Graph;
use mateval_procedural::mtlx::to_text_of_all;
use mateval_scene::SceneError;

use super::scene_materials::SceneMaterials;
use crate::error::BaselineError;

/// Writes the graphs, each as a material that is named after its part. Parts of one colour have none.
pub(super) fn write(path: &Path, materials: &SceneMaterials<'_>) -> Result<(), BaselineError> {
    let mut names = BTreeSet::new();
    let mut graphs: Vec<Graph> = Vec::new();
    for (part, material) in materials.triangles.parts.iter().zip(&materials.of_part) {
        let Some(found) = &material.graph else { continue };
        let name = distinct(name_of(part.id.as_str()), &mut names);
        let doc = format!("{} of part '{}'", found.graph.name, part.id);
        graphs.push(Graph { doc: Some(doc), ..found.settings.as_defaults(&found.graph, &name) });
    }
    std::fs::write(path, to_text_of_all(&graphs)).map_err(SceneError::io("write", path))?;
    Ok(())
}

/// A name that MaterialX allows: letters, digits and underscores. The prefix keeps it apart from names of other kinds.
fn name_of(part: &str) -> String {
    let allowed = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    format!("part_{}", part.chars().map(allowed).collect::<String>())
}

/// The name with a number, if it is taken.
fn distinct(name: String, taken: &mut BTreeSet<String>) -> String {
    let mut found = name.clone();
    let mut number = 2;
    while !taken.insert(found.clone()) {
        found = format!("{name}_{number}");
        number += 1;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_allowed_and_distinct() {
        let mut taken = BTreeSet::new();
        let named: Vec<String> =
            ["floor-p0", "floor.p0", "floor_p0"].map(|part| distinct(name_of(part), &mut taken)).into();
        assert_eq!(named, ["part_floor_p0", "part_floor_p0_2", "part_floor_p0_3"]);
    }
}
