//! Bindings to the part of Debian's Embree 3.13 that the benchmarks use (libembree-dev; header rtcore.h).
#![allow(unsafe_code, reason = "Embree is a C library")]

use std::ffi::{CString, c_char, c_int, c_uint, c_void};

use mateval_scene::TriangleMesh;
use mateval_tracer::Ray;

/// Embree's build and traversal mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// RTC_BUILD_QUALITY_MEDIUM, the default.
    Medium,
    /// The same with RTC_SCENE_FLAG_ROBUST.
    Robust,
}

/// A committed Embree scene.
pub struct Embree {
    device: *mut c_void,
    scene: *mut c_void,
}

#[repr(C, align(16))]
#[derive(Clone, Copy)]
struct RtcRay {
    origin: [f32; 3],
    tnear: f32,
    direction: [f32; 3],
    time: f32,
    tfar: f32,
    mask: c_uint,
    id: c_uint,
    flags: c_uint,
}

#[repr(C, align(16))]
struct RtcRayHit {
    ray: RtcRay,
    normal: [f32; 3],
    u: f32,
    v: f32,
    triangle: c_uint,
    geometry: c_uint,
    instance: c_uint,
}

#[repr(C)]
struct RtcIntersectContext {
    flags: c_uint,
    filter: *const c_void,
    instance: c_uint,
}

const INVALID: c_uint = c_uint::MAX;
const TRIANGLES: c_int = 0;
const INDEX_BUFFER: c_int = 0;
const VERTEX_BUFFER: c_int = 1;
const FORMAT_UINT3: c_int = 0x5003;
const FORMAT_FLOAT3: c_int = 0x9003;
const QUALITY_MEDIUM: c_int = 1;
const FLAG_ROBUST: c_int = 1 << 2;

#[link(name = "embree3")]
unsafe extern "C" {
    fn rtcNewDevice(config: *const c_char) -> *mut c_void;
    fn rtcReleaseDevice(device: *mut c_void);
    fn rtcNewScene(device: *mut c_void) -> *mut c_void;
    fn rtcReleaseScene(scene: *mut c_void);
    fn rtcSetSceneBuildQuality(scene: *mut c_void, quality: c_int);
    fn rtcSetSceneFlags(scene: *mut c_void, flags: c_int);
    fn rtcNewGeometry(device: *mut c_void, kind: c_int) -> *mut c_void;
    fn rtcReleaseGeometry(geometry: *mut c_void);
    fn rtcSetNewGeometryBuffer(
        geometry: *mut c_void,
        kind: c_int,
        slot: c_uint,
        format: c_int,
        stride: usize,
        count: usize,
    ) -> *mut c_void;
    fn rtcCommitGeometry(geometry: *mut c_void);
    fn rtcAttachGeometryByID(scene: *mut c_void, geometry: *mut c_void, id: c_uint);
    fn rtcCommitScene(scene: *mut c_void);
    fn rtcIntersect1(scene: *mut c_void, context: *mut RtcIntersectContext, hit: *mut RtcRayHit);
    fn rtcOccluded1(scene: *mut c_void, context: *mut RtcIntersectContext, ray: *mut RtcRay);
}

impl Embree {
    /// Copies the meshes and builds the scene with `threads` threads. `built` is called around the build alone.
    pub fn new(meshes: &[&TriangleMesh], mode: Mode, threads: usize, built: &mut dyn FnMut(&mut dyn FnMut())) -> Self {
        let config = CString::new(format!("threads={threads},start_threads=1")).unwrap();
        // SAFETY: the calls follow the order in Embree's manual, and buffers have the lengths requested.
        unsafe {
            let device = rtcNewDevice(config.as_ptr());
            assert!(!device.is_null());
            let scene = rtcNewScene(device);
            rtcSetSceneBuildQuality(scene, QUALITY_MEDIUM);
            rtcSetSceneFlags(scene, if mode == Mode::Robust { FLAG_ROBUST } else { 0 });
            for (id, mesh) in meshes.iter().enumerate() {
                let geometry = rtcNewGeometry(device, TRIANGLES);
                let (vertices, triangles) = (mesh.positions.len(), mesh.triangles.len());
                let to = rtcSetNewGeometryBuffer(geometry, VERTEX_BUFFER, 0, FORMAT_FLOAT3, 12, vertices);
                std::ptr::copy_nonoverlapping(mesh.positions.as_ptr().cast::<f32>(), to.cast(), 3 * vertices);
                let to = rtcSetNewGeometryBuffer(geometry, INDEX_BUFFER, 0, FORMAT_UINT3, 12, triangles);
                std::ptr::copy_nonoverlapping(mesh.triangles.as_ptr().cast::<u32>(), to.cast(), 3 * triangles);
                rtcCommitGeometry(geometry);
                rtcAttachGeometryByID(scene, geometry, id as c_uint);
                rtcReleaseGeometry(geometry);
            }
            built(&mut || rtcCommitScene(scene));
            Self { device, scene }
        }
    }

    /// Surface, triangle and distance of the nearest hit.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<(usize, usize, f32)> {
        let mut hit = RtcRayHit {
            ray: rtc_ray(ray),
            normal: [0.0; 3],
            u: 0.0,
            v: 0.0,
            triangle: INVALID,
            geometry: INVALID,
            instance: INVALID,
        };
        // SAFETY: the scene is committed; both structures are laid out as in the header.
        unsafe { rtcIntersect1(self.scene, &mut context(), &mut hit) };
        (hit.geometry != INVALID).then_some((hit.geometry as usize, hit.triangle as usize, hit.ray.tfar))
    }

    /// Whether the ray hits anything.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut ray = rtc_ray(ray);
        // SAFETY: as in `closest`.
        unsafe { rtcOccluded1(self.scene, &mut context(), &mut ray) };
        ray.tfar < 0.0
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        // SAFETY: `new` created both, and they are not used again.
        unsafe {
            rtcReleaseScene(self.scene);
            rtcReleaseDevice(self.device);
        }
    }
}

#[inline]
fn context() -> RtcIntersectContext {
    RtcIntersectContext { flags: 0, filter: std::ptr::null(), instance: INVALID }
}

#[inline]
fn rtc_ray(ray: &Ray) -> RtcRay {
    RtcRay {
        origin: ray.origin().to_array(),
        tnear: 0.0,
        direction: ray.direction().to_array(),
        time: 0.0,
        tfar: ray.max_distance(),
        mask: INVALID,
        id: 0,
        flags: 0,
    }
}
