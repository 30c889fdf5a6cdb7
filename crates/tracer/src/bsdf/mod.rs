//! BSDFs: a material's parameters at one point, with evaluation, density and sampling.
//!
//! `wo` points to the viewer, `wi` to the light, both away from the surface, of unit length and in world space.
//! Evaluation includes the cosine. The choice of a lobe never depends on a colour, so the same paths serve any base
//! colours.

mod blender_tables;
mod facets;
mod lobe;
mod principled;
mod rough_coat;
mod tables;
#[cfg(test)]
mod tests;

use glam::{Vec2, Vec3};
use mateval_dataset::TriangleMesh;
use mateval_dataset::material::{BumpMap, Material, ScalarInput};
use mateval_image::Texture;

use crate::ray::SurfaceHit;
use crate::sampling::Frame;
pub(crate) use blender_tables::BlenderTables;
pub(crate) use facets::eta_from_specular;
use lobe::{Lobe, Table};
pub(crate) use principled::{BsdfPart, Principled};
use principled::{PrincipledVariants, SecondPrincipled};
pub(crate) use tables::MaterialTables;
pub use tables::ReflectanceMeter;

/// The BSDF of a surface at one point, for `K` base colours at once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bsdf<'w, const K: usize = 1> {
    frame: Frame,
    /// The geometric normal, on the side of the frame's z axis.
    geometric: Vec3,
    /// Towards the viewer, in the frame.
    wo: Vec3,
    lobe: Lobe<'w>,
    /// For principled materials, which most are: the terms that depend on `wo` and on the base colours alone.
    principled: Option<PrincipledVariants<K>>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BsdfSample<const K: usize = 1> {
    /// Towards the light.
    pub(crate) wi: Vec3,
    /// The value of [`Bsdf::evaluate`] over `density`, per base colour.
    pub(crate) weights: [Vec3; K],
    /// Per solid angle; for a delta sample, its probability.
    pub(crate) density: f32,
    /// Whether the direction comes from a delta distribution, such as a mirror, which light sampling cannot find.
    pub(crate) delta: bool,
}

/// The smallest cosine between the viewer and a shading normal on the visible side; smaller ones are raised to it.
const GRAZING: f32 = 1e-3;

impl<'w, const K: usize> Bsdf<'w, K> {
    /// The BSDF of `material`, with its precomputed `table`, at `hit` on `mesh`, seen from `wo`. It is the same for all
    /// `K` base colours.
    ///
    /// The back of an opaque material that is not two-sided is black. A shading normal that points away from a viewer
    /// on its side of the triangle is turned towards the viewer.
    pub(crate) fn of_material(
        material: &Material,
        table: &'w Table,
        textures: &[Texture],
        mesh: &TriangleMesh,
        hit: &SurfaceHit,
        wo: Vec3,
    ) -> Self {
        let lobe = Lobe::at(material, table, textures, hit.uv);
        let normal = match &material.bump {
            Some(bump) => bumped_normal(bump, textures, mesh, hit),
            None => hit.shading_normal,
        };
        Self::at(hit, normal, wo, lobe, material.two_sided, None)
    }

    /// The BSDF of a two-sided `principled` material at `hit`, seen from `wo`, for each of `base_colors`. With a
    /// `second` material and a number, the base colours from that number on have its roughness and metallic.
    pub(crate) fn of_principled(
        principled: Principled<'w>,
        second: Option<SecondPrincipled<'w>>,
        base_colors: &[Vec3; K],
        hit: &SurfaceHit,
        wo: Vec3,
    ) -> Self {
        let colors = Some((base_colors, second.as_ref()));
        Self::at(hit, hit.shading_normal, wo, Lobe::Principled(principled), true, colors)
    }

    fn at(
        hit: &SurfaceHit,
        mut normal: Vec3,
        wo: Vec3,
        mut lobe: Lobe<'w>,
        two_sided: bool,
        colors: Option<(&[Vec3; K], Option<&SecondPrincipled<'w>>)>,
    ) -> Self {
        // Face the viewer, unless light passes to the other side.
        let mut geometric = hit.geometric_normal;
        let front = hit.is_front(wo);
        if !front && !lobe.transmits() {
            (normal, geometric) = (-normal, -geometric);
            if !two_sided {
                lobe = Lobe::Black;
            }
        }
        // Build the frame of the shading normal on the side of the viewer.
        let seen_side = if front || !lobe.transmits() { 1.0 } else { -1.0 };
        let normal = turned_to(normal * seen_side, wo) * seen_side;
        let frame = Frame::around(normal);
        let wo = frame.local_from_world(wo);
        // Compute what does not depend on the light.
        let principled = match &lobe {
            Lobe::Principled(principled) if wo.z > 0.0 => {
                let own = [principled.base_color; K];
                let (base_colors, second) = colors.unwrap_or((&own, None));
                Some(PrincipledVariants::new(principled, second, base_colors, wo))
            }
            _ => None,
        };
        Self { frame, geometric, wo, lobe, principled }
    }

    /// The value times the cosine of `wi`, per base colour and channel, and the density with which [`Self::sample`]
    /// samples `wi`, per solid angle. Delta lobes are left out.
    ///
    /// Both are zero where `wi` lies above the shading normal's plane and below the triangle's, or the reverse: such
    /// light would pass through the surface.
    pub(crate) fn evaluate(&self, wi: Vec3, part: BsdfPart) -> ([Vec3; K], f32) {
        let local = self.frame.local_from_world(wi);
        if self.geometric.dot(wi) * local.z <= 0.0 {
            return ([Vec3::ZERO; K], 0.0);
        }
        match &self.principled {
            Some(_) if local.z <= 0.0 => ([Vec3::ZERO; K], 0.0),
            Some(variants) => variants.evaluate(local, part),
            None => ([self.lobe.eval(self.wo, local); K], self.lobe.density(self.wo, local)),
        }
    }

    /// Samples a direction from three numbers in [0, 1), independently of the base colours. `None` if the sample is
    /// absorbed.
    pub(crate) fn sample(&self, u: [f32; 3]) -> Option<BsdfSample<K>> {
        let (local, weights, density, delta) = match &self.principled {
            Some(variants) => {
                let (wi, weights, density) = variants.sample(u)?;
                (wi, weights, density, false)
            }
            None => {
                let sample = self.lobe.sample(self.wo, u)?;
                (sample.wi, [sample.weight; K], sample.density, sample.delta)
            }
        };
        let wi = self.frame.world_from_local(local).normalize();
        (self.geometric.dot(wi) * local.z > 0.0).then_some(BsdfSample { wi, weights, density, delta })
    }

    /// The weights of `sample`, returned by [`Self::sample`], for stage lights: parts that do not reflect them are left
    /// out.
    pub(crate) fn stage_weights(&self, sample: &BsdfSample<K>) -> [Vec3; K] {
        match &self.principled {
            _ if sample.delta => [Vec3::ZERO; K],
            Some(_) => {
                let (values, _) = self.evaluate(sample.wi, BsdfPart::Stage);
                values.map(|value| value / sample.density)
            }
            _ => sample.weights,
        }
    }

    /// Whether all lobes are delta distributions, so that light sampling finds nothing.
    pub(crate) fn is_delta(&self) -> bool {
        self.lobe.is_delta()
    }

    /// Whether all light is absorbed.
    pub(crate) fn is_black(&self) -> bool {
        matches!(self.lobe, Lobe::Black)
    }
}

/// `normal`, or if that points away from `wo`, the nearest normal that does not.
fn turned_to(normal: Vec3, wo: Vec3) -> Vec3 {
    let cos = normal.dot(wo);
    if cos >= GRAZING { normal } else { (normal + wo * (GRAZING - cos)).normalize() }
}

/// Bump mapping: the shading normal tilted by the slope of a height texture, on the side of `hit.shading_normal`. The
/// shading normal itself if the mesh has no usable uv.
///
/// Blinn, "Simulation of Wrinkled Surfaces" (1978), without the surface's own curvature: the tangents dp/du and dp/dv
/// are raised along the normal by the slope of the height, and their cross product is the new normal.
fn bumped_normal(bump: &BumpMap, textures: &[Texture], mesh: &TriangleMesh, hit: &SurfaceHit) -> Vec3 {
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
