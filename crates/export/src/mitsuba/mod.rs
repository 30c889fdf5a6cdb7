//! Writes a scene for Mitsuba 3 that means the same there as to the built-in tracer.
//!
//! In: a [`ReferenceScene`], a [`Camera`] and [`RenderSettings`], or a view of a dataset. Out: a folder with
//! `scene.xml` (version 3.0.0), `meshes/*.ply` and `textures/*`; and findings, with a warning for everything that
//! Mitsuba cannot express. The scene contains the nearest that it can.
//!
//! Between: this file converts the camera, `materials` materials and their textures, and `lights` lights; `xml` writes
//! the document, and `ply` meshes. Names of the source appear in comments of the XML only, so that no name can become a
//! path or markup.

mod lights;
mod materials;
mod ply;
mod xml;

use std::path::Path;

use glam::DVec3;
use mateval_dataset::material::Material;
use mateval_dataset::mesh::bounds;
use mateval_dataset::open::Dataset;
use mateval_dataset::reference::{ReferenceScene, Surface};
use mateval_dataset::{Camera, Finding, SceneId, ViewId, reference};
use mateval_files::FileError;
use mateval_files::whole::write_whole;
use mateval_files::work_folder::WorkFolder;
use mateval_image::Texture;
use mateval_tracer::RenderSettings;

use self::lights::Glow;
use self::materials::TextureFiles;
use self::ply::Sheet;
use self::xml::{Element, Remarks, SCENE_FILE};
use crate::dataset::ExportError;

/// Distance of the second sheet of a lamp that emits on both sides behind the first, as a share of the mesh's extent.
const SHEET_DISTANCE: f32 = 1e-4;

/// Writes a view of a dataset, which must contain the ground truth, to the folder `out`. Returns the findings of
/// [`export`].
///
/// Fails where the scene or the view does not exist.
pub fn export_view(
    dataset: &Dataset,
    scene: &SceneId,
    view: &ViewId,
    samples: u32,
    out: &Path,
) -> Result<Vec<Finding>, ExportError> {
    dataset.scene(scene)?.check_materials_known()?;
    let found = dataset.scene(scene)?.views.iter().find(|known| known.id == *view);
    let no_view = || ExportError::NoView { path: dataset.root.clone(), scene: scene.clone(), view: view.clone() };
    let camera = found.ok_or_else(no_view)?.camera;
    let concerns = |path: &str| path.starts_with("ground_truth/reference/") || path == "ground_truth/lights.json";
    dataset.check_files(scene, concerns)?;
    let scene = reference::read(&dataset.folder(scene))?;
    export(&scene, &camera, &RenderSettings { samples, ..Default::default() }, out)
}

/// Writes the scene to the folder `out`, replacing one that exists. After a failure no partial folder is left.
///
/// Of the settings it uses samples, seed and `max_bounces`. A warning reports what means something else in Mitsuba.
/// Fails where a file cannot be written.
pub fn export(
    scene: &ReferenceScene,
    camera: &Camera,
    settings: &RenderSettings,
    out: &Path,
) -> Result<Vec<Finding>, ExportError> {
    let work = WorkFolder::start(out)?;
    let mut remarks = Remarks::default();
    let document = write_scene(scene, camera, settings, work.path(), &mut remarks)?;
    write_whole(&work.path().join(SCENE_FILE), document.document().as_bytes())?;
    work.finish()?;
    Ok(remarks.sorted())
}

fn write_scene(
    scene: &ReferenceScene,
    camera: &Camera,
    settings: &RenderSettings,
    folder: &Path,
    remarks: &mut Remarks,
) -> Result<Element, ExportError> {
    for name in ["meshes", "textures"] {
        let path = folder.join(name);
        std::fs::create_dir(&path).map_err(FileError::io("make", &path))?;
    }
    let textures = scene.texture_list();
    let mut document = Element::new("scene")
        .attribute("version", "3.0.0")
        .child(integrator(settings))
        .child(sensor(scene, camera, settings, remarks));
    for material in write_materials(scene, folder, &textures, remarks)? {
        document = document.child(material);
    }
    let glows = lights::glows(folder, scene, &textures, remarks)?;
    for (index, surface) in scene.surfaces.iter().enumerate() {
        let glow = glows.get(&mateval_dataset::reference::SurfaceIndex(index));
        for shape in write_surface(folder, index, surface, glow, remarks)? {
            document = document.child(shape);
        }
    }
    Ok(match lights::distant(folder, scene, &textures, remarks)? {
        Some(light) => document.child(light),
        None => document,
    })
}

/// The materials that surfaces use, each with an id.
fn write_materials(
    scene: &ReferenceScene,
    folder: &Path,
    textures: &[Texture],
    remarks: &mut Remarks,
) -> Result<Vec<Element>, ExportError> {
    let mut files = TextureFiles::new(folder, textures);
    let used = |index: &usize| scene.surfaces.iter().any(|surface| surface.material.0 == *index);
    let mut write = |index: usize| {
        let material: &Material = &scene.materials[index];
        let place = format!("material {index} '{}'", material.name);
        let bsdf = materials::bsdf(material, &place, &mut files, remarks)?;
        Ok(bsdf.attribute("id", material_id(index)).remark(&material.name))
    };
    (0..scene.materials.len()).filter(used).map(&mut write).collect()
}

fn material_id(index: usize) -> String {
    format!("material_{index}")
}

/// The shapes of a surface: usually one, two where it emits on both sides, none where it has no triangles.
fn write_surface(
    folder: &Path,
    index: usize,
    surface: &Surface,
    glow: Option<&Glow>,
    remarks: &mut Remarks,
) -> Result<Vec<Element>, ExportError> {
    if surface.mesh.triangles.is_empty() {
        return Ok(Vec::new());
    }
    let place = format!("surface {index} '{}'", surface.name);
    let bent = ply::bent_triangles(&surface.mesh);
    if bent > 0 && glow.is_none() {
        let message = format!("{bent} triangles have a vertex normal behind their front");
        remarks.note(
            "bent_normals",
            &place,
            &message,
            "wrote them; Mitsuba shades them differently near the silhouette",
        );
    }
    let mut sheets = vec![(format!("meshes/{index}.ply"), if glow.is_some() { Sheet::Flat } else { Sheet::Whole })];
    if glow.is_some_and(|glow| glow.two_sided) {
        let distance = SHEET_DISTANCE * extent(surface);
        let message = "the surface emits on both sides; Mitsuba's surfaces emit on one";
        let action = format!("wrote a second sheet {distance} m behind it");
        remarks.note("two_sided_light", &place, message, &action);
        sheets.push((format!("meshes/{index}_back.ply"), Sheet::Behind(distance)));
    }
    if glow.is_some() && surface.mesh.normals.is_some() {
        let message = "the surface emits; Mitsuba's emitters use its vertex normals as if they were the triangles' own";
        remarks.note("flat_light", &place, message, "wrote it without vertex normals");
    }
    let mut shapes = Vec::new();
    for (file, sheet) in sheets {
        let (bytes, normals) = ply::ply_bytes(&surface.mesh, sheet);
        write_whole(&folder.join(&file), &bytes)?;
        let shape = Element::plugin("shape", "ply")
            .remark(&surface.name)
            .string("filename", file)
            .boolean("face_normals", !normals)
            .boolean("flip_tex_coords", false)
            .child(Element::new("ref").attribute("id", material_id(surface.material.0)));
        shapes.push(glow.map_or(shape.clone(), |glow| shape.child(glow.element.clone())));
    }
    Ok(shapes)
}

/// The diagonal of the surface's bounding box, in metres.
fn extent(surface: &Surface) -> f32 {
    bounds(surface.mesh.positions.iter().copied()).map_or(0.0, |[low, high]| (high - low).length())
}

/// The path tracer. Mitsuba's `max_depth` also counts the camera's ray and the last direct light, hence 2 more.
fn integrator(settings: &RenderSettings) -> Element {
    Element::plugin("integrator", "path").integer("max_depth", settings.max_bounces.saturating_add(2))
}

/// The camera, with a box filter over pixels and independent samples.
fn sensor(scene: &ReferenceScene, camera: &Camera, settings: &RenderSettings, remarks: &mut Remarks) -> Element {
    let k = &camera.intrinsics;
    if (k.fx / k.fy - 1.0).abs() > 1e-9 {
        let message = format!("focal lengths are {} and {} pixels; Mitsuba's pixels are square", k.fx, k.fy);
        remarks.warn("square_pixels", "camera", &message, "wrote the first of them");
    }
    let (width, height) = (f64::from(k.width), f64::from(k.height));
    let fov = 2.0 * libm::atan(width / (2.0 * k.fx)).to_degrees();
    let reach = reach(scene, camera.position());
    Element::plugin("sensor", "perspective")
        .string("fov_axis", "x")
        .float("fov", fov)
        .float("principal_point_offset_x", 0.5 - k.cx / width)
        .float("principal_point_offset_y", 0.5 - k.cy / height)
        .float("near_clip", reach * 1e-4)
        .float("far_clip", reach * 4.0)
        .matrix("to_world", turned(camera))
        .child(
            Element::plugin("film", "hdrfilm")
                .integer("width", k.width)
                .integer("height", k.height)
                .string("pixel_format", "rgb")
                .string("component_format", "float32")
                .child(Element::plugin("rfilter", "box")),
        )
        .child(
            Element::plugin("sampler", "independent")
                .integer("sample_count", settings.samples)
                .integer("seed", settings.seed & 0x7fff_ffff),
        )
}

/// The camera's pose for Mitsuba, whose cameras look along +Z with +X to the left: x and z change sign.
fn turned(camera: &Camera) -> [[f64; 4]; 4] {
    camera.world_from_camera.map(|[x, y, z, t]| [-x, y, -z, t])
}

/// The distance from the camera to the farthest corner of the scene's bounding box, in metres.
fn reach(scene: &ReferenceScene, from: DVec3) -> f64 {
    let positions = || scene.surfaces.iter().flat_map(|surface| &surface.mesh.positions).map(|p| p.as_dvec3());
    let farthest = positions().map(|p| (p - from).abs()).reduce(DVec3::max).unwrap_or(DVec3::ONE);
    farthest.length().max(1e-3)
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec2, Vec3};
    use mateval_dataset::material::{
        ColorInput, Distribution, MaterialModel, Microfacets, PrincipledFlavour, ScalarInput, TextureIndex, UvTransform,
    };
    use mateval_dataset::reference::{Emission, EmissionMap, LightGroup, MaterialIndex, SourceTexture, SurfaceIndex};
    use mateval_dataset::{Intrinsics, Severity, TriangleMesh};
    use mateval_image::{LinearRgb, Texels, Wrap, exr_io};
    use mateval_testkit::scenes::quad;

    use super::*;

    /// The direction of the picture's corner, computed here from the matrix and field of view as Mitsuba does (+Z
    /// ahead, +X left), equals that of our camera.
    #[test]
    fn the_corner_pixel_looks_the_same_way() {
        let intrinsics = Intrinsics::from_fov_x(64, 48, 1.1);
        let camera = Camera::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.0, 0.5, 0.0), DVec3::Y, intrinsics);
        let camera = camera.unwrap();
        let ours = camera.direction(glam::DVec2::new(0.0, 0.0));
        let rows = turned(&camera);
        let tan = 64.0 / (2.0 * intrinsics.fx);
        let local = DVec3::new(tan, tan * 48.0 / 64.0, 1.0).normalize();
        let theirs = DVec3::from_array([0, 1, 2].map(|r| DVec3::from_slice(&rows[r][..3]).dot(local)));
        assert!((ours - theirs).length() < 1e-9, "{ours} {theirs}");
    }

    const GREY: ColorInput = ColorInput::Constant([0.5; 3]);

    fn square() -> TriangleMesh {
        TriangleMesh { normals: Some(vec![Vec3::Z; 4]), ..quad(Vec3::ZERO, Vec3::X, Vec3::Y) }
    }

    fn material(model: MaterialModel) -> Material {
        Material { name: "m".to_owned(), model, two_sided: true, opacity: None, bump: None }
    }

    /// One square of each material, one texture.
    fn scene(materials: Vec<Material>) -> ReferenceScene {
        let texels = Texels::Grey8(vec![0, 51, 102, 255]);
        let texture = Texture::new(2, 2, texels, Wrap::Mirror).unwrap();
        let surface = |k: usize| Surface { name: "s".to_owned(), mesh: square(), material: MaterialIndex(k) };
        ReferenceScene {
            surfaces: (0..materials.len()).map(surface).collect(),
            materials,
            textures: vec![SourceTexture { name: String::new(), sha256: None, texture }],
            lights: Vec::new(),
        }
    }

    fn diffuse() -> Material {
        material(MaterialModel::Diffuse { reflectance: GREY, alpha: None })
    }

    fn camera() -> Camera {
        Camera::look_at(DVec3::Z * 3.0, DVec3::ZERO, DVec3::Y, Intrinsics::from_fov_x(8, 6, 1.0)).unwrap()
    }

    /// The codes of an export's findings and the text of its `scene.xml`. Checks that every file that it refers to
    /// exists.
    fn exported(scene: &ReferenceScene) -> (Vec<(Severity, String)>, String) {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let findings = export(scene, &camera(), &RenderSettings::default(), &out).unwrap();
        let text = std::fs::read_to_string(out.join("scene.xml")).unwrap();
        let document = roxmltree::Document::parse(&text).unwrap();
        for node in document.descendants().filter(|node| node.attribute("name") == Some("filename")) {
            let file = node.attribute("value").unwrap();
            assert!(!file.contains("..") && !file.starts_with('/') && out.join(file).is_file(), "{file}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        (findings.into_iter().map(|finding| (finding.severity, finding.code)).collect(), text)
    }

    fn warnings(scene: &ReferenceScene) -> Vec<String> {
        let warnings = exported(scene).0.into_iter().filter(|(severity, _)| *severity == Severity::Warning);
        warnings.map(|(_, code)| code).collect()
    }

    fn light(emission: Emission) -> LightGroup {
        LightGroup { name: "l".to_owned(), emission, camera_visible: true }
    }

    fn area(two_sided: bool) -> LightGroup {
        light(Emission::Area { surfaces: vec![SurfaceIndex(0)], radiance: [2.0; 3], map: None, two_sided })
    }

    fn textured() -> ScalarInput {
        ScalarInput::Texture { texture: TextureIndex(0), channel: 1, uv: Default::default() }
    }

    fn rough_plastic(alpha: ScalarInput) -> Material {
        material(MaterialModel::Plastic {
            eta: 1.5,
            nonlinear: true,
            diffuse_reflectance: GREY,
            specular_reflectance: GREY,
            microfacets: Some(Microfacets { distribution: Distribution::Ggx, alpha }),
        })
    }

    fn principled(flavour: PrincipledFlavour) -> Material {
        material(MaterialModel::Principled {
            base_color: GREY,
            roughness: textured(),
            metallic: ScalarInput::Constant(0.0),
            specular: 0.5,
            flavour,
        })
    }

    /// Everything that Mitsuba cannot express gives a warning; the twin that it can express gives none.
    #[test]
    fn what_mitsuba_cannot_express_is_a_warning() {
        let changed = |change: &dyn Fn(&mut ReferenceScene)| {
            let mut scene = scene(vec![diffuse()]);
            change(&mut scene);
            scene
        };
        let sky = || light(Emission::Constant { radiance: [1.0; 3] });
        let masked = || Material { opacity: Some(textured()), ..diffuse() };
        let hidden = || LightGroup { camera_visible: false, ..area(false) };
        let oren_nayar = MaterialModel::Diffuse { reflectance: GREY, alpha: Some(ScalarInput::Constant(0.3)) };
        let bright = MaterialModel::Diffuse { reflectance: ColorInput::Constant([1.5; 3]), alpha: None };
        let folded = || {
            let mut scene = mapped_lamp();
            scene.surfaces[0].mesh.uvs = Some(vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::X]);
            scene
        };
        let cases: [(ReferenceScene, &[&str]); 14] = [
            (scene(vec![diffuse()]), &[]),
            (scene(vec![material(oren_nayar)]), &["oren_nayar"]),
            (scene(vec![material(bright)]), &["color_range"]),
            (scene(vec![principled(PrincipledFlavour::Mitsuba)]), &[]),
            (scene(vec![principled(PrincipledFlavour::Blender)]), &["blender_principled"]),
            (scene(vec![rough_plastic(ScalarInput::Constant(0.2))]), &[]),
            (scene(vec![rough_plastic(textured())]), &["alpha_texture"]),
            (changed(&|scene| scene.lights = vec![area(true), sky()]), &[]),
            (changed(&|scene| scene.lights = vec![hidden(), sky()]), &["camera_invisible"]),
            (changed(&|scene| scene.lights = vec![sky(), sky()]), &["second_environment"]),
            (changed(&|scene| scene.materials = vec![masked()]), &[]),
            (
                changed(&|scene| (scene.materials, scene.lights) = (vec![masked()], vec![area(false)])),
                &["masked_light"],
            ),
            (mapped_lamp(), &[]),
            (folded(), &["folded_light"]),
        ];
        for (scene, expected) in cases {
            assert_eq!(warnings(&scene), expected, "{scene:?}");
        }
    }

    /// A lamp that emits on both sides becomes two flat shapes, any other surface one. A texture that is used twice is
    /// written once.
    #[test]
    fn shapes_and_files() {
        let mut scene = scene(vec![principled(PrincipledFlavour::Mitsuba), principled(PrincipledFlavour::Mitsuba)]);
        scene.lights = vec![area(true)];
        let (codes, text) = exported(&scene);
        let codes: Vec<&str> = codes.iter().map(|(_, code)| code.as_str()).collect();
        assert_eq!(codes, ["flat_light", "two_sided_light"]);
        assert_eq!((text.matches("<shape").count(), text.matches("<emitter").count()), (3, 2));
        assert_eq!(text.matches("textures/0_green.png").count(), 2);
        assert!(text.contains("<string name=\"wrap_mode\" value=\"mirror\"/>"));
        assert!(text.contains("<integer name=\"max_depth\" value=\"18\"/>"));
        assert_eq!(exported(&ReferenceScene::default()).0, []);
    }

    /// A scene with one lamp, whose radiance is (2, 3, 4) times the texture.
    fn mapped_lamp() -> ReferenceScene {
        let mut scene = scene(vec![diffuse()]);
        let uv = UvTransform([[2.0, 0.0, 0.0], [0.0, 1.0, 0.25]]);
        let map = Some(EmissionMap { texture: TextureIndex(0), uv });
        let surfaces = vec![SurfaceIndex(0)];
        scene.lights = vec![light(Emission::Area { surfaces, radiance: [2.0, 3.0, 4.0], map, two_sided: false })];
        scene
    }

    /// A textured light becomes a bitmap of its radiance in floats, or a constant where all texels are equal.
    #[test]
    fn textured_lights() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        export(&mapped_lamp(), &camera(), &RenderSettings::default(), &out).unwrap();
        let text = std::fs::read_to_string(out.join("scene.xml")).unwrap();
        let emitter = &text[text.find("<emitter").unwrap()..text.find("</emitter>").unwrap()];
        for part in [
            "<texture type=\"bitmap\" name=\"radiance\">",
            "textures/light_0.exr",
            "<boolean name=\"raw\" value=\"true\"/>",
            "value=\"mirror\"",
            "value=\"2 0 0 0 0 -1 0 0.75 0 0 1 0 0 0 0 1\"",
        ] {
            assert!(emitter.contains(part), "{part}: {emitter}");
        }
        let picture = exr_io::read_linear(&out.join("textures/light_0.exr")).unwrap();
        let expected = [0.0, 0.2, 0.4, 1.0].map(|share| LinearRgb([2.0 * share, 3.0 * share, 4.0 * share]));
        for (found, expected) in picture.pixels().iter().zip(expected) {
            assert!((0..3).all(|c| (found.0[c] - expected.0[c]).abs() < 1e-6), "{found:?} {expected:?}");
        }

        let constant = |change: &dyn Fn(&mut ReferenceScene)| {
            let mut scene = mapped_lamp();
            change(&mut scene);
            assert_eq!(warnings(&scene), [""; 0]);
            exported(&scene).1
        };
        let set = |scene: &mut ReferenceScene, texels: Vec<u8>, side: usize| {
            scene.textures[0].texture = Texture::new(side, side, Texels::Grey8(texels), Wrap::Repeat).unwrap();
        };
        let half = constant(&|scene| set(scene, vec![51], 1));
        assert!(half.contains("<rgb name=\"radiance\" value=\"0.4 0.6 0.8\"/>"), "{half}");
        let black = constant(&|scene| set(scene, vec![0; 4], 2));
        assert!(black.contains("<rgb name=\"radiance\" value=\"0 0 0\"/>"), "{black}");
        // Looked up at uv (0, 0), that is at (0, 0.25): the lower left texel.
        let without_uv = constant(&|scene| scene.surfaces[0].mesh.uvs = None);
        assert!(without_uv.contains("<rgb name=\"radiance\" value=\"0.8 1.2 1.6\"/>"), "{without_uv}");
    }

    /// Names that try to leave a folder, an attribute or a comment, or to control a terminal.
    #[test]
    fn hostile_names_stay_comments() {
        let hostile =
            "../../etc/passwd --> <boom a=\"1\"/> <![CDATA[ &x; \u{1b}[31m\u{0}\n".to_owned() + &"long".repeat(9999);
        let mut scene = scene(vec![diffuse()]);
        scene.materials[0].name = hostile.clone();
        scene.surfaces[0].name = hostile.clone();
        scene.textures[0].name = hostile.clone();
        scene.lights = vec![LightGroup { name: hostile, ..area(false) }];
        let text = exported(&scene).1;
        let document = roxmltree::Document::parse(&text).unwrap();
        assert!(!text.contains("<boom") && !text.contains('\u{1b}') && text.len() < 5000, "{text}");
        assert_eq!(document.descendants().filter(|node| node.has_tag_name("boom")).count(), 0);
    }

    /// An existing folder is replaced as a whole. A folder that cannot be created is an error and leaves no files.
    #[test]
    fn the_folder_is_complete_or_does_not_exist() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        std::fs::create_dir(&out).unwrap();
        std::fs::write(out.join("older"), "x").unwrap();
        export(&scene(vec![diffuse()]), &camera(), &RenderSettings::default(), &out).unwrap();
        assert!(out.join("scene.xml").is_file() && !out.join("older").exists());
        let file = folder.path().join("file");
        std::fs::write(&file, "x").unwrap();
        let below = file.join("out");
        assert!(export(&scene(vec![diffuse()]), &camera(), &RenderSettings::default(), &below).is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
