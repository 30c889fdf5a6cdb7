//! `.zip` after PKWARE's APPNOTE 6.3: stored or deflated files, with or without Zip64.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use flate2::bufread::DeflateDecoder;

use super::unpacked::{Budget, EntryKind, Fault, MAX_ENTRIES, Writer};

/// Largest central directory, in bytes. It is held in memory.
const MAX_DIRECTORY: u64 = 64 << 20;
/// Bytes of the end record without its comment, and of its longest comment.
const END: u64 = 22;
const LONGEST_COMMENT: u64 = 65_535;

/// Unpacks into an empty folder.
pub fn unpack_zip(file: File, folder: &Path) -> Result<(), Fault> {
    let mut archive = Archive { length: file.metadata()?.len(), file };
    let directory = archive.directory()?;
    let entries = directory.entries()?;
    check_declared(&entries, archive.length)?;
    let mut writer = Writer::new(folder);
    let mut packed = 0;
    for entry in &entries {
        archive.unpack(entry, &directory, &mut packed, &mut writer)?;
    }
    writer.finish()
}

/// Fails where the sizes that the archive states exceed the limits already.
fn check_declared(entries: &[Entry], length: u64) -> Result<(), Fault> {
    let total = |size: fn(&Entry) -> u64| entries.iter().map(size).fold(0, u64::saturating_add);
    if total(|entry| entry.packed) > length {
        let message = "its entries together have more bytes than the archive: they overlap";
        return Err(Fault::refused("overlapping_entries", message, "pack it again"));
    }
    Budget::default().add_bytes(total(|entry| entry.size), length)
}

/// One file or folder, from the central directory.
struct Entry {
    name: std::ops::Range<usize>,
    kind: EntryKind,
    encrypted: bool,
    method: u16,
    checksum: u32,
    packed: u64,
    size: u64,
    offset: u64,
}

impl Entry {
    /// Whether its bytes can be unpacked; if not, that is a fault.
    fn is_readable(&self, shown: &str, writer: &mut Writer<'_>) -> bool {
        if self.encrypted {
            writer.fault("encrypted", shown, "encrypted", "pack it without a password");
        } else if !matches!(self.method, 0 | 8) {
            let message = format!("compression method {}; expected stored (0) or deflated (8)", self.method);
            writer.fault("unknown_compression", shown, message, "pack it as usual (zip -r)");
        } else {
            return true;
        }
        false
    }
}

/// The central directory: the list of entries.
struct Directory {
    bytes: Vec<u8>,
    count: u64,
    /// Where it begins; the files lie before it.
    offset: u64,
}

struct Archive {
    file: File,
    length: u64,
}

impl Archive {
    fn read_at(&mut self, offset: u64, length: u64) -> Result<Vec<u8>, Fault> {
        self.file.seek(SeekFrom::Start(offset))?;
        let mut bytes = Vec::new();
        self.file.by_ref().take(length).read_to_end(&mut bytes)?;
        if bytes.len() as u64 == length { Ok(bytes) } else { Err(Fault::damaged("it is truncated")) }
    }

    /// Finds the end record and reads the central directory that it points to.
    fn directory(&mut self) -> Result<Directory, Fault> {
        let tail_length = self.length.min(END + LONGEST_COMMENT);
        let tail_start = self.length - tail_length;
        let tail = self.read_at(tail_start, tail_length)?;
        // Its comment fills the rest of the file.
        let fits = |at: &usize| {
            tail[*at..].starts_with(b"PK\x05\x06")
                && number(&tail, at + 20, 2).is_some_and(|comment| *at as u64 + END + comment == tail_length)
        };
        let at = (0..tail.len())
            .rev()
            .find(fits)
            .ok_or_else(|| Fault::damaged("it has no valid end record: it may be truncated"))?;
        let field = |offset: usize, bytes: usize| number(&tail, at + offset, bytes).unwrap_or_default();
        let (mut count, mut size, mut offset) = (field(10, 2), field(12, 4), field(16, 4));
        if count == 0xffff || size == 0xffff_ffff || offset == 0xffff_ffff {
            (count, size, offset) = self.zip64_end(tail_start + at as u64)?;
        }
        if count > MAX_ENTRIES as u64 {
            let message = format!("{count} files and folders; expected at most {MAX_ENTRIES}");
            return Err(Fault::refused("too_many_files", message, "pack submission.json and the maps only"));
        }
        if size > MAX_DIRECTORY {
            let message = format!("a central directory of {size} bytes; expected at most {MAX_DIRECTORY}");
            return Err(Fault::refused("directory_too_large", message, "pack it without comments"));
        }
        if offset.checked_add(size).is_none_or(|end| end > tail_start + at as u64) {
            return Err(Fault::damaged("its central directory is not where the end record says"));
        }
        Ok(Directory { bytes: self.read_at(offset, size)?, count, offset })
    }

    /// Count, size and offset of the central directory, from the Zip64 end record in front of the plain one.
    fn zip64_end(&mut self, end: u64) -> Result<(u64, u64, u64), Fault> {
        let start = end.checked_sub(20).ok_or_else(|| Fault::damaged("it has no valid Zip64 end record"))?;
        let locator = self.read_at(start, 20)?;
        let offset = number(&locator, 8, 8).filter(|_| locator.starts_with(b"PK\x06\x07"));
        let offset = offset.filter(|offset| offset.checked_add(56).is_some_and(|end| end <= start));
        let record = self.read_at(offset.ok_or_else(|| Fault::damaged("it has no valid Zip64 end record"))?, 56)?;
        if !record.starts_with(b"PK\x06\x06") {
            return Err(Fault::damaged("it has no valid Zip64 end record"));
        }
        let field = |at: usize| number(&record, at, 8).unwrap_or_default();
        Ok((field(32), field(40), field(48)))
    }

    fn unpack(
        &mut self,
        entry: &Entry,
        directory: &Directory,
        packed: &mut u64,
        writer: &mut Writer<'_>,
    ) -> Result<(), Fault> {
        let name = &directory.bytes[entry.name.clone()];
        let shown = String::from_utf8_lossy(name).into_owned();
        let Some(place) = writer.place(name, entry.kind)? else { return Ok(()) };
        if !entry.is_readable(&shown, writer) || !writer.is_small(&shown, entry.size) {
            return Ok(());
        }
        let Some(start) = self.data_start(entry, name, directory.offset)? else {
            writer.fault(
                "damaged_archive",
                &shown,
                "its data are not where the central directory says",
                "pack it again",
            );
            return Ok(());
        };
        self.file.seek(SeekFrom::Start(start))?;
        let data = BufReader::new(self.file.by_ref().take(entry.packed));
        let before = *packed;
        let sum = if entry.method == 0 {
            let mut data = data;
            writer.write(&place, entry.size, &mut data, |_| before + entry.packed)?
        } else {
            let mut data = DeflateDecoder::new(data);
            writer.write(&place, entry.size, &mut data, |data| before + data.total_in())?
        };
        *packed += entry.packed;
        if sum.is_some_and(|sum| sum != entry.checksum) {
            writer.fault("damaged_archive", &shown, "its checksum is wrong", "pack it again");
        }
        Ok(())
    }

    /// Where an entry's data begin; absent if its own header is invalid or has another name than the central
    /// directory.
    fn data_start(&mut self, entry: &Entry, name: &[u8], end: u64) -> Result<Option<u64>, Fault> {
        const HEADER: u64 = 30;
        let Some(header_end) = entry.offset.checked_add(HEADER + name.len() as u64).filter(|at| *at <= end) else {
            return Ok(None);
        };
        let header = self.read_at(entry.offset, HEADER + name.len() as u64)?;
        let [name_length, extra] = [26, 28].map(|at| number(&header, at, 2).unwrap_or_default());
        let start = header_end + extra;
        let sound = header.starts_with(b"PK\x03\x04")
            && name_length == name.len() as u64
            && header[HEADER as usize..] == *name
            && start.checked_add(entry.packed).is_some_and(|data_end| data_end <= end);
        Ok(sound.then_some(start))
    }
}

impl Directory {
    /// All entries, as many as the end record says.
    fn entries(&self) -> Result<Vec<Entry>, Fault> {
        let (mut entries, mut at) = (Vec::new(), 0);
        for _ in 0..self.count {
            let (entry, next) = self.entry(at).ok_or_else(|| Fault::damaged("its central directory is invalid"))?;
            entries.push(entry);
            at = next;
        }
        if at == self.bytes.len() {
            Ok(entries)
        } else {
            Err(Fault::damaged("its central directory is longer than the end record says"))
        }
    }

    /// The entry at a place of the central directory, and the place of the next.
    fn entry(&self, at: usize) -> Option<(Entry, usize)> {
        let header = self.bytes.get(at..at.checked_add(46)?)?;
        let field = |offset: usize, bytes: usize| number(header, offset, bytes);
        let [name, extra, comment] = [28, 30, 32].map(|offset| field(offset, 2).unwrap_or_default() as usize);
        let name = at + 46..at + 46 + name;
        let extra = name.end..name.end + extra;
        let next = extra.end + comment;
        if !header.starts_with(b"PK\x01\x02") || next > self.bytes.len() {
            return None;
        }
        let mut long = Zip64::of(&self.bytes[extra]);
        let size = long.or_longer(field(24, 4)?)?;
        let packed = long.or_longer(field(20, 4)?)?;
        let offset = long.or_longer(field(42, 4)?)?;
        let kind = kind_of(&self.bytes[name.clone()], field(4, 2)?, field(38, 4)?);
        let entry = Entry {
            name,
            kind,
            encrypted: field(8, 2)? & 1 == 1,
            method: field(10, 2)? as u16,
            checksum: field(16, 4)? as u32,
            packed,
            size,
            offset,
        };
        Some((entry, next))
    }
}

/// Links and devices are recognised by their Unix mode, in the upper half of the attributes.
fn kind_of(name: &[u8], made_by: u64, attributes: u64) -> EntryKind {
    const UNIX: u64 = 3;
    let mode = if made_by >> 8 == UNIX { (attributes >> 16) & 0o170_000 } else { 0 };
    match mode {
        0o120_000 => EntryKind::Link,
        0o040_000 => EntryKind::Folder,
        0 | 0o100_000 if name.ends_with(b"/") => EntryKind::Folder,
        0 | 0o100_000 => EntryKind::File,
        _ => EntryKind::Special,
    }
}

/// The 64-bit numbers of an entry, in a fixed order. Each occurs only where its 32-bit field is all ones.
struct Zip64<'a>(&'a [u8]);

impl<'a> Zip64<'a> {
    fn of(mut extra: &'a [u8]) -> Self {
        while let (Some(id), Some(length)) = (number(extra, 0, 2), number(extra, 2, 2)) {
            let Some((field, rest)) = extra[4..].split_at_checked(length as usize) else { break };
            if id == 1 {
                return Self(field);
            }
            extra = rest;
        }
        Self(&[])
    }

    fn or_longer(&mut self, short: u64) -> Option<u64> {
        if short != 0xffff_ffff {
            return Some(short);
        }
        let long = number(self.0, 0, 8)?;
        self.0 = &self.0[8..];
        Some(long)
    }
}

/// A little-endian number of `count` bytes.
fn number(bytes: &[u8], at: usize, count: usize) -> Option<u64> {
    let bytes = bytes.get(at..at.checked_add(count)?)?;
    Some(bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)))
}
