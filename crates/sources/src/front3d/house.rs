//! The content of a 3D-FRONT house's JSON after checking: its rooms, what they contain, and where.

use glam::{DMat3, DMat4, DQuat, DVec3};
use mateval_scene::TriangleMesh;
use mateval_scene::material::UvTransform;

/// Which release of 3D-FRONT wrote the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Release {
    /// February 2021: no version.
    R1,
    /// Version 2.0 without lights.
    R2,
    /// Version 2.0 with lights; materials have a `UVTransform`.
    R3,
}

/// The checked content of a house's JSON.
#[derive(Clone, Debug)]
pub struct House {
    /// Its uid, or the file's stem where it has none.
    pub uid: String,
    /// The release that the file belongs to.
    pub release: Release,
    /// Records of furniture, including those that are not valid.
    pub furniture: Vec<FurnitureRecord>,
    /// Meshes of the architecture.
    pub meshes: Vec<HouseMesh>,
    /// Materials of the meshes.
    pub materials: Vec<HouseMaterial>,
    /// Rooms, in the file's order.
    pub rooms: Vec<Room>,
    /// The designers' cameras in the file.
    pub cameras: Vec<DesignerCamera>,
    /// What has been subtracted from the places of rooms and cameras: whole metres far from the origin, else nothing.
    pub shift_m: DVec3,
    /// Number of V-Ray lights. They are not used, since their units are V-Ray's own.
    pub lights: usize,
}

/// A record of furniture, to which children of rooms refer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FurnitureRecord {
    /// The uid by which children refer to it.
    pub uid: String,
    /// The name of its model's folder.
    pub jid: String,
    /// Whether its model is public.
    pub valid: bool,
    /// The file's category.
    pub category: Option<String>,
    /// The file's title, as in `lighting/pendant light`.
    pub title: Option<String>,
    /// JSON pointer to the record.
    pub place: String,
}

/// A mesh of the architecture, in the space of the child that refers to it.
#[derive(Clone, Debug)]
pub struct HouseMesh {
    /// The uid by which children refer to it.
    pub uid: String,
    /// Its type, as in `WallInner`; `Other` where the file gives none.
    pub kind: String,
    /// The triangles relative to `base`, without the file's normals, which are often wrong.
    pub mesh: TriangleMesh,
    /// What has been subtracted from the file's positions: whole metres far from the origin, else nothing.
    pub base: DVec3,
    /// Index in [`House::materials`]; none where the file names no known material.
    pub material: Option<usize>,
    /// JSON pointer to the record.
    pub place: String,
}

/// A material of the architecture.
#[derive(Clone, Debug, PartialEq)]
pub struct HouseMaterial {
    /// The uid by which meshes refer to it.
    pub uid: String,
    /// The name of its texture's folder; none where the colour counts.
    pub texture: Option<String>,
    /// The words of its content type, as in `material wallpaper`.
    pub content: Option<String>,
    /// sRGB-encoded colour, 0 to 255; absent if the file states none.
    pub color: Option<[f64; 3]>,
    /// The map from the mesh's uv to the texture's.
    pub uv: UvTransform,
    /// JSON pointer to the record.
    pub place: String,
}

/// A room.
#[derive(Clone, Debug, PartialEq)]
pub struct Room {
    /// Its instanceid, as in `LivingDiningRoom-1912`.
    pub id: String,
    /// Its type, as in `LivingDiningRoom`.
    pub kind: String,
    /// The product of the scene's and the room's transforms, less the house's shift; the identity in every known file.
    pub house_from_room: DMat4,
    /// Its meshes and pieces of furniture.
    pub children: Vec<Child>,
    /// JSON pointer to the record.
    pub place: String,
}

/// A mesh or a piece of furniture in a room.
#[derive(Clone, Debug, PartialEq)]
pub struct Child {
    /// The record that it refers to.
    pub what: ChildKind,
    /// Its instanceid, as in `furniture/147`.
    pub id: String,
    /// Its placement in the room.
    pub placement: Placement,
    /// JSON pointer to the child.
    pub place: String,
}

/// The record that a child refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChildKind {
    /// Index in [`House::furniture`].
    Furniture(usize),
    /// Index in [`House::meshes`].
    Mesh(usize),
}

/// Translation, rotation and scale of a child in its room, of a room in the scene, or of the scene in the house: a
/// point v moves to `T * R * S * v`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Metres.
    pub position: DVec3,
    /// Unit quaternion; the file's order is x, y, z, w.
    pub rotation: DQuat,
    /// Factors along the axes; a negative one mirrors.
    pub scale: DVec3,
}

impl Placement {
    /// The identity.
    pub const IDENTITY: Self = Self { position: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE };

    /// The placement as a matrix.
    pub fn matrix(&self) -> DMat4 {
        DMat4::from_scale_rotation_translation(self.scale, self.rotation, self.position)
    }

    /// `T * R * diag(-1, 1, 1) * S`, which mirrors the piece along its own x axis.
    pub fn mirrored_matrix(&self) -> DMat4 {
        let mirror = DMat4::from_mat3(DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)));
        DMat4::from_rotation_translation(self.rotation, self.position) * mirror * DMat4::from_scale(self.scale)
    }
}

/// From the house's space to world space: the identity, or with `compat` the mirror that BlenderProc applies, since it
/// swaps y and z instead of rotating.
pub(super) fn world_from_house(compat: bool) -> DMat4 {
    DMat4::from_scale(DVec3::new(1.0, 1.0, if compat { -1.0 } else { 1.0 }))
}

/// A camera that a designer set.
#[derive(Clone, Debug, PartialEq)]
pub struct DesignerCamera {
    /// Its number in its file.
    pub number: usize,
    /// Position in metres.
    pub position: DVec3,
    /// A point in the middle of the picture, in metres.
    pub target: DVec3,
    /// Vertical field of view in degrees.
    pub fov_y_deg: f64,
}

impl DesignerCamera {
    /// The camera in a house from whose places `shift_m` is subtracted.
    pub(super) fn shifted(self, shift_m: DVec3) -> Self {
        Self { position: self.position - shift_m, target: self.target - shift_m, ..self }
    }
}

impl House {
    /// Index of the room with this id.
    pub fn room(&self, id: &str) -> Option<usize> {
        self.rooms.iter().position(|room| room.id == id)
    }
}
