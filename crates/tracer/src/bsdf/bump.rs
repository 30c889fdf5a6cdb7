//! Bump mapping: tilts the shading normal by the slope of a height texture.
//!
//! Blinn, "Simulation of Wrinkled Surfaces" (1978), without the surface's own curvature: the tangents dp/du and dp/dv
//! are raised along the normal by the slope of the height, and their cross product is the new normal.

use glam::{Vec2, Vec3};
use mateval_image::Texture;
use mateval_scene::TriangleMesh;
use mateval_scene::material::{BumpMap, ScalarInput};

use crate::ray::SurfaceHit;

/// The bumped normal, on the side of `hit.shading_normal`. The shading normal itself if the mesh has no usable uv.
pub(crate) fn bumped_normal(bump: &BumpMap, textures: &[Texture], mesh: &TriangleMesh, hit: &SurfaceHit) -> Vec3 {
    let normal = hit.shading_normal;
    let Some([dp_du, dp_dv]) = tangents(mesh, hit.triangle.0) else { return normal };
    let slope = slope(&bump.height, textures, hit.uv) * bump.scale;
    let raised = |tangent: Vec3, slope: f32| tangent + normal * (slope - normal.dot(tangent));
    let bent = raised(dp_du, slope.x).cross(raised(dp_dv, slope.y)).normalize_or(normal);
    let bent = if bent.dot(normal) < 0.0 { -bent } else { bent };
    if bent.is_finite() { bent } else { normal }
}

/// The derivatives of the position by u and by v over the triangle, in metres.
fn tangents(mesh: &TriangleMesh, triangle: usize) -> Option<[Vec3; 2]> {
    let uvs = mesh.uvs.as_ref()?;
    let [a, b, c] = mesh.corners(triangle);
    let [ta, tb, tc] = mesh.triangles[triangle].map(|vertex| uvs[vertex as usize]);
    let (e1, e2, d1, d2) = (b - a, c - a, tb - ta, tc - ta);
    let area = d1.x * d2.y - d1.y * d2.x;
    let tangents = [(e1 * d2.y - e2 * d1.y) / area, (e2 * d1.x - e1 * d2.x) / area];
    tangents.iter().all(|t| t.is_finite()).then_some(tangents)
}

/// The derivatives of the height by the surface's u and v. As in Mitsuba, this is the slope of the bilinear lookup
/// itself, which jumps from texel to texel.
fn slope(height: &ScalarInput, textures: &[Texture], uv: Vec2) -> Vec2 {
    let ScalarInput::Texture { texture, channel, uv: transform } = height else { return Vec2::ZERO };
    let map = &textures[texture.0];
    let at = transform.apply(uv);
    let value = |uv: Vec2| map.sample(uv.to_array())[*channel];
    let (width, height) = (map.width() as f32, map.height() as f32);
    // Derivatives by the texture's own uv, then by the chain rule.
    let [left, right] = centres_around(at.x, width);
    let du = (value(Vec2::new(right, at.y)) - value(Vec2::new(left, at.y))) * width;
    let [below, above] = centres_around(at.y, height);
    let dv = (value(Vec2::new(at.x, above)) - value(Vec2::new(at.x, below))) * height;
    let rows = &transform.0;
    Vec2::new(du * rows[0][0] + dv * rows[1][0], du * rows[0][1] + dv * rows[1][1])
}

/// The centres of the two texels around a coordinate, for `count` texels between 0 and 1.
fn centres_around(at: f32, count: f32) -> [f32; 2] {
    let lower = (at * count - 0.5).floor();
    [(lower + 0.5) / count, (lower + 1.5) / count]
}

#[cfg(test)]
mod tests {
    use mateval_image::{Texels, Wrap};
    use mateval_scene::material::{TextureIndex, UvTransform};
    use mateval_scene::reference::SurfaceIndex;

    use super::*;
    use crate::ray::TriangleIndex;
    use crate::ray::TriangleRecord;

    /// Heights rise by 1 m over the texture, which covers 2 m of a square: a slope of one half. If the texture is
    /// repeated twice, the slope doubles; if it is turned by a quarter, the slope runs along v.
    #[test]
    fn a_ramp_tilts_the_normal_by_its_slope() {
        let ramp = (0..16 * 16).map(|k| (k % 16) as f32 / 16.0).collect();
        let textures = [Texture::new(16, 16, Texels::Grey(ramp), Wrap::Repeat).unwrap()];
        let mesh = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X * 2.0, Vec3::new(2.0, 2.0, 0.0)],
            normals: None,
            uvs: Some(vec![Vec2::ZERO, Vec2::X, Vec2::ONE]),
            triangles: vec![[0, 1, 2]],
        };
        let bent = |uv: [[f32; 3]; 2], scale: f32| {
            let height = ScalarInput::Texture { texture: TextureIndex(0), channel: 0, uv: UvTransform(uv) };
            let record = TriangleRecord::new(&mesh, TriangleIndex(0), 2.0);
            let weights = Vec3::new(0.45, 0.25, 0.3);
            let hit = SurfaceHit::new(SurfaceIndex(0), TriangleIndex(0), &record, weights);
            bumped_normal(&BumpMap { height, scale }, &textures, &mesh, &hit)
        };
        let straight = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let is = |found: Vec3, expected: Vec3| assert!((found - expected.normalize()).length() < 1e-5, "{found}");
        is(bent(straight, 1.0), Vec3::new(-0.5, 0.0, 1.0));
        is(bent(straight, -3.0), Vec3::new(1.5, 0.0, 1.0));
        is(bent([[2.0, 0.0, 0.2], [0.0, 1.0, 0.0]], 1.0), Vec3::new(-1.0, 0.0, 1.0));
        is(bent([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], 1.0), Vec3::new(0.0, -0.5, 1.0));
        is(bent(straight, 0.0), Vec3::Z);
    }

    /// The slope is that of the interpolated heights at the very point: zero between two equal texels, the whole step
    /// between two that differ. A difference over a wider range would mix them.
    #[test]
    fn the_slope_jumps_at_texel_centres() {
        let textures = [Texture::new(4, 1, Texels::Grey(vec![0.0, 0.0, 1.0, 1.0]), Wrap::Clamp).unwrap()];
        let height = ScalarInput::Texture { texture: TextureIndex(0), channel: 0, uv: UvTransform::default() };
        let at = |u: f32| slope(&height, &textures, Vec2::new(u, 0.5)).x;
        for (u, expected) in [(0.2, 0.0), (0.36, 0.0), (0.39, 4.0), (0.61, 4.0), (0.64, 0.0), (0.05, 0.0)] {
            assert!((at(u) - expected).abs() < 1e-4, "{u}: {}", at(u));
        }
    }
}
