//! Compares the meshes of a finished scene, one for each instance and each part, with its `scene.json`.

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::glb::{self, GlbNode};
use mateval_dataset::layout::{SceneFolder, part_picture, parts_file};
use mateval_dataset::{Finding, Severity};

use crate::error::PrepError;

const INSTANCES: &str = "geometry/instances.glb";

pub struct Meshes {
    /// The nodes of `instances.glb`.
    pub instances: Vec<GlbNode>,
    /// For every set of parts and every instance: the part of each triangle, as an index in the set.
    pub part_sets: Vec<Vec<Vec<usize>>>,
}

impl Meshes {
    /// For each set of parts its picture's file, and the part's value in it for every triangle of every instance.
    pub fn part_values(&self, scene: &SceneFile) -> Vec<(String, Vec<Vec<u16>>)> {
        let mut sets = Vec::new();
        for ((set, parts), of_triangles) in scene.all_part_sets().zip(&self.part_sets) {
            let value = |part: &usize| parts[*part].index.0.get();
            let values = of_triangles.iter().map(|instance| instance.iter().map(value).collect());
            sets.push((part_picture(set), values.collect()));
        }
        sets
    }
}

/// Reads the meshes and compares them with `scene.json`. Returns none where they differ, since nothing else can then be
/// compared with them.
pub fn check(folder: &SceneFolder, scene: &SceneFile, faults: &mut Faults) -> Option<Meshes> {
    let instances = faults.read(INSTANCES, glb::read(&folder.instances()))?;
    let known = scene.instances.iter().map(|instance| (instance.id.as_str(), instance.triangles));
    let mut fits = same_nodes(INSTANCES, &instances, known, faults);
    let mut nodes_of_sets = Vec::new();
    for (set, parts) in scene.all_part_sets() {
        let file = parts_file(set);
        let nodes = faults.read(&file, glb::read(&folder.parts(set)))?;
        let known = parts.iter().map(|part| (part.id.as_str(), part.triangles));
        fits &= same_nodes(&file, &nodes, known, faults);
        nodes_of_sets.push(nodes);
    }
    if !fits {
        return None;
    }
    for (instance, node) in scene.instances.iter().zip(&instances) {
        check_uv(instance.atlas.is_some(), node, faults);
    }
    let mut part_sets = Vec::new();
    for ((set, parts), nodes) in scene.all_part_sets().zip(&nodes_of_sets) {
        let owned = scene.instances.iter().map(|instance| {
            let is_own = |part: &usize| parts[*part].instance == instance.id;
            (0..parts.len()).filter(is_own).collect::<Vec<_>>()
        });
        part_sets.push(parts_of_triangles(&instances, owned, nodes, &parts_file(set), faults)?);
    }
    Some(Meshes { instances, part_sets })
}

/// Whether the nodes have the ids and numbers of triangles that `scene.json` states, in the same order.
fn same_nodes<'a>(
    file: &str,
    nodes: &[GlbNode],
    known: impl ExactSizeIterator<Item = (&'a str, usize)>,
    faults: &mut Faults,
) -> bool {
    let before = faults.all.len();
    if nodes.len() != known.len() {
        faults.add("wrong_nodes", file, "", format!("found {} nodes, scene.json lists {}", nodes.len(), known.len()));
    }
    for (node, (id, triangles)) in nodes.iter().zip(known) {
        if node.name != id || node.mesh.triangles.len() != triangles {
            let found = format!("'{}' of {} triangles", node.name, node.mesh.triangles.len());
            faults.add("wrong_nodes", file, format!("node '{id}'"), format!("found {found}, expected {triangles}"));
        }
    }
    faults.all.len() == before
}

fn check_uv(has_atlas: bool, node: &GlbNode, faults: &mut Faults) {
    let place = format!("node '{}'", node.name);
    match (&node.mesh.uvs, has_atlas) {
        (None, false) => {}
        (None, true) => faults.add("bad_uv", INSTANCES, place, "it has an atlas but no TEXCOORD_0"),
        (Some(_), false) => faults.add("bad_uv", INSTANCES, place, "it has TEXCOORD_0 but no atlas"),
        (Some(uvs), true) => {
            if let Some(at) = uvs.iter().position(|uv| uv.min_element() < 0.0 || uv.max_element() > 1.0) {
                faults.add("bad_uv", INSTANCES, place, format!("vertex {at} has uv {}, expected 0 to 1", uvs[at]));
            }
        }
    }
}

/// The part of each triangle. The parts of an instance must hold its triangles in their order: each triangle is the
/// next one of exactly one part. `owned` holds for each instance the indices of its parts.
fn parts_of_triangles(
    instances: &[GlbNode],
    owned: impl Iterator<Item = Vec<usize>>,
    parts: &[GlbNode],
    file: &str,
    faults: &mut Faults,
) -> Option<Vec<Vec<usize>>> {
    let mut used = vec![0_usize; parts.len()];
    let mut all = Vec::new();
    for (node, own) in instances.iter().zip(owned) {
        let mut of_triangles = Vec::with_capacity(node.mesh.triangles.len());
        for triangle in 0..node.mesh.triangles.len() {
            let corners = node.mesh.corners(triangle);
            let found = own.iter().copied().find(|part| {
                used[*part] < parts[*part].mesh.triangles.len() && parts[*part].mesh.corners(used[*part]) == corners
            });
            let Some(part) = found else {
                let message = format!("triangle {triangle} of '{}' is in none of its parts", node.name);
                faults.add("bad_parts", file, format!("node '{}'", node.name), message);
                return None;
            };
            used[part] += 1;
            of_triangles.push(part);
        }
        all.push(of_triangles);
    }
    Some(all)
}

/// The value in `part.png` of every triangle of every instance, from the meshes. Fails where the meshes differ from
/// `scene.json`.
pub fn part_values(folder: &SceneFolder, scene: &SceneFile) -> Result<Vec<Vec<u16>>, PrepError> {
    let mut faults = Faults::default();
    let Some(meshes) = check(folder, scene, &mut faults) else {
        let path = folder.path().to_owned();
        return Err(mateval_dataset::DatasetError::Invalid { path, findings: faults.all }.into());
    };
    Ok(meshes.part_values(scene).swap_remove(0).1)
}

/// Faults of a dataset, collected so that all of them are reported together.
#[derive(Debug, Default)]
pub struct Faults {
    /// All of them, in the order in which they were found.
    pub all: Vec<Finding>,
    /// A prefix for the file of every fault that is added.
    pub prefix: String,
}

impl Faults {
    /// Adds a fault of `file` at `place`.
    pub fn add(&mut self, code: &str, file: &str, place: impl Into<String>, message: impl Into<String>) {
        self.all.push(Finding::new(
            Severity::Error,
            code,
            format!("{}{file}", self.prefix),
            place.into(),
            message.into(),
            "download the dataset again, or build it again",
        ));
    }

    /// The value; or none, after adding the reason why it could not be read.
    pub fn read<T, E: std::fmt::Display>(&mut self, file: &str, result: Result<T, E>) -> Option<T> {
        result.map_err(|error| self.add("unreadable", file, "", error.to_string())).ok()
    }
}
