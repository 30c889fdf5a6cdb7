//! `.tar.gz`: POSIX's ustar with long names of GNU and pax, in gzip.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;
use mateval_scene::findings::shortened;

use super::Fault;
use super::entry::{EntryKind, Writer};
use crate::map_file::MAX_MAP_BYTES;

/// Everything is in blocks of so many bytes.
const BLOCK: usize = 512;
/// Longest name or list of attributes that comes before its entry, in bytes.
const LONGEST_EXTRA: u64 = 1 << 16;

/// Unpacks into an empty folder.
pub fn unpack_tar_gz(file: File, folder: &Path) -> Result<(), Fault> {
    let mut writer = Writer::new(folder);
    let mut stream = Stream { data: MultiGzDecoder::new(BufReader::new(Counted { file, bytes: 0 })) };
    let mut long_name: Option<Vec<u8>> = None;
    while let Some(header) = stream.header(&mut writer)? {
        let Some(size) = header.size() else { return Err(damaged("an entry whose size is no number")) };
        match header.kind() {
            // What follows is the next entry's name, or attributes.
            b'L' => {
                let mut name = stream.extra(size, &mut writer)?;
                name.truncate(name.iter().position(|byte| *byte == 0).unwrap_or(name.len()));
                long_name = Some(name);
            }
            b'x' => long_name = pax_path(&stream.extra(size, &mut writer)?)?.or(long_name),
            b'g' | b'K' => drop(stream.extra(size, &mut writer)?),
            kind => {
                let name = long_name.take().unwrap_or_else(|| header.name());
                stream.unpack(&name, kind, size, &mut writer)?;
            }
        }
    }
    stream.finish(&mut writer)?;
    writer.finish()
}

fn damaged(message: &str) -> Fault {
    Fault::refused("damaged_archive", message, "pack it again")
}

/// Counts what is read of the archive.
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

struct Stream {
    data: MultiGzDecoder<BufReader<Counted>>,
}

impl Stream {
    fn packed(&self) -> u64 {
        self.data.get_ref().get_ref().bytes
    }

    /// The next bytes, counted; 0 where the stream ends.
    fn read(&mut self, buffer: &mut [u8], writer: &mut Writer<'_>) -> Result<usize, Fault> {
        let count = loop {
            match self.data.read(buffer) {
                Ok(count) => break count,
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(error) => return Err(damaged(&format!("it cannot be unpacked: {error}"))),
            }
        };
        // Names and what is passed over take time too.
        writer.budget.add_bytes(count as u64, self.packed())?;
        Ok(count)
    }

    /// Fills a buffer; gives how much of it could be filled.
    fn fill(&mut self, buffer: &mut [u8], writer: &mut Writer<'_>) -> Result<usize, Fault> {
        let mut filled = 0;
        while filled < buffer.len() {
            match self.read(&mut buffer[filled..], writer)? {
                0 => break,
                count => filled += count,
            }
        }
        Ok(filled)
    }

    /// The next entry's header; none at the end.
    fn header(&mut self, writer: &mut Writer<'_>) -> Result<Option<Header>, Fault> {
        let mut block = [0; BLOCK];
        match self.fill(&mut block, writer)? {
            // Some write no closing blocks.
            0 => return Ok(None),
            BLOCK => {}
            _ => return Err(damaged("it ends early")),
        }
        if block.iter().all(|byte| *byte == 0) {
            return Ok(None);
        }
        let header = Header(block);
        if header.is_sound() { Ok(Some(header)) } else { Err(damaged("an entry whose checksum is wrong")) }
    }

    /// What comes before an entry, held in memory.
    fn extra(&mut self, size: u64, writer: &mut Writer<'_>) -> Result<Vec<u8>, Fault> {
        if size > LONGEST_EXTRA {
            let message = format!("a name or attributes of {size} bytes; expected at most {LONGEST_EXTRA}");
            return Err(Fault::refused("directory_too_large", message, "pack it without attributes"));
        }
        writer.budget.add_entry()?;
        let mut bytes = vec![0; size as usize];
        if self.fill(&mut bytes, writer)? < bytes.len() {
            return Err(damaged("it ends early"));
        }
        self.skip(padding(size), writer)?;
        Ok(bytes)
    }

    /// Passes over so many bytes.
    fn skip(&mut self, mut bytes: u64, writer: &mut Writer<'_>) -> Result<(), Fault> {
        let mut block = [0; 128 * BLOCK];
        while bytes > 0 {
            let most = bytes.min(block.len() as u64) as usize;
            match self.read(&mut block[..most], writer)? {
                0 => return Err(damaged("it ends early")),
                count => bytes -= count as u64,
            }
        }
        Ok(())
    }

    /// Reads what is behind the last entry: only at its end gzip says whether all was whole.
    fn finish(&mut self, writer: &mut Writer<'_>) -> Result<(), Fault> {
        let mut block = [0; 128 * BLOCK];
        while self.read(&mut block, writer)? > 0 {}
        Ok(())
    }

    fn unpack(&mut self, name: &[u8], kind: u8, size: u64, writer: &mut Writer<'_>) -> Result<(), Fault> {
        let kind = match kind {
            0 | b'0' | b'7' if name.ends_with(b"/") => EntryKind::Folder,
            0 | b'0' | b'7' => EntryKind::File,
            b'5' => EntryKind::Folder,
            b'1' | b'2' => EntryKind::Link,
            _ => EntryKind::Special,
        };
        let padded = size.checked_add(padding(size)).ok_or_else(|| damaged("an entry whose size is no number"))?;
        let Some(place) = writer.place(name, kind)? else { return self.skip(padded, writer) };
        // What is too large is not even passed over: there is no seeking in a stream.
        if size > MAX_MAP_BYTES {
            let message = format!("'{}' has {size} bytes; expected at most {MAX_MAP_BYTES}", shortened(&place));
            return Err(Fault::refused("file_too_large", message, "save it with compression, or with fewer texels"));
        }
        let mut data = EntryData { stream: self, left: size };
        let written = writer.write(&place, size, &mut data, |data| data.stream.packed())?;
        // After a fault the rest is passed over.
        let left = data.left;
        if written.is_none() {
            self.skip(left, writer)?;
        }
        self.skip(padding(size), writer)
    }
}

/// The bytes of one entry.
struct EntryData<'a> {
    stream: &'a mut Stream,
    left: u64,
}

impl Read for EntryData<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let most = (buffer.len() as u64).min(self.left) as usize;
        let count = self.stream.data.read(&mut buffer[..most])?;
        self.left -= count as u64;
        Ok(count)
    }
}

/// Bytes from an entry's end to the next block.
fn padding(size: u64) -> u64 {
    (BLOCK as u64 - size % BLOCK as u64) % BLOCK as u64
}

/// An entry's first block.
struct Header([u8; BLOCK]);

impl Header {
    fn kind(&self) -> u8 {
        self.0[156]
    }

    /// Its name; in ustar what belongs before it is apart.
    fn name(&self) -> Vec<u8> {
        let text = |range: std::ops::Range<usize>| {
            let field = &self.0[range];
            field[..field.iter().position(|byte| *byte == 0).unwrap_or(field.len())].to_vec()
        };
        let (name, prefix) = (text(0..100), text(345..500));
        let is_posix = self.0[257..].starts_with(b"ustar\0");
        if is_posix && !prefix.is_empty() { [prefix, name].join(&b'/') } else { name }
    }

    fn size(&self) -> Option<u64> {
        let field = &self.0[124..136];
        // GNU writes what octal digits cannot hold as a number of 95 bits.
        if field[0] & 0x80 != 0 {
            let (high, low) = field.split_at(4);
            let is_short = high == [0x80, 0, 0, 0];
            return is_short.then(|| low.iter().fold(0, |size, byte| size << 8 | u64::from(*byte)));
        }
        octal(field)
    }

    /// The sum of all bytes, its own counted as spaces.
    fn is_sound(&self) -> bool {
        let sum: u64 = self.0.iter().map(|byte| u64::from(*byte)).sum();
        let own: u64 = self.0[148..156].iter().map(|byte| u64::from(*byte)).sum();
        octal(&self.0[148..156]) == Some(sum - own + 8 * u64::from(b' '))
    }
}

/// Octal digits between spaces and zeros.
fn octal(field: &[u8]) -> Option<u64> {
    let text = std::str::from_utf8(field).ok()?;
    let digits = text.trim_matches([' ', '\0']);
    if digits.is_empty() { Some(0) } else { u64::from_str_radix(digits, 8).ok() }
}

/// The path of pax attributes: lines of `<length> <key>=<value>`. Sizes that only they tell are those of files that are too
/// large.
fn pax_path(bytes: &[u8]) -> Result<Option<Vec<u8>>, Fault> {
    let (mut rest, mut path) = (bytes, None);
    while !rest.is_empty() {
        let record = pax_record(rest).ok_or_else(|| damaged("attributes that are not sound"))?;
        let (length, key, value) = record;
        match key {
            b"path" => path = Some(value.to_vec()),
            b"size" => {
                let message = "a file of more bytes than its header can say";
                return Err(Fault::refused(
                    "file_too_large",
                    message,
                    "save it with compression, or with fewer texels",
                ));
            }
            _ => {}
        }
        rest = &rest[length..];
    }
    Ok(path)
}

/// Length, key and value of the first record.
fn pax_record(bytes: &[u8]) -> Option<(usize, &[u8], &[u8])> {
    let space = bytes.iter().take(20).position(|byte| *byte == b' ')?;
    let length: usize = std::str::from_utf8(&bytes[..space]).ok()?.parse().ok()?;
    let record = bytes.get(space + 1..length)?.strip_suffix(b"\n")?;
    let equals = record.iter().position(|byte| *byte == b'=')?;
    Some((length, &record[..equals], &record[equals + 1..]))
}
