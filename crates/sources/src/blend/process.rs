//! Runs Blender as a process, and kills it when it exceeds a limit of time or memory.
//!
//! The scripts that Blender runs are embedded when this program is built.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use mateval_files::FileError;
use mateval_files::work_folder::make_folder;

/// Time between two looks at the running process.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// The path of Blender, or of a Python that has the `bpy` module.
#[derive(Clone, Debug)]
pub struct BlenderProgram(pub PathBuf);

#[derive(Clone, Copy, Debug)]
pub struct BlenderLimits {
    /// Longest time for one scene.
    pub time: Duration,
    /// Longest time without a line of output, after which the process counts as hanging.
    pub silence: Duration,
    /// Most resident memory, in bytes.
    pub memory_bytes: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    Itself(ExitStatus),
    /// The process was killed, since it took longer than this limit.
    TooLong(Duration),
    /// The process was killed, since it printed nothing for longer than this limit.
    Silent(Duration),
    /// The process was killed, since it took too much memory.
    TooMuchMemory {
        /// The memory that it took, in bytes.
        bytes: u64,
        /// The limit, in bytes.
        most: u64,
    },
}

impl std::fmt::Display for Ended {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Itself(status) => write!(f, "the process ended with {status}"),
            Self::TooLong(most) => write!(f, "the process took longer than {} s and was killed", most.as_secs()),
            Self::Silent(most) => write!(f, "the process printed nothing for {} s and was killed", most.as_secs()),
            Self::TooMuchMemory { bytes, most } => {
                write!(
                    f,
                    "the process took {} MiB of memory, more than {} MiB, and was killed",
                    bytes >> 20,
                    most >> 20
                )
            }
        }
    }
}

impl BlenderProgram {
    /// Whether the program is a Python, by its name. Any other program is taken for Blender.
    pub fn is_python(&self) -> bool {
        self.0.file_name().is_some_and(|name| name.to_string_lossy().starts_with("python"))
    }

    /// The command that runs `script` on `job`. Blender's temporary files lie beside the job.
    pub fn command(&self, script: &Path, job: &Path) -> Command {
        let mut command = Command::new(&self.0);
        match self.is_python() {
            // Isolated mode imports only from Python's own folders; the script adds its folder itself.
            true => command.args(["-I", "-B", "-u"]).arg(script).arg(job),
            false => command.args(["--background", "--factory-startup", "--python"]).arg(script).arg("--").arg(job),
        };
        command.env("PYTHONDONTWRITEBYTECODE", "1");
        // Scripts end by `os._exit` or are killed, which leaves Blender's folder of temporary files behind. Here it goes
        // with the job's.
        if let Some(folder) = std::path::absolute(job).ok().as_deref().and_then(Path::parent) {
            command.env("TMPDIR", folder);
        }
        command
    }
}

/// Runs the command until it ends or exceeds a limit. Its output goes to the file `log`. `on_line` is called with each
/// line of it, and with `None` after every look at the process.
pub fn run<E: From<FileError>>(
    mut command: Command,
    log: &Path,
    limits: &BlenderLimits,
    on_line: &mut dyn FnMut(Option<&str>) -> Result<(), E>,
) -> Result<Ended, E> {
    let io = |action| FileError::io(action, log);
    let file = File::create(log).map_err(io("write"))?;
    let other = file.try_clone().map_err(io("write"))?;
    command.stdin(Stdio::null()).stdout(file).stderr(other);
    let program = PathBuf::from(command.get_program());
    let mut child = Running(command.spawn().map_err(FileError::io("run", program))?);
    let mut lines = Lines { file: File::open(log).map_err(io("read"))?, rest: String::new() };
    let start = Instant::now();
    let mut last_line = start;
    loop {
        let ended = child.0.try_wait().map_err(io("wait for the process of"))?;
        for line in lines.read_new().map_err(io("read"))? {
            last_line = Instant::now();
            on_line(Some(&line))?;
        }
        on_line(None)?;
        if let Some(status) = ended {
            return Ok(Ended::Itself(status));
        }
        if start.elapsed() > limits.time {
            return Ok(Ended::TooLong(limits.time));
        }
        if last_line.elapsed() > limits.silence {
            return Ok(Ended::Silent(limits.silence));
        }
        let most = limits.memory_bytes;
        if let Some(bytes) = resident_bytes(child.0.id()).filter(|bytes| *bytes > most) {
            return Ok(Ended::TooMuchMemory { bytes, most });
        }
        std::thread::sleep(POLL_INTERVAL);
    }
}

/// A process that is killed when this value is dropped.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // Killing fails where the process has ended already, which is fine.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The lines of a file that is still being written.
struct Lines {
    file: File,
    /// The start of a line whose end has not been written yet.
    rest: String,
}

/// A longer line is discarded; those that Blender prints are short.
const MAX_LINE_BYTES: usize = 1 << 16;

impl Lines {
    /// The lines written since the last call.
    fn read_new(&mut self) -> std::io::Result<Vec<String>> {
        let mut bytes = Vec::new();
        self.file.read_to_end(&mut bytes)?;
        self.rest.push_str(&String::from_utf8_lossy(&bytes));
        let mut lines: Vec<String> = self.rest.split('\n').map(|line| line.trim_end().to_owned()).collect();
        self.rest = lines.pop().unwrap_or_default();
        if self.rest.len() > MAX_LINE_BYTES {
            self.rest.clear();
        }
        Ok(lines)
    }
}

/// Resident memory of a process, in bytes; absent if the system does not report it.
fn resident_bytes(process: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? << 10)
}

/// The last lines of a log, at most `bytes` bytes.
pub fn tail(log: &Path, bytes: u64) -> String {
    let read = || -> std::io::Result<String> {
        let mut file = File::open(log)?;
        let length = file.metadata()?.len();
        file.seek(SeekFrom::Start(length.saturating_sub(bytes)))?;
        let mut text = Vec::new();
        file.read_to_end(&mut text)?;
        let text = String::from_utf8_lossy(&text).into_owned();
        // The first line is probably incomplete.
        Ok(if length > bytes { text.split_once('\n').map_or(String::new(), |(_, rest)| rest.to_owned()) } else { text })
    };
    read().unwrap_or_else(|error| format!("(the log cannot be read: {error})"))
}

macro_rules! script {
    ($name:literal) => {
        ($name, include_str!(concat!("../../../../blender_scripts/", $name)))
    };
}

/// The files of `blender_scripts`. The first one renders.
const SCRIPTS: [(&str, &str); 27] = [
    script!("render.py"),
    script!("bake_blend.py"),
    script!("mateval/__init__.py"),
    script!("mateval/bake.py"),
    script!("mateval/baking_job.py"),
    script!("mateval/blend_file.py"),
    script!("mateval/bodies.py"),
    script!("mateval/camera.py"),
    script!("mateval/channels.py"),
    script!("mateval/cycles.py"),
    script!("mateval/denoise.py"),
    script!("mateval/devices.py"),
    script!("mateval/environment.py"),
    script!("mateval/evaluated.py"),
    script!("mateval/gltf.py"),
    script!("mateval/job.py"),
    script!("mateval/lighting.py"),
    script!("mateval/materials.py"),
    script!("mateval/metal.py"),
    script!("mateval/nodes.py"),
    script!("mateval/osl.py"),
    script!("mateval/pictures.py"),
    script!("mateval/plastic.py"),
    script!("mateval/scene.py"),
    script!("mateval/unwrap.py"),
    script!("mateval/uv_charts.py"),
    script!("mateval/world.py"),
];

/// The script that bakes a `.blend` file.
pub const BAKE_SCRIPT: &str = "bake_blend.py";

/// The folder of the modules.
const PACKAGE: &str = "mateval";

/// Writes the scripts into `folder/scripts` and returns the path of the one that renders.
pub fn write_scripts(folder: &Path) -> Result<PathBuf, FileError> {
    let scripts = folder.join("scripts");
    let package = scripts.join(PACKAGE);
    make_folder(&package)?;
    for (name, text) in SCRIPTS {
        let path = scripts.join(name);
        std::fs::write(&path, text).map_err(FileError::io("write", path))?;
    }
    Ok(scripts.join(SCRIPTS[0].0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a killed Blender leaves there is removed with the job.
    #[test]
    fn temporary_files_lie_beside_the_job() {
        let folder = tempfile::tempdir().unwrap();
        let command = BlenderProgram("blender".into()).command(Path::new("render.py"), &folder.path().join("job.json"));
        let found = command.get_envs().find(|(name, _)| *name == "TMPDIR").and_then(|(_, value)| value);
        assert_eq!(found, Some(folder.path().as_os_str()));
    }

    /// A script that is not in the list would be missing when Blender runs.
    #[test]
    fn every_script_is_embedded() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../blender_scripts");
        let mut found = Vec::new();
        for below in ["", PACKAGE] {
            for entry in std::fs::read_dir(folder.join(below)).unwrap() {
                let name = Path::new(below).join(entry.unwrap().file_name()).to_string_lossy().into_owned();
                found.extend(name.ends_with(".py").then_some(name));
            }
        }
        let mut listed = SCRIPTS.map(|(name, _)| name.to_owned());
        found.sort();
        listed.sort();
        assert_eq!(found, listed);
    }
}
