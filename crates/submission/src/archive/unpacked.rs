//! Writes the entries of an archive to a folder within limits: checks the name of each and counts its bytes.

use std::io::{ErrorKind, Read, Write as _};
use std::path::Path;

use mateval_dataset::Finding;
use mateval_files::untrusted::shortened;

use crate::error::error;
use crate::files::MAX_MAP_BYTES;

/// Most files and folders of a submission, packed or not.
pub const MAX_ENTRIES: usize = 200_000;
/// Most bytes of all files together, once unpacked.
pub const MAX_UNPACKED: u64 = 64 << 30;
/// Bytes that any archive may unpack to, however small it is.
pub const ALWAYS_ALLOWED: u64 = 256 << 20;
/// Beyond [`ALWAYS_ALLOWED`], most bytes that may be unpacked from each byte of the archive.
pub const MAX_RATIO: u64 = 200;
/// Longest name, in bytes.
const LONGEST_NAME: usize = 512;
/// Most names in a path.
const DEEPEST: usize = 8;
/// Most faults that are reported.
const MOST_FAULTS: usize = 100;
const BLOCK: usize = 1 << 16;

/// Why an archive is not unpacked.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    #[error("the archive is refused:{}", Finding::list(.0))]
    Refused(Vec<Finding>),
    #[error(transparent)]
    Io(#[from] std::io::Error),
}

impl Fault {
    pub(super) fn refused(code: &str, message: impl Into<String>, action: &str) -> Self {
        Self::Refused(vec![refusal(code, "", message, action)])
    }

    /// Refuses an archive that is not what its format prescribes.
    pub(super) fn damaged(message: impl Into<String>) -> Self {
        Self::refused("damaged_archive", message, "pack it again")
    }
}

/// A finding about one entry, or about the whole archive where `entry` is empty.
fn refusal(code: &str, entry: &str, message: impl Into<String>, action: &str) -> Finding {
    error(code, &shortened(entry), message, action)
}

/// What has been unpacked from an archive so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Budget {
    pub(super) entries: usize,
    unpacked: u64,
}

impl Budget {
    pub(super) fn add_entry(&mut self) -> Result<(), Fault> {
        self.entries += 1;
        if self.entries <= MAX_ENTRIES {
            return Ok(());
        }
        let message = format!("more than {MAX_ENTRIES} files and folders");
        Err(Fault::refused("too_many_files", message, "pack submission.json and the maps only"))
    }

    /// Counts bytes that were unpacked from the first `packed` bytes of the archive.
    pub(super) fn add_bytes(&mut self, bytes: u64, packed: u64) -> Result<(), Fault> {
        self.unpacked = self.unpacked.saturating_add(bytes);
        if self.unpacked > MAX_UNPACKED {
            let message = format!("more than {MAX_UNPACKED} bytes once unpacked");
            return Err(Fault::refused(
                "archive_too_large",
                message,
                "pack fewer scenes, and score them in several runs",
            ));
        }
        if self.unpacked > ALWAYS_ALLOWED && self.unpacked > packed.saturating_mul(MAX_RATIO) {
            let message = format!(
                "{packed} bytes of the archive unpack to {} bytes or more; expected at most {MAX_RATIO} times the packed size",
                self.unpacked
            );
            return Err(Fault::refused(
                "archive_bomb",
                message,
                "store maps as compressed PNG or EXR files, then pack them",
            ));
        }
        Ok(())
    }
}

type EntryFault = (&'static str, String);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EntryKind {
    File,
    Folder,
    Link,
    /// A device, a pipe, a sparse file or anything else.
    Special,
}

/// Writes entries to a folder. Faults of single entries are collected, so that all of them are reported together.
pub(super) struct Writer<'a> {
    root: &'a Path,
    pub(super) budget: Budget,
    faults: Vec<Finding>,
}

impl<'a> Writer<'a> {
    pub(super) fn new(root: &'a Path) -> Self {
        Self { root, budget: Budget::default(), faults: Vec::new() }
    }

    pub(super) fn fault(&mut self, code: &str, entry: &str, message: impl Into<String>, action: &str) {
        if self.faults.len() < MOST_FAULTS {
            self.faults.push(refusal(code, entry, message, action));
        }
    }

    /// The path, relative to the target folder, of the file that an entry becomes. None for a folder, and for an entry
    /// with a fault.
    pub(super) fn place(&mut self, name: &[u8], kind: EntryKind) -> Result<Option<String>, Fault> {
        self.budget.add_entry()?;
        let shown = String::from_utf8_lossy(name).into_owned();
        let place = match place_of(name) {
            Ok(place) => place,
            Err((code, message)) => {
                self.fault(code, &shown, message, "pack the folder with relative names");
                return Ok(None);
            }
        };
        match kind {
            EntryKind::Link => {
                self.fault("link_in_archive", &shown, "a link; expected a file or a folder", "pack the file itself");
                Ok(None)
            }
            EntryKind::Special => {
                self.fault("special_entry", &shown, "neither a file nor a folder", "leave it out");
                Ok(None)
            }
            EntryKind::File | EntryKind::Folder if place.is_empty() => Ok(None),
            EntryKind::Folder => {
                self.make_folder(&shown, &place)?;
                Ok(None)
            }
            EntryKind::File => Ok(Some(place)),
        }
    }

    /// Whether a file is small enough to be a map; if not, that is a fault.
    pub(super) fn is_small(&mut self, entry: &str, bytes: u64) -> bool {
        if bytes > MAX_MAP_BYTES {
            let message = format!("{bytes} bytes; expected at most {MAX_MAP_BYTES}");
            self.fault("file_too_large", entry, message, "save it with compression, or with fewer texels");
        }
        bytes <= MAX_MAP_BYTES
    }

    /// Writes a file of exactly `expected` bytes. `packed` is the number of the archive's bytes that have been read so
    /// far. Returns the file's checksum (CRC-32), or none where the entry has a fault.
    pub(super) fn write<R: Read>(
        &mut self,
        place: &str,
        expected: u64,
        data: &mut R,
        packed: impl Fn(&R) -> u64,
    ) -> Result<Option<u32>, Fault> {
        let parent = place.rsplit_once('/').map_or("", |(parent, _)| parent);
        if !self.make_folder(place, parent)? {
            return Ok(None);
        }
        let mut file = match std::fs::File::create_new(self.root.join(place)) {
            Ok(file) => file,
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                self.duplicate(place);
                return Ok(None);
            }
            Err(error) => return Err(error.into()),
        };
        match self.copy(&mut file, expected, data, packed)? {
            Ok(sum) => Ok(Some(sum)),
            Err((code, message)) => {
                self.fault(code, place, message, "pack it again");
                Ok(None)
            }
        }
    }

    /// Copies a file's bytes. Returns their checksum, or the entry's fault.
    fn copy<R: Read>(
        &mut self,
        file: &mut std::fs::File,
        expected: u64,
        data: &mut R,
        packed: impl Fn(&R) -> u64,
    ) -> Result<Result<u32, EntryFault>, Fault> {
        let (mut block, mut written, mut sum) = (vec![0; BLOCK], 0_u64, flate2::Crc::new());
        while written <= expected {
            let count = match data.read(&mut block) {
                Ok(0) => break,
                Ok(count) => count,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => match error.downcast::<Fault>() {
                    Ok(fault) => return Err(fault),
                    Err(error) => return Ok(Err(("damaged_archive", format!("it cannot be unpacked: {error}")))),
                },
            };
            written += count as u64;
            self.budget.add_bytes(count as u64, packed(data))?;
            file.write_all(&block[..count])?;
            sum.update(&block[..count]);
        }
        if written == expected {
            return Ok(Ok(sum.sum()));
        }
        let found = if written > expected { "more".to_owned() } else { written.to_string() };
        Ok(Err(("wrong_size", format!("expected {expected} bytes as its header states, found {found}"))))
    }

    /// Makes a folder and those around it; each counts as an entry. Returns false, and records a fault, where a file
    /// has the name of one of them.
    fn make_folder(&mut self, entry: &str, place: &str) -> Result<bool, Fault> {
        let path = self.root.join(place);
        if path.is_dir() {
            return Ok(true);
        }
        let ends = place.match_indices('/').map(|(end, _)| end).chain([place.len()]);
        for folder in ends.map(|end| self.root.join(&place[..end])) {
            match std::fs::create_dir(&folder) {
                Ok(()) => self.budget.add_entry()?,
                Err(error) if error.kind() == ErrorKind::AlreadyExists && folder.is_dir() => {}
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                    self.duplicate(entry);
                    return Ok(false);
                }
                Err(error) => return Err(error.into()),
            }
        }
        Ok(true)
    }

    fn duplicate(&mut self, entry: &str) {
        self.fault("duplicate_name", entry, "a name that occurs twice", "pack each file once");
    }

    /// Fails if any entry had a fault.
    pub(super) fn finish(mut self) -> Result<(), Fault> {
        if self.faults.is_empty() {
            return Ok(());
        }
        self.faults.sort();
        Err(Fault::Refused(self.faults))
    }
}

/// The path that a name stands for, without `.` and empty parts. Fails where it leads out of the folder or is unusable.
fn place_of(name: &[u8]) -> Result<String, EntryFault> {
    let text = std::str::from_utf8(name).map_err(|_| ("bad_name", "a name that is not UTF-8".to_owned()))?;
    if text.len() > LONGEST_NAME || text.contains(['\0', '\\']) || text.chars().any(char::is_control) {
        let message = format!(
            "a name of {} bytes; expected at most {LONGEST_NAME}, without \\ and control characters",
            text.len()
        );
        return Err(("bad_name", message));
    }
    if text.starts_with('/') || text.as_bytes().get(1) == Some(&b':') {
        return Err((
            "absolute_name",
            "a name that is absolute; expected one relative to the archive's root".to_owned(),
        ));
    }
    let parts: Vec<&str> = text.split('/').filter(|part| !matches!(*part, "" | ".")).collect();
    if parts.contains(&"..") {
        return Err(("name_leads_out", "a name with '..'".to_owned()));
    }
    if parts.len() > DEEPEST {
        return Err(("bad_name", format!("a path of {} names; expected at most {DEEPEST}", parts.len())));
    }
    Ok(parts.join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_archives_are_not_held_to_the_ratio_and_large_ones_are() {
        let mut budget = Budget::default();
        budget.add_bytes(ALWAYS_ALLOWED, 1).unwrap();
        budget.add_bytes(1, ALWAYS_ALLOWED).unwrap();
        assert!(matches!(budget.add_bytes(1, 1), Err(Fault::Refused(_))));
        assert!(matches!(budget.add_bytes(MAX_UNPACKED, u64::MAX), Err(Fault::Refused(_))));
        budget.entries = MAX_ENTRIES - 1;
        budget.add_entry().unwrap();
        assert!(budget.add_entry().is_err());
    }

    /// A name that implies many folders counts as much as the folders do.
    #[test]
    fn folders_count_as_entries_do() {
        for (left, fits) in [(3, true), (2, false)] {
            let folder = tempfile::tempdir().unwrap();
            let mut writer = Writer::new(folder.path());
            writer.budget.entries = MAX_ENTRIES - left;
            assert_eq!(writer.place(b"a/b/", EntryKind::Folder).is_ok(), fits);
        }
    }

    #[test]
    fn names_stay_inside() {
        assert_eq!(place_of(b"./scenes//a/b.png").unwrap(), "scenes/a/b.png");
        assert_eq!(place_of(b"./").unwrap(), "");
        assert_eq!(place_of(b"a..b/...").unwrap(), "a..b/...");
        let bad: [(&[u8], &str); 9] = [
            (b"../a", "name_leads_out"),
            (b"a/../../b", "name_leads_out"),
            (b"a/..", "name_leads_out"),
            (b"/etc/passwd", "absolute_name"),
            (b"C:/a", "absolute_name"),
            (b"a\\..\\b", "bad_name"),
            (b"a\0b", "bad_name"),
            (b"\xff", "bad_name"),
            (b"1/2/3/4/5/6/7/8/9", "bad_name"),
        ];
        for (name, code) in bad {
            assert_eq!(place_of(name).unwrap_err().0, code, "{name:?}");
        }
        assert!(place_of(&[b'a'; 513]).is_err());
    }
}
