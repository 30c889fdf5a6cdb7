//! Finds the painted shadow under a 3D-FUTURE model.
//!
//! Of the models of later releases 11 % contain a few horizontal triangles at their lowest height, across the whole
//! footprint, whose texels are black and translucent: a picture of a shadow. Placed on a floor they lie in it exactly. Read
//! as a surface, they are a black sheet, or speckles, depending on the renderer.

use glam::{Vec2, Vec3};
use mateval_image::Texture;
use mateval_scene::TriangleMesh;

/// The largest height above the model's lowest point, in metres. Models stand on y = 0 to within 4 mm, and their shadows are
/// lower than all else.
const LEVEL_M: f32 = 1e-3;
/// The smallest share of the footprint of everything else that the shadow covers. Shadows of the data cover all of it, and
/// feet a tenth.
const LEAST_COVER: f64 = 0.5;
/// Texels with no larger value in any channel, of 0 to 1 in the file, are black. Those of the data are 0.
const BLACK: f32 = 4.0 / 255.0;
/// Texels with no larger opacity are translucent. Those of the data have up to 193 of 255.
const TRANSLUCENT: f32 = 200.0 / 255.0;
/// The least mean opacity. Texels without any are an unused part of the texture, or a texture whose opacity says nothing.
const LEAST_OPACITY: f32 = 1.0 / 255.0;
/// The share of places that must be black and translucent; the others may lie on the border of a neighbouring field.
const LEAST_SHARE: f32 = 0.95;
/// Places looked at on each side of a triangle.
const PLACES: usize = 32;

/// The triangles of `mesh`, in metres with +y up, that are a painted shadow; none in most models.
///
/// `texels` holds the colours of the model's texture as its file states them, 0 to 1, and `opacity` its opacity.
pub(super) fn triangles(mesh: &TriangleMesh, texels: &Texture, opacity: &Texture) -> Vec<usize> {
    let Some(uvs) = &mesh.uvs else { return Vec::new() };
    let candidates = candidates(mesh);
    let is_shadow = |triangle: &usize| {
        let corners = mesh.triangles[*triangle].map(|vertex| uvs[vertex as usize]);
        is_painted_shadow(corners, texels, opacity)
    };
    let shadow: Vec<usize> = candidates.into_iter().filter(is_shadow).collect();
    if covers(mesh, &shadow) { shadow } else { Vec::new() }
}

/// Whether a model has flat triangles at its lowest height that could be a shadow, whatever its texture shows.
pub(super) fn is_possible(mesh: &TriangleMesh) -> bool {
    mesh.uvs.is_some() && covers(mesh, &candidates(mesh))
}

/// The horizontal triangles at the model's lowest height.
fn candidates(mesh: &TriangleMesh) -> Vec<usize> {
    let all = || (0..mesh.triangles.len()).map(|triangle| (triangle, mesh.corners(triangle)));
    let lowest = all().flat_map(|(_, corners)| corners).fold(f32::INFINITY, |low, corner| low.min(corner.y));
    let is_lowest = |corners: &[Vec3; 3]| corners.iter().all(|corner| corner.y <= lowest + LEVEL_M);
    all().filter(|(_, corners)| is_lowest(corners)).map(|(triangle, _)| triangle).collect()
}

/// Whether these triangles, seen from above, cover enough of the footprint of all others.
fn covers(mesh: &TriangleMesh, chosen: &[usize]) -> bool {
    let (mut low, mut high) = (Vec2::INFINITY, Vec2::NEG_INFINITY);
    // Both are sorted.
    let others = (0..mesh.triangles.len()).filter(|triangle| chosen.binary_search(triangle).is_err());
    for corner in others.flat_map(|triangle| mesh.corners(triangle)) {
        let place = Vec2::new(corner.x, corner.z);
        (low, high) = (low.min(place), high.max(place));
    }
    let size = (high - low).as_dvec2();
    let area = |triangle: &usize| {
        let [a, b, c] = mesh.corners(*triangle).map(|corner| Vec2::new(corner.x, corner.z).as_dvec2());
        ((b - a).perp_dot(c - a) / 2.0).abs()
    };
    // A model of nothing but flat triangles has no footprint, and no shadow.
    size.is_finite() && chosen.iter().map(area).sum::<f64>() >= LEAST_COVER * size.x * size.y && !chosen.is_empty()
}

/// Whether the texels below a triangle are a picture of a shadow.
fn is_painted_shadow([a, b, c]: [Vec2; 3], texels: &Texture, opacity: &Texture) -> bool {
    let (mut shadowy, mut places, mut sum) = (0, 0, 0.0);
    for row in 0..PLACES {
        for column in 0..PLACES - row {
            let along = |step: usize| (step as f32 + 1.0 / 3.0) / PLACES as f32;
            let uv = a + (b - a) * along(column) + (c - a) * along(row);
            let [color, [alpha, ..]] = [texels, opacity].map(|texture| nearest(texture, uv));
            shadowy += usize::from(color.iter().all(|v| *v <= BLACK) && alpha <= TRANSLUCENT);
            sum += alpha;
            places += 1;
        }
    }
    let places = places as f32;
    shadowy as f32 >= LEAST_SHARE * places && sum >= LEAST_OPACITY * places
}

/// The texel at a place of a texture that repeats, v upwards.
fn nearest(texture: &Texture, uv: Vec2) -> [f32; 3] {
    let at = |coordinate: f32, count: usize| ((coordinate.rem_euclid(1.0) * count as f32) as usize).min(count - 1);
    texture.texel(at(uv.x, texture.width()), at(1.0 - uv.y, texture.height()))
}

#[cfg(test)]
mod tests {
    use mateval_image::{Texels, Wrap};

    use super::*;

    /// A box from 10 to 50 cm above a horizontal square of `side` at `height`, with the texture's left half on the box and
    /// the right half on the square.
    fn boxed(side: f32, height: f32) -> TriangleMesh {
        let corner = |x: f32, y: f32, z: f32| Vec3::new(x - 0.5, y, z - 0.5);
        let mut positions = Vec::new();
        for y in [0.1, 0.5] {
            positions.extend([corner(0.0, y, 0.0), corner(1.0, y, 0.0), corner(1.0, y, 1.0), corner(0.0, y, 1.0)]);
        }
        let flat = |x: f32, z: f32| Vec3::new((x - 0.5) * side, height, (z - 0.5) * side);
        positions.extend([flat(0.0, 0.0), flat(1.0, 0.0), flat(1.0, 1.0), flat(0.0, 1.0)]);
        let uv = |u: f32, v: f32| Vec2::new(u, v);
        let mut uvs = [[uv(0.1, 0.1), uv(0.4, 0.1), uv(0.4, 0.9), uv(0.1, 0.9)]; 2].concat();
        uvs.extend([uv(0.6, 0.1), uv(0.9, 0.1), uv(0.9, 0.9), uv(0.6, 0.9)]);
        let quads =
            [[0, 1, 2, 3], [4, 7, 6, 5], [0, 4, 5, 1], [1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 4, 0], [8, 11, 10, 9]];
        let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        TriangleMesh { positions, normals: None, uvs: Some(uvs), triangles }
    }

    /// The triangles found under a texture whose right half has this grey and this opacity, in bytes.
    fn found(mesh: &TriangleMesh, grey: u8, opacity: impl Fn(usize) -> u8) -> Vec<usize> {
        let texture = |right: &dyn Fn(usize) -> u8, left: u8| {
            let texel = |at: usize| if at % 64 < 32 { left } else { right(at) };
            Texture::new(64, 64, Texels::Grey8((0..64 * 64).map(texel).collect()), Wrap::Repeat).unwrap()
        };
        triangles(mesh, &texture(&|_| grey, 90), &texture(&opacity, 255))
    }

    #[test]
    fn a_painted_shadow_is_found() {
        for (side, height) in [(1.0, 0.0), (1.3, 0.0), (0.8, 0.0996), (1.0, -0.004)] {
            let mesh = boxed(side, height);
            assert!(is_possible(&mesh));
            assert_eq!(found(&mesh, 0, |_| 45), [12, 13], "{side} {height}");
            // Soft: transparent at one end, 193 of 255 at the other.
            assert_eq!(found(&mesh, 0, |at| (at / 64 * 3) as u8), [12, 13]);
        }
    }

    #[test]
    fn other_flat_bases_stay() {
        let mesh = boxed(1.0, 0.0);
        assert_eq!(found(&mesh, 0, |_| 255), [0; 0], "black and opaque");
        assert_eq!(found(&mesh, 20, |_| 45), [0; 0], "dark grey");
        assert_eq!(found(&mesh, 0, |_| 0), [0; 0], "an opacity of 0 says nothing");
        assert_eq!(found(&boxed(0.6, 0.0), 0, |_| 45), [0; 0], "smaller than half the footprint");
        assert_eq!(found(&boxed(1.0, 0.2), 0, |_| 45), [0; 0], "a shelf");
        let alone = mesh.picked(|triangle| triangle >= 12);
        assert_eq!(found(&alone, 0, |_| 45), [0; 0], "nothing stands on it");
        let plain = TriangleMesh { uvs: None, ..mesh };
        assert!(!is_possible(&plain));
    }
}
