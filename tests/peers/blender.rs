//! Blender 4.5 (Cycles) and the tracer render scenes that are made here; the pictures must agree tile by tile.
//!
//! The samples are chosen so that the noise of a tile, of both renderers together, is under a third of the difference
//! allowed for all tiles but one. Each comparison is repeated with a slightly wrong scene, and must then fail by more
//! than its noise.

use std::sync::Arc;

use glam::Vec3;
use mateval_dataset::material::{ColorInput, Material, MaterialModel, PrincipledFlavour, ScalarInput, UvTransform};
use mateval_dataset::reference::{Emission, ReferenceScene};
use mateval_image::{Texels, Texture, Wrap};
use mateval_tracer::{RenderSettings, World};

use super::blender_job::{self, BOUNCES, SEEDS, SIZE, Shot};
use super::tiles::{Agreement, Tiles, agreement};
use mateval_testkit::scenes::{Builder, camera, grey, material, quad, room, sphere};

/// Allowed relative differences: of the means of all tiles but one (that one by twice as much), and of whole pictures.
#[derive(Clone, Copy)]
struct Bounds {
    tiles: f64,
    whole: f64,
}

impl Bounds {
    fn hold(&self, found: &Agreement) -> bool {
        found.most <= self.tiles && found.worst <= 2.0 * self.tiles && found.whole.abs() <= self.whole
    }

    /// Whether the bounds are exceeded by more than noise can explain.
    fn fail_clearly(&self, found: &Agreement) -> bool {
        found.most > self.tiles + 3.0 * found.noise || found.whole.abs() > self.whole + 3.0 * found.whole_error
    }
}

/// The tracer's renders.
fn trace(shot: &Shot) -> Tiles {
    let world = World::new(Arc::new(shot.scene.clone())).unwrap();
    let one = |seed: u64| {
        let settings = RenderSettings { samples: shot.samples, seed, max_bounces: BOUNCES, ..Default::default() };
        let done = mateval_tracer::render(&world, &shot.camera, &settings, &|_, _| ()).unwrap();
        assert_eq!(done.stats.not_finite, 0);
        done.picture
    };
    Tiles::of(&(0..SEEDS).map(one).collect::<Vec<_>>())
}

/// Asserts that the shot agrees, that the noise is small enough to decide this, and that none of the twins agrees.
fn assert_agrees(shot: &Shot, theirs: &Tiles, bounds: Bounds, twins: &[Twin]) {
    let found = agreement(&trace(shot), theirs);
    eprintln!("{}: {found:.4?}", shot.name);
    assert!(found.noise <= bounds.tiles / 3.0 && found.whole_error <= bounds.whole / 3.0, "too noisy: {found:?}");
    assert!(bounds.hold(&found), "{}: {found:?}", shot.name);
    for twin in twins {
        let found = agreement(&trace(&twin.of(shot)), theirs);
        eprintln!("    {twin:?}: {found:.4?}");
        assert!(bounds.fail_clearly(&found), "{}: {twin:?} passes: {found:?}", shot.name);
    }
}

/// Faults of a twin. A quarter of the samples suffices to detect them.
#[derive(Clone, Copy, Debug)]
enum Twin {
    /// The other flavour of principled.
    Mitsuba,
    /// Every roughness 0.05 more.
    Rougher,
    /// Every lamp one percent brighter.
    Brighter,
    /// Lamps that the camera sees.
    Seen,
    /// Maps of lamps left to right.
    Turned,
}

impl Twin {
    fn of(self, shot: &Shot) -> Shot {
        let mut scene = shot.scene.clone();
        for material in &mut scene.materials {
            let MaterialModel::Principled { roughness: ScalarInput::Constant(roughness), flavour, .. } =
                &mut material.model
            else {
                continue;
            };
            match self {
                Self::Mitsuba => *flavour = PrincipledFlavour::Mitsuba,
                Self::Rougher => *roughness += 0.05,
                Self::Brighter | Self::Seen | Self::Turned => (),
            }
        }
        for light in &mut scene.lights {
            match (self, &mut light.emission) {
                (Self::Brighter, Emission::Area { radiance, .. }) => *radiance = radiance.map(|r| 1.01 * r),
                (Self::Seen, _) => light.camera_visible = true,
                (Self::Turned, Emission::Area { map: Some(map), .. }) => {
                    map.uv.0 = map.uv.0.map(|[along_u, along_v, shift]| [-along_u, along_v, along_u + shift]);
                }
                _ => (),
            }
        }
        Shot { name: String::new(), scene, camera: shot.camera, samples: shot.samples / 4 }
    }
}

fn principled(base_color: [f32; 3], roughness: f32, metallic: f32) -> Material {
    material(MaterialModel::Principled {
        base_color: ColorInput::Constant(base_color),
        roughness: ScalarInput::Constant(roughness),
        metallic: ScalarInput::Constant(metallic),
        specular: 0.5,
        flavour: PrincipledFlavour::Blender,
    })
}

fn lambert_material(color: [f32; 3]) -> Material {
    material(MaterialModel::Diffuse { reflectance: ColorInput::Constant(color), alpha: None })
}

/// The scene with lamps that emit on both sides, as Blender's do.
fn on_both_sides(mut scene: ReferenceScene) -> ReferenceScene {
    for light in &mut scene.lights {
        if let Emission::Area { two_sided, .. } = &mut light.emission {
            *two_sided = true;
        }
    }
    scene
}

/// A ball between a warm lamp and a cool one, with dim light from all directions.
fn ball(roughness: f32, metallic: f32) -> Shot {
    let warm = quad(Vec3::new(-3.0, 1.5, 0.5), Vec3::Z * 2.0, Vec3::new(1.0, 1.5, 0.0));
    let cool = quad(Vec3::new(2.5, -1.0, -1.0), Vec3::Z * 2.0, Vec3::Y * 2.0);
    let builder = Builder::default()
        .surface(sphere(Vec3::ZERO, 1.0, 96), principled([0.8, 0.5, 0.3], roughness, metallic))
        .surface(warm, grey(0.0))
        .glowing([9.0, 7.0, 5.0])
        .surface(cool, grey(0.0))
        .glowing([2.0, 3.0, 4.0])
        .light(Emission::Constant { radiance: [0.2, 0.25, 0.3] });
    Shot {
        name: format!("ball, roughness {roughness}, metallic {metallic}"),
        scene: on_both_sides(builder.scene()),
        camera: camera([0.0, 0.5, 5.0], [0.0; 3], SIZE as u32, 26.0),
        // Reflections of the lamps in smooth metal are noisier.
        samples: if metallic == 1.0 { 448 } else { 192 },
    }
}

/// A closed room with a shelf, a ball and a floating lamp, whose materials differ only in colour.
fn furnished(name: String, samples: u32, made_of: impl Fn([f32; 3]) -> Material) -> Shot {
    let colors = [[0.7, 0.6, 0.5], [0.8; 3], [0.7, 0.3, 0.2], [0.3, 0.6, 0.3], [0.7; 3], [0.6, 0.7, 0.8]];
    let walls = room().into_iter().zip(colors);
    let shelf = quad(Vec3::new(-0.9, -0.4, -0.5), Vec3::Z * 0.6, Vec3::X * 0.8);
    let lamp = quad(Vec3::new(-0.6, 0.5, -0.6), Vec3::X * 1.2, Vec3::Z * 1.2);
    let builder = walls
        .fold(Builder::default(), |builder, (wall, color)| builder.surface(wall, made_of(color)))
        .surface(sphere(Vec3::new(0.35, -0.6, 0.1), 0.4, 64), made_of([0.8, 0.7, 0.3]))
        .surface(shelf, made_of([0.4, 0.3, 0.6]))
        .surface(lamp, made_of([0.3, 0.5, 0.2]))
        .glowing([4.0, 3.8, 3.5]);
    Shot {
        name: format!("room, {name}"),
        scene: on_both_sides(builder.scene()),
        camera: camera([0.1, -0.1, 0.95], [0.0, -0.5, -0.2], SIZE as u32, 75.0),
        samples,
    }
}

fn principled_room(roughness: f32, metallic: f32, samples: u32) -> Shot {
    let name = format!("roughness {roughness}, metallic {metallic}");
    furnished(name, samples, |color| principled(color, roughness, metallic))
}

/// Lambert everywhere: scenes, cameras, lamps and bounces have the same meaning in both renderers.
#[test]
fn lambert_everywhere() {
    let shot = furnished("Lambert".into(), 768, lambert_material);
    let theirs = blender_job::render(std::slice::from_ref(&shot));
    assert_agrees(&shot, &theirs[0], Bounds { tiles: 0.01, whole: 0.001 }, &[Twin::Brighter]);
}

/// Dielectrics and metals with mostly one bounce: 0.5 %.
#[test]
fn balls() {
    use Twin::{Mitsuba, Rougher};
    let looks: [(f32, f32, &[Twin]); 7] = [
        // Here and at 0.9, 0.05 more roughness changes hardly any tile by 1 %; the same facets in metal show it.
        (0.1, 0.0, &[Mitsuba]),
        (0.5, 0.0, &[Mitsuba, Rougher]),
        (0.9, 0.0, &[Mitsuba]),
        (0.3, 0.5, &[Mitsuba, Rougher]),
        // Smooth metal loses no energy between its facets and has no base, so the flavours are the same.
        (0.1, 1.0, &[Rougher]),
        (0.5, 1.0, &[Mitsuba, Rougher]),
        (0.9, 1.0, &[Mitsuba, Rougher]),
    ];
    let shots = looks.map(|(roughness, metallic, _)| ball(roughness, metallic));
    let theirs = blender_job::render(&shots);
    for ((shot, theirs), (_, _, twins)) in shots.iter().zip(&theirs).zip(looks) {
        assert_agrees(shot, theirs, Bounds { tiles: 0.005, whole: 0.002 }, twins);
    }
}

/// Dielectrics with sixteen bounces: 1 %.
#[test]
fn dielectric_rooms() {
    let shots = [0.1, 0.5, 0.9].map(|roughness| principled_room(roughness, 0.0, 512));
    for (shot, theirs) in shots.iter().zip(blender_job::render(&shots)) {
        assert_agrees(shot, &theirs, Bounds { tiles: 0.01, whole: 0.002 }, &[Twin::Mitsuba]);
    }
}

/// Metals with sixteen bounces: 3 %.
#[test]
fn metal_rooms() {
    let shots = [(0.1, 256), (0.5, 128), (0.9, 128)].map(|(roughness, n)| principled_room(roughness, 1.0, n));
    for (shot, theirs) in shots.iter().zip(blender_job::render(&shots)) {
        assert_agrees(shot, &theirs, Bounds { tiles: 0.03, whole: 0.004 }, &[Twin::Rougher]);
    }
}

/// A lamp as BlenderProc makes them: camera rays see a surface, all other rays see only light.
#[test]
fn lamp_hidden_from_the_camera() {
    let mut shot = principled_room(0.5, 0.0, 512);
    shot.name = "room whose lamp is hidden from the camera".into();
    shot.scene.lights[0].camera_visible = false;
    shot.camera = camera([0.1, 0.1, 0.95], [0.0, 0.1, -0.4], SIZE as u32, 75.0);
    let theirs = blender_job::render(std::slice::from_ref(&shot));
    assert_agrees(&shot, &theirs[0], Bounds { tiles: 0.01, whole: 0.002 }, &[Twin::Seen]);
}

/// A lamp of many colours whose radiance is a factor times a texture, hidden from the camera as BlenderProc's, and
/// visible.
#[test]
fn lamps_with_a_map() {
    let shots = [true, false].map(|hidden| {
        let mut shot = principled_room(0.5, 0.0, 512);
        shot.name = format!("room whose lamp has a map, {}", if hidden { "hidden from the camera" } else { "seen" });
        let texels = (0..20).map(|k| [12 * k, 255 - 12 * k, 40 + 53 * k % 199].map(|v| v as u8)).collect();
        let texture = Texture::new(5, 4, Texels::Srgb8(texels), Wrap::Repeat).unwrap();
        let uv = UvTransform([[0.9, 0.2, -0.3], [-0.4, 1.3, 0.6]]);
        let mut scene = Builder::from(shot.scene).mapped(texture, uv).scene();
        let group = &mut scene.lights[0];
        let Emission::Area { radiance, .. } = &mut group.emission else { unreachable!("the room has one lamp") };
        (*radiance, group.camera_visible) = ([7.0; 3], !hidden);
        shot.camera = camera([0.1, 0.1, 0.95], [0.0, 0.1, -0.4], SIZE as u32, 75.0);
        Shot { scene, ..shot }
    });
    for (shot, theirs) in shots.iter().zip(blender_job::render(&shots)) {
        assert_agrees(shot, &theirs, Bounds { tiles: 0.01, whole: 0.002 }, &[Twin::Turned, Twin::Brighter]);
    }
}
