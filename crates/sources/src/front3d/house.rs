//! A 3D-FRONT house as its JSON tells it, checked: what is in which room, and where.

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

/// A house.
#[derive(Clone, Debug)]
pub struct House {
    /// Its uid; the file's stem where it has none.
    pub uid: String,
    /// Which release it is of.
    pub release: Release,
    /// Pieces of furniture, those that are not valid included.
    pub furniture: Vec<FurnitureRecord>,
    /// Meshes of the architecture.
    pub meshes: Vec<HouseMesh>,
    /// What they are made of.
    pub materials: Vec<HouseMaterial>,
    /// Rooms, in the file's order.
    pub rooms: Vec<Room>,
    /// The designers' cameras that the file holds.
    pub cameras: Vec<DesignerCamera>,
    /// How many V-Ray lights it has; their units are V-Ray's own, and nobody uses them.
    pub lights: usize,
}

/// A piece of furniture, which rooms place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FurnitureRecord {
    /// What children refer to.
    pub uid: String,
    /// Its model's folder.
    pub jid: String,
    /// Only valid pieces have a public model.
    pub valid: bool,
    /// As the file says it.
    pub category: Option<String>,
    /// As the file says it, as in `lighting/pendant light`.
    pub title: Option<String>,
    /// Where it is in the file, a JSON pointer.
    pub place: String,
}

/// A mesh of the architecture, in the house's space.
#[derive(Clone, Debug)]
pub struct HouseMesh {
    /// What children refer to.
    pub uid: String,
    /// As in `WallInner`; `Other` where it is empty.
    pub kind: String,
    /// Without normals: the file's are often garbage.
    pub mesh: TriangleMesh,
    /// A place in [`House::materials`]; none where the file names none that is there.
    pub material: Option<usize>,
    /// Where it is in the file, a JSON pointer.
    pub place: String,
}

/// What a mesh is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct HouseMaterial {
    /// What meshes refer to.
    pub uid: String,
    /// Its texture's folder; none where its colour is all.
    pub texture: Option<String>,
    /// sRGB-encoded, 0 to 255.
    pub color: [f64; 3],
    /// From the mesh's uv to the texture's.
    pub uv: UvTransform,
    /// Where it is in the file, a JSON pointer.
    pub place: String,
}

/// A room.
#[derive(Clone, Debug, PartialEq)]
pub struct Room {
    /// Its instanceid, as in `LivingDiningRoom-1912`.
    pub id: String,
    /// As in `LivingDiningRoom`.
    pub kind: String,
    /// The scene's and the room's own transforms; the identity in every file seen.
    pub world_from_room: DMat4,
    /// What is in it.
    pub children: Vec<Child>,
    /// Where it is in the file, a JSON pointer.
    pub place: String,
}

/// Something in a room.
#[derive(Clone, Debug, PartialEq)]
pub struct Child {
    /// What it is.
    pub what: ChildKind,
    /// Its instanceid, as in `furniture/147`.
    pub id: String,
    /// Where it stands in its room.
    pub placement: Placement,
    /// Where it is in the file, a JSON pointer.
    pub place: String,
}

/// What a child is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChildKind {
    /// A place in [`House::furniture`].
    Furniture(usize),
    /// A place in [`House::meshes`].
    Mesh(usize),
}

/// Translation, rotation, scale: `world = T * R * S * v`, scale first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Metres.
    pub position: DVec3,
    /// Unit length; the file's order is x, y, z, w.
    pub rotation: DQuat,
    /// Negative where it mirrors.
    pub scale: DVec3,
}

impl Placement {
    /// Nothing moved.
    pub const IDENTITY: Self = Self { position: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE };

    /// As a matrix.
    pub fn matrix(&self) -> DMat4 {
        DMat4::from_scale_rotation_translation(self.scale, self.rotation, self.position)
    }

    /// `T * R * diag(-1, 1, 1) * S`: the piece mirrored along its own x.
    pub fn mirrored_matrix(&self) -> DMat4 {
        let mirror = DMat4::from_mat3(DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)));
        DMat4::from_rotation_translation(self.rotation, self.position) * mirror * DMat4::from_scale(self.scale)
    }
}

/// A camera that a designer set.
#[derive(Clone, Debug, PartialEq)]
pub struct DesignerCamera {
    /// Its number in its file.
    pub number: usize,
    /// Metres.
    pub position: DVec3,
    /// A point in the middle of the picture, metres.
    pub target: DVec3,
    /// Vertical field of view in degrees.
    pub fov_y_deg: f64,
}

impl House {
    /// The room of this id.
    pub fn room(&self, id: &str) -> Option<usize> {
        self.rooms.iter().position(|room| room.id == id)
    }
}
