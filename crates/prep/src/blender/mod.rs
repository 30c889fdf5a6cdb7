//! Renders with Blender's Cycles, and has Blender [`bake`] its own files.
//!
//! In: a scene of a dataset and its views. Out: [`BlenderView`]s. Between: `job` writes a folder with the scene, `scripts`
//! copies `blender_scripts` into it, `process` runs Blender and enforces limits, `view_files` reads the pictures.

pub mod bake;
pub mod job;
mod process;
mod scripts;
mod view_files;

use std::path::{Path, PathBuf};

use mateval_scene::json;

use crate::error::PrepError;
pub use job::{BlenderJob, BlenderResult, JobPlan, JobView};
pub use process::{BlenderLimits, BlenderProgram, Ended, tail};
pub use view_files::{BlenderView, LightPictures};

/// A folder with a job that is ready to run.
#[derive(Debug)]
pub struct JobFolder {
    folder: PathBuf,
    script: PathBuf,
    /// Number of light groups of the scene.
    groups: usize,
}

/// An event of a running Blender.
pub enum BlenderEvent<'a> {
    /// Blender printed a line.
    Line(&'a str),
    /// The pictures of a view are complete.
    View(&'a job::ResultView, &'a BlenderResult, Box<BlenderView>),
}

impl JobFolder {
    /// Writes the job into the folder, which is created if it does not exist.
    pub fn prepare(folder: &Path, plan: &JobPlan<'_>) -> Result<Self, PrepError> {
        std::fs::create_dir_all(folder).map_err(PrepError::io("make", folder))?;
        job::write(folder, plan)?;
        let script = scripts::write(folder)?;
        Ok(Self { folder: folder.to_owned(), script, groups: plan.reference.lights.len() })
    }

    /// The file of everything that Blender prints.
    pub fn log(&self) -> PathBuf {
        self.folder.join("blender.log")
    }

    fn job(&self) -> PathBuf {
        self.folder.join("job.json")
    }

    /// The command that runs the job, as text that a user can repeat in a shell.
    pub fn command_text(&self, program: &BlenderProgram) -> String {
        let command = program.command(&self.script, &self.job());
        let words = std::iter::once(command.get_program()).chain(command.get_args());
        words.map(|word| format!("'{}'", word.to_string_lossy())).collect::<Vec<_>>().join(" ")
    }

    /// Runs Blender until it ends, and calls `on_event` for every line that it prints and for each view as soon as its
    /// pictures are complete.
    pub fn run(
        &self,
        program: &BlenderProgram,
        limits: &BlenderLimits,
        on_event: &mut dyn FnMut(BlenderEvent<'_>) -> Result<(), PrepError>,
    ) -> Result<Ended, PrepError> {
        let result = self.folder.join("result.json");
        match std::fs::remove_file(&result) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(PrepError::io("remove", &result)(error));
            }
            _ => {}
        }
        let mut reported = 0;
        process::run(program.command(&self.script, &self.job()), &self.log(), limits, &mut |line| match line {
            Some(line) => on_event(BlenderEvent::Line(line)),
            None => {
                let Some(result) = self.result()? else { return Ok(()) };
                for view in result.views.iter().skip(reported) {
                    let pictures = view_files::read(&self.folder.join(view.id.as_str()), self.groups)?;
                    on_event(BlenderEvent::View(view, &result, Box::new(pictures)))?;
                    reported += 1;
                }
                Ok(())
            }
        })
    }

    /// What the script has recorded so far; none before it has written its first result.
    pub fn result(&self) -> Result<Option<BlenderResult>, PrepError> {
        let path = self.folder.join("result.json");
        if !path.is_file() {
            return Ok(None);
        }
        Ok(Some(json::read_format(&path, job::RESULT_FORMAT)?))
    }
}
