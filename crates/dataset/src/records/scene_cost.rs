//! What making a scene has cost. It is kept in `.build`, because the bytes of a dataset must not depend on a clock.
//!
//! Costs add up over all runs since the scene was built, so that a resumed step counts as a whole; a run that was
//! killed or failed is not counted.

use std::path::Path;
use std::time::{Duration, Instant};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::layout::BuildFolder;
use crate::{DatasetError, RendererId, SceneId, json};
use mateval_files::work_folder;

/// The format of this version of the file.
const COST_FORMAT: &str = "mateval-cost/1";

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Step {
    /// `prep build`.
    Build,
    /// `prep render`: the photo renderer's pictures.
    Render,
    /// `prep render`: the scorer's reference.
    Scorer,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StepCost {
    /// The step of making the scene.
    pub step: Step,
    /// The renderer of the step `render`; null for the others.
    pub renderer: Option<RendererId>,
    /// Number of runs that ended well.
    pub runs: usize,
    /// Elapsed time of all runs, in seconds.
    pub wall_seconds: f64,
    /// Processor time of all runs, on all threads and in child processes such as Blender, in seconds; null where the
    /// system does not state it, or where a run worked on several scenes at once.
    pub cpu_seconds: Option<f64>,
}

/// `.build/costs/<scene>.json`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CostFile {
    format: String,
    steps: Vec<StepCost>,
}

/// The work whose cost is recorded.
#[derive(Clone, Copy, Debug)]
pub struct TimedStep<'a> {
    pub step: Step,
    /// The renderer of the step `render`.
    pub renderer: Option<&'a RendererId>,
    /// Whether the process works on no other scene meanwhile, so that its processor time is the scene's.
    pub is_alone: bool,
}

/// The costs recorded for a scene of the dataset in `root`; empty where there are none.
pub fn read(root: &Path, scene: &SceneId) -> Result<Vec<StepCost>, DatasetError> {
    let path = BuildFolder::of(root).cost(scene);
    if !path.exists() {
        return Ok(Vec::new());
    }
    Ok(json::read_format::<CostFile>(&path, COST_FORMAT)?.steps)
}

/// Forgets the costs of a scene that is about to be built again.
pub fn forget(root: &Path, scene: &SceneId) -> Result<(), DatasetError> {
    Ok(work_folder::remove(&BuildFolder::of(root).cost(scene))?)
}

/// Does the work and, if it succeeds, adds its cost to those recorded. The caller holds the scene's lease. A record
/// that cannot be read fails before the work.
pub fn timed<T, E: From<DatasetError>>(
    root: &Path,
    scene: &SceneId,
    timed: &TimedStep<'_>,
    work: impl FnOnce() -> Result<T, E>,
) -> Result<T, E> {
    let mut steps = read(root, scene)?;
    let (start, cpu) = (Instant::now(), processor_time().filter(|_| timed.is_alone));
    let done = work()?;
    let cpu = cpu.zip(processor_time()).map(|(before, after)| after.saturating_sub(before));
    let run = StepCost {
        step: timed.step,
        renderer: timed.renderer.cloned(),
        runs: 1,
        wall_seconds: milliseconds(start.elapsed()),
        cpu_seconds: cpu.map(milliseconds),
    };
    add(&mut steps, run);
    write(root, scene, steps)?;
    Ok(done)
}

fn write(root: &Path, scene: &SceneId, steps: Vec<StepCost>) -> Result<(), DatasetError> {
    let path = BuildFolder::of(root).cost(scene);
    let folder = path.parent().unwrap_or(root);
    work_folder::make_folder(folder)?;
    json::write(&path, &CostFile { format: COST_FORMAT.to_owned(), steps })
}

/// Seconds, rounded to milliseconds.
fn milliseconds(time: std::time::Duration) -> f64 {
    (time.as_secs_f64() * 1e3).round() / 1e3
}

fn add(steps: &mut Vec<StepCost>, run: StepCost) {
    match steps.iter_mut().find(|known| known.step == run.step && known.renderer == run.renderer) {
        Some(known) => {
            known.runs += run.runs;
            known.wall_seconds += run.wall_seconds;
            known.cpu_seconds = known.cpu_seconds.zip(run.cpu_seconds).map(|(a, b)| a + b);
        }
        None => steps.push(run),
    }
}

/// Where Linux states it; see proc(5).
const STAT: &str = "/proc/self/stat";

/// The places of `utime`, `stime`, `cutime` and `cstime` behind the program's name.
const TIMES: std::ops::Range<usize> = 11..15;

/// The processor time used so far, of all threads and of child processes that have ended; absent if the system does
/// not state it.
pub fn processor_time() -> Option<Duration> {
    let ticks = ticks(&std::fs::read_to_string(STAT).ok()?)?;
    Some(Duration::from_secs_f64(ticks as f64 / rustix::param::clock_ticks_per_second() as f64))
}

/// The sum of the four times, in clock ticks. The program's name is in parentheses and may contain any character.
fn ticks(stat: &str) -> Option<u64> {
    let (_, rest) = stat.rsplit_once(") ")?;
    let fields: Vec<&str> = rest.split_whitespace().collect();
    fields.get(TIMES)?.iter().map(|field| field.parse::<u64>().ok()).sum()
}

#[cfg(test)]
mod tests {
    use mateval_files::FileError;

    use super::*;

    fn run(root: &Path, step: Step, is_alone: bool, works: bool) -> Result<(), DatasetError> {
        let scene = SceneId::new("room").unwrap();
        let renderer = RendererId::new("blender").unwrap();
        let renderer = (step == Step::Render).then_some(&renderer);
        timed(root, &scene, &TimedStep { step, renderer, is_alone }, || match works {
            true => Ok(()),
            false => Err(FileError::io("read", root)(std::io::Error::other("no")).into()),
        })
    }

    #[test]
    fn runs_add_up_and_failed_ones_do_not_count() {
        let root = tempfile::tempdir().unwrap();
        let scene = SceneId::new("room").unwrap();
        assert_eq!(read(root.path(), &scene).unwrap(), []);
        run(root.path(), Step::Build, true, true).unwrap();
        run(root.path(), Step::Render, true, true).unwrap();
        run(root.path(), Step::Render, true, false).unwrap_err();
        run(root.path(), Step::Render, false, true).unwrap();
        let found = read(root.path(), &scene).unwrap();
        let counts: Vec<_> = found.iter().map(|cost| (cost.step, cost.runs, cost.cpu_seconds.is_some())).collect();
        assert_eq!(counts, [(Step::Build, 1, true), (Step::Render, 2, false)]);
        assert_eq!(found[1].renderer.as_ref().unwrap().as_str(), "blender");
        forget(root.path(), &scene).unwrap();
        assert_eq!(read(root.path(), &scene).unwrap(), []);
    }

    /// A record that nobody can read is not replaced.
    #[test]
    fn a_bad_record_fails_before_the_work() {
        let root = tempfile::tempdir().unwrap();
        run(root.path(), Step::Build, true, true).unwrap();
        let path = BuildFolder::of(root.path()).cost(&SceneId::new("room").unwrap());
        std::fs::write(&path, "{}").unwrap();
        let mut worked = false;
        let step = TimedStep { step: Step::Build, renderer: None, is_alone: true };
        let failed: Result<(), DatasetError> = timed(root.path(), &SceneId::new("room").unwrap(), &step, || {
            worked = true;
            Ok(())
        });
        assert!(failed.is_err() && !worked);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "{}");
    }

    #[test]
    fn four_times_are_summed_whatever_the_name() {
        let stat = "12 (a) b) R 1 2 3 4 5 6 7 8 9 10 100 20 3000 4 0 0";
        assert_eq!(ticks(stat), Some(3124));
        assert_eq!(ticks("12 (a) R 1 2 3"), None);
        assert_eq!(ticks(&stat.replace("3000", "x")), None);
    }

    #[test]
    fn time_passes() {
        let before = processor_time().unwrap();
        while processor_time().unwrap() == before {}
    }
}
