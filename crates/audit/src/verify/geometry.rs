//! Checks the dataset's meshes against the reference geometry, and baked materials against their atlases.

use mateval_image::Wrap;
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_prep::faults::Faults;
use mateval_prep::scene_meshes::Meshes;
use mateval_scene::dataset::SceneFile;
use mateval_scene::glb::GlbNode;
use mateval_scene::layout::SceneFolder;
use mateval_scene::material::{ColorInput, Material, MaterialModel};
use mateval_scene::reference::{MaterialIndex, ReferenceScene, Surface};
use mateval_scene::submission::Map;

/// Whether the reference has exactly the triangles of `instances.glb`. Every difference is reported as a fault.
pub(super) fn matches_reference(reference: &ReferenceScene, meshes: &Meshes, faults: &mut Faults) -> bool {
    let before = faults.all.len();
    const FILE: &str = "ground_truth/reference/geometry.glb";
    if reference.surfaces.len() != meshes.instances.len() {
        let message = format!(
            "{} surfaces, expected one for each of {} instances",
            reference.surfaces.len(),
            meshes.instances.len()
        );
        faults.add("wrong_nodes", FILE, "", message);
        return false;
    }
    for (surface, node) in reference.surfaces.iter().zip(&meshes.instances) {
        let (a, b) = (&surface.mesh, &node.mesh);
        let same = a.triangles.len() == b.triangles.len()
            && (0..a.triangles.len()).all(|triangle| a.corners(triangle) == b.corners(triangle));
        if !same {
            let message = "its triangles differ from those of instances.glb";
            faults.add("wrong_geometry", FILE, format!("node '{}'", node.name), message);
        }
    }
    faults.all.len() == before
}

/// Checks that every atlas has its three baked maps, at the size of the atlas.
pub(super) fn check_materials(folder: &SceneFolder, scene: &SceneFile, faults: &mut Faults) {
    for instance in &scene.instances {
        let Some(atlas) = &instance.atlas else { continue };
        for map in Map::ALL {
            let file = format!("ground_truth/materials/{}/{}.png", instance.id, map.stem());
            let path = folder.truth_material(&instance.id).join(map.stem()).with_extension("png");
            let read = read_texture(&path, Encoding::Linear, Wrap::Clamp);
            let Some(picture) = faults.read(&file, read) else { continue };
            let size = atlas.size as usize;
            if (picture.width(), picture.height()) != (size, size) {
                let message = format!("{}x{} texels, expected {size}x{size}", picture.width(), picture.height());
                faults.add("wrong_size", &file, "", message);
            }
        }
    }
}

/// The instances as opaque surfaces, against which pictures are checked where the ground truth is withheld.
pub(super) fn opaque(meshes: &Meshes) -> ReferenceScene {
    let material = Material {
        name: String::new(),
        model: MaterialModel::Diffuse { reflectance: ColorInput::Constant([0.5; 3]), alpha: None },
        two_sided: true,
        opacity: None,
        bump: None,
    };
    let surface =
        |node: &GlbNode| Surface { name: node.name.clone(), mesh: node.mesh.clone(), material: MaterialIndex(0) };
    ReferenceScene {
        surfaces: meshes.instances.iter().map(surface).collect(),
        materials: vec![material],
        ..ReferenceScene::default()
    }
}
