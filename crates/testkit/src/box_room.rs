//! A closed room of 4 x 2.5 x 6 metres, and a camera in it.

use glam::{DVec3, Vec2, Vec3};
use mateval_scene::material::{ColorInput, Material, MaterialModel};
use mateval_scene::reference::{MaterialIndex, ReferenceScene, Surface};
use mateval_scene::{Camera, Intrinsics, TriangleMesh};

/// The four walls among the room's surfaces; added meshes come after them.
pub const WALLS: [usize; 4] = [2, 3, 4, 5];

/// A parallelogram.
pub fn quad(corner: [f32; 3], u: [f32; 3], v: [f32; 3]) -> TriangleMesh {
    let (corner, u, v) = (Vec3::from(corner), Vec3::from(u), Vec3::from(v));
    TriangleMesh {
        positions: vec![corner, corner + u, corner + u + v, corner + v],
        uvs: Some(vec![Vec2::ZERO; 4]),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Default::default()
    }
}

/// Floor, ceiling, walls at x = 0 and 4 and at z = 0 and 6, then `more`; all of one grey.
pub fn box_room(more: Vec<TriangleMesh>) -> ReferenceScene {
    let [x, y, z] = [[4.0, 0.0, 0.0], [0.0, 2.5, 0.0], [0.0, 0.0, 6.0]];
    let mut meshes = vec![
        quad([0.0; 3], x, z),
        quad([0.0, 2.5, 0.0], x, z),
        quad([0.0; 3], y, z),
        quad([4.0, 0.0, 0.0], y, z),
        quad([0.0; 3], x, y),
        quad([0.0, 0.0, 6.0], x, y),
    ];
    meshes.extend(more);
    let model = MaterialModel::Diffuse { reflectance: ColorInput::Constant([0.5; 3]), alpha: None };
    let material = Material { name: String::new(), model, two_sided: true, opacity: None, bump: None };
    let surface = |mesh| Surface { name: String::new(), mesh, material: MaterialIndex(0) };
    ReferenceScene {
        surfaces: meshes.into_iter().map(surface).collect(),
        materials: vec![material],
        ..Default::default()
    }
}

/// At the back of the room, looking along -z to the far wall, 60 degrees wide.
pub fn camera() -> Camera {
    let intrinsics = Intrinsics::from_fov_x(320, 180, 60_f64.to_radians());
    Camera::look_at(DVec3::new(2.0, 1.2, 5.5), DVec3::new(2.0, 1.2, 0.0), DVec3::Y, intrinsics)
        .expect("the camera looks along an axis")
}
