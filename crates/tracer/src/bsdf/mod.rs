//! What light does where a ray meets a surface: a material's parameters at that place, with value, density and sampling.
//!
//! `wo` points to the viewer, `wi` to the light, both away from the surface and of unit length, in world space. `eval`
//! includes the cosine. Which of several lobes is sampled never depends on a colour, so that paths made for one set of
//! colours serve for another.

mod bump;
mod facets;
mod fresnel;
mod lobe;
mod principled_tables;
mod rough_boundary;
mod sample;
mod tables;
#[cfg(test)]
mod tests;

use glam::Vec3;
use mateval_image::Texture;
use mateval_scene::TriangleMesh;
use mateval_scene::material::Material;

use crate::frame::Frame;
use crate::surface_hit::SurfaceHit;
pub(crate) use fresnel::eta_from_specular;
pub(crate) use lobe::Principled;
use lobe::{Lobe, PrincipledView, Tint};
pub(crate) use principled_tables::BlenderTables;
pub(crate) use tables::{MaterialTables, Table};

/// A surface's scattering at one place, for `K` base colours at once.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf<'w, const K: usize = 1> {
    frame: Frame,
    /// The triangle's normal on the side of the frame's.
    geometric: Vec3,
    /// Towards the viewer, in the frame.
    wo: Vec3,
    lobe: Lobe<'w>,
    /// For principled materials, which most are: what follows from `wo` already, and from the colours.
    principled: Option<(PrincipledView, [Tint; K])>,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample<const K: usize = 1> {
    /// Where the light comes from.
    pub wi: Vec3,
    /// The value of [`Bsdf::evaluate`] over `density`, by base colour.
    pub weights: [Vec3; K],
    /// Per solid angle; for a single direction (`delta`), its probability.
    pub density: f32,
    /// Whether this is a single direction, that of a mirror or of clear glass, which sampling lights cannot find.
    pub delta: bool,
}

/// The cosine to which a shading normal is turned back that points away from a viewer who sees the front.
const GRAZING: f32 = 1e-3;

/// Facets smoother than this roughness do not show the lights of a stage ([`crate::StageLight`]).
pub const STAGE_ROUGHNESS: f32 = 0.2;

impl Bsdf<'_> {
    /// Value times the cosine of `wi`, a channel, and the density with which [`Self::sample`] finds `wi`, per solid angle;
    /// single directions left out. See `Self::evaluate_all`.
    pub fn evaluate(&self, wi: Vec3) -> (Vec3, f32) {
        let ([value], density) = self.evaluate_all(wi, Shown::All);
        (value, density)
    }
}

/// What of a surface light is evaluated on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shown {
    /// All of it.
    All,
    /// What shows the lights of a stage: facets below [`STAGE_ROUGHNESS`] do not.
    Stage,
}

impl<'w, const K: usize> Bsdf<'w, K> {
    /// The scattering of `material`, whose integrals are `table`, at `hit` on `mesh`, seen from `wo`; the same `K` times.
    ///
    /// The back of an opaque material that is not two-sided is black. A shading normal that points away from a viewer who
    /// sees that side of the triangle is turned until it does not.
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
            Some(bump) => bump::bumped_normal(bump, textures, mesh, hit),
            None => hit.shading_normal,
        };
        Self::at(hit, normal, wo, lobe, material.two_sided, None)
    }

    /// The scattering of a two-sided `principled` surface at `hit`, seen from `wo`, once for each of `base_colors`.
    pub(crate) fn of_principled(
        principled: Principled<'w>,
        base_colors: &[Vec3; K],
        hit: &SurfaceHit,
        wo: Vec3,
    ) -> Self {
        Self::at(hit, hit.shading_normal, wo, Lobe::Principled(principled), true, Some(base_colors))
    }

    fn at(
        hit: &SurfaceHit,
        mut normal: Vec3,
        wo: Vec3,
        mut lobe: Lobe<'w>,
        two_sided: bool,
        colors: Option<&[Vec3; K]>,
    ) -> Self {
        let mut geometric = hit.geometric_normal;
        let front = hit.is_front(wo);
        if !front && !lobe.transmits() {
            (normal, geometric) = (-normal, -geometric);
            if !two_sided {
                lobe = Lobe::Black;
            }
        }
        let seen_side = if front || !lobe.transmits() { 1.0 } else { -1.0 };
        let normal = turned_to(normal * seen_side, wo) * seen_side;
        let frame = Frame::around(normal);
        let wo = frame.local_from_world(wo);
        let principled = match &lobe {
            Lobe::Principled(principled) if wo.z > 0.0 => {
                let view = principled.seen_from(wo);
                let tints = match colors {
                    Some(colors) => colors.map(|color| view.tint(color)),
                    None => [view.tint(principled.base_color); K],
                };
                Some((view, tints))
            }
            _ => None,
        };
        Self { frame, geometric, wo, lobe, principled }
    }

    /// Value times the cosine of `wi`, by base colour and channel, and the density with which [`Self::sample`] finds `wi`,
    /// per solid angle; single directions left out.
    ///
    /// Both are zero where `wi` lies above the shading normal's plane and below the triangle's or the reverse: such light
    /// would come through the surface.
    pub(crate) fn evaluate_all(&self, wi: Vec3, shown: Shown) -> ([Vec3; K], f32) {
        let local = self.frame.local_from_world(wi);
        if self.geometric.dot(wi) * local.z <= 0.0 {
            return ([Vec3::ZERO; K], 0.0);
        }
        match &self.principled {
            Some(_) if local.z <= 0.0 => ([Vec3::ZERO; K], 0.0),
            Some((view, tints)) => {
                let mut response = view.response(local);
                if shown == Shown::Stage && view.is_smoother_than(STAGE_ROUGHNESS) {
                    response = response.of_base_alone();
                }
                (tints.map(|tint| tint.value(&response)), response.density)
            }
            None => ([self.lobe.eval(self.wo, local); K], self.lobe.density(self.wo, local)),
        }
    }

    /// A direction for `wo`, from three numbers in [0, 1); none where the draw sends light nowhere. Does not depend on the
    /// base colours.
    pub fn sample(&self, u: [f32; 3]) -> Option<BsdfSample<K>> {
        let (local, weights, density, delta) = match &self.principled {
            Some((view, tints)) => {
                let (wi, response) = view.sample(u)?;
                (wi, tints.map(|tint| tint.value(&response) / response.density), response.density, false)
            }
            None => {
                let sample = self.lobe.sample(self.wo, u)?;
                (sample.wi, [sample.weight; K], sample.density, sample.delta)
            }
        };
        let wi = self.frame.world_from_local(local).normalize();
        (self.geometric.dot(wi) * local.z > 0.0).then_some(BsdfSample { wi, weights, density, delta })
    }

    /// The weights of `sample`, one of [`Self::sample`]'s, for the lights of a stage: what shows none of them left out.
    pub(crate) fn stage_weights(&self, sample: &BsdfSample<K>) -> [Vec3; K] {
        match &self.principled {
            _ if sample.delta => [Vec3::ZERO; K],
            Some((view, _)) if view.is_smoother_than(STAGE_ROUGHNESS) => {
                let (values, _) = self.evaluate_all(sample.wi, Shown::Stage);
                values.map(|value| value / sample.density)
            }
            _ => sample.weights,
        }
    }

    /// Whether all light goes to single directions, so that sampling lights finds nothing.
    pub fn is_delta(&self) -> bool {
        self.lobe.is_delta()
    }

    /// Whether nothing is sent back at all.
    pub fn is_black(&self) -> bool {
        matches!(self.lobe, Lobe::Black)
    }
}

/// `normal`, or where that points away from `wo`, the nearest one that does not.
fn turned_to(normal: Vec3, wo: Vec3) -> Vec3 {
    let cos = normal.dot(wo);
    if cos >= GRAZING { normal } else { (normal + wo * (GRAZING - cos)).normalize() }
}
