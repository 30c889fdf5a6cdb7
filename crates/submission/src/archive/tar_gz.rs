//! `.tar.gz`: what the `tar` crate reads, in gzip, under the byte budget of [`super::unpacked`].
//!
//! The crate is used in raw mode, which yields the headers of GNU long names and of pax attributes as entries of their
//! own. It then reads nothing unboundedly into memory and expands no sparse file. Every byte that it asks for, also one
//! that it skips, passes through [`Stream`], which counts it. The pax records are parsed here, because the crate takes
//! a line break within a value, as macOS writes in extended attributes, for the end of the record.

use std::fs::File;
use std::io::{BufReader, ErrorKind, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;
use mateval_files::untrusted::shortened;
use tar::{Archive, Entry, EntryType};

use super::unpacked::{Budget, EntryKind, Fault, Writer};
use crate::files::MAX_MAP_BYTES;

/// Longest name or list of attributes that precedes its entry, in bytes. It is held in memory.
const LONGEST_EXTRA: u64 = 1 << 16;

/// Unpacks into an empty folder.
pub fn unpack_tar_gz(file: File, folder: &Path) -> Result<(), Fault> {
    let mut writer = Writer::new(folder);
    let mut archive = Archive::new(Stream::new(file));
    let mut long_name: Option<Vec<u8>> = None;
    for entry in archive.entries().map_err(fault_of)?.raw(true) {
        let mut entry = entry.map_err(fault_of)?;
        match entry.header().entry_type() {
            // These precede the entry that they belong to.
            EntryType::GNULongName => long_name = Some(up_to_zero(extra(&mut entry, &mut writer)?)),
            EntryType::XHeader => long_name = pax_path(&extra(&mut entry, &mut writer)?)?.or(long_name),
            EntryType::XGlobalHeader | EntryType::GNULongLink => drop(extra(&mut entry, &mut writer)?),
            _ => {
                let name = long_name.take().unwrap_or_else(|| entry.path_bytes().into_owned());
                unpack(&mut entry, &name, &mut writer)?;
            }
        }
    }
    // Only the end of the gzip stream says whether all of it was intact.
    std::io::copy(&mut archive.into_inner(), &mut std::io::sink()).map_err(fault_of)?;
    writer.finish()
}

/// The fault that reading the archive met: the budget's, or damage.
fn fault_of(error: std::io::Error) -> Fault {
    error.downcast::<Fault>().unwrap_or_else(|error| Fault::damaged(format!("it cannot be unpacked: {error}")))
}

struct Counted {
    file: File,
    bytes: u64,
}

impl Read for Counted {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.bytes += count as u64;
        Ok(count)
    }
}

/// Decompresses the archive. Fails with a [`Fault`] inside the error where more comes out than the budget allows.
struct Stream {
    data: MultiGzDecoder<BufReader<Counted>>,
    budget: Budget,
}

impl Stream {
    fn new(file: File) -> Self {
        let data = MultiGzDecoder::new(BufReader::new(Counted { file, bytes: 0 }));
        Self { data, budget: Budget::default() }
    }
}

impl Read for Stream {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = loop {
            match self.data.read(buffer) {
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                read => break read?,
            }
        };
        let packed = self.data.get_ref().get_ref().bytes;
        self.budget.add_bytes(count as u64, packed).map_err(std::io::Error::other)?;
        Ok(count)
    }
}

/// A name or attributes that precede their entry.
fn extra(entry: &mut Entry<'_, Stream>, writer: &mut Writer<'_>) -> Result<Vec<u8>, Fault> {
    let size = entry.size();
    if size > LONGEST_EXTRA {
        let message = format!("a name or attributes of {size} bytes; expected at most {LONGEST_EXTRA}");
        return Err(Fault::refused("directory_too_large", message, "pack it without attributes"));
    }
    writer.budget.add_entry()?;
    let mut bytes = Vec::new();
    entry.read_to_end(&mut bytes).map_err(fault_of)?;
    if bytes.len() as u64 == size { Ok(bytes) } else { Err(Fault::damaged("it is truncated")) }
}

fn up_to_zero(mut name: Vec<u8>) -> Vec<u8> {
    name.truncate(name.iter().position(|byte| *byte == 0).unwrap_or(name.len()));
    name
}

fn unpack(entry: &mut Entry<'_, Stream>, name: &[u8], writer: &mut Writer<'_>) -> Result<(), Fault> {
    let kind = match entry.header().entry_type() {
        EntryType::Regular | EntryType::Continuous if name.ends_with(b"/") => EntryKind::Folder,
        EntryType::Regular | EntryType::Continuous => EntryKind::File,
        EntryType::Directory => EntryKind::Folder,
        EntryType::Link | EntryType::Symlink => EntryKind::Link,
        _ => EntryKind::Special,
    };
    let Some(place) = writer.place(name, kind)? else { return Ok(()) };
    let size = entry.size();
    // A stream cannot seek: even to skip a file that is too large takes as long as to unpack it.
    if size > MAX_MAP_BYTES {
        let message = format!("'{}' has {size} bytes; expected at most {MAX_MAP_BYTES}", shortened(&place));
        return Err(Fault::refused("file_too_large", message, "save it with compression, or with fewer texels"));
    }
    // How much comes out of each byte of the archive is counted by the stream.
    writer.write(&place, size, entry, |_| u64::MAX).map(drop)
}

/// The path among pax attributes. Fails where they change how the entry's bytes are to be read.
fn pax_path(bytes: &[u8]) -> Result<Option<Vec<u8>>, Fault> {
    let (mut rest, mut path) = (bytes, None);
    while !rest.is_empty() {
        let (length, key, value) = pax_record(rest).ok_or_else(|| Fault::damaged("attributes that cannot be read"))?;
        match key {
            b"path" => path = Some(value.to_vec()),
            b"size" => {
                let message = "a file of more bytes than its header can state";
                let action = "save it with compression, or with fewer texels";
                return Err(Fault::refused("file_too_large", message, action));
            }
            _ if key.starts_with(b"GNU.sparse.") => {
                return Err(Fault::refused("special_entry", "a sparse file", "pack it without --sparse"));
            }
            _ => {}
        }
        rest = &rest[length..];
    }
    Ok(path)
}

/// Length, key and value of the first record, `<length> <key>=<value>` and a line break.
fn pax_record(bytes: &[u8]) -> Option<(usize, &[u8], &[u8])> {
    let space = bytes.iter().take(20).position(|byte| *byte == b' ')?;
    let length: usize = std::str::from_utf8(&bytes[..space]).ok()?.parse().ok()?;
    let record = bytes.get(space + 1..length)?.strip_suffix(b"\n")?;
    let equals = record.iter().position(|byte| *byte == b'=')?;
    Some((length, &record[..equals], &record[equals + 1..]))
}
