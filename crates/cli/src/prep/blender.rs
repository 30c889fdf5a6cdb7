//! Which Blender renders, and what it may take.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::bail;
use mateval_prep::render::{BlenderOptions, BlenderProgram};

use crate::weights::cache_folder;

/// The command that installs Blender as a Python module, from the project's folder.
const MEND: &str = "tools/setup.sh";

/// What concerns Blender alone.
#[derive(clap::Args, Clone, Debug)]
pub struct BlenderArgs {
    /// A Blender 4.5, or a Python whose `bpy` module is one; else $MATEVAL_BLENDER, else what tools/setup.sh installed.
    #[arg(long, value_name = "PATH")]
    pub blender: Option<PathBuf>,
    /// Scenes that Blender renders at once.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=64))]
    pub jobs: u16,
    /// Seconds that Blender may take for a scene.
    #[arg(long, value_name = "SECONDS", default_value_t = 7200, value_parser = clap::value_parser!(u32).range(1..))]
    pub time_limit: u32,
    /// GiB of memory that Blender may take.
    #[arg(long, value_name = "GIB", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub memory_limit: u32,
    /// How often a scene is tried.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=10))]
    pub attempts: u32,
}

impl BlenderArgs {
    /// What they ask for; fails where there is no Blender.
    pub fn options(&self) -> anyhow::Result<BlenderOptions> {
        let mut options = BlenderOptions::new(BlenderProgram(self.program()?));
        options.jobs = usize::from(self.jobs);
        options.attempts = self.attempts;
        options.limits.time = Duration::from_secs(u64::from(self.time_limit));
        options.limits.memory_bytes = u64::from(self.memory_limit) << 30;
        Ok(options)
    }

    fn program(&self) -> anyhow::Result<PathBuf> {
        let named = std::env::var_os("MATEVAL_BLENDER").filter(|value| !value.is_empty()).map(PathBuf::from);
        let installed = cache_folder().join("blender/bin/python");
        let (program, named) = match (&self.blender, named) {
            (Some(path), _) => (path.clone(), "--blender"),
            (None, Some(path)) => (path, "MATEVAL_BLENDER"),
            (None, None) if installed.exists() => (installed, ""),
            (None, None) => {
                let place = installed.display();
                bail!(
                    "there is no Blender: neither --blender nor MATEVAL_BLENDER names one, and '{place}' is not there; run: {MEND}"
                );
            }
        };
        // A name without a folder is looked for on the PATH.
        if program.components().count() > 1 && !program.is_file() {
            bail!(
                "{named} names '{}', which is not there; expected a Blender, or a Python with bpy",
                program.display()
            );
        }
        Ok(program)
    }
}
