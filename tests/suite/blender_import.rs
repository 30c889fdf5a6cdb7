//! Blender's own importer keeps the uv of a dataset's geometry. trimesh is tested with the Python package, three.js
//! with the site.

use std::collections::BTreeMap;
use std::process::Command;

use mateval_dataset::glb::{self, GlbNode};

use super::blender::blender;
use super::sample::unrendered;

/// Prints, for each mesh, the uv of every corner in every uv layer.
const IMPORT: &str = r#"
import json, sys
import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=sys.argv[1])
layers = lambda mesh: [[list(loop.uv) for loop in layer.data] for layer in mesh.uv_layers]
print("MESHES" + json.dumps({mesh.name: layers(mesh) for mesh in bpy.data.meshes}))
"#;

type Layers = Vec<Vec<[f32; 2]>>;

#[test]
fn the_importer_keeps_the_uv_of_every_corner() {
    let Some((python, _turn)) = blender() else { return };
    for (file, least) in [("instances.glb", 15), ("parts.glb", 15)] {
        let path = unrendered().join("scenes/room/geometry").join(file);
        let run = Command::new(&python).args(["-c", IMPORT]).arg(&path).output().unwrap();
        let stdout = String::from_utf8_lossy(&run.stdout);
        let meshes = stdout.lines().find_map(|line| line.strip_prefix("MESHES"));
        let imported: BTreeMap<String, Layers> =
            serde_json::from_str(meshes.unwrap_or_else(|| panic!("{run:?}"))).unwrap();
        let nodes = glb::read(&path).unwrap();
        assert_eq!(imported.len(), nodes.len());
        let with_uv = nodes.iter().filter(|node| has_its_uv(node, &imported[&node.name])).count();
        assert!(with_uv >= least, "{with_uv} meshes of {file} have uv");
    }
}

/// Whether the mesh has uv; if so, the importer's only layer must hold that of each triangle's corners.
fn has_its_uv(node: &GlbNode, layers: &Layers) -> bool {
    let Some(uvs) = &node.mesh.uvs else {
        // The twin: panes have no atlas, and thus no layer.
        assert!(layers.is_empty(), "{}", node.name);
        return false;
    };
    let corners = node.mesh.triangles.as_flattened().iter().map(|vertex| uvs[*vertex as usize].to_array());
    assert_eq!(layers.len(), 1, "{}", node.name);
    assert_eq!(layers[0].len(), 3 * node.mesh.triangles.len(), "{}", node.name);
    for (found, expected) in layers[0].iter().zip(corners) {
        // v is turned twice, which rounds.
        assert!((0..2).all(|c| (found[c] - expected[c]).abs() < 1e-6), "{}: {found:?}, not {expected:?}", node.name);
    }
    true
}
