//! The lights of a room, as BlenderProc sets them: ceilings and lamps emit although the camera sees their ordinary
//! surface, and a grey environment surrounds the house.

use mateval_scene::Role;
use mateval_scene::material::{ColorInput, MaterialModel};
use mateval_scene::reference::{Emission, EmissionMap, LightGroup, ReferenceScene, SurfaceIndex};

use super::furnished_house::FurnishedHouse;

/// Radiance of ceilings, times their colour.
const CEILING: f32 = 0.8;
/// Radiance of lamps, times their base colour.
const LAMP: f32 = 7.0;
/// The name of the environment's light group.
pub(super) const WORLD_NAME: &str = "world";
/// Radiance of the environment.
const WORLD: f32 = 0.05;

/// Whether and how a surface emits.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Glow {
    No,
    /// With this radiance. Ceilings of one room with equal radiance form one light group.
    Ceiling([f32; 3]),
    Lamp,
}

fn glow(house: &FurnishedHouse, surface: usize) -> Glow {
    let placed = &house.placed[surface];
    match &placed.origin.role {
        role if role.is_ceiling() => Glow::Ceiling(placed.color.map(|v| v * CEILING)),
        Role::LightFixture {} => Glow::Lamp,
        Role::Architecture { .. } | Role::Furniture {} | Role::Other {} => Glow::No,
    }
}

/// The light groups of the house's surfaces `kept`, which are the surfaces of `scene` in this order. As in Blender, both
/// sides emit.
pub(super) fn groups(house: &FurnishedHouse, kept: &[usize], scene: &ReferenceScene) -> Vec<LightGroup> {
    let mut groups: Vec<LightGroup> = Vec::new();
    let mut ceilings: Vec<((usize, [f32; 3]), usize)> = Vec::new();
    for (at, surface) in kept.iter().enumerate() {
        let (radiance, map) = match glow(house, *surface) {
            Glow::No | Glow::Ceiling(BLACK) => continue,
            Glow::Lamp => lamp(scene, at),
            // A ceiling joins the group of its room and radiance, if that exists.
            Glow::Ceiling(radiance) => {
                let key = (house.placed[*surface].room, radiance);
                let known = ceilings.iter().find(|(known, _)| *known == key).map(|(_, group)| *group);
                if let Some(Emission::Area { surfaces, .. }) = known.map(|group| &mut groups[group].emission) {
                    surfaces.push(SurfaceIndex(at));
                    continue;
                }
                ceilings.push((key, groups.len()));
                (radiance, None)
            }
        };
        let emission = Emission::Area { surfaces: vec![SurfaceIndex(at)], radiance, map, two_sided: true };
        groups.push(LightGroup { name: scene.surfaces[at].name.clone(), emission, camera_visible: false });
    }
    let emission = Emission::Constant { radiance: [WORLD; 3] };
    groups.push(LightGroup { name: WORLD_NAME.to_owned(), emission, camera_visible: true });
    groups
}

const BLACK: [f32; 3] = [0.0; 3];

/// The emission of a lamp, whose base colour is the emission's map or factor.
fn lamp(scene: &ReferenceScene, surface: usize) -> ([f32; 3], Option<EmissionMap>) {
    let material = &scene.materials[scene.surfaces[surface].material.0];
    match material.model {
        MaterialModel::Principled { base_color: ColorInput::Texture { texture, uv }, .. } => {
            ([LAMP; 3], Some(EmissionMap { texture, uv }))
        }
        MaterialModel::Principled { base_color: ColorInput::Constant(color), .. } => (color.map(|v| LAMP * v), None),
        _ => ([LAMP; 3], None),
    }
}
