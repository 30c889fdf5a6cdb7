//! Attacks on a redressed split by somebody who has the public files and the undressed source: remembering textures,
//! building the room again, and submissions whose shown numbers solve for the truth.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{LazyLock, Mutex};

use glam::{DMat3, DVec2, DVec3};
use mateval_baselines::estimate_source::EstimateSource;
use mateval_baselines::geometry::{PartTriangles, SceneGeometry};
use mateval_baselines::lift::lift;
use mateval_baselines::nn::seen_pixels;
use mateval_dataset::open::Dataset;
use mateval_dataset::uv_atlas::UvAtlas;
use mateval_dataset::{TriangleMesh, glb};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{LinearRgb, Picture, Wrap, png_io};
use mateval_testkit::{copy_folder, kept_folder, shared_data};
use serde_json::Value;

use super::command::{baseline, build, mateval, run};
use super::leaks::{Secrets, check_bytes};
use super::sample::{copy_source, files_below, json};

/// A room as its source shows it (`undressed`), redressed (`redressed`), and the public part of that (`public`), each
/// with a photo; and the first two without one (`undressed_scored`, `redressed_scored`), since nothing is rendered where
/// these are scored. Submissions are written beside them.
struct Rooms {
    folder: PathBuf,
    /// Held while a shared submission is written.
    writing: Mutex<()>,
}

impl Rooms {
    /// `scene` is the recipe's entry, whose paths are relative to `source`.
    fn new(name: &str, source: &Path, scene: &str) -> Self {
        let folder = kept_folder(name);
        std::fs::write(folder.join("key"), [5; 32]).unwrap();
        for (dataset, redress) in [("undressed", ""), ("redressed", "redress = { key = \"KEY\" }")] {
            let recipe = folder.join(format!("{dataset}.toml"));
            let redress = redress.replace("KEY", folder.join("key").to_str().unwrap());
            let head = "name = \"attacked\"\nresolution = [96, 72]\natlas_size = 128";
            std::fs::write(&recipe, format!("{head}\n[[scene]]\nid = \"room\"\n{scene}\n{redress}\n")).unwrap();
            run(build(&recipe, &folder.join(dataset)).arg("--source").arg(source)).ends_with(0);
            copy_folder(&folder.join(dataset), &folder.join(format!("{dataset}_scored")));
            let mut render = mateval();
            run(render.args(["prep", "render", "--only", "photo", "--samples", "16"]).arg(folder.join(dataset)))
                .ends_with(0);
        }
        let mut publish = mateval();
        publish.args(["prep", "publish", "--withhold", "ground_truth", "--public"]).arg(folder.join("public"));
        run(publish.arg("--private").arg(folder.join("private")).arg(folder.join("redressed"))).ends_with(0);
        Self { folder, writing: Mutex::new(()) }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Writes the submission of a baseline on what `delight` makes of the photo, from the public files of a dataset.
    fn honest(&self, name: &str, dataset: &str) -> PathBuf {
        let [root, estimate, out] =
            [dataset, &format!("delit_{dataset}"), &format!("{name}_{dataset}")].map(|name| self.path(name));
        let _writing = self.writing.lock().unwrap();
        if !estimate.exists() {
            run(&mut baseline("delight", &root, &estimate)).ends_with(0);
        }
        if !out.exists() {
            run(baseline(name, &root, &out).args(["--adapter", "delight", "--estimate"]).arg(&estimate)).ends_with(0);
        }
        out
    }

    /// The PSNR of albedo in the novel views, in dB, and that without its scale.
    fn psnrs(&self, submission: &Path, dataset: &str) -> [f64; 2] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.json");
        run(&mut score(submission, &self.path(dataset), &path)).ends_with(0);
        let result = json(&path);
        ["albedo", "albedo_aligned"].map(|picture| psnr_of(&result, picture))
    }

    fn psnr(&self, submission: &Path, dataset: &str) -> f64 {
        self.psnrs(submission, dataset)[0]
    }
}

fn psnr(result: &Value) -> f64 {
    psnr_of(result, "albedo")
}

fn psnr_of(result: &Value, picture: &str) -> f64 {
    result["protocols"]["mateval-3"]["summary"][format!("{picture}.novel.psnr")].as_f64().unwrap()
}

/// Scores the maps of a submission.
fn score(submission: &Path, dataset: &Path, result: &Path) -> Command {
    let mut command = mateval();
    command.args(["eval", "score"]).arg(submission).arg("--dataset").arg(dataset).arg("--out").arg(result);
    command
}

static SAMPLE: LazyLock<Rooms> = LazyLock::new(|| {
    let source = kept_folder("attacked_source").join("source");
    copy_source(&source);
    Rooms::new("attacked", &source, "bitterli = \"room/scene.xml\"")
});

/// A room of 3D-FRONT; absent where the shared data is.
static REAL: LazyLock<Option<Rooms>> = LazyLock::new(|| {
    let source = shared_data("3d-front")?;
    let scene = "front3d = { house = \"3D-FRONT/07700701-1835-4532-8af0-bd8c7f624b1b.json\", \
        room = \"SecondBedroom-1238\", models = \"3D-FUTURE-model\" }\ncamera = { seed = 0 }";
    Some(Rooms::new("attacked_real", &source, scene))
});

/// The undressed base colours of every instance of a dataset whose shape is known, on the atlas that it has there.
/// Shapes are the same if their triangles are, up to their place in the room; atlases differ between datasets.
fn undressed_atlases(rooms: &Rooms, dataset: &str) -> BTreeMap<String, Picture<LinearRgb>> {
    let nodes = |dataset: &str| glb::read(&rooms.path(dataset).join("scenes/room/geometry/instances.glb")).unwrap();
    let (known, mut found) = (nodes("undressed"), BTreeMap::new());
    for node in nodes(dataset) {
        let Some(shape) = known.iter().find(|other| shape(&other.mesh) == shape(&node.mesh)) else { continue };
        let file = format!("undressed/scenes/room/ground_truth/materials/{}/base_color.png", shape.name);
        if !rooms.path(&file).is_file() {
            continue;
        }
        let texture = read_texture(&rooms.path(&file), Encoding::Srgb, Wrap::Clamp).unwrap();
        let (size, uvs) = (texture.width(), shape.mesh.uvs.as_ref().unwrap());
        let atlas = UvAtlas::new(&node.mesh, size);
        let color = |x: usize, y: usize| {
            let Some((triangle, _)) = atlas.owner(x, y) else { return LinearRgb::default() };
            let weights = atlas.nearest_barycentrics(triangle, DVec2::new(x as f64 + 0.5, y as f64 + 0.5)).as_vec3();
            let corners = shape.mesh.triangles[triangle].map(|vertex| uvs[vertex as usize]);
            let uv = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
            LinearRgb(texture.sample(uv.to_array()))
        };
        let mut picture = Picture::from_fn(size, size, color);
        atlas.fill_gutters(&mut picture);
        found.insert(node.name, picture);
    }
    assert!(found.len() > 5, "{}", found.len());
    found
}

/// What a shape is known by: the corners of its triangles from the first one on, in millimetres.
fn shape(mesh: &TriangleMesh) -> Vec<[[i32; 3]; 3]> {
    let first = mesh.corners(0)[0];
    let corners =
        |triangle| mesh.corners(triangle).map(|place| ((place - first) * 1000.0).round().as_ivec3().to_array());
    (0..mesh.triangles.len()).map(corners).collect()
}

/// Writes base colours over those of another submission.
fn write_colors(submission: &Path, instance: &str, colors: &Picture<LinearRgb>) {
    let bytes = colors.map(|LinearRgb(rgb)| rgb.map(|value| byte_from_unit(srgb_from_linear(value.clamp(0.0, 1.0)))));
    png_io::write_rgb_bytes(&submission.join("scenes/room").join(instance).join("base_color.png"), &bytes).unwrap();
}

/// The submission of somebody who knows textures by shape; what is not known has the medians of the photo.
fn remembered(rooms: &Rooms, dataset: &str) -> PathBuf {
    let out = rooms.path(&format!("remembered_{dataset}"));
    copy_folder(&rooms.honest("median", dataset), &out);
    undressed_atlases(rooms, dataset).iter().for_each(|(instance, colors)| write_colors(&out, instance, colors));
    out
}

/// The submission of somebody who also fits the remembered colours to those of `nn`: each instance and channel has the
/// scale and offset that bring them nearest. `flat` has a scale of 0, so that nothing is remembered.
fn recolored(rooms: &Rooms, dataset: &str, flat: bool) -> PathBuf {
    let out = rooms.path(&format!("recolored_{dataset}_{flat}"));
    copy_folder(&rooms.honest("median", dataset), &out);
    let seen = rooms.honest("nn", dataset);
    for (instance, colors) in undressed_atlases(rooms, dataset) {
        let seen = seen.join("scenes/room").join(&instance).join("base_color.png");
        let seen = read_texture(&seen, Encoding::Srgb, Wrap::Clamp).unwrap();
        let size = colors.width();
        let uv =
            |at: usize| [(at % size) as f32 + 0.5, size as f32 - (at / size) as f32 - 0.5].map(|v| v / size as f32);
        let seen: Vec<[f32; 3]> = (0..size * size).map(|at| seen.sample(uv(at))).collect();
        let fits: [(f32, f32); 3] = std::array::from_fn(|channel| {
            let pairs = colors.pixels().iter().zip(&seen).map(|(color, seen)| (color.0[channel], seen[channel]));
            line(&pairs.map(|(color, seen)| (if flat { 0.0 } else { color }, seen)).collect::<Vec<_>>())
        });
        let fitted =
            colors.map(|LinearRgb(rgb)| LinearRgb(std::array::from_fn(|at| fits[at].0 * rgb[at] + fits[at].1)));
        write_colors(&out, &instance, &fitted);
    }
    out
}

/// Scale and offset of the line of least squares; the scale is 0 if all first values are equal.
fn line(pairs: &[(f32, f32)]) -> (f32, f32) {
    let count = pairs.len() as f64;
    let (x, y) = pairs.iter().fold((0.0, 0.0), |sum, pair| (sum.0 + f64::from(pair.0), sum.1 + f64::from(pair.1)));
    let (x, y) = (x / count, y / count);
    let (mut covariance, mut variance) = (0.0, 0.0);
    for pair in pairs {
        covariance += (f64::from(pair.0) - x) * (f64::from(pair.1) - y);
        variance += (f64::from(pair.0) - x).powi(2);
    }
    let scale = if variance > 1e-6 * count { covariance / variance } else { 0.0 };
    (scale as f32, (y - scale * x) as f32)
}

/// The texels that share a transform of their colours.
#[derive(Clone, Copy, Debug)]
enum Fitted {
    Instance,
    Part,
}

/// The submission for the public dataset of somebody who fits the remembered colours to the photo: those of each
/// instance or part go through the 3x4 transform of linear colours that brings them nearest to the photo, over the
/// texels that it shows. `flat` has black in place of what is remembered, so that the mean of the photo is left.
fn fitted_to_photo(rooms: &Rooms, fitted: Fitted, flat: bool) -> PathBuf {
    let out = rooms.path(&format!("fitted_to_photo_{fitted:?}_{flat}"));
    copy_folder(&rooms.honest("median", "public"), &out);
    let dataset = Dataset::open(&rooms.path("public")).unwrap();
    let scene = &dataset.scenes[0];
    let geometry = SceneGeometry::read(dataset.folder(&scene.id), scene).unwrap();
    let photo = EstimateSource::Input.read(&dataset, scene, &|_| ()).unwrap();
    let seen = seen_pixels(&geometry, &photo).unwrap();
    let parts = PartTriangles::read(&geometry, None).unwrap();
    let remembered = undressed_atlases(rooms, "public");
    let mut count = 0;
    for (at, instance) in scene.instances.iter().enumerate() {
        let Some(known) = remembered.get(instance.id.as_str()) else { continue };
        let size = known.width();
        let lifted = lift(&geometry, &seen, &photo, at, size);
        let color = |at: usize| if flat { DVec3::ZERO } else { DVec3::from_array(known.pixels()[at].0.map(f64::from)) };
        // Pairs of remembered and seen colours, of the instance and of each part.
        let of_triangles = parts.of(at);
        let part = |at: usize| {
            let (triangle, _) = lifted.atlas.owner(at % size, at / size)?;
            of_triangles[triangle]
        };
        let mut of_instance = Vec::new();
        let mut of_parts: BTreeMap<Option<usize>, Vec<(DVec3, DVec3)>> = BTreeMap::new();
        for (at, texel) in lifted.texels.pixels().iter().enumerate() {
            let Some([r, g, b, ..]) = texel.seen() else { continue };
            let pair = (color(at), DVec3::new(r.into(), g.into(), b.into()));
            of_instance.push(pair);
            of_parts.entry(part(at)).or_default().push(pair);
        }
        if of_instance.len() < FEWEST_TEXELS {
            continue;
        }
        count += 1;
        let whole = ColorTransform::nearest(&of_instance);
        of_parts.retain(|_, pairs| matches!(fitted, Fitted::Part) && pairs.len() >= FEWEST_TEXELS);
        let of_parts: BTreeMap<_, _> =
            of_parts.iter().map(|(part, pairs)| (*part, ColorTransform::nearest(pairs))).collect();
        let texel = |x: usize, y: usize| {
            let at = y * size + x;
            let found = of_parts.get(&part(at)).unwrap_or(&whole).apply(color(at));
            LinearRgb(found.as_vec3().to_array())
        };
        let mut colors = Picture::from_fn(size, size, texel);
        lifted.atlas.fill_gutters(&mut colors);
        write_colors(&out, instance.id.as_str(), &colors);
    }
    assert!(count > 5, "{count}");
    out
}

/// The fewest texels that a transform is fitted to: twice the number that determines it, since it has 12 unknowns and
/// each texel gives 3 equations.
const FEWEST_TEXELS: usize = 8;

/// Maps a colour to `linear * (color - from) + to`.
struct ColorTransform {
    linear: DMat3,
    from: DVec3,
    to: DVec3,
}

impl ColorTransform {
    /// The transform of least squares from the first colours to the second. The least variance of a channel keeps it
    /// defined if all first colours are equal.
    fn nearest(pairs: &[(DVec3, DVec3)]) -> Self {
        const LEAST_VARIANCE: f64 = 1e-6;
        let share = 1.0 / pairs.len() as f64;
        let from = pairs.iter().map(|pair| pair.0).sum::<DVec3>() * share;
        let to = pairs.iter().map(|pair| pair.1).sum::<DVec3>() * share;
        let outer = |a: DVec3, b: DVec3| DMat3::from_cols(a * b.x, a * b.y, a * b.z);
        let (mut both, mut own) = (DMat3::ZERO, DMat3::from_diagonal(DVec3::splat(LEAST_VARIANCE)));
        for (first, second) in pairs {
            both += outer(*second - to, *first - from) * share;
            own += outer(*first - from, *first - from) * share;
        }
        Self { linear: both * own.inverse(), from, to }
    }

    fn apply(&self, color: DVec3) -> DVec3 {
        self.linear * (color - self.from) + self.to
    }
}

/// The most that memory may gain where it loses to no honest method, in dB; 0.13 was found.
const GAIN_DB: f64 = 0.2;

/// Panics unless the albedo of remembered colours that are fitted to the photo is more than 3 dB below that of `nn`, and
/// without its scale below that of `nn` or no better than the same fit without memory: the means of the photo may be
/// better than `nn` by themselves. `nn` is given by its [`Rooms::psnrs`].
fn check_fits_to_photo(rooms: &Rooms, nn: [f64; 2]) {
    for fitted in [Fitted::Instance, Fitted::Part] {
        let [memory, flat] =
            [false, true].map(|flat| rooms.psnrs(&fitted_to_photo(rooms, fitted, flat), "redressed_scored"));
        let all = format!("fitted by {fitted:?}: {memory:?}, flat {flat:?}; nn {nn:?}");
        assert!(memory[0] < nn[0] - 3.0 && memory[0] < flat[0] + GAIN_DB, "{all}");
        assert!(memory[1] < nn[1].max(flat[1] + GAIN_DB), "{all}");
    }
}

/// The datasets that a method reads and is scored on: of the undressed room, and of the redressed one.
const PAIRS: [[&str; 2]; 2] = [["undressed", "undressed_scored"], ["public", "redressed_scored"]];

/// A method that remembers textures is first in the undressed room and below the medians of the photo in the redressed
/// one. A method that looks at the photo stays where it was, but for less than a third of that fall.
#[test]
fn remembered_textures_fall_below_the_medians() {
    let rooms = &*SAMPLE;
    let [undressed, redressed] = PAIRS.map(|[made, scored]| {
        [remembered(rooms, made), rooms.honest("nn", made), rooms.honest("median", made)]
            .map(|submission| rooms.psnr(&submission, scored))
    });
    let all = format!("memory, nn, median: {undressed:?} undressed, {redressed:?} redressed");
    assert!(undressed[0] > undressed[1].max(undressed[2]) && redressed[0] < redressed[2], "{all}");
    assert!((undressed[1] - redressed[1]).abs() < (undressed[0] - redressed[0]) / 3.0, "{all}");
    // Remembered colours that are fitted to `nn` are better than the fit alone in the undressed room only, if not by
    // much: the sample's textures vary little.
    let gains = PAIRS.map(|[made, scored]| {
        let [fitted, alone] = [false, true].map(|flat| rooms.psnr(&recolored(rooms, made, flat), scored));
        fitted - alone
    });
    assert!(gains[0] > 0.2 && gains[1] < 0.05, "gains by fitted memory: {gains:?}; {all}");
}

/// Fitted to the photo itself, remembered textures have its light in them.
#[test]
fn remembered_textures_fitted_to_the_photo_lose() {
    let rooms = &*SAMPLE;
    let nn = rooms.psnrs(&rooms.honest("nn", "public"), "redressed_scored");
    check_fits_to_photo(rooms, nn);
}

/// The same in a room of 3D-FRONT. `delight` is right about the brightness of its white walls and wrong about that of
/// the redressed ones. This fall has nothing to do with memory, so scores without scale are compared.
#[test]
fn remembered_textures_fall_in_a_real_room() {
    let Some(rooms) = &*REAL else { return };
    let scores = |name: &str| {
        PAIRS.map(|[made, scored]| {
            let submission = if name == "memory" { remembered(rooms, made) } else { rooms.honest(name, made) };
            rooms.psnrs(&submission, scored)
        })
    };
    let (memory, nn, median) = (scores("memory"), scores("nn"), scores("median"));
    let all = format!("albedo and aligned, undressed and redressed: memory {memory:?}, nn {nn:?}, median {median:?}");
    for number in 0..2 {
        let [undressed, redressed] = [0, 1].map(|room| [&memory, &nn, &median].map(|scores| scores[room][number]));
        assert!(undressed[0] > undressed[1].max(undressed[2]) && redressed[0] < redressed[2], "{all}");
    }
    assert!(nn[0][1] - nn[1][1] < (memory[0][1] - memory[1][1]) / 3.0, "{all}");
    // Memory that is fitted to what `nn` sees is as wrong about brightness as `nn`, and knows less of the colours.
    let fitted = rooms.psnrs(&recolored(rooms, "public", false), "redressed_scored");
    assert!(fitted[0] < nn[1][0] + 0.1 && fitted[1] < nn[1][1] - 3.0, "fitted memory: {fitted:?}; {all}");
    check_fits_to_photo(rooms, nn[1]);
}

/// The attacks on files, in a room of 3D-FRONT: the room is built again from the public source, with the recipe and
/// another key; hashes and pieces of the truth are looked up; and the exports of the public folder are searched for it.
#[test]
fn a_real_room_is_neither_made_again_nor_looked_up() {
    let Some(rooms) = &*REAL else { return };
    let [public, private, remade] = ["public", "private", "remade"].map(|name| rooms.path(name));
    std::fs::write(rooms.path("guessed_key"), [6; 32]).unwrap();
    let [key, guess] = ["key", "guessed_key"].map(|name| format!("\"{}\"", rooms.path(name).display()));
    let recipe = std::fs::read_to_string(rooms.path("redressed.toml")).unwrap();
    assert!(recipe.contains(&key), "{recipe}");
    std::fs::write(rooms.path("guessed.toml"), recipe.replace(&key, &guess)).unwrap();
    let source = shared_data("3d-front").unwrap();
    run(build(&rooms.path("guessed.toml"), &remade).arg("--source").arg(source)).ends_with(0);
    // Metallic maps are left out: most are 0 in both rooms, since few of their materials are metals.
    let maps = |root: &Path| -> BTreeMap<PathBuf, image::DynamicImage> {
        let materials = root.join("scenes/room/ground_truth/materials");
        let files = files_below(&materials).into_iter();
        let files = files.filter(|file| file.ends_with("base_color.png") || file.ends_with("roughness.png"));
        files.map(|file| (file.clone(), image::open(materials.join(file)).unwrap())).collect()
    };
    let withheld = maps(&private);
    for root in [&remade, &rooms.path("undressed")] {
        let made = maps(root);
        let equal: Vec<&PathBuf> = withheld.keys().filter(|file| made.get(*file) == withheld.get(*file)).collect();
        assert!(equal.is_empty() && made.len() == withheld.len(), "{equal:?}");
    }
    assert!(withheld.len() >= 20, "{}", withheld.len());

    let pieces = check_bytes(&public, &private, &rooms.path("undressed"));
    assert!(pieces >= 8, "{pieces}");

    let secrets = Secrets::of(&private);
    for format in ["tar", "huggingface"] {
        let out = rooms.path(format);
        let mut export = mateval();
        export.args(["prep", "export", "--as", format, "--out"]).arg(&out);
        run(export.arg(&public)).ends_with(0);
        let shown = secrets.found_in(&out);
        assert_eq!(shown.leaks, BTreeSet::new(), "{format}");
        assert!(shown.pictures > 0, "{format}");
    }
}

/// Constant submissions: black, red, green and blue.
const CONSTANTS: [[f32; 3]; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The mean colour that four errors of constants follow from: the mean of (t - 1)^2 over a channel and of t^2 over the
/// others is that of black plus (1 - 2 mean) / 3.
fn solved([black, red, green, blue]: [f64; 4]) -> [f32; 3] {
    [red, green, blue].map(|mse| ((1.0 - 3.0 * (mse - black)) / 2.0).clamp(0.0, 1.0) as f32)
}

/// Fault 3: the results of black and of three colours solve for the mean colour of every instance. Rounded ones do not
/// tell the four apart, and no constant is better than the floor.
#[test]
fn shown_results_are_no_oracle() {
    let rooms = &*SAMPLE;
    let out = tempfile::tempdir().unwrap();
    let [submission, result, rounded, floor] =
        ["constant", "result.json", "rounded.json", "floor.json"].map(|name| out.path().join(name));
    let whole = rooms.path("redressed_scored");
    run(&mut score(&rooms.honest("nn", "public"), &whole, &floor)).ends_with(0);
    run(&mut baseline("grey", &rooms.path("public"), &submission)).ends_with(0);
    let maps: Vec<PathBuf> =
        files_below(&submission).into_iter().filter(|file| file.ends_with("base_color.png")).collect();
    // The whole and the rounded result of a colour for each instance.
    let scored = |color: &dyn Fn(&str) -> [f32; 3]| {
        for map in &maps {
            let instance = map.parent().and_then(Path::file_name).unwrap().to_str().unwrap();
            let bytes = color(instance).map(|value| (255.0 * srgb_from_linear(value)).round() as u8);
            png_io::write_rgb_bytes(&submission.join(map), &Picture::filled(64, 64, bytes)).unwrap();
        }
        let mut command = score(&submission, &whole, &result);
        run(command.arg("--force").arg("--rounded").arg(&rounded).arg("--floor").arg(&floor)).ends_with(0);
        (json(&result), json(&rounded))
    };
    let mse = |psnr: f64| 10_f64.powf(-psnr / 10.0);
    let constants = CONSTANTS.map(|color| scored(&|_| color));

    // Whole results: first of the mean colour of the split, then of each instance.
    let best_constant = scored(&|_| solved(constants.each_ref().map(|(whole, _)| mse(psnr(whole)))));
    let errors = constants.each_ref().map(|(whole, _)| {
        let all = whole["protocols"]["mateval-3"]["instances"].as_array().unwrap().iter();
        let albedo = all.filter(|one| one["picture"] == "albedo" && one["views"] == "novel");
        albedo.map(|one| (one["instance"].as_str().unwrap().to_owned(), one["mse"].as_f64().unwrap())).collect()
    });
    let of_instance = |name: &str| {
        let errors: [Option<f64>; 4] = errors.each_ref().map(|all: &BTreeMap<String, f64>| all.get(name).copied());
        solved(errors.map(|error| error.unwrap_or(0.0)))
    };
    let oracle = psnr(&scored(&of_instance).0);

    // Rounded ones.
    let shown = |file: &Value| (file["headline"].clone(), file["at_floor"].clone());
    for (_, file) in &constants {
        assert!(!file.to_string().contains("instances") && file["floors"].as_array().unwrap().len() == 1, "{file}");
        assert_eq!(shown(file), shown(&constants[0].1));
    }
    let headline = &best_constant.1["headline"]["mateval-3"];
    let at_floor = best_constant.1["at_floor"]["mateval-3"].as_array().unwrap();
    assert!(at_floor.contains(&"albedo.novel.psnr".into()), "{}", best_constant.1);
    let guess = scored(&|_| solved([mse(headline["albedo.novel.psnr"].as_f64().unwrap()); 4])).0;
    let median = rooms.psnr(&rooms.honest("median", "public"), "redressed_scored");
    let honest = psnr(&json(&floor));
    let all = format!(
        "oracle of instances {oracle}, best constant {}, constant of the shown numbers {}, median {median}, nn {honest}",
        psnr(&best_constant.0),
        psnr(&guess)
    );
    assert!(psnr(&guess) < median && psnr(&best_constant.0) < honest && oracle > honest + 3.0, "{all}");

    // A board is made from whole results, and no number is shown without a floor.
    let board = run(mateval().args(["eval", "leaderboard"]).arg(&rounded).arg("--out").arg(out.path().join("site")));
    board.ends_with(2).says("mateval-rounded/1");
    run(score(&submission, &whole, &result).arg("--force").arg("--rounded").arg(&rounded)).ends_with(2).says("--floor");
}
