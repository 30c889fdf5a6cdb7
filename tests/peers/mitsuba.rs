//! Compares the tracer with Mitsuba 3 on scenes exported by `mateval_export::mitsuba`.
//!
//! Each measurement is printed on a line. If `MATEVAL_TEST_PICTURES` names a folder, both pictures of each scene are
//! written there side by side, with their difference (grey where they are equal).

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use mateval_dataset::reference::ReferenceScene;
use mateval_dataset::{Camera, Severity};
use mateval_export::mitsuba::export;
use mateval_image::{LinearRgb, Picture, SrgbRgb, png_io};
use mateval_tracer::{RenderSettings, World, render};

use super::python;
use super::z_test::{Agreement, Renders, compare};

/// Number of renders of each side.
const RENDERS: u32 = 16;

/// One measurement at a time: both sides use all cores.
static ALONE: Mutex<()> = Mutex::new(());

/// A scene that both renderers render.
#[derive(Clone)]
pub struct Case {
    pub name: String,
    pub scene: ReferenceScene,
    pub camera: Camera,
    /// Samples a pixel of each of the renders.
    pub samples: u32,
}

/// A case with Mitsuba's pictures of it.
pub struct Rendered {
    pub case: Case,
    theirs: Renders,
    seconds: f64,
}

/// Renders all cases with Mitsuba in one process, so that kernels are compiled only once.
pub fn by_mitsuba(cases: Vec<Case>) -> Vec<Rendered> {
    let _alone = ALONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let folder = tempfile::tempdir().unwrap();
    let place = |index: usize, name: &str| folder.path().join(index.to_string()).join(name);
    let scenes: Vec<_> = cases
        .iter()
        .enumerate()
        .map(|(index, case)| {
            export_whole(case, &place(index, ""));
            let (scene, out) = (place(index, "scene.xml"), place(index, "out.raw"));
            let seeds: Vec<u32> = (0..RENDERS).map(|seed| 1000 + seed).collect();
            serde_json::json!({"scene": scene, "out": out, "seeds": seeds, "samples": case.samples})
        })
        .collect();
    let job = folder.path().join("job.json");
    std::fs::write(&job, serde_json::json!({ "scenes": scenes }).to_string()).unwrap();
    python::run("render_mitsuba.py", &job);
    let result: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("result.json")).unwrap()).unwrap();
    let rendered = |(index, case): (usize, Case)| Rendered {
        theirs: read_renders(&place(index, "out.raw"), &case.camera),
        seconds: result["seconds"][index].as_f64().unwrap(),
        case,
    };
    cases.into_iter().enumerate().map(rendered).collect()
}

/// Exports the scene, which must not contain anything that Mitsuba cannot represent.
fn export_whole(case: &Case, folder: &Path) {
    let settings = RenderSettings { samples: case.samples, ..Default::default() };
    let findings = export(&case.scene, &case.camera, &settings, folder).unwrap();
    let unsaid: Vec<_> = findings.iter().filter(|finding| finding.severity != Severity::Note).collect();
    assert!(unsaid.is_empty(), "{}: {unsaid:?}", case.name);
}

fn read_renders(path: &Path, camera: &Camera) -> Renders {
    let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
    let bytes = std::fs::read(path).unwrap();
    assert_eq!(bytes.len(), 12 * width * height * RENDERS as usize);
    let floats: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    let picture = |values: &[f32]| {
        let pixels = values.as_chunks::<3>().0.iter().map(|rgb| LinearRgb(*rgb)).collect();
        Picture::new(width, height, pixels).unwrap()
    };
    floats.chunks(3 * width * height).map(picture).collect()
}

impl Rendered {
    /// Compares our pictures of `scene` from the same camera with Mitsuba's of the case; prints the result under
    /// `name`.
    pub fn against(&self, name: &str, scene: ReferenceScene) -> Agreement {
        let _alone = ALONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let started = Instant::now();
        let world = World::new(Arc::new(scene)).unwrap();
        let ours: Renders = (0..RENDERS).map(|seed| self.our_render(&world, seed)).collect();
        let seconds = started.elapsed().as_secs_f64();
        let found = compare(&ours, &self.theirs);
        let Agreement { ratio, error, whole_z, tile_mean, worst_tile, pixel_mean, worst_pixel, p, test } = found;
        eprintln!(
            "{name:<34} ratio {ratio:.5} +- {error:.5} z {whole_z:>6.2} | tiles {tile_mean:>5.2} worst {worst_tile:>5.2} \
             | pixels {pixel_mean:.3} worst {worst_pixel:>5.2} | p {p:.1e} {test:<11} | {seconds:.1} s, Mitsuba {:.1} s",
            self.seconds
        );
        show(name, &ours, &self.theirs);
        found
    }

    fn our_render(&self, world: &World, seed: u32) -> Picture<LinearRgb> {
        let settings = RenderSettings { samples: self.case.samples, seed: 1 + u64::from(seed), ..Default::default() };
        let done = render(world, &self.case.camera, &settings, &|_, _| ()).unwrap();
        assert_eq!(done.stats.not_finite, 0, "{}", self.case.name);
        done.picture
    }

    /// Whether both renderers agree on the case.
    pub fn agrees(&self) -> bool {
        self.against(&self.case.name, self.case.scene.clone()).holds()
    }

    /// The twin: whether our pictures of the changed scene are found to differ from Mitsuba's of the original one.
    pub fn detects(&self, what: &str, change: impl FnOnce(&mut ReferenceScene)) -> bool {
        let mut scene = self.case.scene.clone();
        change(&mut scene);
        assert!(scene != self.case.scene, "{what} changes nothing");
        !self.against(&format!("  twin: {what}"), scene).holds()
    }
}

/// Renders all cases by both and fails with the names of those that disagree.
#[track_caller]
pub fn all_agree(cases: Vec<Case>) -> Vec<Rendered> {
    let rendered = by_mitsuba(cases);
    let wrong: Vec<&str> = rendered.iter().filter(|case| !case.agrees()).map(|case| case.case.name.as_str()).collect();
    assert!(wrong.is_empty(), "our pictures and Mitsuba's disagree: {wrong:?}");
    rendered
}

/// Ours, theirs and half grey plus four times the difference, side by side.
fn show(name: &str, ours: &Renders, theirs: &Renders) {
    let Some(folder) = std::env::var_os("MATEVAL_TEST_PICTURES") else { return };
    let (a, b) = (mean(ours), mean(theirs));
    let (width, height) = (a.width(), a.height());
    let encoded = [a.to_srgb(), b.to_srgb()];
    let strip = Picture::from_fn(3 * width, height, |x, y| match x / width {
        2 => {
            let (a, b) = (a.get(x % width, y).0, b.get(x % width, y).0);
            SrgbRgb([0, 1, 2].map(|c| (0.5 + 4.0 * (a[c] - b[c]) / (a[c] + b[c]).max(1e-4)).clamp(0.0, 1.0)))
        }
        side => encoded[side].get(x % width, y),
    });
    let file: String = name.trim().chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
    png_io::write_srgb(&PathBuf::from(folder).join(format!("{file}.png")), &strip).unwrap();
}

fn mean(renders: &Renders) -> Picture<LinearRgb> {
    let n = renders.len() as f32;
    Picture::from_fn(renders[0].width(), renders[0].height(), |x, y| {
        let value = |c: usize| renders.iter().map(|picture| picture.get(x, y).0[c]).sum::<f32>() / n;
        LinearRgb([value(0), value(1), value(2)])
    })
}
