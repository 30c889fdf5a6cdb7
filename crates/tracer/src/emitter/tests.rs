//! Emitters are found with the density with which they are sampled.

use mateval_scene::TriangleMesh;
use mateval_scene::reference::{LightGroup, MaterialIndex, Surface};

use super::*;

fn triangle(at: Vec3, size: f32) -> Surface {
    let positions = vec![at, at + Vec3::X * size, at + Vec3::Y * size];
    let mesh = TriangleMesh { positions, triangles: vec![[0, 1, 2]], ..Default::default() };
    Surface { name: String::new(), mesh, material: MaterialIndex(0) }
}

fn emitters(surfaces: usize, distant: bool) -> (ReferenceScene, Emitters) {
    let mut scene = ReferenceScene::default();
    let mut light = |emission: Emission| {
        scene.lights.push(LightGroup { name: String::new(), emission, camera_visible: true });
    };
    for k in 0..surfaces {
        let surfaces = vec![SurfaceIndex(k)];
        light(Emission::Area { surfaces, radiance: [1.0; 3], map: None, two_sided: k % 2 == 0 });
    }
    if distant {
        light(Emission::Constant { radiance: [1.0; 3] });
        light(Emission::Constant { radiance: [2.0; 3] });
    }
    let place = |k: usize| triangle(Vec3::new(k as f32 - 2.0, 0.3 * k as f32, -3.0), 0.2 + 0.2 * k as f32);
    scene.surfaces = (0..surfaces).map(place).collect();
    let emitters = Emitters::new(&scene, &[], 5.0).unwrap();
    (scene, emitters)
}

/// The density of a sample equals the density reported when the same light is met by chance, for all mixes of
/// emitters, whether surfaces are sampled one by one or by group.
#[test]
fn sampled_and_found_densities_agree() {
    for (surfaces, distant) in [(1, false), (5, false), (5, true), (70, true), (0, true)] {
        let (scene, emitters) = emitters(surfaces, distant);
        let from = Vec3::new(0.2, -0.1, 0.5);
        let shares: Vec<f64> = (0..scene.lights.len()).map(|light| 1.0 + light as f64).collect();
        for emitters in [emitters.with_group_shares(&[from, Vec3::ZERO], &shares), emitters] {
            let mut lights = std::collections::BTreeSet::new();
            for index in 0..2000 {
                let [a, b, c, _] = sobol_burley::sample_4d(index, 0, 3);
                let Some(sample) = emitters.sample(from, [a, b, c], |_| 1.0) else { continue };
                let found = match &sample.place {
                    Some(place) => emitters.emitted(place, from).unwrap(),
                    None => emitters.from_outside(sample.direction).find(|f| f.light == sample.light).unwrap(),
                };
                assert!((found.density / sample.density - 1.0).abs() < 1e-3, "{surfaces} {sample:?} {found:?}");
                assert_eq!((found.light, found.radiance), (sample.light, sample.radiance));
                lights.insert(sample.light.0);
            }
            // Of many emitters, some are too small to be found.
            assert!(lights.len() == scene.lights.len() || (surfaces == 70 && lights.len() > 60), "{}", lights.len());
        }
    }
}

#[test]
fn no_emitters_give_no_light() {
    let (_, emitters) = emitters(0, false);
    assert!(emitters.sample(Vec3::ZERO, [0.5; 3], |_| 1.0).is_none());
    assert_eq!(emitters.from_outside(Vec3::X).count(), 0);
}
