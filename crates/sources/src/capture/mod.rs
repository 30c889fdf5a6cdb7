//! Reads a real room that was scanned and photographed: a mesh, cameras and photos.
//!
//! The mesh is a PLY, OBJ or glTF file. Its instances are the labels of a PLY's faces or of a NumPy file, the groups of
//! an OBJ or the nodes of a glTF; where there is only one, its connected pieces. The cameras are in any of the formats
//! that [`cameras`] lists, and the photos in one folder. The output is a [`FileScene`] without materials of its own,
//! since nobody knows them, and the camera of the input photo. Photos are not decoded here.
//!
//! Mesh and cameras share a world, of any unit and any direction up: both are turned and scaled to metres with +Y up.

pub mod cameras;
mod colmap;
mod matrices;
pub mod measured;
mod ply;

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use glam::{DMat3, DMat4, DQuat, DVec3, Vec3};
use mateval_dataset::material::{ColorInput, Material, MaterialModel, StatedParameters};
use mateval_dataset::mesh::bounds;
use mateval_dataset::obj::{self, Materials, ObjLimits};
use mateval_dataset::reference::{Emission, LightGroup, MaterialIndex, ReferenceScene, Surface};
use mateval_dataset::{Role, SceneLights, TriangleMesh};
use mateval_files::FileError;
use mateval_files::source_folder::SourceFolder;
use mateval_files::untrusted::{hint, quoted};
use mateval_image::npy_io;

use crate::gltf;
use crate::log::Log;
use crate::open::{Invalid, SourceError};
use crate::source_scene::{FileScene, InstanceOrigin, Missing, read_licence, report_shift, shift_of};
use crate::surface_mesh::{connected_parts, to_world};
use cameras::{Cameras, CapturedCamera, PhotoName};

/// The largest file, in bytes.
const FILE_BYTES: u64 = 1 << 31;
/// The most triangles of a mesh.
const MOST_TRIANGLES: usize = 20_000_000;
const MOST_FINDINGS: usize = 500;
/// Connected pieces with a smaller share of the area belong to one instance, the rest.
const LEAST_PIECE: f64 = 0.005;
/// The name of that instance.
const REST: &str = "rest";
/// Longest sides of a room, in metres: others are those of a mesh in another unit.
const SIDES_M: std::ops::RangeInclusive<f64> = 0.2..=200.0;
/// Reflectance of all surfaces. No score depends on it; some rendered pictures do.
const PLACEHOLDER: [f32; 3] = [0.5; 3];
/// Endings of the files in the folder of photos that count as photos, in lower case. Those of formats that are not read
/// count too, since cameras may be numbered as they are.
const PHOTO_ENDINGS: [&str; 14] =
    ["png", "jpg", "jpeg", "webp", "bmp", "exr", "hdr", "tif", "tiff", "heic", "dng", "cr2", "cr3", "arw"];
/// The most photos.
const MOST_PHOTOS: usize = 100_000;

/// The paths of a capture, relative to its folder, and what its files do not state.
#[derive(Clone, Debug)]
pub struct CaptureFiles {
    pub root: PathBuf,
    /// A `.ply`, `.obj`, `.glb` or `.gltf` file.
    pub mesh: String,
    /// A file or a folder of cameras.
    pub cameras: String,
    /// The folder of the photos.
    pub photos: String,
    /// The input photo: its name, with or without its ending.
    pub input: String,
    /// The photos of other views: their names, with or without their endings.
    pub novel: Vec<String>,
    /// A NumPy file with an integer for each triangle of the mesh, the number of its instance.
    pub labels: Option<String>,
    /// Metres for each unit of mesh and cameras.
    pub scale: f64,
    /// The direction up in the world of mesh and cameras.
    pub up: DVec3,
    /// The names of the instances that belong to the building.
    pub architecture: Vec<String>,
}

/// A capture, in metres with +Y up.
#[derive(Clone, Debug)]
pub struct Capture {
    /// Its camera is left out, since it depends on the size of the photo.
    pub read: FileScene,
    /// The input photo, relative to the folder, and its camera.
    pub input: (String, CapturedCamera),
    /// The photos of other views, in the order in which they are named.
    pub novel: Vec<(String, CapturedCamera)>,
    /// The input camera by [`CapturedCamera::other_poses`].
    pub other_poses: Vec<(&'static str, CapturedCamera)>,
}

/// A mesh in the file's own world, with names for its instances.
struct Scan {
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// For each triangle, a number in `names`.
    instances: Vec<usize>,
    names: Vec<String>,
}

/// Reads a capture. Fails where there is no mesh, no camera or no photo to read.
pub fn read(files: &CaptureFiles) -> Result<Capture, SourceError> {
    let root = &files.root;
    let mut folder = SourceFolder::new(root, FILE_BYTES).map_err(FileError::io("open", root))?;
    let relative = |path: &str| SourceFolder::relative(path).map_err(|fault| Invalid(fault.message).in_file(root));
    let (mesh, camera_path, photo_folder) =
        (relative(&files.mesh)?, relative(&files.cameras)?, relative(&files.photos)?);
    let mut log = Log::new(mesh.clone(), MOST_FINDINGS);

    // The cameras, and among them those of the named photos.
    let in_cameras = |fault: Invalid| fault.in_file(&root.join(&camera_path));
    let cameras = read_cameras(&mut folder, &camera_path).map_err(in_cameras)?;
    if cameras.is_transformed {
        let message =
            "states an `applied_transform`: its poses are in another world than the model that they came from";
        let action = "used the poses as they are; export the mesh in their world, as `ns-export` does";
        log.push(mateval_dataset::Severity::Warning, "applied_transform", &camera_path, "", message, action);
    }
    let photos = photos_of(&root.join(&photo_folder));
    let mut named: Vec<usize> = Vec::new();
    let mut taken = Vec::new();
    for name in std::iter::once(&files.input).chain(&files.novel) {
        let at = cameras::find(&cameras.all, &photos, name).map_err(in_cameras)?;
        if named.contains(&at) {
            return Err(in_cameras(Invalid(format!("the photo {} is named twice; name each once", quoted(name)))));
        }
        named.push(at);
        let camera = cameras.all[at].clone();
        taken.push((photo_path(&folder, &photo_folder, &photos, &camera.photo).map_err(in_cameras)?, camera));
    }

    // The mesh, in the world of all scenes.
    let in_mesh = |fault: Invalid| fault.in_file(&root.join(&mesh));
    let scan = read_mesh(&mut folder, &mesh, files, &mut log)?;
    let scan = match &files.labels {
        Some(path) => labelled(scan, &mut folder, path).map_err(|fault| fault.in_file(&root.join(path)))?,
        None if scan.names.len() > 1 => scan,
        None => in_pieces(scan, &mut log),
    };
    let turn = DMat3::from_quat(DQuat::from_rotation_arc(files.up.normalize(), DVec3::Y));
    let shift_m = shift_of(turn * taken[0].1.position * files.scale);
    report_shift(shift_m, &mut log);
    let mut other_poses: Vec<_> = taken[0].1.other_poses().collect();
    for camera in taken.iter_mut().map(|(_, camera)| camera).chain(other_poses.iter_mut().map(|(_, camera)| camera)) {
        camera.rotation = turn * camera.rotation;
        camera.position = turn * camera.position * files.scale - shift_m;
    }
    let place = |position: DVec3| (turn * position * files.scale - shift_m).as_vec3();
    let scene = scene_of(&scan, place, &mut log);
    check_sides(&scene, &mut log);
    let origins = origins_of(&scan, &scene, files).map_err(in_mesh)?;
    let licence = read_licence(&mut folder, &mut log);
    let files = folder.into_files();
    let read = FileScene {
        scene,
        origins,
        lights: SceneLights::Stage,
        camera: None,
        aspect: None,
        shift_m,
        findings: log.into_findings(),
        licence,
        missing: Missing::default(),
        files,
    };
    let input = taken.remove(0);
    Ok(Capture { read, input, novel: taken, other_poses })
}

/// The names of the photos in a folder, in order.
fn photos_of(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder).into_iter().flatten().flatten().take(MOST_PHOTOS);
    let names = names.filter_map(|entry| entry.file_name().into_string().ok());
    let is_photo = |name: &String| {
        name.rsplit_once('.').is_some_and(|(_, ending)| PHOTO_ENDINGS.contains(&ending.to_lowercase().as_str()))
    };
    let mut photos: Vec<String> = names.filter(is_photo).collect();
    photos.sort();
    photos
}

/// The path of a camera's photo: by its path below the folder of photos, by its file name, or by that without its
/// ending.
fn photo_path(folder: &SourceFolder, photos: &str, names: &[String], photo: &PhotoName) -> Result<String, Invalid> {
    let inside = |name: &str| format!("{photos}/{name}");
    let stem = |name: &str| name.rsplit_once('.').map_or(name.to_owned(), |(stem, _)| stem.to_owned());
    match photo {
        PhotoName::Number(number) => names.get(*number).map(|name| inside(name)),
        PhotoName::File(path) => {
            let file = path.rsplit('/').next().unwrap_or(path);
            let whole = SourceFolder::relative(&inside(path)).ok().filter(|path| folder.contains(path));
            let by_name = names.iter().find(|name| *name == file);
            let by_stem = || names.iter().find(|name| stem(name) == stem(file) || **name == file);
            whole.or_else(|| by_name.or_else(by_stem).map(|name| inside(name)))
        }
    }
    .ok_or_else(|| {
        Invalid(format!("the folder '{photos}' does not hold the photo of {photo:?}, among {}", names.len()))
    })
}

/// Reads the mesh; labels of a PLY's faces, groups of an OBJ and nodes of a glTF are its instances.
fn read_mesh(folder: &mut SourceFolder, path: &str, files: &CaptureFiles, log: &mut Log) -> Result<Scan, SourceError> {
    let place = files.root.join(path);
    let in_mesh = |fault: Invalid| fault.in_file(&place);
    let read = |folder: &mut SourceFolder| folder.read(path).map_err(|fault| in_mesh(Invalid(fault.message)));
    let ending = path.rsplit_once('.').map(|(_, ending)| ending.to_lowercase());
    match ending.as_deref() {
        Some("ply") => scan_of_ply(&read(folder)?, log).map_err(in_mesh),
        Some("obj") => scan_of_obj(&read(folder)?).map_err(in_mesh),
        Some("glb" | "gltf") => scan_of_gltf(folder, &place, &files.root),
        _ => Err(in_mesh(Invalid("expected a mesh as .ply, .obj, .glb or .gltf".to_owned()))),
    }
}

fn scan_of_ply(bytes: &[u8], log: &mut Log) -> Result<Scan, Invalid> {
    let mesh = ply::read(bytes, MOST_TRIANGLES)?;
    if mesh.without_area > 0 {
        let message = format!("{} faces have fewer than three corners", mesh.without_area);
        log.note("degenerate_triangles", "", message, "left them out");
    }
    let positions = mesh.positions.into_iter().map(DVec3::from_array).collect();
    let labels = mesh.labels;
    let (instances, names) = match labels.is_empty() {
        true => (vec![0; mesh.triangles.len()], vec!["mesh".to_owned()]),
        false => by_label(&labels),
    };
    Ok(Scan { positions, triangles: mesh.triangles, instances, names })
}

fn scan_of_obj(bytes: &[u8]) -> Result<Scan, Invalid> {
    let limits = ObjLimits { triangles: MOST_TRIANGLES, corners: 3 * MOST_TRIANGLES };
    let read = obj::read(bytes, limits, Materials::Ignored).map_err(|error| Invalid(error.to_string()))?;
    let positions = read.mesh.positions.iter().map(|position| position.as_dvec3() + read.base).collect();
    let groups = read.groups.iter().enumerate();
    let instances = groups.flat_map(|(at, group)| std::iter::repeat_n(at, group.triangles)).collect();
    let names = read.groups.iter().map(|group| group.name.clone()).collect();
    Ok(Scan { positions, triangles: read.mesh.triangles, instances, names })
}

/// `place` is the file, below the capture's folder `root`.
fn scan_of_gltf(folder: &mut SourceFolder, place: &Path, root: &Path) -> Result<Scan, SourceError> {
    let read = gltf::read(place, Some(DVec3::ZERO), &gltf::Limits::default())?;
    // Its buffers are read again for their hashes, which the scene records.
    for (file, _) in &read.files.hashes {
        let inside = place.parent().unwrap_or(root).join(file);
        let inside = inside.strip_prefix(root).unwrap_or(&inside).to_string_lossy().into_owned();
        folder.read(&inside).map_err(|fault| Invalid(fault.message).in_file(place))?;
    }
    let mut scan = Scan { positions: Vec::new(), triangles: Vec::new(), instances: Vec::new(), names: Vec::new() };
    for (at, surface) in read.scene.surfaces.iter().enumerate() {
        let first = scan.positions.len() as u32;
        scan.positions.extend(surface.mesh.positions.iter().map(|position| position.as_dvec3()));
        scan.triangles.extend(surface.mesh.triangles.iter().map(|corners| corners.map(|at| at + first)));
        scan.instances.extend(std::iter::repeat_n(at, surface.mesh.triangles.len()));
        scan.names.push(surface.name.clone());
    }
    Ok(scan)
}

/// Numbers and names of the instances of labels, in the order of the labels.
fn by_label(labels: &[i64]) -> (Vec<usize>, Vec<String>) {
    let mut numbers: BTreeMap<i64, usize> = labels.iter().map(|label| (*label, 0)).collect();
    numbers.values_mut().enumerate().for_each(|(at, number)| *number = at);
    let names = numbers.keys().map(|label| format!("label_{label}")).collect();
    (labels.iter().map(|label| numbers[label]).collect(), names)
}

/// The scan with the labels of a NumPy file as its instances.
fn labelled(scan: Scan, folder: &mut SourceFolder, path: &str) -> Result<Scan, Invalid> {
    let bytes = folder.read(path).map_err(|fault| Invalid(fault.message))?;
    let labels = npy_io::whole_numbers(&bytes).map_err(|fault| Invalid(fault.to_string()))?;
    if labels.len() != scan.triangles.len() {
        let (found, expected) = (labels.len(), scan.triangles.len());
        return Err(Invalid(format!("{found} labels; expected {expected}, one for each triangle of the mesh")));
    }
    let (instances, names) = by_label(&labels);
    Ok(Scan { instances, names, ..scan })
}

/// The scan with its connected pieces as its instances, largest first. Small ones belong to one of them, the rest.
fn in_pieces(scan: Scan, log: &mut Log) -> Scan {
    let positions: Vec<Vec3> = scan.positions.iter().map(|position| position.as_vec3()).collect();
    let mesh = TriangleMesh { positions, triangles: scan.triangles, ..TriangleMesh::default() };
    let pieces = connected_parts(&mesh);
    let mut areas = vec![0.0; pieces.iter().max().map_or(0, |most| most + 1)];
    pieces.iter().enumerate().for_each(|(triangle, piece)| areas[*piece] += mesh.triangle_area(triangle));
    let least = LEAST_PIECE * areas.iter().sum::<f64>();
    // The first is kept whatever its share, so that there is an instance.
    let kept = areas.iter().enumerate().take_while(|(at, area)| *at == 0 || **area >= least).count();
    let mut names: Vec<String> = (1..=kept).map(|number| format!("piece_{number}")).collect();
    if areas.len() > kept {
        names.push(REST.to_owned());
        let share = 100.0 * areas[kept..].iter().sum::<f64>() / areas.iter().sum::<f64>();
        let message = format!("{share:.1} % of its area are connected pieces below {:.1} % each", 100.0 * LEAST_PIECE);
        log.note("small_pieces", "", message, format!("made them one instance, '{REST}'"));
    }
    let instances = pieces.into_iter().map(|piece| piece.min(kept)).collect();
    Scan { triangles: mesh.triangles, instances, names, ..scan }
}

/// A surface for each instance that has triangles, all of one material, lit from everywhere.
fn scene_of(scan: &Scan, place: impl Fn(DVec3) -> Vec3, log: &mut Log) -> ReferenceScene {
    let mut meshes = vec![TriangleMesh::default(); scan.names.len()];
    let mut new_places: Vec<HashMap<u32, u32>> = vec![HashMap::new(); scan.names.len()];
    for (corners, instance) in scan.triangles.iter().zip(&scan.instances) {
        let (mesh, new_place) = (&mut meshes[*instance], &mut new_places[*instance]);
        mesh.triangles.push(corners.map(|corner| {
            *new_place.entry(corner).or_insert_with(|| {
                mesh.positions.push(place(scan.positions[corner as usize]));
                mesh.positions.len() as u32 - 1
            })
        }));
    }
    let mut surfaces = Vec::new();
    for (name, mesh) in scan.names.iter().zip(meshes) {
        let (mesh, repairs) = to_world(mesh, DMat4::IDENTITY, false);
        repairs.report(name, &mesh, log);
        if !mesh.triangles.is_empty() {
            surfaces.push(Surface { name: name.clone(), mesh, material: MaterialIndex(0) });
        }
    }
    let material = Material {
        name: "unknown".to_owned(),
        model: MaterialModel::Diffuse { reflectance: ColorInput::Constant(PLACEHOLDER), alpha: None },
        two_sided: true,
        opacity: None,
        bump: None,
    };
    let emission = Emission::Constant { radiance: [1.0; 3] };
    let light = LightGroup { name: "outside".to_owned(), emission, camera_visible: true };
    ReferenceScene { surfaces, materials: vec![material], lights: vec![light], ..ReferenceScene::default() }
}

/// Reports a mesh that is no room in metres.
fn check_sides(scene: &ReferenceScene, log: &mut Log) {
    let corners = scene.surfaces.iter().flat_map(|surface| &surface.mesh.positions).copied();
    let [low, high] = bounds(corners).unwrap_or_default();
    let longest = f64::from((high - low).max_element());
    if !SIDES_M.contains(&longest) {
        let (least, most) = SIDES_M.into_inner();
        let message = format!("its longest side is {longest:.3} m, expected {least} to {most} m for a room");
        log.warn("mesh_size", "", message, "kept it; state metres for each of its units as `scale`, as in 0.001");
    }
}

/// Facts about each surface. Fails where an instance of the building has no surface.
fn origins_of(scan: &Scan, scene: &ReferenceScene, files: &CaptureFiles) -> Result<Vec<InstanceOrigin>, Invalid> {
    let unknown: Vec<&str> =
        files.architecture.iter().filter(|name| !scan.names.contains(name)).map(String::as_str).collect();
    if !unknown.is_empty() {
        let known: Vec<&str> = scan.names.iter().take(20).map(String::as_str).collect();
        let (unknown, known) = (unknown.join("', '"), known.join("', '"));
        return Err(Invalid(format!("architecture: there is no instance '{unknown}'; the first are '{known}'")));
    }
    let unstated = StatedParameters { base_color: false, roughness: false, metallic: false, emission: false };
    let role = |name: &String| match files.architecture.contains(name) {
        true => Role::Architecture { kind: name.clone() },
        false => Role::default(),
    };
    let of =
        |surface: &Surface| InstanceOrigin { role: role(&surface.name), stated: unstated, ..InstanceOrigin::default() };
    Ok(scene.surfaces.iter().map(of).collect())
}

/// Reads the cameras at `path` in the folder: a file, or a folder of several.
fn read_cameras(folder: &mut SourceFolder, path: &str) -> Result<Cameras, Invalid> {
    let inside = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}/{name}") };
    let beside = |name: &str| match path.rsplit_once('/') {
        Some((parent, _)) => format!("{parent}/{name}"),
        None => name.to_owned(),
    };
    let has = |name: &str| folder.contains(&inside(name));
    let of_all = |all: Result<Vec<CapturedCamera>, Invalid>| {
        all.map(|all| Cameras { all, is_transformed: false }).map_err(|fault| fault.about(path))
    };
    if folder.root().join(path).is_dir() {
        if has("cameras.bin") || has("images.bin") {
            let (cameras, images) = (bytes(folder, &inside("cameras.bin"))?, bytes(folder, &inside("images.bin"))?);
            return of_all(colmap::of_binary(&cameras, &images));
        }
        if has("cameras.txt") || has("images.txt") {
            let (cameras, images) = (text(folder, &inside("cameras.txt"))?, text(folder, &inside("images.txt"))?);
            return of_all(colmap::of_text(&cameras, &images));
        }
        if has("cam.txt") {
            let (poses, matrices) = (text(folder, &inside("cam.txt"))?, text(folder, &inside("K_list.txt"))?);
            return of_all(matrices::of_fipt(&poses, &matrices));
        }
        let files = matrices::camera_files(&folder.root().join(path));
        if !files.is_empty() {
            let read = |name: &String| matrices::of_lighting(name, &text(folder, &inside(name))?);
            return of_all(files.iter().map(read).collect());
        }
        let expected = "cameras and images (.bin or .txt) of COLMAP, cam.txt with K_list.txt, or camera_*.txt";
        return Err(Invalid(format!("the folder '{path}' holds no cameras; expected {expected}")));
    }
    match path.rsplit('.').next() {
        Some("json") => cameras::of_transforms(&bytes(folder, path)?).map_err(|fault: Invalid| fault.about(path)),
        Some("npz") => of_all(matrices::of_npz(&bytes(folder, path)?)),
        Some("txt") if path.ends_with("cam.txt") => {
            let (poses, matrices) = (text(folder, path)?, text(folder, &beside("K_list.txt"))?);
            of_all(matrices::of_fipt(&poses, &matrices))
        }
        _ => {
            let expected =
                "transforms.json, an .npz with world_mat_<n>, cam.txt, or a folder of COLMAP or of camera_*.txt";
            Err(Invalid(format!("'{path}' is no file of cameras that is read here; expected {expected}")))
        }
    }
}

fn bytes(folder: &mut SourceFolder, path: &str) -> Result<Vec<u8>, Invalid> {
    folder.read(path).map_err(|fault| Invalid(fault.message))
}

fn text(folder: &mut SourceFolder, path: &str) -> Result<String, Invalid> {
    let bytes = bytes(folder, path)?;
    let hint = hint(&bytes).into_owned();
    String::from_utf8(bytes).map_err(|_| Invalid(format!("'{path}' is no text{hint}")))
}

impl Invalid {
    fn about(self, path: &str) -> Self {
        Self(format!("'{path}': {}", self.0))
    }
}

#[cfg(test)]
mod tests {
    use mateval_testkit::npy;
    use proptest::prelude::*;

    use super::*;

    /// Two squares, one above the other, and a small third; in a world with +Z up.
    const OBJ: &str = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nv 5 0 0\nv 5.01 0 0\nv 5 0.01 0\n\
                       g floor\nf 1 2 3 4\ng table\nf 5 6 7 8\nf 9 10 11\n";
    const CAMERAS: &str = r#"{"fl_x": 50, "cx": 32, "cy": 24, "w": 64, "h": 48, "frames": [
        {"file_path": "a/1.png", "transform_matrix": [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3]]}]}"#;

    fn written(mesh: &str, bytes: &[u8]) -> (tempfile::TempDir, CaptureFiles) {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().to_owned();
        std::fs::create_dir(root.join("photos")).unwrap();
        std::fs::write(root.join("photos/1.png"), "").unwrap();
        std::fs::write(root.join("transforms.json"), CAMERAS).unwrap();
        std::fs::write(root.join(mesh), bytes).unwrap();
        let files = CaptureFiles {
            root,
            mesh: mesh.to_owned(),
            cameras: "transforms.json".to_owned(),
            photos: "photos".to_owned(),
            input: "1".to_owned(),
            novel: Vec::new(),
            labels: None,
            scale: 1.0,
            up: DVec3::Y,
            architecture: Vec::new(),
        };
        (folder, files)
    }

    fn names(capture: &Capture) -> Vec<&str> {
        capture.read.scene.surfaces.iter().map(|surface| surface.name.as_str()).collect()
    }

    #[test]
    fn groups_of_an_obj_are_instances_and_the_world_is_turned() {
        let (_folder, files) = written("a.obj", OBJ.as_bytes());
        let files = CaptureFiles { up: DVec3::Z, scale: 2.0, architecture: vec!["floor".to_owned()], ..files };
        let capture = read(&files).unwrap();
        assert_eq!((names(&capture), capture.input.0.as_str()), (vec!["floor", "table"], "photos/1.png"));
        let roles: Vec<bool> = capture.read.origins.iter().map(|origin| origin.role.is_architecture()).collect();
        assert_eq!(roles, [true, false]);
        // (x, y, z) with +Z up becomes (x, z, -y).
        let table = &capture.read.scene.surfaces[1].mesh;
        assert!(table.positions[..4].iter().all(|position| (position.y - 2.0).abs() < 1e-6));
        assert!(capture.input.1.position.abs_diff_eq(DVec3::new(2.0, 6.0, -4.0), 1e-12));
        assert!(capture.input.1.rotation.y_axis.abs_diff_eq(DVec3::NEG_Z, 1e-12));
        assert!(capture.read.origins.iter().all(|origin| !origin.stated.base_color));
        let unknown = read(&CaptureFiles { architecture: vec!["wall".to_owned()], ..files }).unwrap_err().to_string();
        assert!(unknown.contains("no instance 'wall'; the first are 'floor', 'table'"), "{unknown}");
    }

    #[test]
    fn one_group_is_split_into_its_pieces_or_by_labels() {
        let one = OBJ.replace("g floor\n", "").replace("g table\n", "");
        let (folder, files) = written("a.obj", one.as_bytes());
        let pieces = read(&files).unwrap();
        assert_eq!(names(&pieces), ["piece_1", "piece_2", "rest"]);
        let areas: Vec<f64> = pieces.read.scene.surfaces.iter().map(|surface| surface.mesh.area()).collect();
        assert!((areas[0] - 4.0).abs() < 1e-6 && (areas[1] - 1.0).abs() < 1e-6);
        assert!(pieces.read.findings.iter().any(|finding| finding.code == "small_pieces"));
        let labels = |labels: &[i64]| {
            std::fs::write(folder.path().join("labels.npy"), npy(labels, &[labels.len() as u64])).unwrap();
            read(&CaptureFiles { labels: Some("labels.npy".to_owned()), ..files.clone() })
        };
        assert_eq!(names(&labels(&[7, 7, -1, -1, 7]).unwrap()), ["label_-1", "label_7"]);
        let wrong = labels(&[1, 2]).unwrap_err().to_string();
        assert!(wrong.contains("2 labels; expected 5"), "{wrong}");
    }

    #[test]
    fn the_photo_is_found_by_its_name_or_refused() {
        let (folder, files) = written("a.obj", OBJ.as_bytes());
        std::fs::rename(folder.path().join("photos/1.png"), folder.path().join("photos/1.exr")).unwrap();
        assert_eq!(read(&files).unwrap().input.0, "photos/1.exr");
        std::fs::remove_file(folder.path().join("photos/1.exr")).unwrap();
        assert!(read(&files).unwrap_err().to_string().contains("'photos' does not hold the photo"));
        let outside = read(&CaptureFiles { mesh: "../a.obj".to_owned(), ..files }).unwrap_err().to_string();
        assert!(outside.contains("leads out"), "{outside}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Bytes of a sound file, some of them changed: no reader panics or takes memory that the file does not justify.
        #[test]
        fn no_bytes_cause_a_panic(
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
            end in any::<prop::sample::Index>(),
        ) {
            let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                       element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
            let changed = |sound: &[u8]| {
                let mut bytes = sound.to_vec();
                changes.iter().for_each(|(at, byte)| { let at = at.index(bytes.len()); bytes[at] = *byte });
                bytes.truncate(bytes.len() - end.index(bytes.len().min(40)));
                bytes
            };
            let (_folder, files) = written("a.ply", &changed(ply.as_bytes()));
            drop(read(&files));
            std::fs::write(files.root.join("a.ply"), ply).unwrap();
            std::fs::write(files.root.join("transforms.json"), changed(CAMERAS.as_bytes())).unwrap();
            drop(read(&files));
            let cameras = [1_u64.to_le_bytes().to_vec(), vec![1; 80]].concat();
            std::fs::create_dir(files.root.join("colmap")).unwrap();
            std::fs::write(files.root.join("colmap/cameras.bin"), changed(&cameras)).unwrap();
            std::fs::write(files.root.join("colmap/images.bin"), changed(&cameras)).unwrap();
            drop(read(&CaptureFiles { cameras: "colmap".to_owned(), ..files }));
        }
    }
}
