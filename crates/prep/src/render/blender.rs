//! Renders with Blender: one process per scene, which is run again where it fails and resumes where it ended.
//!
//! Blender renders the reference scene, as the built-in tracer does: its geometry with the source's uv, and the
//! source's textures. `instances.glb` and `parts.glb` serve only to find the part of each triangle; baked textures are
//! not used.

use std::collections::{BTreeSet, VecDeque};
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::layout::SceneFolder;
use mateval_dataset::render_file::{DeviceKind, RenderFile, RenderNoise};
use mateval_dataset::{Finding, Progress, Report, SceneId, Severity, reference};
use mateval_files::FileError;

use super::run::{MAX_BOUNCES, RenderReport, RenderRun, ViewRender, seed, seed_texts, write_view};
use crate::blender_job::{
    BlenderEvent, BlenderLimits, BlenderProgram, BlenderResult, BlenderView, DeviceChoice, JobFolder, JobPlan, JobView,
    tail,
};
use crate::error::PrepError;
use crate::scene_meshes;

/// Folder of the jobs while they are rendered, inside the dataset's folder. Names that start with a dot do not belong
/// to a dataset.
const WORK: &str = ".render";
/// How much of the end of a log a finding quotes, in bytes.
const TAIL_BYTES: u64 = 1500;
/// Cycles takes seeds below this number.
const SEEDS: u64 = 1 << 31;

#[derive(Clone, Debug)]
pub struct BlenderOptions {
    pub program: BlenderProgram,
    pub limits: BlenderLimits,
    pub device: DeviceChoice,
    /// Number of scenes rendered at once. Each process renders on one graphics card, and they take turns.
    pub jobs: usize,
    /// How often Blender is run for a scene before the scene counts as failed.
    pub attempts: u32,
}

impl BlenderOptions {
    /// One scene at a time on the processor and two attempts, each of two hours and 16 GiB at most.
    pub fn new(program: BlenderProgram) -> Self {
        let limits = BlenderLimits {
            time: Duration::from_secs(2 * 3600),
            silence: Duration::from_secs(15 * 60),
            memory_bytes: 16 << 30,
        };
        Self { program, limits, device: DeviceChoice::Cpu, jobs: 1, attempts: 2 }
    }
}

/// Renders the scenes, `options.jobs` at a time. A scene that fails becomes a failure in the report and does not stop
/// the others.
pub(super) fn render_scenes(
    run: &RenderRun<'_>,
    options: &BlenderOptions,
    scenes: &[&SceneId],
    progress: Progress<'_>,
) -> Result<RenderReport, PrepError> {
    let at_once = options.jobs.clamp(1, scenes.len().max(1));
    let queue: Mutex<VecDeque<usize>> = Mutex::new((0..scenes.len()).collect());
    let done: Mutex<Vec<(usize, Result<RenderReport, PrepError>)>> = Mutex::new(Vec::new());
    let work = |turn: u32| {
        let next = || lock(&queue).pop_front();
        while let Some(at) = next() {
            let finished = lock(&done).len();
            progress(Report::part(&format!("scene {}", scenes[at]), finished, scenes.len()));
            let scene = BlenderScene { run, options, id: scenes[at], turn, at_once, progress };
            // Before the list is locked, or one scene would be rendered at a time.
            let report = run.on_scene(scenes[at], || scene.render());
            lock(&done).push((at, report));
        }
    };
    std::thread::scope(|scope| {
        for turn in 0..at_once as u32 {
            let work = &work;
            scope.spawn(move || work(turn));
        }
    });
    let mut done = std::mem::take(&mut *lock(&done));
    done.sort_by_key(|(at, _)| *at);
    let mut all = RenderReport::default();
    for (_, report) in done {
        all.add(report?);
    }
    // What concerns the device is the same for every scene.
    let mut said = BTreeSet::new();
    all.remarks.retain(|remark| said.insert(remark.clone()));
    remove_if_empty(run.root.join(WORK));
    Ok(all)
}

/// Locks the queue or the list. A panic of another thread leaves both in a valid state.
fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A scene that Blender is to render.
struct BlenderScene<'a> {
    run: &'a RenderRun<'a>,
    options: &'a BlenderOptions,
    id: &'a SceneId,
    /// The position of this thread among those that render at once, and their number.
    turn: u32,
    at_once: usize,
    progress: Progress<'a>,
}

impl BlenderScene<'_> {
    fn render(&self) -> Result<RenderReport, PrepError> {
        let folder = SceneFolder::of(self.run.root, self.id);
        let scene = SceneFile::read(&folder)?;
        let mut report = RenderReport::default();
        let (mut views, mut required_device) = self.views_to_render(&folder, &scene);
        report.kept = scene.views.len() - views.len();
        if views.is_empty() {
            return Ok(report);
        }
        let work = self.run.root.join(WORK).join(self.id.as_str());
        if work.exists() {
            std::fs::remove_dir_all(&work).map_err(FileError::io("remove", &work))?;
        }
        let reference = reference::read(&folder)?;
        let parts = scene_meshes::part_values(&folder, &scene)?;
        let mut failure = None;
        for attempt in 1..=self.options.attempts.max(1) {
            let plan = JobPlan {
                scene: self.id,
                reference: &reference,
                parts: &parts,
                views: views.clone(),
                samples_each_half: self.run.samples,
                max_bounces: MAX_BOUNCES,
                threads: self.threads(),
                device: self.options.device,
                required_device,
                turn: self.turn,
            };
            let job = JobFolder::prepare(&work, &plan)?;
            let before = views.len();
            failure = self.attempt(&job, &folder, &scene, &mut views).err();
            report.rendered += before - views.len();
            if let Some(result) = job.result().ok().flatten() {
                if before > views.len() {
                    required_device = Some(result.device.as_ref().map(|device| device.kind));
                    report.remarks.extend(result.device.map(|device| format!("rendered on {device}")));
                }
                report.remarks.extend(result.remark);
            }
            let Some(failure) = &failure else { break };
            report.remarks.push(format!("scene '{}': attempt {attempt} failed: {}", self.id, failure.what));
        }
        match failure {
            None => std::fs::remove_dir_all(&work).map_err(FileError::io("remove", &work))?,
            Some(failure) => report.failures.push(self.finding(failure)),
        }
        Ok(report)
    }

    /// The views to render, and what has rendered the others: `None` for nothing, `Some(None)` for the processor.
    fn views_to_render(&self, folder: &SceneFolder, scene: &SceneFile) -> (Vec<JobView>, Option<Option<DeviceKind>>) {
        let device = self.options.device;
        let mut kept: Option<Option<DeviceKind>> = None;
        let mut views = Vec::new();
        for view in &scene.views {
            let seeds = self.seeds(view);
            let found = self.run.done(folder, view, &seed_texts(seeds)).map(|file| file.device);
            // Where an earlier run was asked for another kind and ended early, the first kept view decides.
            let is_of_kept = |kind| kept.is_none_or(|kept| kept == kind);
            match found {
                Some(found) if device.accepts(found.as_ref()) && is_of_kept(found.as_ref().map(|found| found.kind)) => {
                    kept = Some(found.map(|found| found.kind));
                }
                _ => views.push(JobView {
                    id: view.id.clone(),
                    camera: view.camera,
                    seeds: seeds.map(|seed| u32::try_from(seed).expect("seeds are below 2^31")),
                }),
            }
        }
        (views, kept)
    }

    fn seeds(&self, view: &View) -> [u64; 2] {
        [0, 1].map(|half| seed(self.id, view, half) % SEEDS)
    }

    /// Threads of one process: its share of what this process may use, which on a cluster is less than the node has
    /// (RAYON_NUM_THREADS, or the processors that the job is bound to).
    fn threads(&self) -> u32 {
        (rayon::current_num_threads() / self.at_once).max(1) as u32
    }

    /// Runs Blender once and removes the views that it finished from `views`.
    fn attempt(
        &self,
        job: &JobFolder,
        folder: &SceneFolder,
        scene: &SceneFile,
        views: &mut Vec<JobView>,
    ) -> Result<(), Failure> {
        let mut step = format!("{} start", self.id);
        let ended = job.run(&self.options.program, &self.options.limits, &mut |event| match event {
            BlenderEvent::Line(line) => {
                self.show_progress(line, &mut step);
                Ok(())
            }
            BlenderEvent::View(view, result, pictures) => {
                let Some(at) = views.iter().position(|wanted| wanted.id == view.id) else { return Ok(()) };
                self.keep(folder, scene, &views[at], result, &pictures)?;
                views.remove(at);
                Ok(())
            }
        });
        let failed = |what: String| Failure {
            what,
            log: tail(&job.log(), TAIL_BYTES),
            repeat: job.command_text(&self.options.program),
        };
        match ended {
            Err(error) => Err(failed(error.to_string())),
            Ok(_) if views.is_empty() => Ok(()),
            Ok(ended) => {
                let reported = job.result().ok().flatten().and_then(|result| result.error);
                Err(failed(reported.map_or(ended.to_string(), |error| format!("{ended}: {error}"))))
            }
        }
    }

    /// Shows how far Blender is, from a line that it printed: Blender itself counts samples, our script names views.
    fn show_progress(&self, line: &str, step: &mut String) {
        if let Some(text) = line.strip_prefix("mateval: ") {
            *step = format!("{} {text}", self.id);
            (self.progress)(Report::step(step, 0, 1));
        } else if let Some((done, all)) = line.rsplit_once("Sample ").and_then(|(_, count)| count.split_once('/'))
            && let (Ok(done), Ok(all)) = (done.trim().parse(), all.trim().parse())
        {
            (self.progress)(Report::step(step, done, all));
        }
    }

    /// Writes the pictures of a view to their place in the dataset.
    fn keep(
        &self,
        folder: &SceneFolder,
        scene: &SceneFile,
        view: &JobView,
        result: &BlenderResult,
        pictures: &BlenderView,
    ) -> Result<(), PrepError> {
        let (width, height) = (view.camera.intrinsics.width as usize, view.camera.intrinsics.height as usize);
        let [a, b] = &pictures.halves;
        let (expected, found) = ([width, height], [a.rgb.width(), a.rgb.height()]);
        if found != expected {
            let picture = format!("scene '{}', view '{}': the rendered picture", self.id, view.id);
            return Err(PrepError::PictureSize { picture, expected, found, hint: "" });
        }
        let file = RenderFile {
            renderer: self.run.renderer.clone(),
            renderer_version: Some(result.blender.clone()),
            device: result.device.clone(),
            samples_each_half: self.run.samples,
            seeds: seed_texts(view.seeds.map(u64::from)),
            max_bounces: MAX_BOUNCES,
            capped_throughput: None,
            denoiser: "OpenImageDenoise".to_owned(),
            noise: RenderNoise::of([&a.rgb, &b.rgb], &pictures.denoised.rgb),
            approximations: result.approximations.clone(),
        };
        let render = ViewRender { halves: [a, b], shown: &pictures.denoised, passes: Some(pictures) };
        write_view(&folder.render(&self.run.renderer, &view.id), &render, scene.exposure, &file)
    }

    fn finding(&self, failure: Failure) -> Finding {
        let log = match failure.log.trim().is_empty() {
            true => "(the log is empty)".to_owned(),
            false => format!("the log ends with:\n{}", failure.log),
        };
        Finding::new(
            Severity::Error,
            "blender_failed",
            format!("scenes/{}", self.id),
            "",
            format!("Blender failed: {}; {log}", failure.what),
            format!(
                "to repeat the failure: {}; to render the scene, run the same `mateval` command again",
                failure.repeat
            ),
        )
    }
}

struct Failure {
    what: String,
    log: String,
    /// The command that repeats the attempt.
    repeat: String,
}

/// Removes the folder unless failed jobs left files in it.
fn remove_if_empty(folder: PathBuf) {
    // An error means that the folder is not empty or does not exist, and either is fine.
    let _ = std::fs::remove_dir(folder);
}
