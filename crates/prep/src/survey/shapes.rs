//! Simple meshes for tests of furniture that intersects.

use glam::Vec3;
use mateval_scene::TriangleMesh;

/// A block with its faces along the axes.
pub(super) fn block(middle: Vec3, size: Vec3) -> TriangleMesh {
    let corner = |k: u32| middle + (Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32) - 0.5) * size;
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    TriangleMesh {
        positions: (0..8).map(corner).collect(),
        triangles: faces.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]).collect(),
        ..Default::default()
    }
}

/// Blocks from their lowest to their highest corners, as one mesh.
pub(super) fn blocks(corners: &[[[f32; 3]; 2]]) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for [low, high] in corners.iter().map(|pair| pair.map(Vec3::from_array)) {
        mesh.append(&block((low + high) / 2.0, high - low));
    }
    mesh
}

/// The mesh, moved.
pub(super) fn moved(mut mesh: TriangleMesh, by: Vec3) -> TriangleMesh {
    mesh.positions.iter_mut().for_each(|position| *position += by);
    mesh
}

/// A table of 1.6 by 0.9 m, 0.75 m high, with its middle at the origin: a top of 3 cm and four legs.
pub(super) fn table() -> TriangleMesh {
    let mut corners = vec![[[-0.8, 0.72, -0.45], [0.8, 0.75, 0.45]]];
    for (x, z) in [(-0.78, -0.43), (0.73, -0.43), (-0.78, 0.38), (0.73, 0.38)] {
        corners.push([[x, 0.0, z], [x + 0.05, 0.72, z + 0.05]]);
    }
    blocks(&corners)
}

/// A chair of 45 by 45 cm that faces -Z: a seat at 45 cm, four legs, and a back that is 90 cm high, at z from 0.19 to 0.22.
pub(super) fn chair() -> TriangleMesh {
    let mut corners = vec![[[-0.22, 0.42, -0.22], [0.22, 0.46, 0.22]], [[-0.22, 0.46, 0.19], [0.22, 0.9, 0.22]]];
    for (x, z) in [(-0.22, -0.22), (0.18, -0.22), (-0.22, 0.18), (0.18, 0.18)] {
        corners.push([[x, 0.0, z], [x + 0.04, 0.42, z + 0.04]]);
    }
    blocks(&corners)
}

/// A wardrobe of 1 by 2 by 0.6 m made of boards of 2 cm, hollow; its front, at z = 0.3, is closed.
pub(super) fn wardrobe_of_boards() -> TriangleMesh {
    blocks(&[
        [[-0.5, 0.0, -0.3], [0.5, 0.02, 0.3]],
        [[-0.5, 1.98, -0.3], [0.5, 2.0, 0.3]],
        [[-0.5, 0.02, -0.3], [-0.48, 1.98, 0.3]],
        [[0.48, 0.02, -0.3], [0.5, 1.98, 0.3]],
        [[-0.48, 0.02, -0.3], [0.48, 1.98, -0.28]],
        [[-0.48, 0.02, 0.28], [0.48, 1.98, 0.3]],
    ])
}

/// A sphere of triangles whose edges are about two centimetres long for a radius of 0.3 m.
pub(super) fn ball(middle: Vec3, radius: f32) -> TriangleMesh {
    const SIDES: u32 = 96;
    let mut mesh = TriangleMesh::default();
    for ring in 0..=SIDES / 2 {
        for side in 0..SIDES {
            let (up, around) = (f64::from(ring) / f64::from(SIDES / 2), f64::from(side) / f64::from(SIDES));
            let ((sin, cos), (s, c)) =
                (libm::sincos(up * std::f64::consts::PI), libm::sincos(around * std::f64::consts::TAU));
            let out = glam::DVec3::new(sin * c, cos, sin * s).as_vec3();
            mesh.positions.push(middle + out * radius);
            if ring > 0 {
                let [here, next] = [side, (side + 1) % SIDES].map(|side| ring * SIDES + side);
                mesh.triangles.extend([[here, next, here - SIDES], [next, next - SIDES, here - SIDES]]);
            }
        }
    }
    mesh
}
