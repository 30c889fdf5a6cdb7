//! Arguments that choose the Blender that renders, and its limits.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::bail;
use mateval_prep::render::{BlenderOptions, BlenderProgram};

use crate::weights::cache_folder;

/// The command that installs Blender.
const FETCH_BLENDER: &str = "mateval fetch blender";

/// Arguments that concern Blender alone.
#[derive(clap::Args, Clone, Debug)]
pub struct BlenderArgs {
    /// Blender 4.5, or a Python with that version's `bpy` module [default: $MATEVAL_BLENDER, else the one that
    /// `mateval fetch blender` installed].
    #[arg(long, value_name = "PATH")]
    blender: Option<PathBuf>,
    /// Number of scenes that Blender renders at once.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=64))]
    jobs: u16,
    /// Longest time that Blender may take for a scene, in seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 7200, value_parser = clap::value_parser!(u32).range(1..))]
    time_limit: u32,
    /// Most memory that Blender may take, in GiB.
    #[arg(long, value_name = "GIB", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=4096))]
    memory_limit: u32,
    /// How often Blender is run for a scene before the scene counts as failed.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=10))]
    attempts: u32,
}

/// The Blender at this path, or else the usual one; absent if no path is given and none is installed.
pub fn found(path: Option<PathBuf>) -> anyhow::Result<Option<BlenderOptions>> {
    let arguments = BlenderArgs { blender: path, jobs: 1, time_limit: 7200, memory_limit: 16, attempts: 1 };
    match arguments.options() {
        Ok(options) => Ok(Some(options)),
        Err(error) if arguments.is_given() => Err(error),
        Err(_) => Ok(None),
    }
}

impl BlenderArgs {
    /// How Blender is run; fails where it cannot be found.
    pub fn options(&self) -> anyhow::Result<BlenderOptions> {
        let mut options = BlenderOptions::new(BlenderProgram(self.program()?));
        options.jobs = usize::from(self.jobs);
        options.attempts = self.attempts;
        options.limits.time = Duration::from_secs(u64::from(self.time_limit));
        options.limits.memory_bytes = u64::from(self.memory_limit) << 30;
        Ok(options)
    }

    /// The program that the user names, and where.
    fn given(&self) -> Option<(PathBuf, &'static str)> {
        let from_environment = std::env::var_os("MATEVAL_BLENDER").filter(|value| !value.is_empty());
        let from_option = self.blender.clone().map(|path| (path, "--blender"));
        from_option.or_else(|| from_environment.map(|path| (path.into(), "MATEVAL_BLENDER")))
    }

    /// Whether the user names a program, which must then be usable.
    pub fn is_given(&self) -> bool {
        self.given().is_some()
    }

    fn program(&self) -> anyhow::Result<PathBuf> {
        let Some((program, origin)) = self.given() else {
            let installed = cache_folder().join("blender/bin/python");
            if installed.exists() {
                return Ok(installed);
            }
            bail!(
                "no Blender found: neither --blender nor MATEVAL_BLENDER is given, and '{}' does not exist; run: \
                 {FETCH_BLENDER}, or give --renderer builtin",
                installed.display()
            );
        };
        // A name without a folder is searched for in PATH when it is run.
        if program.components().count() > 1 && !program.is_file() {
            let shown = program.display();
            bail!("{origin} is '{shown}', which does not exist; expected Blender, or a Python with bpy");
        }
        Ok(program)
    }
}
