//! What light does where a ray meets a surface: a material's parameters at that place, with value, density and sampling.
//!
//! `wo` points to the viewer, `wi` to the light, both away from the surface and of unit length, in world space. `eval`
//! includes the cosine. Which of several lobes is sampled never depends on a colour, so that paths made for one set of
//! colours serve for another.

mod bump;
mod conductor;
mod dielectric;
mod diffuse;
mod facets;
mod fresnel;
mod lobe;
mod plastic;
mod principled;
mod principled_tables;
mod rough_boundary;
mod tables;
#[cfg(test)]
mod tests;

use glam::Vec3;

use crate::frame::Frame;
use crate::surface_hit::SurfaceHit;
use crate::world::World;
use lobe::Lobe;
use principled::PrincipledView;
pub(crate) use tables::MaterialTables;

/// A surface's scattering at one place.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf<'w> {
    frame: Frame,
    /// The triangle's normal on the side of the frame's.
    geometric: Vec3,
    /// Towards the viewer, in the frame.
    wo: Vec3,
    lobe: Lobe<'w>,
    /// For principled materials, which most are: what follows from `wo` already.
    principled: Option<PrincipledView>,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Where the light comes from.
    pub wi: Vec3,
    /// The value of [`Bsdf::evaluate`] over `density`.
    pub weight: Vec3,
    /// Per solid angle; for a single direction (`delta`), its probability.
    pub density: f32,
    /// Whether this is a single direction, that of a mirror or of clear glass, which sampling lights cannot find.
    pub delta: bool,
}

/// The cosine to which a shading normal is turned back that points away from a viewer who sees the front.
const GRAZING: f32 = 1e-3;

impl<'w> Bsdf<'w> {
    /// The scattering at `hit`, seen from `wo`.
    ///
    /// The back of an opaque material that is not two-sided is black. A shading normal that points away from a viewer who
    /// sees that side of the triangle is turned until it does not.
    pub fn new(world: &'w World, hit: &SurfaceHit, wo: Vec3) -> Self {
        let material = world.material_of(hit.surface);
        let table = world.tables().of(world.scene().surfaces[hit.surface.0].material.0);
        let mut lobe = Lobe::at(material, table, world.textures(), hit.uv);
        let mut normal = match &material.bump {
            Some(bump) => bump::bumped_normal(bump, world.textures(), world.mesh(hit.surface), hit),
            None => hit.shading_normal,
        };
        let mut geometric = hit.geometric_normal;
        let front = hit.is_front(wo);
        if !front && !lobe.transmits() {
            (normal, geometric) = (-normal, -geometric);
            if !material.two_sided {
                lobe = Lobe::Black;
            }
        }
        let seen_side = if front || !lobe.transmits() { 1.0 } else { -1.0 };
        let normal = turned_to(normal * seen_side, wo) * seen_side;
        let frame = Frame::around(normal);
        let wo = frame.local_from_world(wo);
        let principled = match &lobe {
            Lobe::Principled(principled) if wo.z > 0.0 => Some(principled.seen_from(wo)),
            _ => None,
        };
        Self { frame, geometric, wo, lobe, principled }
    }

    /// Value times the cosine of `wi`, a channel, and the density with which [`Self::sample`] finds `wi`, per solid angle;
    /// single directions left out.
    ///
    /// Both are zero where `wi` lies above the shading normal's plane and below the triangle's or the reverse: such light
    /// would come through the surface.
    pub fn evaluate(&self, wi: Vec3) -> (Vec3, f32) {
        let local = self.frame.local_from_world(wi);
        if self.geometric.dot(wi) * local.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        match &self.principled {
            Some(_) if local.z <= 0.0 => (Vec3::ZERO, 0.0),
            Some(principled) => principled.evaluate(local),
            None => (self.lobe.eval(self.wo, local), self.lobe.density(self.wo, local)),
        }
    }

    /// A direction for `wo`, from three numbers in [0, 1); none where the draw sends light nowhere.
    pub fn sample(&self, u: [f32; 3]) -> Option<BsdfSample> {
        let sample = match &self.principled {
            Some(principled) => principled.sample(u)?,
            None => self.lobe.sample(self.wo, u)?,
        };
        let wi = self.frame.world_from_local(sample.wi).normalize();
        (self.geometric.dot(wi) * sample.wi.z > 0.0).then_some(BsdfSample {
            wi,
            weight: sample.weight,
            density: sample.density,
            delta: sample.delta,
        })
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
