//! Small scenes built in code, among them a closed room of 4 x 2.5 x 6 metres with a camera in it.

use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use mateval_dataset::material::{
    ColorInput, ConductorIor, Distribution, Material, MaterialModel, Microfacets, PrincipledFlavour, ScalarInput,
    TextureIndex, UvTransform,
};
use mateval_dataset::reference::{
    Emission, EmissionMap, LightGroup, MaterialIndex, ReferenceScene, SourceTexture, Surface, SurfaceIndex,
};
use mateval_dataset::{Camera, Intrinsics, TriangleMesh};
use mateval_image::Texture;
use mateval_tracer::World;

/// A parallelogram from `corner` along `u` and `v`; u x v points to its front.
pub fn quad(corner: Vec3, u: Vec3, v: Vec3) -> TriangleMesh {
    TriangleMesh {
        positions: vec![corner, corner + u, corner + u + v, corner + v],
        normals: None,
        uvs: Some(vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}

/// The six sides of the cube from -1 to 1, with their fronts inside.
pub fn room() -> Vec<TriangleMesh> {
    let (x, y, z) = (Vec3::X * 2.0, Vec3::Y * 2.0, Vec3::Z * 2.0);
    let (low, high) = (Vec3::splat(-1.0), Vec3::splat(1.0));
    vec![quad(low, z, x), quad(high, -x, -z), quad(low, y, z), quad(high, -z, -y), quad(low, x, y), quad(high, -y, -x)]
}

/// A sphere of `rings` x 2 `rings` quads with smooth normals and its front outside.
pub fn sphere(centre: Vec3, radius: f32, rings: u32) -> TriangleMesh {
    let sectors = 2 * rings;
    let mut normals = Vec::new();
    for ring in 0..=rings {
        for sector in 0..=sectors {
            let (sin_t, cos_t) = libm::sincosf(std::f32::consts::PI * ring as f32 / rings as f32);
            let (sin_p, cos_p) = libm::sincosf(std::f32::consts::TAU * sector as f32 / sectors as f32);
            normals.push(Vec3::new(sin_t * cos_p, cos_t, sin_t * sin_p));
        }
    }
    let at = |ring: u32, sector: u32| ring * (sectors + 1) + sector;
    let triangles = (0..rings).flat_map(|r| {
        (0..sectors)
            .flat_map(move |s| [[at(r, s), at(r, s + 1), at(r + 1, s)], [at(r + 1, s), at(r, s + 1), at(r + 1, s + 1)]])
    });
    let positions = normals.iter().map(|n| centre + *n * radius).collect();
    TriangleMesh { positions, triangles: triangles.collect(), normals: Some(normals), uvs: None }
}

/// A two-sided material of `model`.
pub fn material(model: MaterialModel) -> Material {
    Material::new("", model)
}

/// A grey Lambertian material.
pub fn grey(reflectance: f32) -> Material {
    material(MaterialModel::Diffuse { reflectance: ColorInput::Constant([reflectance; 3]), alpha: None })
}

/// Constant parameters of the principled model.
pub fn principled(color: [f32; 3], roughness: f32, metallic: f32, flavour: PrincipledFlavour) -> MaterialModel {
    MaterialModel::Principled {
        base_color: ColorInput::Constant(color),
        roughness: ScalarInput::Constant(roughness),
        metallic: ScalarInput::Constant(metallic),
        specular: 0.5,
        flavour,
    }
}

/// A copper-like metal, smooth or with GGX facets of this width.
pub fn metal(alpha: Option<f32>) -> MaterialModel {
    let facets = |alpha| Microfacets { distribution: Distribution::Ggx, alpha: ScalarInput::Constant(alpha) };
    MaterialModel::Conductor {
        ior: ConductorIor::EtaK { eta: [0.2, 0.9, 1.1], k: [3.9, 2.4, 2.1] },
        specular_reflectance: ColorInput::Constant([1.0; 3]),
        microfacets: alpha.map(facets),
    }
}

/// Builds a scene step by step.
#[derive(Default)]
pub struct Builder(ReferenceScene);

impl From<ReferenceScene> for Builder {
    fn from(scene: ReferenceScene) -> Self {
        Self(scene)
    }
}

impl Builder {
    /// Adds a mesh made of `material`.
    pub fn surface(mut self, mesh: TriangleMesh, material: Material) -> Self {
        let index = MaterialIndex(self.0.materials.len());
        self.0.materials.push(material);
        self.0.surfaces.push(Surface { name: String::new(), mesh, material: index });
        self
    }

    /// Makes the front of the last surface emit.
    pub fn glowing(self, radiance: [f32; 3]) -> Self {
        let last = SurfaceIndex(self.0.surfaces.len() - 1);
        self.light(Emission::Area { surfaces: vec![last], radiance, map: None, two_sided: false })
    }

    /// Multiplies the radiance of the last light by `texture`, looked up by `uv`.
    pub fn mapped(mut self, texture: Texture, uv: UvTransform) -> Self {
        let index = TextureIndex(self.0.textures.len());
        self.0.textures.push(SourceTexture { name: String::new(), sha256: None, texture });
        let Some(Emission::Area { map, .. }) = self.0.lights.last_mut().map(|group| &mut group.emission) else {
            unreachable!("no surface has been made to glow")
        };
        *map = Some(EmissionMap { texture: index, uv });
        self
    }

    /// Makes the last light emit on both sides.
    pub fn on_both_sides(mut self) -> Self {
        let Some(Emission::Area { two_sided, .. }) = self.0.lights.last_mut().map(|group| &mut group.emission) else {
            unreachable!("no surface has been made to glow")
        };
        *two_sided = true;
        self
    }

    pub fn light(mut self, emission: Emission) -> Self {
        self.0.lights.push(LightGroup { name: String::new(), emission, camera_visible: true });
        self
    }

    /// Hides the last light from the camera.
    pub fn hidden(mut self) -> Self {
        self.0.lights.last_mut().unwrap().camera_visible = false;
        self
    }

    /// Returns the scene, for further changes.
    pub fn scene(self) -> ReferenceScene {
        self.0
    }

    /// Returns the scene as a world.
    pub fn world(self) -> World {
        World::new(Arc::new(self.0)).unwrap()
    }
}

/// A camera of `size` x `size` pixels.
pub fn camera(position: [f64; 3], target: [f64; 3], size: u32, fov_deg: f64) -> Camera {
    let (position, target) = (DVec3::from_array(position), DVec3::from_array(target));
    let up = if (target - position).normalize().y.abs() > 0.99 { DVec3::Z } else { DVec3::Y };
    Camera::look_at(position, target, up, Intrinsics::from_fov_x(size, size, fov_deg.to_radians())).unwrap()
}

/// The four walls among the room's surfaces; added meshes come after them.
pub const WALLS: [usize; 4] = [2, 3, 4, 5];

pub fn box_quad(corner: [f32; 3], u: [f32; 3], v: [f32; 3]) -> TriangleMesh {
    TriangleMesh { uvs: Some(vec![Vec2::ZERO; 4]), ..quad(corner.into(), u.into(), v.into()) }
}

/// Floor, ceiling, walls at x = 0 and 4 and at z = 0 and 6, then `more`; all of one grey.
pub fn box_room(more: Vec<TriangleMesh>) -> ReferenceScene {
    let [x, y, z] = [[4.0, 0.0, 0.0], [0.0, 2.5, 0.0], [0.0, 0.0, 6.0]];
    let mut meshes = vec![
        box_quad([0.0; 3], x, z),
        box_quad([0.0, 2.5, 0.0], x, z),
        box_quad([0.0; 3], y, z),
        box_quad([4.0, 0.0, 0.0], y, z),
        box_quad([0.0; 3], x, y),
        box_quad([0.0, 0.0, 6.0], x, y),
    ];
    meshes.extend(more);
    let surface = |mesh| Surface { name: String::new(), mesh, material: MaterialIndex(0) };
    ReferenceScene {
        surfaces: meshes.into_iter().map(surface).collect(),
        materials: vec![grey(0.5)],
        ..Default::default()
    }
}

/// At the back of the room, looking along -z to the far wall, 60 degrees wide.
pub fn box_camera() -> Camera {
    let intrinsics = Intrinsics::from_fov_x(320, 180, 60_f64.to_radians());
    Camera::look_at(DVec3::new(2.0, 1.2, 5.5), DVec3::new(2.0, 1.2, 0.0), DVec3::Y, intrinsics)
        .expect("the camera looks along an axis")
}
