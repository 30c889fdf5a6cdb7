//! Pictures have the same bytes for any number of threads, with either instruction set, in every build and on every
//! machine.
//!
//! `tools/test_builds.sh`, run by hand, tests that the optimised build renders these bytes too.

use std::sync::Arc;

use mateval_image::{LinearRgb, Picture};
use mateval_scene::TriangleMesh;
use mateval_scene::reference::ReferenceScene;
use mateval_tracer::accel::{Accel, InstructionSet};
use mateval_tracer::{LightGroups, RenderSettings, World, render, render_views};
use sha2::{Digest, Sha256};

use super::estimators;

/// Hashes of a picture with every kind of material and light, and of two views of it from one set of paths, per light.
/// They change with anything that pictures depend on. The pictures of a release then change too, and the change must be
/// announced.
const RENDER: &str = "7030fec4b6f69e72023caa36de744f290dafebb940d31bfa7ebafa8cc30e1a8e";
const VIEWS: &str = "ab22777263eb0106adc1bb49d0ff691a4030cc52042ca3871fca25575d90e58f";

fn hash<'a>(pictures: impl IntoIterator<Item = &'a Picture<LinearRgb>>) -> String {
    let mut hasher = Sha256::new();
    for value in pictures.into_iter().flat_map(|picture| picture.pixels()).flat_map(|pixel| pixel.0) {
        hasher.update(value.to_le_bytes());
    }
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Both hashes of a world, rendered by `threads` threads.
fn hashes(world: &World, threads: usize) -> [String; 2] {
    let settings = RenderSettings { samples: 4, seed: 3, ..Default::default() };
    let views = [estimators::view(), estimators::view().turned(5.0, -5.0)];
    let groups = LightGroups::apart(world.scene().lights.len());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let (picture, views) = pool.install(|| {
        let picture = render(world, &views[0], &settings, &|_, _| ()).unwrap().picture;
        (picture, render_views(world, &views, &groups, &settings, &[4, 5], &|_, _| ()).unwrap().views)
    });
    let halves = views.iter().flat_map(|view| &view.halves);
    [hash([&picture]), hash(halves.flat_map(|half| half.basis.pictures()))]
}

/// The scene with a hierarchy that uses the given instructions, or `None` if the machine lacks them.
fn world(scene: &Arc<ReferenceScene>, instructions: InstructionSet) -> Option<World> {
    let meshes: Vec<&TriangleMesh> = scene.surfaces.iter().map(|surface| &surface.mesh).collect();
    let accel = Accel::build(&meshes).unwrap().with_instructions(instructions)?;
    Some(World::sharing(scene.clone(), Arc::new(accel)).unwrap())
}

#[test]
fn pictures_are_those_stored() {
    let scene = Arc::new(estimators::scene(1.0));
    for instructions in [InstructionSet::Avx2, InstructionSet::Portable] {
        let Some(world) = world(&scene, instructions) else {
            mateval_testkit::data::say_skipped(&format!("this machine has no {instructions:?}"));
            continue;
        };
        for threads in [1, 2, 7] {
            assert_eq!(hashes(&world, threads), [RENDER, VIEWS], "{instructions:?}, {threads} threads");
        }
    }
}

/// Another seed, or a light brighter by a millionth, gives another picture.
#[test]
fn what_changes_a_picture_changes_its_hash() {
    let picture = |brightness, seed| {
        let world = World::new(Arc::new(estimators::scene(brightness))).unwrap();
        let settings = RenderSettings { samples: 4, seed, ..Default::default() };
        hash([&render(&world, &estimators::view(), &settings, &|_, _| ()).unwrap().picture])
    };
    assert_ne!(picture(1.0, 3), picture(1.0, 4));
    assert_ne!(picture(1.0, 3), picture(1.000_001, 3));
}
