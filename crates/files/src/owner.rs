//! The process that an unfinished file or a lease belongs to, so that nobody takes what a living process holds.

use std::os::unix::fs::MetadataExt as _;
use std::sync::LazyLock;
use std::time::SystemTime;

/// A process of some host. Its text is `HOST-PROCESS-START`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Owner {
    /// The host's name, with `_` for everything but ASCII letters and digits, and the number of its process namespace.
    pub host: String,
    pub process: u32,
    /// Distinguishes the process from an earlier one with the same number, such as the first process of a container
    /// that was started again.
    start: u64,
}

/// Linux allows no longer name.
const HOST_CHARS: usize = 64;

static HOST: LazyLock<String> = LazyLock::new(|| {
    let name = rustix::system::uname().nodename().to_string_lossy().into_owned();
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let name: String = name.chars().take(HOST_CHARS).map(plain).collect();
    // Two containers may have one host's name, and each counts its processes from 1.
    let processes = std::fs::metadata("/proc/self/ns/pid").map_or(0, |found| found.ino());
    format!("{name}_{processes}")
});

static START: LazyLock<u64> =
    LazyLock::new(|| SystemTime::UNIX_EPOCH.elapsed().map_or(0, |time| u64::try_from(time.as_nanos()).unwrap_or(0)));

impl Owner {
    pub fn this_process() -> Self {
        // The number is asked for each time, since a forked child inherits everything else.
        Self { host: HOST.clone(), process: std::process::id(), start: *START }
    }

    /// Reads an owner's text; absent if it is not one.
    pub fn parse(text: &str) -> Option<Self> {
        let [host, process, start] = <[&str; 3]>::try_from(text.split('-').collect::<Vec<_>>()).ok()?;
        let start = u64::from_str_radix(start, 16).ok()?;
        Some(Self { host: host.to_owned(), process: process.parse().ok()?, start })
    }

    /// Whether the process has ended; absent if it runs on another host, since only that one knows.
    pub fn is_gone(&self) -> Option<bool> {
        if self.host != *HOST {
            return None;
        }
        if self.process == std::process::id() {
            return Some(self.start != *START);
        }
        let number = i32::try_from(self.process).ok().and_then(rustix::process::Pid::from_raw);
        // Every other error is of a process that exists and belongs to somebody else.
        let gone = |number| rustix::process::test_kill_process(number) == Err(rustix::io::Errno::SRCH);
        Some(number.is_none_or(gone))
    }
}

impl std::fmt::Display for Owner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}-{}-{:x}", self.host, self.process, self.start)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_is_read_back_and_other_texts_are_refused() {
        let own = Owner::this_process();
        assert_eq!(Owner::parse(&own.to_string()), Some(own));
        for text in ["", "a", "a-b-c", "a-1", "a-1-1-1", "a--1-1"] {
            assert_eq!(Owner::parse(text), None, "{text}");
        }
    }

    #[test]
    fn this_process_lives_and_another_start_of_it_does_not() {
        let own = Owner::this_process();
        assert_eq!(own.is_gone(), Some(false));
        assert_eq!(Owner { start: 1, ..own.clone() }.is_gone(), Some(true));
        assert_eq!(Owner { host: "other.host".to_owned(), ..own.clone() }.is_gone(), None);
        // A number beyond every process.
        assert_eq!(Owner { process: u32::MAX, ..own }.is_gone(), Some(true));
    }
}
