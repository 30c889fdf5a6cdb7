//! A room of the sample passed off as a capture: its mesh as a PLY without uv, its photos as 16-bit PNG, their cameras
//! in every format, and measured colours that are means of the ordinary albedo picture. Scores are those of the
//! ordinary path.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use glam::{DMat3, DQuat, DVec2, DVec3};
use mateval_baselines::delight::CandidateLights;
use mateval_baselines::estimate_source::EstimateSource;
use mateval_baselines::nn::{self, NnOptions};
use mateval_baselines::{bounds, submission};
use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::lens::Lens;
use mateval_dataset::measured::{MEASUREMENTS_FORMAT, MeasuredArea, MeasuredFile, MeasurementsFile};
use mateval_dataset::open::Dataset;
use mateval_dataset::{Camera, Finding, SceneId, glb, json};
use mateval_eval::metric::{Metric, PictureKind};
use mateval_eval::protocol::Protocol;
use mateval_eval::result::key::Region;
use mateval_eval::result::{PictureValues, ProtocolResult, ResultFile};
use mateval_eval::score::{LpipsWeights, ScorePlan, score};
use mateval_eval::shown::scene_albedo;
use mateval_eval::truth::{OpenScene, true_material};
use mateval_image::transfer::{byte_from_unit, srgb_from_linear, word_from_unit};
use mateval_image::{LinearRgb, Mask, Picture, exr_io, png_io};
use mateval_light::photo_pixels::PhotoRules;
use mateval_metrics::measured::measured_difference;
use mateval_prep::build::{BuildOptions, build};
use mateval_prep::error::PrepError;
use mateval_testkit::{kept_folder, sample_dataset};
use mateval_tracer::aov::hit_through;

/// The formats of cameras, and the path of each in the source.
const FORMATS: [(&str, &str); 6] = [
    ("nerfstudio", "transforms.json"),
    ("colmap_text", "text"),
    ("colmap_binary", "binary"),
    ("idr", "cameras_sphere.npz"),
    ("fipt", "cam.txt"),
    ("lighting", "lighting"),
];
const SCENE: &str = "living";
/// The distortion of the photos in the folder `distorted`.
const K1: f64 = -0.2;
/// The number of columns of a distorted photo for each column of the camera's picture. With eight, undistorting blurs
/// the picture by an eighth of a pixel.
const FINER: u32 = 8;
/// The brightness of each view's photo relative to the ordinary one.
const FACTORS: [f64; 5] = [1.0, 1.0, 1.0, 0.5, 0.7];

pub(super) fn ordinary() -> (&'static Dataset, &'static SceneFile) {
    let dataset = sample_dataset::dataset();
    (dataset, dataset.scene(&SceneId::new(SCENE).unwrap()).unwrap())
}

fn input_view() -> &'static View {
    &ordinary().1.views[0]
}

/// The source `capture`, with every format of cameras.
pub(super) static SOURCE: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = kept_folder("capture_source");
    let (dataset, scene) = ordinary();
    write_mesh(&folder.join("mesh.ply"), dataset, scene, DMat3::IDENTITY);
    let renderer = dataset.photo_renderer(scene).unwrap();
    let photos = scene.views.iter().zip(FACTORS).map(|(view, factor)| {
        let photo = exr_io::read_linear(&dataset.folder(&scene.id).render(renderer, &view.id).join("rgb.exr")).unwrap();
        photo.map(|LinearRgb(rgb)| rgb.map(|v| (f64::from(v) * scene.exposure * factor) as f32))
    });
    let photos: Vec<Picture<[f32; 3]>> = photos.collect();
    assert_eq!(photos.len(), FACTORS.len());
    write_photos(&folder.join("images"), photos.iter().map(|photo| photo.map(words)));
    let shown = shown_by_bent();
    let bent = |photo: &Picture<[f32; 3]>| shown.map(|[x, y]| words(photo.get(x, y)));
    write_photos(&folder.join("distorted"), photos.iter().map(bent));
    write_cameras(&folder);
    write_measurements(&folder);
    folder
});

pub(super) fn words(rgb: [f32; 3]) -> [u16; 3] {
    rgb.map(|v| word_from_unit(srgb_from_linear(v.clamp(0.0, 1.0))))
}

/// A photo that no view shows, so that the input photo's number is 1, then the photos of all views, the input photo
/// first.
pub(super) fn write_photos(folder: &Path, photos: impl Iterator<Item = Picture<[u16; 3]>>) {
    std::fs::create_dir_all(folder).unwrap();
    let write = |number: usize, photo: &Picture<[u16; 3]>| {
        png_io::write_rgb_words(&folder.join(format!("image_{number:04}.png")), photo).unwrap();
    };
    let photos: Vec<_> = photos.collect();
    write(0, &photos[0].map(|_| [9; 3]));
    photos.iter().zip(1..).for_each(|(photo, number)| write(number, photo));
}

/// The lens of a distorted photo.
fn bent_lens() -> Lens {
    let Lens { width, height, fx, fy, cx, cy, .. } = Lens::pinhole(&input_view().camera.intrinsics);
    let finer = f64::from(FINER);
    Lens {
        width: FINER * width,
        height: FINER * height,
        fx: finer * fx,
        fy: finer * fy,
        cx: finer * cx,
        cy: finer * cy,
        k1: K1,
        k2: 0.0,
        p1: 0.0,
        p2: 0.0,
    }
}

/// For each pixel of a distorted photo, the nearest pixel of the pinhole's picture that shows the same.
fn shown_by_bent() -> Picture<[usize; 2]> {
    let (lens, k) = (bent_lens(), input_view().camera.intrinsics);
    let nearest = |place: f64, size: u32| place.clamp(0.0, f64::from(size - 1)) as usize;
    Picture::from_fn(lens.width as usize, lens.height as usize, |x, y| {
        // No pixel beyond the fold of the lens is looked up; any will do there.
        let direction = lens.direction(DVec2::new(x as f64 + 0.5, y as f64 + 0.5)).unwrap_or_default();
        [nearest(k.cx + k.fx * direction.x, k.width), nearest(k.cy + k.fy * direction.y, k.height)]
    })
}

/// All triangles of a room, in a turned world; the label of a face is the index of its instance.
fn write_mesh(path: &Path, dataset: &Dataset, scene: &SceneFile, turn: DMat3) {
    let nodes = glb::read(&dataset.folder(&scene.id).instances()).unwrap();
    let (mut vertices, mut faces, mut count) = (String::new(), String::new(), [0_usize; 2]);
    for (node, instance) in nodes.iter().zip(&scene.instances) {
        assert_eq!(node.name, instance.id.as_str());
        for corner in &node.mesh.positions {
            let corner = turn * corner.as_dvec3();
            writeln!(vertices, "{:?} {:?} {:?}", corner.x, corner.y, corner.z).unwrap();
        }
        for [a, b, c] in &node.mesh.triangles {
            let [a, b, c] = [a, b, c].map(|corner| *corner as usize + count[0]);
            writeln!(faces, "3 {a} {b} {c} {}", instance.index.0).unwrap();
        }
        count = [count[0] + node.mesh.positions.len(), count[1] + node.mesh.triangles.len()];
    }
    let [positions, triangles] = count;
    let head = format!(
        "ply\nformat ascii 1.0\nelement vertex {positions}\nproperty float x\nproperty float y\nproperty float z\nelement face \
         {triangles}\nproperty list uchar int vertex_indices\nproperty int label\nend_header\n"
    );
    std::fs::write(path, head + &vertices + &faces).unwrap();
}

/// In all formats, a camera that looks the other way, then the cameras of all views.
fn write_cameras(folder: &Path) {
    let camera = input_view().camera;
    let back = Camera::from_rotation(
        camera.rotation() * DMat3::from_rotation_y(std::f64::consts::PI),
        camera.position(),
        camera.intrinsics,
    );
    let k = camera.intrinsics;
    let cameras: Vec<Camera> = std::iter::once(back).chain(ordinary().1.views.iter().map(|view| view.camera)).collect();
    // To OpenCV's axes, as COLMAP, IDR and Objects With Lighting have them.
    let to_opencv = |camera: &Camera| {
        let rotation = (camera.rotation() * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0))).transpose();
        (rotation, -(rotation * camera.position()))
    };
    let name = |at: usize| format!("image_{at:04}.png");
    let frames: Vec<serde_json::Value> = (0..cameras.len())
        .map(|at| {
            serde_json::json!({ "file_path": format!("images/{}", name(at)),
            "transform_matrix": cameras[at].world_from_camera })
        })
        .collect();
    for (file, lens) in [("transforms.json", Lens::pinhole(&k)), ("distorted.json", bent_lens())] {
        let transforms = serde_json::json!({ "camera_model": "OPENCV", "fl_x": lens.fx, "fl_y": lens.fy,
            "cx": lens.cx, "cy": lens.cy, "w": lens.width, "h": lens.height, "k1": lens.k1, "frames": frames });
        std::fs::write(folder.join(file), transforms.to_string()).unwrap();
    }
    for name in ["text", "binary", "lighting"] {
        std::fs::create_dir_all(folder.join(name)).unwrap();
    }
    let numbers = [k.fx, k.fy, k.cx, k.cy];
    let lens = format!("1 PINHOLE {} {} {} {} {} {}\n", k.width, k.height, k.fx, k.fy, k.cx, k.cy);
    std::fs::write(folder.join("text/cameras.txt"), lens).unwrap();
    let mut bytes = [1_u64.to_le_bytes().to_vec(), 1_u32.to_le_bytes().to_vec(), 1_i32.to_le_bytes().to_vec()].concat();
    [k.width, k.height].iter().for_each(|side| bytes.extend(u64::from(*side).to_le_bytes()));
    numbers.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    std::fs::write(folder.join("binary/cameras.bin"), bytes).unwrap();
    let (mut images, mut binary) = (String::new(), (cameras.len() as u64).to_le_bytes().to_vec());
    let count = format!("{}\n", cameras.len());
    let (mut fipt, mut list) = (count.clone(), count);
    let mut npz = zip::ZipWriter::new(std::fs::File::create(folder.join("cameras_sphere.npz")).unwrap());
    for (at, camera) in cameras.iter().enumerate() {
        let (rotation, t) = to_opencv(camera);
        let q = DQuat::from_mat3(&rotation);
        let pose = [q.w, q.x, q.y, q.z, t.x, t.y, t.z];
        let words = pose.map(|number| number.to_string()).join(" ");
        writeln!(images, "{} {words} 1 {}\n", at + 1, name(at)).unwrap();
        binary.extend((at as u32 + 1).to_le_bytes());
        pose.iter().for_each(|number| binary.extend(number.to_le_bytes()));
        binary.extend(1_u32.to_le_bytes());
        binary.extend(format!("{}\0", name(at)).into_bytes());
        binary.extend(0_u64.to_le_bytes());
        let place = camera.position();
        for row in [place, place - camera.rotation().z_axis, camera.rotation().y_axis] {
            writeln!(fipt, "{} {} {}", row.x, row.y, row.z).unwrap();
        }
        let matrix = DMat3::from_cols(DVec3::X * k.fx, DVec3::Y * k.fy, DVec3::new(k.cx, k.cy, 1.0));
        let rows = |matrix: DMat3| -> String {
            (0..3).map(|at| matrix.row(at)).map(|row| format!("{} {} {}\n", row.x, row.y, row.z)).collect()
        };
        list += &rows(matrix);
        let size = format!("{} {} 3\n", k.width, k.height);
        let lighting = format!("{}{}{} {} {}\n{size}", rows(matrix), rows(rotation), t.x, t.y, t.z);
        std::fs::write(folder.join(format!("lighting/camera_{at:04}.txt")), lighting).unwrap();
        let (m, last) = (matrix * rotation, matrix * t);
        let mut world: Vec<f64> = (0..3).flat_map(|at| [m.row(at).x, m.row(at).y, m.row(at).z, last[at]]).collect();
        world.extend([0.0, 0.0, 0.0, 1.0]);
        npz.start_file(format!("world_mat_{at}.npy"), zip::write::SimpleFileOptions::default()).unwrap();
        npz.write_all(&npy(&world, &[4, 4])).unwrap();
    }
    npz.finish().unwrap();
    std::fs::write(folder.join("text/images.txt"), images).unwrap();
    std::fs::write(folder.join("binary/images.bin"), binary).unwrap();
    std::fs::write(folder.join("cam.txt"), fipt).unwrap();
    std::fs::write(folder.join("K_list.txt"), list).unwrap();
}

fn npy(numbers: &[f64], shape: &[u64]) -> Vec<u8> {
    use npyz::WriterBuilder as _;
    let mut bytes = Vec::new();
    let mut writer = npyz::WriteOptions::new().default_dtype().shape(shape).writer(&mut bytes).begin_nd().unwrap();
    writer.extend(numbers.iter().copied()).unwrap();
    writer.finish().unwrap();
    bytes
}

/// The instances that fill most of the input view, each a region: its index and its valid pixels.
fn regions() -> Vec<(u16, Mask)> {
    let (dataset, scene) = ordinary();
    let folder = dataset.folder(&scene.id).view(&input_view().id);
    let instances = png_io::read_ids(&folder.join("instance.png")).unwrap();
    let valid = png_io::read_mask(&folder.join("valid.png")).unwrap();
    let mut counts: BTreeMap<u16, usize> = BTreeMap::new();
    let pixels = instances.pixels().iter().zip(valid.pixels()).filter(|(_, valid)| **valid);
    pixels.for_each(|(instance, _)| *counts.entry(*instance).or_default() += 1);
    let mut largest: Vec<(u16, usize)> = counts.into_iter().collect();
    largest.sort_by_key(|(index, count)| (std::cmp::Reverse(*count), *index));
    let mask = |index: u16| {
        Picture::from_fn(valid.width(), valid.height(), |x, y| valid.get(x, y) && instances.get(x, y) == index)
    };
    largest.into_iter().take(5).map(|(index, _)| (index, mask(index))).collect()
}

fn mean(picture: &Picture<LinearRgb>, mask: &Mask) -> [f64; 3] {
    let chosen: Vec<[f32; 3]> =
        picture.pixels().iter().zip(mask.pixels()).filter(|(_, counts)| **counts).map(|(rgb, _)| rgb.0).collect();
    [0, 1, 2].map(|c| chosen.iter().map(|rgb| f64::from(rgb[c])).sum::<f64>() / chosen.len() as f64)
}

/// `measured.json` and its mask, and the same for the distorted photo; `maw.csv` with the colours in the same mask.
fn write_measurements(folder: &Path) {
    let (dataset, scene) = ordinary();
    let truth = dataset.folder(&scene.id).truth_view(&input_view().id).join("albedo.exr");
    let (albedo, regions) = (exr_io::read_linear(&truth).unwrap(), regions());
    let (width, height) = (albedo.width(), albedo.height());
    let value = |x: usize, y: usize| {
        regions.iter().position(|(_, mask)| mask.get(x, y)).map_or(0, |place| 10 * (place as u8 + 1))
    };
    png_io::write_grey_bytes(&folder.join("regions.png"), &Picture::from_fn(width, height, value)).unwrap();
    let bent = shown_by_bent().map(|[x, y]| value(x, y));
    png_io::write_grey_bytes(&folder.join("bent_regions.png"), &bent).unwrap();
    for (file, mask) in [("measured.json", "regions.png"), ("bent_measured.json", "bent_regions.png")] {
        let area = |(place, (index, pixels)): (usize, &(u16, Mask))| MeasuredArea {
            name: index.to_string(),
            photo: "image_0001.png".to_owned(),
            mask: mask.to_owned(),
            value: 10 * (place as u16 + 1),
            color: mean(&albedo, pixels).map(|v| v.min(1.0)),
            standard_error: (place == 0).then_some([0.01; 3]),
        };
        let areas = regions.iter().enumerate().map(area).collect();
        let measurements = MeasurementsFile { format: MEASUREMENTS_FORMAT.to_owned(), regions: areas };
        json::write(&folder.join(file), &measurements).unwrap();
    }
    std::fs::write(folder.join("colors.npy"), npy(&[0.25; 15], &[5, 3])).unwrap();
    std::fs::write(folder.join("maw.csv"), "colors.npy\tregions.png\tval\timage_0001\ta.png\tNone\n").unwrap();
}

/// The keys of a captured scene, after its id.
pub(super) fn entry(id: &str, cameras: &str, more: &str) -> String {
    let keys = |photos: &str, measured: &str| {
        format!(
            "\n[[scene]]\nid = \"{id}\"\n[scene.capture]\nmesh = \"mesh.ply\"\ncameras = \"{cameras}\"\nphotos = \"{photos}\"\n\
                 input = \"image_0001\"\nmeasured = \"{measured}\"\n{more}\n"
        )
    };
    match id {
        // At the size of the others.
        "distorted" => {
            keys("distorted", "bent_measured.json").replace("[scene.capture]", "resolution = [64, 48]\n[scene.capture]")
        }
        "maw" => keys("images", "maw.csv"),
        _ => keys("images", "measured.json"),
    }
}

pub(super) fn built(name: &str, entries: &str) -> Result<Dataset, PrepError> {
    let folder = kept_folder(name);
    let recipe = folder.join("recipe.toml");
    let head = "name = \"captures\"\natlas_size = 128\nviews = []\n";
    let exposure = format!("exposure = {}\n[scene.capture]", ordinary().1.exposure);
    std::fs::write(&recipe, head.to_owned() + &entries.replace("[scene.capture]", &exposure)).unwrap();
    let out = folder.join("dataset");
    let options = BuildOptions {
        recipe,
        source: Some(SOURCE.clone()),
        out: out.clone(),
        scenes: Vec::new(),
        force: false,
        blender: None,
        atlas_cache: None,
    };
    build(&options, "test", &|_| ())?;
    Ok(Dataset::open(&out).unwrap())
}

/// A dataset with a scene for each format of cameras, the distorted photo, and MAW's table.
pub(super) static CAPTURES: LazyLock<Dataset> = LazyLock::new(|| {
    let mut entries: String = FORMATS.iter().map(|(id, cameras)| entry(id, cameras, "")).collect();
    entries += &entry("distorted", "distorted.json", "");
    entries += &entry("maw", "transforms.json", "");
    built("captures", &entries).unwrap()
});

pub(super) fn scored(dataset: &Dataset, submission: &Path, protocol: &str) -> ResultFile {
    scored_by(dataset, submission, Protocol::named(protocol).unwrap())
}

fn scored_by(dataset: &Dataset, submission: &Path, protocol: Protocol) -> ResultFile {
    let [reason, fix] = ["", ""].map(str::to_owned);
    let lpips = LpipsWeights::Missing { reason, fix };
    let plan = ScorePlan::new(dataset, vec![submission], vec![protocol], lpips, "test");
    let result = score(&plan, &|_| ()).unwrap().remove(0);
    // Such a map would be scored as grey.
    assert!(result.findings.iter().all(|finding| finding.code != "unsound_map"), "{:?}", result.findings);
    result
}

/// A submission with one colour for each instance, by the index of the ordinary scene's.
pub(super) fn write_one_colored(
    dataset: &Dataset,
    out: &Path,
    index: impl Fn(&SceneFile, usize) -> usize,
    color: impl Fn(usize) -> [f32; 3],
) {
    let method = submission::Method::new("one-colored", "");
    submission::write(dataset, out, false, &method, |scene, instance, folder| {
        let at = scene.instances.iter().position(|known| known.id == instance.id).unwrap();
        let color = color(index(scene, at));
        let picture = Picture::filled(64, 64, color.map(|v| byte_from_unit(srgb_from_linear(v))));
        png_io::write_rgb_bytes(&folder.join("base_color.png"), &picture).unwrap();
        Ok(())
    })
    .unwrap();
}

fn painted(index: usize) -> [f32; 3] {
    let index = index as f32;
    [0.13 * index % 0.9, 0.29 * index % 0.8, 0.47 * index % 0.7].map(|v| v + 0.1)
}

/// The mean of the true base colour.
pub(super) fn true_mean(index: usize) -> [f32; 3] {
    let (dataset, scene) = ordinary();
    let instance = &scene.instances[index - 1];
    instance.atlas.as_ref().map_or([0.5; 3], |atlas| {
        let map = true_material(&dataset.folder(&scene.id), &instance.id, atlas.size as usize).unwrap().base_color;
        let texels = Picture::from_fn(map.width(), map.height(), |x, y| LinearRgb(map.texel(x, y)));
        mean(&texels, &texels.map(|_| true)).map(|v| v as f32)
    })
}

pub(super) fn label(scene: &SceneFile, at: usize) -> usize {
    scene.instances[at].name.strip_prefix("label_").unwrap().parse().unwrap()
}

pub(super) fn captured(result: &ResultFile) -> &ProtocolResult {
    &result.protocols["capture-1"]
}

#[test]
fn every_format_of_cameras_gives_the_ordinary_camera_and_photo() {
    let (ordinary_dataset, ordinary) = ordinary();
    let expected = input_view().camera;
    let shown = |dataset: &Dataset, scene: &SceneFile| {
        exr_io::read_linear(&dataset.folder(&scene.id).view(&scene.views[0].id).join("rgb.exr")).unwrap()
    };
    let photo = shown(ordinary_dataset, ordinary);
    for (id, _) in FORMATS {
        let scene = CAPTURES.scene(&SceneId::new(id).unwrap()).unwrap();
        let found = scene.views[0].camera;
        assert!(found.matrix().abs_diff_eq(expected.matrix(), 1e-9), "{id}");
        assert!((found.intrinsics.fx - expected.intrinsics.fx).abs() < 1e-9, "{id}");
        assert_eq!(scene.instances.len(), ordinary.instances.len());
        // 16 bits of sRGB; what is brighter than white is clipped.
        let off = shown(&CAPTURES, scene)
            .pixels()
            .iter()
            .zip(photo.pixels())
            .map(|(a, b)| {
                let clipped = b.0.map(|v| (f64::from(v) * ordinary.exposure).min(1.0));
                (0..3).map(|c| (f64::from(a.0[c]) * scene.exposure - clipped[c]).abs()).fold(0.0, f64::max)
            })
            .fold(0.0, f64::max);
        assert!(off < 1e-4, "{id}: {off}");
    }
}

/// Of the same prediction, the regions of the capture have the means of the ordinary albedo picture.
#[test]
fn measured_colours_are_compared_with_means_of_the_albedo_picture() {
    let (dataset, ordinary) = ordinary();
    let folder = kept_folder("capture_painted");
    let (of_ordinary, of_captures) = (folder.join("ordinary"), folder.join("captures"));
    write_one_colored(dataset, &of_ordinary, |_, at| at + 1, painted);
    write_one_colored(&CAPTURES, &of_captures, label, painted);
    let albedo = scene_albedo(dataset, ordinary, &[&of_ordinary]).unwrap().remove(0).predicted.remove(0);
    let result = scored(&CAPTURES, &of_captures, "capture-1");
    let measured = &captured(&result).measured;
    let of_whole = measured.iter().filter(|region| region.scene.as_str() != "distorted").count();
    assert_eq!(of_whole, 5 * (FORMATS.len() + 1));
    let masks: BTreeMap<String, Mask> = regions().into_iter().map(|(index, mask)| (index.to_string(), mask)).collect();
    for region in measured.iter().filter(|region| region.scene.as_str() != "maw") {
        let expected = mean(&albedo, &masks[&region.region]);
        // A pixel of a capture is always a mean over 64 places.
        let off = (0..3).map(|c| (region.predicted[c] - expected[c]).abs()).fold(0.0, f64::max);
        assert!(off < 1e-3, "{} {}: {:?} {expected:?}", region.scene, region.region, region.predicted);
        assert!((region.delta_e - measured_difference(region.predicted, region.measured)).abs() < 1e-12);
        assert_eq!(region.measurement_delta_e.is_some(), region.region == regions()[0].0.to_string());
    }
    let key = "measured.input.region_delta_e".parse().unwrap();
    let of_scene = |id: &str| captured(&result).scenes[&SceneId::new(id).unwrap()][&key];
    let listed = measured.iter().filter(|region| region.scene.as_str() == "idr").map(|region| region.delta_e);
    assert!((of_scene("idr") - listed.sum::<f64>() / 5.0).abs() < 1e-12);
    assert!((of_scene("idr") - of_scene("fipt")).abs() < 1e-3);
    let of_kind =
        |wanted: PictureKind| captured(&result).summary.keys().filter(|key| key.picture.kind == wanted).count();
    assert_eq!(of_kind(PictureKind::Measured), 3);
    assert!(of_kind(PictureKind::RgbFitted) >= 3, "MSE, PSNR and SSIM of the input photo");
    assert_eq!(captured(&result).summary.len(), 3 + of_kind(PictureKind::RgbFitted));
}

/// The photo is far from the measured colours, which have no light in them, and grey farther than one of the colours.
#[test]
fn baselines_run_on_captures_and_the_truth_is_refused() {
    let folder = kept_folder("capture_baselines");
    let (grey, photo) = (folder.join("grey"), folder.join("photo"));
    bounds::write_grey(&CAPTURES, &grey, false).unwrap();
    nn::write(&CAPTURES, &photo, false, &EstimateSource::Input, &NnOptions::default(), &|_| ()).unwrap();
    for submission in [&grey, &photo] {
        let result = scored(&CAPTURES, submission, "capture-1");
        let key = "measured.input.region_delta_e".parse().unwrap();
        assert!(captured(&result).summary[&key] > 3.0);
    }
    let refused = bounds::write_truth(&CAPTURES, &folder.join("gt"), false).unwrap_err().to_string();
    assert!(refused.contains("'nerfstudio' is captured"), "{refused}");
    let by_estimate =
        nn::write(&CAPTURES, &folder.join("nn"), false, &EstimateSource::Truth, &NnOptions::default(), &|_| ());
    assert!(by_estimate.unwrap_err().to_string().contains("is captured"));
}

/// A photo without its light is nearer to the measured colours than the photo, if the capture names its ceilings: these
/// may glow then. The twin has no names; no ceiling of it may glow, and its base colours become too bright.
#[test]
fn the_delit_photo_beats_the_photo_where_ceilings_are_named() {
    let (dataset, scene) = ordinary();
    std::fs::copy(dataset.folder(&scene.id).instances(), SOURCE.join("named.glb")).unwrap();
    let building = scene.instances.iter().filter(|instance| instance.role.is_architecture());
    let building: Vec<&str> = building.map(|instance| instance.id.as_str()).collect();
    let entries = entry("named", "transforms.json", &format!("architecture = {building:?}"))
        + &entry("unnamed", "transforms.json", "");
    let captures = built("capture_named", &entries.replace("mesh.ply", "named.glb")).unwrap();
    let folder = kept_folder("capture_delit");
    let delta_e = |name: &str, estimate: EstimateSource| -> [f64; 2] {
        let out = folder.join(name);
        nn::write(&captures, &out, false, &estimate, &NnOptions::default(), &|_| ()).unwrap();
        let result = scored(&captures, &out, "capture-1");
        let key = "measured.input.region_delta_e".parse().unwrap();
        ["named", "unnamed"].map(|id| captured(&result).scenes[&SceneId::new(id).unwrap()][&key])
    };
    let [photo, _] = delta_e("photo", EstimateSource::Input);
    let [named, unnamed] = delta_e("delight", EstimateSource::Delight(CandidateLights::Room));
    assert!(named < 0.8 * photo && unnamed > photo, "photo {photo}, delight {named}, without names {unnamed}");
}

/// Datasets with the photos of all views of a scene, as they are and distorted. The scene has the id of the ordinary
/// one, and so its seeds: with others, the noise of the fit alone moves a PSNR by up to 0.5 dB.
static WITH_NOVEL: LazyLock<[Dataset; 2]> = LazyLock::new(|| {
    let novel: Vec<String> = (2..=FACTORS.len()).map(|number| format!("image_{number:04}")).collect();
    let building = ordinary().1.instances.iter().filter(|instance| instance.role.is_architecture());
    let building: Vec<String> = building.map(|instance| format!("label_{}", instance.index.0)).collect();
    let more = format!("novel = {novel:?}\narchitecture = {building:?}");
    let distorted = entry("distorted", "distorted.json", &more);
    let distorted = distorted.replace("id = \"distorted\"", &format!("id = \"{SCENE}\""));
    [built("novel", &entry(SCENE, "binary", &more)).unwrap(), built("novel_distorted", &distorted).unwrap()]
});

/// The PSNR of each view's fitted light, in the order of the views.
pub(super) fn fitted(scores: &ProtocolResult, scene: &str) -> Vec<f64> {
    let is_wanted =
        |picture: &&PictureValues| picture.scene.as_str() == scene && picture.picture.to_string() == "rgb_fitted";
    let whole = scores.pictures.iter().filter(is_wanted).filter(|picture| picture.region == Region::Valid);
    whole.map(|picture| picture.values[&Metric::Psnr]).collect()
}

/// Light is fitted as in `paper`, and every other photo has an exposure of its own.
#[test]
fn photos_are_compared_as_in_the_paper() {
    let folder = kept_folder("capture_means");
    let (of_ordinary, of_captures) = (folder.join("ordinary"), folder.join("captures"));
    write_one_colored(ordinary().0, &of_ordinary, |_, at| at + 1, true_mean);
    write_one_colored(&WITH_NOVEL[0], &of_captures, label, true_mean);
    let paper = scored(ordinary().0, &of_ordinary, "paper");
    let expected = fitted(&paper.protocols["paper"], SCENE);
    // Every valid pixel counts, as in `paper`.
    let mut protocol = Protocol::named("capture-1").unwrap();
    protocol.photos = Some(PhotoRules { clipped_from: 1e9, depth_jump: 1e9, jump_pixels: 1 });
    let [plain, distorted] = WITH_NOVEL.each_ref().map(|dataset| {
        let result = scored_by(dataset, &of_captures, protocol.clone());
        let found = fitted(captured(&result), SCENE);
        assert_eq!(found.len(), FACTORS.len());
        found
    });
    assert!((plain[0] - expected[0]).abs() < 0.1 && (distorted[0] - expected[0]).abs() < 0.1, "{plain:?} {expected:?}");
    for (view, factor) in FACTORS.iter().enumerate().skip(1) {
        // A free exposure removes an error of brightness and nothing else. Darker photos have smaller errors.
        let range = if *factor < 1.0 { 0.5..4.0 } else { -0.1..0.8 };
        let off = plain[view] - expected[view];
        assert!(range.contains(&off), "{view}: {off}");
        assert!((distorted[view] - plain[view]).abs() < 0.1, "{distorted:?} {plain:?}");
    }
    // By the protocol's own rules, pixels are left out and counted.
    for dataset in &*WITH_NOVEL {
        let result = scored(dataset, &of_captures, "capture-1");
        let lit = captured(&result).pictures.iter().filter(|picture| picture.picture.kind.is_light());
        let shares: Vec<f64> = lit.map(|picture| picture.left_out.unwrap()).collect();
        // The valid pixels of each view, and of each view but the input view also the unobserved ones.
        assert_eq!(shares.len(), 2 * FACTORS.len() - 1);
        assert!(shares.iter().all(|share| (0.1..0.8).contains(share)), "{shares:?}");
        let key = "rgb_fitted.novel.psnr".parse().unwrap();
        assert!(captured(&result).summary[&key] > 12.0 && captured(&result).fits.len() == 1);
        assert!(captured(&result).noise[&SceneId::new(SCENE).unwrap()].contains_key(&key));
    }
}

/// The share of a picture that is left out falls with its size: pixels beside a jump are a strip two pixels wide. At
/// the size of real photos most pixels count.
#[test]
fn few_pixels_of_a_large_photo_are_left_out() {
    let (dataset, scene) = ordinary();
    let world = OpenScene::read(dataset, scene).unwrap().world;
    let camera = input_view().camera;
    let left_out = |finer: usize| -> f64 {
        let (k, times) = (camera.intrinsics, finer as f64);
        let (width, height) = (k.width as usize * finer, k.height as usize * finer);
        let depth = Picture::from_fn(width, height, |x, y| {
            let place = DVec2::new((x as f64 + 0.5) / times, (y as f64 + 0.5) / times);
            hit_through(&world, &camera, place).map_or(0.0, |hit| hit.depth as f32)
        });
        // Nothing is clipped.
        let dark = Picture::filled(width, height, LinearRgb([0.1; 3]));
        let counted = PhotoRules::default().counted(&dark, 1.0, &depth, &Mask::filled(width, height, true));
        counted.pixels().iter().filter(|counts| !**counts).count() as f64 / (width * height) as f64
    };
    let [small, large] = [1, 12].map(left_out);
    // `capture.md` states both.
    assert!((small - 0.59).abs() < 0.01 && (large - 0.06).abs() < 0.01, "{small} {large}");
}

/// No other protocol has a value for a capture, and `capture-1` has none for another scene.
#[test]
fn what_has_no_truth_has_no_value() {
    let folder = kept_folder("capture_protocols");
    let (of_captures, of_ordinary) = (folder.join("captures"), folder.join("ordinary"));
    bounds::write_grey(&CAPTURES, &of_captures, false).unwrap();
    bounds::write_grey(sample_dataset::dataset(), &of_ordinary, false).unwrap();
    for (dataset, submission, protocol) in
        [(&*CAPTURES, &of_captures, "mateval-3"), (sample_dataset::dataset(), &of_ordinary, "capture-1")]
    {
        let result = scored(dataset, submission, protocol);
        let ProtocolResult { summary, pictures, texels, instances, measured, .. } = &result.protocols[protocol];
        assert!(summary.is_empty() && pictures.is_empty() && texels.is_empty());
        assert!(instances.is_empty() && measured.is_empty());
        let notes = result.findings.iter().filter(|finding| finding.code == "other_protocol").count();
        assert_eq!(notes, dataset.scenes.len());
    }
}

#[test]
fn the_dataset_is_sound_and_changed_measurements_are_found() {
    let verified = |root: &Path| mateval_prep::verify::verify(root, &|_| ()).unwrap();
    let sound = verified(&CAPTURES.root);
    assert!(sound.iter().all(|finding| finding.severity != mateval_dataset::Severity::Error), "{sound:?}");
    let copy = kept_folder("capture_changed");
    mateval_testkit::copy_folder(&CAPTURES.root, &copy);
    let folder = Dataset::open(&copy).unwrap().folder(&SceneId::new("idr").unwrap());
    let mut file: MeasuredFile = json::read(&folder.measured()).unwrap();
    file.regions[0].color[0] = 1.5;
    file.regions.pop();
    json::write(&folder.measured(), &file).unwrap();
    let found = verified(&copy);
    for code in ["bad_color", "wrong_region"] {
        assert!(found.iter().any(|finding| finding.code == code), "{code}: {found:?}");
    }
}

#[test]
fn captures_that_cannot_be_scored_are_refused_with_the_reason() {
    let refused = |name: &str, entries: &str, words: &str| {
        let found = built(name, entries).err().unwrap().to_string();
        assert!(found.contains(words), "{name}: {found}");
    };
    let plain = |more: &str| entry("a", "transforms.json", more);
    let with = |key: &str, from: &str, to: &str| {
        plain("").replace(&format!("{key} = \"{from}\""), &format!("{key} = \"{to}\""))
    };
    refused("capture_other", &with("input", "image_0001", "image_0000"), "'images/image_0000.png' is black");
    refused("capture_none", &with("input", "image_0001", "9"), "no camera took a photo '9'");
    refused("capture_missing", &with("mesh", "mesh.ply", "none.ply"), "there is no file");
    refused("capture_kind", &with("mesh", "mesh.ply", "regions.png"), "expected a mesh as .ply");
    refused("capture_names", &plain("architecture = [\"wall\"]"), "there is no instance 'wall'");
    refused("capture_scale", &plain("scale = 0.0"), "scale = 0: expected a number above 0");
    refused("capture_up", &plain("up = [0, 0, 0]"), "expected a direction");
    let camera = plain("").replace("id = \"a\"", "id = \"a\"\ncamera = { seed = 1 }");
    refused("capture_camera", &camera, "`camera` does not go with `capture`");
    // Photos that are missing, named twice, fewer than the cameras or of another size.
    refused("capture_novel", &plain("novel = [\"9\"]"), "no camera took a photo '9'");
    refused("capture_twice", &plain("novel = [\"image_0001.png\"]"), "the photo 'image_0001.png' is named twice");
    std::fs::create_dir_all(SOURCE.join("fewer")).unwrap();
    std::fs::copy(SOURCE.join("images/image_0001.png"), SOURCE.join("fewer/image_0001.png")).unwrap();
    let fewer = |cameras: &str, more: &str| entry("a", cameras, more).replace("\"images\"", "\"fewer\"");
    let absent = fewer("transforms.json", "novel = [\"image_0002\"]");
    refused("capture_fewer", &absent, "'fewer' does not hold the photo");
    refused("capture_numbered", &fewer("cam.txt", ""), "6 cameras are numbered, and the folder holds 1 photos");
    png_io::write_rgb_words(&SOURCE.join("fewer/image_0003.png"), &Picture::filled(32, 24, [30_000; 3])).unwrap();
    let thumbnail = fewer("transforms.json", "novel = [\"image_0003\"]");
    refused("capture_thumbnail", &thumbnail, "'fewer/image_0003.png' is 32x24, and its camera states 64x48");
    // Cameras of FIPT state no size; the twin is a whole photo, in `every_format_of_cameras…`.
    std::fs::create_dir_all(SOURCE.join("halves")).unwrap();
    for number in 1..=6 {
        let half = Picture::filled(32, 24, [30_000; 3]);
        png_io::write_rgb_words(&SOURCE.join(format!("halves/image_000{number}.png")), &half).unwrap();
    }
    let halves = entry("a", "cam.txt", "").replace("\"images\"", "\"halves\"");
    refused("capture_halves", &halves, "expected a point in the middle half");
    // A camera in another world than the mesh.
    write_posed("away.json", |camera| {
        Camera::from_rotation(camera.rotation(), camera.position() + DVec3::X * 1e4, camera.intrinsics)
    });
    refused("capture_away", &entry("a", "away.json", ""), "or check that mesh and cameras share a world");
    // Regions of a picture of another size, and of another photo.
    let folder = SOURCE.clone();
    let mut file: MeasurementsFile = json::read(&folder.join("measured.json")).unwrap();
    png_io::write_grey_bytes(&folder.join("small.png"), &Picture::filled(8, 6, 10)).unwrap();
    file.regions[0].mask = "small.png".to_owned();
    json::write(&folder.join("small.json"), &file).unwrap();
    refused(
        "capture_small",
        &with("measured", "measured.json", "small.json"),
        "'small.png' is 8x6, and the photo 64x48",
    );
    file.regions.iter_mut().for_each(|region| region.photo = "image_0000".to_owned());
    json::write(&folder.join("others.json"), &file).unwrap();
    refused(
        "capture_others",
        &with("measured", "measured.json", "others.json"),
        "no region is of the photo 'image_0001.png'",
    );
}

/// A camera's axes and place.
type Pose = (DMat3, DVec3);

/// Flips the y and z axes.
const FLIP: DMat3 = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));

fn inverse((axes, place): Pose) -> Pose {
    (axes.transpose(), -(axes.transpose() * place))
}

fn turned((axes, place): Pose, by_deg: f64) -> Pose {
    let turn = DMat3::from_rotation_x(by_deg.to_radians());
    (turn * axes, turn * place)
}

/// A change by which a pose is the right one again, and what a file without it states.
type Convention = (&'static str, fn(Pose) -> Pose);

const CONVENTIONS: [Convention; 6] = [
    ("the camera's y and z axes flipped", |(axes, place)| (axes * FLIP, place)),
    ("the matrix inverted", inverse),
    // OpenCV's world to camera.
    ("the matrix inverted, then the camera's y and z axes flipped", |pose| {
        let (axes, place) = inverse(pose);
        (FLIP * axes, FLIP * place)
    }),
    ("the camera's y and z axes flipped before and after inverting", |pose| {
        let (axes, place) = inverse(pose);
        (FLIP * axes * FLIP, FLIP * place)
    }),
    // Either the mesh or the cameras have +Z up.
    ("their world turned by 90 degrees about x", |pose| turned(pose, -90.0)),
    ("their world turned by -90 degrees about x", |pose| turned(pose, 90.0)),
];

/// Two rooms of the sample and two of houses that are made of it.
fn write_rooms() -> Vec<(String, Camera)> {
    let mut rooms = Vec::new();
    for (dataset, up) in [(ordinary().0, DVec3::Y), (sample_dataset::houses(), DVec3::Z)] {
        assert_eq!(dataset.scenes.len(), 2);
        for scene in &dataset.scenes {
            let place = SOURCE.join("rooms").join(scene.id.as_str());
            std::fs::create_dir_all(place.join("images")).unwrap();
            let turn = DMat3::from_quat(DQuat::from_rotation_arc(DVec3::Y, up));
            write_mesh(&place.join("mesh.ply"), dataset, scene, turn);
            let view = &scene.views[0];
            let photo = exr_io::read_linear(&dataset.folder(&scene.id).view(&view.id).join("rgb.exr")).unwrap();
            let photo = photo.map(|LinearRgb(rgb)| words(rgb.map(|v| (f64::from(v) * scene.exposure) as f32)));
            png_io::write_rgb_words(&place.join("images/image_0001.png"), &photo).unwrap();
            png_io::write_grey_bytes(&place.join("regions.png"), &photo.map(|_| 10)).unwrap();
            let region = MeasuredArea {
                name: "all".to_owned(),
                photo: "image_0001".to_owned(),
                mask: "regions.png".to_owned(),
                value: 10,
                color: [0.5; 3],
                standard_error: None,
            };
            let file = MeasurementsFile { format: MEASUREMENTS_FORMAT.to_owned(), regions: vec![region] };
            json::write(&place.join("measured.json"), &file).unwrap();
            let (axes, place) = (turn * view.camera.rotation(), turn * view.camera.position());
            rooms.push((scene.id.to_string(), Camera::from_rotation(axes, place, view.camera.intrinsics)));
        }
    }
    rooms
}

/// The warnings about the pose of a room whose file of cameras states this one. If the room is refused, its error,
/// which holds them.
fn said_of_pose(room: &str, stated: &Camera, up: DVec3) -> Vec<String> {
    let k = stated.intrinsics;
    let transforms = serde_json::json!({ "fl_x": k.fx, "fl_y": k.fy, "cx": k.cx, "cy": k.cy, "w": k.width,
        "h": k.height, "frames": [{ "file_path": "images/image_0001.png",
        "transform_matrix": stated.world_from_camera }] });
    std::fs::write(SOURCE.join("rooms").join(room).join("transforms.json"), transforms.to_string()).unwrap();
    let keys = entry("a", "transforms.json", &format!("up = {:?}", up.to_array()));
    let folder = format!("= \"rooms/{room}/");
    let keys = ["mesh.ply", "transforms.json", "images", "measured.json"]
        .iter()
        .fold(keys, |keys, file| keys.replace(&format!("= \"{file}"), &format!("{folder}{file}")));
    match built(&format!("capture_pose_{room}"), &keys) {
        Ok(dataset) => {
            let of_poses = |finding: &&Finding| finding.code == "pose_convention";
            dataset.scenes[0].findings.iter().filter(of_poses).map(|finding| finding.message.clone()).collect()
        }
        Err(refused) => vec![refused.to_string()],
    }
}

/// In every room, poses of another convention are recognised by the edges of the photo. Right poses give no warning.
#[test]
fn poses_of_another_convention_are_named() {
    let rooms = write_rooms();
    assert_eq!(rooms.len(), 4);
    for ((room, camera), up) in rooms.iter().zip([DVec3::Y, DVec3::Y, DVec3::Z, DVec3::Z]) {
        assert_eq!(said_of_pose(room, camera, up), Vec::<String>::new(), "{room}");
        for (change, stated) in CONVENTIONS {
            let (axes, place) = stated((camera.rotation(), camera.position()));
            let said = said_of_pose(room, &Camera::from_rotation(axes, place, camera.intrinsics), up);
            assert!(said.len() == 1 && said[0].contains(&format!(" with {change};")), "{room}, {change}: {said:?}");
        }
    }
}

/// Writes a copy of `transforms.json` whose poses are changed by `pose`.
fn write_posed(file: &str, pose: impl Fn(Camera) -> Camera) {
    let mut transforms: serde_json::Value = json::read(&SOURCE.join("transforms.json")).unwrap();
    let cameras = ordinary().1.views.iter().map(|view| view.camera);
    for (frame, camera) in transforms["frames"].as_array_mut().unwrap().iter_mut().skip(1).zip(cameras) {
        frame["transform_matrix"] = serde_json::json!(pose(camera).world_from_camera);
    }
    std::fs::write(SOURCE.join(file), transforms.to_string()).unwrap();
}

/// The undistorted picture of a pincushion does not hold the middle of the photo's left edge. A region there is left
/// out, and refused if it is the only one.
#[test]
fn regions_outside_of_the_picture_are_left_out() {
    let transforms = std::fs::read_to_string(SOURCE.join("transforms.json")).unwrap();
    std::fs::write(SOURCE.join("pincushion.json"), transforms.replace("\"k1\":0.0", "\"k1\":2.0")).unwrap();
    let values = |x: usize, y: usize| match x {
        0 if (20..28).contains(&y) => 20,
        20..30 => 10,
        _ => 0,
    };
    png_io::write_grey_bytes(&SOURCE.join("edge.png"), &Picture::from_fn(64, 48, values)).unwrap();
    let area = |name: &str, value: u16| MeasuredArea {
        name: name.to_owned(),
        photo: "image_0001".to_owned(),
        mask: "edge.png".to_owned(),
        value,
        color: [0.5; 3],
        standard_error: None,
    };
    let with = |file: &str, regions: Vec<MeasuredArea>| {
        json::write(&SOURCE.join(file), &MeasurementsFile { format: MEASUREMENTS_FORMAT.to_owned(), regions }).unwrap();
        built(&format!("capture_{file}"), &entry("a", "pincushion.json", "").replace("measured.json", file))
    };
    let dataset = with("both.json", vec![area("middle", 10), area("edge", 20)]).unwrap();
    let unseen: Vec<&Finding> =
        dataset.scenes[0].findings.iter().filter(|finding| finding.code == "unseen_region").collect();
    assert!(unseen.len() == 1 && unseen[0].message.contains("'edge'"), "{unseen:?}");
    let refused = with("edge.json", vec![area("edge", 20)]).err().unwrap().to_string();
    assert!(refused.contains("none of the 1 regions shows a valid pixel"), "{refused}");
}

/// Millimetres give a warning that names the key; stated as `scale`, they are metres again.
#[test]
fn a_mesh_of_another_unit_is_noticed() {
    let mesh = std::fs::read_to_string(SOURCE.join("mesh.ply")).unwrap();
    let (head, body) = mesh.split_once("end_header\n").unwrap();
    let scaled = |line: &str| {
        let words: Vec<&str> = line.split(' ').collect();
        match words.len() {
            3 => words.iter().map(|w| (w.parse::<f64>().unwrap() * 1000.0).to_string()).collect::<Vec<_>>().join(" "),
            _ => line.to_owned(),
        }
    };
    let body: Vec<String> = body.lines().map(scaled).collect();
    std::fs::write(SOURCE.join("millimetres.ply"), format!("{head}end_header\n{}\n", body.join("\n"))).unwrap();
    let mut transforms: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(SOURCE.join("transforms.json")).unwrap()).unwrap();
    for frame in transforms["frames"].as_array_mut().unwrap() {
        for row in 0..3 {
            let place = frame["transform_matrix"][row][3].as_f64().unwrap() * 1000.0;
            frame["transform_matrix"][row][3] = place.into();
        }
    }
    std::fs::write(SOURCE.join("millimetres.json"), transforms.to_string()).unwrap();
    let plain = |id: &str, more: &str| entry(id, "millimetres.json", more).replace("mesh.ply", "millimetres.ply");
    let dataset = built("capture_units", &(plain("wrong", "") + &plain("right", "scale = 0.001"))).unwrap();
    let noticed = |id: &str| {
        let scene = dataset.scene(&SceneId::new(id).unwrap()).unwrap();
        scene.findings.iter().any(|finding| finding.code == "mesh_size" && finding.action.contains("`scale`"))
    };
    assert!(noticed("wrong") && !noticed("right"));
    let right = &dataset.scene(&SceneId::new("right").unwrap()).unwrap().views[0];
    assert!(right.camera.matrix().abs_diff_eq(input_view().camera.matrix(), 1e-9));
}
