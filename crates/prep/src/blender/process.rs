//! Blender as a process of its own: started, watched, ended when it takes too long or too much.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use crate::error::PrepError;

/// How often a running Blender is looked at.
const LOOK: Duration = Duration::from_millis(100);

/// A Blender, or a Python that has the `bpy` module.
#[derive(Clone, Debug)]
pub struct BlenderProgram(pub PathBuf);

/// What a Blender may take.
#[derive(Clone, Copy, Debug)]
pub struct BlenderLimits {
    /// Time for one scene.
    pub time: Duration,
    /// Time without a line of output, after which it counts as hanging.
    pub silence: Duration,
    /// Resident memory in bytes.
    pub memory_bytes: u64,
}

/// How a Blender ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// By itself.
    Itself(ExitStatus),
    /// It took longer than this, which it may, and was ended.
    TooLong(Duration),
    /// It said nothing for longer than this, which it may, and was ended.
    Silent(Duration),
    /// It took so many bytes of memory, more than it may, and was ended.
    TooMuchMemory {
        /// What it took.
        bytes: u64,
        /// What it may take.
        most: u64,
    },
}

impl std::fmt::Display for Ended {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Itself(status) => write!(f, "it ended with {status}"),
            Self::TooLong(most) => write!(f, "it took longer than {} s and was ended", most.as_secs()),
            Self::Silent(most) => write!(f, "it said nothing for {} s and was ended", most.as_secs()),
            Self::TooMuchMemory { bytes, most } => {
                write!(f, "it took {} MiB of memory, more than {} MiB, and was ended", bytes >> 20, most >> 20)
            }
        }
    }
}

impl BlenderProgram {
    /// A Python by its name; anything else is a Blender.
    fn is_python(&self) -> bool {
        self.0.file_name().is_some_and(|name| name.to_string_lossy().starts_with("python"))
    }

    /// What is run for a job.
    pub fn command(&self, script: &Path, job: &Path) -> Command {
        let mut command = Command::new(&self.0);
        match self.is_python() {
            // Isolated: nothing but the script's folder and the module's is imported from.
            true => command.args(["-I", "-B", "-u"]).arg(script).arg(job),
            false => command.args(["--background", "--factory-startup", "--python"]).arg(script).arg("--").arg(job),
        };
        command.env("PYTHONDONTWRITEBYTECODE", "1");
        command
    }
}

/// Runs the command until it ends or breaks a limit. All that it prints goes to `log`, and line by line to `hear`, which
/// is also called with nothing now and then.
pub fn run(
    mut command: Command,
    log: &Path,
    limits: &BlenderLimits,
    hear: &mut dyn FnMut(Option<&str>) -> Result<(), PrepError>,
) -> Result<Ended, PrepError> {
    let io = |action| PrepError::io(action, log);
    let file = File::create(log).map_err(io("write"))?;
    let other = file.try_clone().map_err(io("write"))?;
    command.stdin(Stdio::null()).stdout(file).stderr(other);
    let program = PathBuf::from(command.get_program());
    let mut child = Running(command.spawn().map_err(PrepError::io("run", program))?);
    let mut lines = Lines { file: File::open(log).map_err(io("read"))?, rest: String::new() };
    let start = Instant::now();
    let mut last_line = start;
    loop {
        let ended = child.0.try_wait().map_err(io("wait for the process of"))?;
        for line in lines.new_ones().map_err(io("read"))? {
            last_line = Instant::now();
            hear(Some(&line))?;
        }
        hear(None)?;
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
        std::thread::sleep(LOOK);
    }
}

/// A process that does not outlive its owner.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // One that has ended cannot be killed, which is as well.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A file's lines as it grows.
struct Lines {
    file: File,
    rest: String,
}

/// A line longer than this is not kept: Blender's own are short.
const MAX_LINE_BYTES: usize = 1 << 16;

impl Lines {
    fn new_ones(&mut self) -> std::io::Result<Vec<String>> {
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

/// Resident memory of a process; none where the system does not tell.
fn resident_bytes(process: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? << 10)
}

/// The last lines of a log, at most `bytes` of them.
pub fn tail(log: &Path, bytes: u64) -> String {
    let read = || -> std::io::Result<String> {
        let mut file = File::open(log)?;
        let length = file.metadata()?.len();
        file.seek(SeekFrom::Start(length.saturating_sub(bytes)))?;
        let mut text = Vec::new();
        file.read_to_end(&mut text)?;
        let text = String::from_utf8_lossy(&text).into_owned();
        // The first line is most likely cut.
        Ok(if length > bytes { text.split_once('\n').map_or(String::new(), |(_, rest)| rest.to_owned()) } else { text })
    };
    read().unwrap_or_else(|error| format!("(the log cannot be read: {error})"))
}
