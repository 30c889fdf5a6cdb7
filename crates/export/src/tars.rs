//! One tar a scene and one for the rest of the dataset, with the same bytes on every machine.
//!
//! Unpacked in one folder, `base.tar` and any number of `scenes/<scene>.tar` are a dataset that
//! [`Dataset::open`](mateval_dataset::open::Dataset::open) accepts.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use mateval_dataset::layout::{COMPARE, DATASET, MANIFEST};
use mateval_dataset::open::is_below;
use mateval_dataset::{Progress, Report};
use mateval_files::FileError;
use mateval_files::untrusted::hex;
use sha2::{Digest as _, Sha256};

use crate::dataset::{ExportError, Exported, SoundDataset, make_folder_of, write_file, write_licences};

/// The tar with everything outside the scenes.
pub const BASE: &str = "base.tar";

/// The list of the tars, which `sha256sum -c` reads.
pub const TARS: &str = "TARS.sha256";

/// A tar that was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WrittenTar {
    /// Its path relative to the export.
    pub name: String,
    /// SHA-256 of its bytes, hex.
    pub sha256: String,
    pub bytes: u64,
}

/// Writes the tars, [`TARS`] and the licences to `out`.
pub fn export(sound: &SoundDataset, out: &Path, progress: Progress<'_>) -> Result<Exported, ExportError> {
    write(sound, out, progress)?;
    Ok(Exported { scenes: sound.dataset.scenes.len(), ..Exported::default() })
}

/// Writes the same as [`export()`] and returns the tars, [`BASE`] first and then the scenes in the dataset's order.
pub fn write(sound: &SoundDataset, out: &Path, progress: Progress<'_>) -> Result<Vec<WrittenTar>, ExportError> {
    let ids = &sound.dataset.file.scenes;
    let mut base: Vec<&str> = sound.files.iter().map(String::as_str).filter(|file| !is_below(file, ids)).collect();
    base.extend([DATASET, MANIFEST]);
    base.extend(sound.dataset.root.join(COMPARE).is_file().then_some(COMPARE));
    base.sort_unstable();
    let mut tars = vec![write_tar(&sound.dataset.root, &base, out, BASE)?];
    for (at, id) in ids.iter().enumerate() {
        progress(Report::part(&format!("scene {id}"), at, ids.len()));
        let of_scene = |file: &&str| is_below(file, std::slice::from_ref(id));
        let files: Vec<&str> = sound.files.iter().map(String::as_str).filter(of_scene).collect();
        tars.push(write_tar(&sound.dataset.root, &files, out, &format!("scenes/{id}.tar"))?);
    }
    let list: String = tars.iter().map(|tar| format!("{}  {}\n", tar.sha256, tar.name)).collect();
    write_file(&out.join(TARS), list.as_bytes())?;
    write_licences(&sound.dataset, out)?;
    Ok(tars)
}

fn write_tar(root: &Path, files: &[&str], out: &Path, name: &str) -> Result<WrittenTar, ExportError> {
    let path = out.join(name);
    make_folder_of(&path)?;
    let file = File::create(&path).map_err(FileError::io("write", &path))?;
    let mut tar = tar::Builder::new(Hashed { inner: BufWriter::new(file), hash: Sha256::new(), bytes: 0 });
    for file in files {
        append(&mut tar, root, file).map_err(FileError::io("pack", root.join(file)))?;
    }
    let mut hashed = tar.into_inner().map_err(FileError::io("write", &path))?;
    hashed.flush().map_err(FileError::io("write", &path))?;
    Ok(WrittenTar { name: name.to_owned(), sha256: hex(&hashed.hash.finalize()), bytes: hashed.bytes })
}

/// Appends a file with nothing of the machine that it lies on: no time, no owner, the same mode for all.
fn append(tar: &mut tar::Builder<impl Write>, root: &Path, file: &str) -> std::io::Result<()> {
    let source = File::open(root.join(file))?;
    let mut header = tar::Header::new_gnu();
    header.set_entry_type(tar::EntryType::Regular);
    header.set_size(source.metadata()?.len());
    header.set_mode(0o644);
    header.set_mtime(0);
    header.set_uid(0);
    header.set_gid(0);
    tar.append_data(&mut header, file, source)
}

/// Hashes and counts what is written.
struct Hashed<W> {
    inner: W,
    hash: Sha256,
    bytes: u64,
}

impl<W: Write> Write for Hashed<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let length = self.inner.write(bytes)?;
        self.hash.update(&bytes[..length]);
        self.bytes += length as u64;
        Ok(length)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.inner.flush()
    }
}
