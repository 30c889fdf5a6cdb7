//! Writes lights: surfaces that emit, and the light from outside.
//!
//! Mitsuba finds places on a textured light by their uv, so these must be injective.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec2, Vec2};
use mateval_dataset::TriangleMesh;
use mateval_dataset::reference::{Emission, LightGroup, ReferenceScene, Surface, SurfaceIndex};
use mateval_image::exr_io::{self, Precision};
use mateval_image::{ImageError, LinearRgb, Picture, Texture};

use super::materials::radiance_map;
use super::xml::{Element, Remarks};

/// The emission of a surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Glow {
    /// The shape's emitter, which emits from the shape's front.
    pub(super) element: Element,
    /// Whether the back emits too.
    pub(super) two_sided: bool,
}

/// The emission of every surface that emits. Emission maps are written to files below `folder`.
pub(super) fn glows(
    folder: &Path,
    scene: &ReferenceScene,
    textures: &[Texture],
    remarks: &mut Remarks,
) -> Result<BTreeMap<SurfaceIndex, Glow>, ImageError> {
    let mut glows = BTreeMap::new();
    for (index, group) in scene.lights.iter().enumerate() {
        let place = place(index, group);
        if !group.camera_visible {
            let message = "Mitsuba cannot hide a light from the camera alone";
            remarks.warn("camera_invisible", &place, message, "wrote it visible");
        }
        let Emission::Area { surfaces, radiance, map, two_sided } = &group.emission else { continue };
        let bitmap = match map.filter(|map| needs_map(&textures[map.texture.0], radiance)) {
            Some(map) => Some(radiance_map(folder, index, &textures[map.texture.0], &map.uv, *radiance)?),
            None => None,
        };
        // A mesh without uv looks up the map at a single place.
        let constant = map.map_or(*radiance, |map| product(radiance, &map.at(textures, Vec2::ZERO)));
        for surface in surfaces {
            let Surface { mesh, material, .. } = &scene.surfaces[surface.0];
            let area = Element::plugin("emitter", "area");
            let element = match &bitmap {
                Some(bitmap) if mesh.uvs.is_some() => {
                    remark_folds(mesh, &place, remarks);
                    area.child(bitmap.clone())
                }
                _ => area.rgb("radiance", constant),
            };
            glows.insert(*surface, Glow { element, two_sided: *two_sided });
            if scene.materials[material.0].opacity.is_some() {
                let message = "a masked surface emits; in Mitsuba its transparent places emit too";
                remarks.warn("masked_light", &place, message, "wrote it as it is");
            }
        }
    }
    Ok(glows)
}

fn remark_folds(mesh: &TriangleMesh, place: &str, remarks: &mut Remarks) {
    if !is_unfolded(mesh) {
        let message = "the uv of a textured light overlap or leave 0..1; Mitsuba finds places on the light by their uv";
        remarks.warn("folded_light", place, message, "wrote it as it is; Mitsuba renders it wrongly");
    }
}

/// Whether the light needs a map: it has several texels, and is not black, which Mitsuba could not sample.
fn needs_map(texture: &Texture, radiance: &[f32; 3]) -> bool {
    let (width, height) = (texture.width(), texture.height());
    let mut texels = (0..width * height).map(|k| texture.texel(k % width, k / width));
    width * height > 1 && texels.any(|texel| product(radiance, &texel).iter().any(|v| *v > 0.0))
}

fn product(a: &[f32; 3], b: &[f32; 3]) -> [f32; 3] {
    std::array::from_fn(|c| a[c] * b[c])
}

/// The light from infinitely far away. Mitsuba supports one.
pub(super) fn distant(
    folder: &Path,
    scene: &ReferenceScene,
    textures: &[Texture],
    remarks: &mut Remarks,
) -> Result<Option<Element>, ImageError> {
    let mut found = None;
    for (index, group) in scene.lights.iter().enumerate() {
        let is_area = matches!(group.emission, Emission::Area { .. });
        if !is_area && found.is_some() {
            let message = "this is the second light from outside; Mitsuba takes one";
            remarks.warn("second_environment", &place(index, group), message, "left it out");
            continue;
        }
        match &group.emission {
            Emission::Area { .. } => {}
            Emission::Constant { radiance } => {
                found = Some(Element::plugin("emitter", "constant").rgb("radiance", *radiance));
            }
            Emission::Environment { texture, scale, world_from_environment } => {
                let picture = stretched(&textures[texture.0]);
                exr_io::write_linear(&folder.join("textures/environment.exr"), &picture, Precision::Float)?;
                let rows = world_from_environment.map(|[a, b, c]| [a.into(), b.into(), c.into(), 0.0]);
                let emitter = Element::plugin("emitter", "envmap")
                    .string("filename", "textures/environment.exr")
                    .float("scale", *scale)
                    .matrix("to_world", [rows[0], rows[1], rows[2], [0.0, 0.0, 0.0, 1.0]]);
                found = Some(emitter);
            }
        }
    }
    Ok(found)
}

fn place(index: usize, group: &LightGroup) -> String {
    format!("light {index} '{}'", group.name)
}

/// The map resampled for Mitsuba 3, which looks it up in another way: its row i lies at i / (rows - 1) of the way from
/// pole to pole, ours at (i + 0.5) / rows. With 2 * rows + 1 rows, ours become the odd ones. The even ones lie halfway
/// between them, or repeat the nearest row at the poles, where our lookup clamps. Linear interpolation then gives the
/// same values everywhere.
fn stretched(texture: &Texture) -> Picture<LinearRgb> {
    let (width, height) = (texture.width(), texture.height());
    // Mitsuba requires at least two columns.
    Picture::from_fn(width.max(2), 2 * height + 1, |x, y| {
        let x = x % width;
        let above = texture.texel(x, (y.max(1) - 1) / 2);
        let below = texture.texel(x, (y / 2).min(height - 1));
        LinearRgb(std::array::from_fn(|c| 0.5 * (above[c] + below[c])))
    })
}

/// How far triangles may overlap by rounding, in uv.
const SLACK: f64 = 1e-6;

/// Whether every place of the mesh has its own uv within 0..1: triangles lie in the unit square, have area there, and
/// do not overlap. Triangles without area in the world do not count.
pub(super) fn is_unfolded(mesh: &TriangleMesh) -> bool {
    let Some(uvs) = &mesh.uvs else { return false };
    let has_area = |triangle: &usize| {
        let [a, b, c] = mesh.corners(*triangle).map(|corner| corner.as_dvec3());
        (b - a).cross(c - a).length_squared() > 0.0
    };
    let uv_of = |triangle: usize| mesh.triangles[triangle].map(|vertex| uvs[vertex as usize].as_dvec2());
    let mut charts: Vec<[DVec2; 3]> = (0..mesh.triangles.len()).filter(has_area).map(uv_of).collect();
    if !charts.iter().all(is_sound) {
        return false;
    }
    charts.sort_by(|a, b| low(a).x.total_cmp(&low(b).x));
    let overlaps = |(index, chart): (usize, &[DVec2; 3])| {
        let end = high(chart).x;
        charts[index + 1..].iter().take_while(|next| low(next).x < end).any(|next| overlap(chart, next))
    };
    !charts.iter().enumerate().any(overlaps)
}

/// Whether the triangle lies in the unit square and has area.
fn is_sound(chart: &[DVec2; 3]) -> bool {
    let inside = low(chart).min_element() >= -SLACK && high(chart).max_element() <= 1.0 + SLACK;
    let [a, b, c] = *chart;
    inside && (b - a).perp_dot(c - a) != 0.0
}

fn low([a, b, c]: &[DVec2; 3]) -> DVec2 {
    a.min(*b).min(*c)
}

fn high([a, b, c]: &[DVec2; 3]) -> DVec2 {
    a.max(*b).max(*c)
}

/// Whether the triangles overlap: no line along one of their six edges separates them.
fn overlap(one: &[DVec2; 3], other: &[DVec2; 3]) -> bool {
    let apart = |edge: DVec2| {
        let along = |triangle: &[DVec2; 3]| triangle.map(|corner| corner.dot(edge.perp()));
        let (a, b) = (along(one), along(other));
        let (low, high) = (|v: [f64; 3]| v[0].min(v[1]).min(v[2]), |v: [f64; 3]| v[0].max(v[1]).max(v[2]));
        high(a) <= low(b) + SLACK * edge.length() || high(b) <= low(a) + SLACK * edge.length()
    };
    let edges = |[a, b, c]: &[DVec2; 3]| [*b - *a, *c - *b, *a - *c];
    !edges(one).into_iter().chain(edges(other)).any(apart)
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};
    use mateval_image::{Texels, Wrap};

    use super::*;

    /// Linear interpolation gives the same value in both pictures at every height.
    #[test]
    fn stretching_changes_no_lookup() {
        let texture = Texture::new(1, 3, Texels::Grey(vec![1.0, 5.0, 2.0]), Wrap::Clamp).unwrap();
        let picture = stretched(&texture);
        assert_eq!((picture.width(), picture.height()), (2, 7));
        for step in 0..=60 {
            let v = step as f32 / 60.0;
            let ours = texture.sample([0.0, 1.0 - v])[0];
            let row = v * 6.0;
            let upper = (row as usize).min(5);
            let value = |row: usize| picture.get(1, row).0[0];
            let theirs = value(upper) + (row - upper as f32) * (value(upper + 1) - value(upper));
            assert!((ours - theirs).abs() < 1e-5, "{v}: {ours} {theirs}");
        }
    }

    /// Two triangles that form a square. `uv` maps a corner's position in the square to its uv.
    fn square(uv: impl Fn(Vec2) -> Vec2) -> TriangleMesh {
        let corners = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        TriangleMesh {
            positions: corners.map(|corner| corner.extend(0.0)).into(),
            normals: None,
            uvs: Some(corners.map(uv).into()),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    #[test]
    fn a_square_unfolds_unless_it_overlaps_or_leaves() {
        assert!(is_unfolded(&square(|uv| uv)));
        assert!(is_unfolded(&square(|uv| Vec2::new(0.3 * uv.x + 0.1 * uv.y, 1.0 - 0.7 * uv.y))));
        assert!(!is_unfolded(&square(|uv| 1.1 * uv)));
        assert!(!is_unfolded(&square(|uv| uv - 0.5)));
        assert!(!is_unfolded(&square(|uv| Vec2::splat(uv.x))));
        // Folded along the diagonal.
        assert!(!is_unfolded(&square(|uv| if uv == Vec2::Y { Vec2::X } else { uv })));
        assert!(!is_unfolded(&TriangleMesh { uvs: None, ..square(|uv| uv) }));
    }

    /// A grid of many triangles is unfolded. So it is with a triangle without area, but not with one on top of another.
    #[test]
    fn one_overlap_among_many_is_found() {
        let n = 20_u32;
        let corner = |k: u32| Vec2::new((k % (n + 1)) as f32 / n as f32, (k / (n + 1)) as f32 / n as f32);
        let uvs: Vec<Vec2> = (0..(n + 1) * (n + 1)).map(corner).collect();
        let cells = (0..n * n).map(|k| k % n + (n + 1) * (k / n));
        let mut grid = TriangleMesh {
            positions: uvs.iter().map(|uv| Vec3::new(uv.x, 0.0, uv.y)).collect(),
            normals: None,
            uvs: Some(uvs),
            triangles: cells.flat_map(|k| [[k, k + 1, k + n + 2], [k, k + n + 2, k + n + 1]]).collect(),
        };
        assert!(is_unfolded(&grid));
        grid.triangles.push([7, 7, 200]);
        assert!(is_unfolded(&grid));
        grid.triangles.push([150, 152, 172]);
        assert!(!is_unfolded(&grid));
    }
}
