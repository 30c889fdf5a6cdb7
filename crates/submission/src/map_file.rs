//! Decodes one map of a submission: its header and texels, or the fault that makes it unusable.
//!
//! Scoring and `eval lint` both decode maps here. The file is untrusted input: sizes are checked before memory is
//! taken.

use std::path::Path;

use mateval_image::exr_header::{EXR_SIGNATURE, ExrHeader};
use mateval_image::png_header::{PNG_SIGNATURE, PngHeader};
use mateval_image::{ImageError, Texture, map_io};
use mateval_scene::findings::shortened;
use mateval_scene::submission::{MAP_SIZES, Map};
use mateval_scene::{SceneError, TriangleMesh};

use crate::bad_texels;
use crate::file_fault::FileFault;
use crate::submitted_file::SubmittedFile;

/// Largest file of a map, in bytes.
pub const MAX_MAP_BYTES: u64 = 512 << 20;

/// Most numbers that an OpenEXR file may hold in all its parts and channels together: eight channels of the largest
/// map.
pub const MAX_EXR_NUMBERS: usize = 8 * 4096 * 4096;

/// The header of a map's file.
#[derive(Clone, Debug, PartialEq)]
pub enum MapHeader {
    /// Of a PNG.
    Png(PngHeader),
    /// Of an OpenEXR file.
    Exr(ExrHeader),
}

/// A map that can be used.
#[derive(Clone, Debug)]
pub struct MapFile {
    /// The file's header.
    pub header: MapHeader,
    /// Colours of a base colour; scalars of the others. All numbers are finite and in range.
    pub texture: Texture,
    /// The finding about texels that were not, and that lookups reach.
    pub bad_texels: Option<FileFault>,
    /// Of the file's bytes, hex.
    pub sha256: String,
}

/// Decodes the file of a map; its ending says whether it should be a PNG or an EXR.
///
/// `atlas` reads the mesh of the map's instance and is called only if the map has bad texels. The outer error is its
/// error: without the mesh nothing is known about the map.
pub fn decode<'a>(
    file: SubmittedFile,
    map: Map,
    atlas: impl FnOnce() -> Result<&'a TriangleMesh, SceneError>,
) -> Result<Result<MapFile, FileFault>, SceneError> {
    let DecodedFile { header, texture, sha256 } = match decode_any(file, map) {
        Ok(decoded) => decoded,
        Err(fault) => return Ok(Err(fault)),
    };
    let repaired = bad_texels::repaired(texture, map, atlas)?;
    Ok(repaired.map(|(texture, bad_texels)| MapFile { header, texture, bad_texels, sha256 }))
}

/// A file whose numbers may be anything.
struct DecodedFile {
    header: MapHeader,
    texture: Texture,
    sha256: String,
}

fn decode_any(file: SubmittedFile, map: Map) -> Result<DecodedFile, FileFault> {
    let header = check_header(file.path(), file.bytes(), map)?;
    let (path, sha256) = (file.path().to_owned(), file.hashed().sha256.clone());
    let texture = texels(&path, file.into_bytes(), map, &header)?;
    Ok(DecodedFile { header, texture, sha256 })
}

/// Reads the header. Fails if the file's kind, size or channels rule it out, before any texel is decoded.
fn check_header(path: &Path, bytes: &[u8], map: Map) -> Result<MapHeader, FileFault> {
    check_kind(path, bytes)?;
    let header = header_of(path, bytes)?;
    match &header {
        MapHeader::Png(png) => {
            check_size(png.width as usize, png.height as usize)?;
            check_end(png)?;
        }
        MapHeader::Exr(exr) => check_exr(exr, map)?,
    }
    Ok(header)
}

fn check_kind(path: &Path, bytes: &[u8]) -> Result<(), FileFault> {
    if bytes.is_empty() {
        return Err(FileFault::new("empty_file", "a file of 0 bytes", "write the map again"));
    }
    let (expected, name) = if path.extension().is_some_and(|ending| ending == "exr") {
        (EXR_SIGNATURE, "EXR")
    } else {
        (PNG_SIGNATURE, "PNG")
    };
    if bytes.starts_with(b"version https://git-lfs") {
        let message = "a Git LFS pointer, not the file that it stands for";
        return Err(FileFault::new("git_lfs_pointer", message, "fetch the file itself (git lfs pull)"));
    }
    // A file that was cut within its signature is a truncated file of that kind.
    if bytes.starts_with(expected) || expected.starts_with(bytes) {
        return Ok(());
    }
    let message = format!("{} in a file named .{}", kind_of(bytes), name.to_lowercase());
    Err(FileFault::new("wrong_kind", message, "write a PNG as .png, an EXR as .exr; nothing else is read"))
}

/// The kind of a file by its first bytes.
fn kind_of(bytes: &[u8]) -> &'static str {
    const KINDS: [(&[u8], &str); 11] = [
        (PNG_SIGNATURE, "a PNG"),
        (EXR_SIGNATURE, "an EXR"),
        (b"\xff\xd8\xff", "a JPEG"),
        (b"GIF8", "a GIF"),
        (b"II*\0", "a TIFF"),
        (b"MM\0*", "a TIFF"),
        (b"RIFF", "a WebP"),
        (b"#?", "a Radiance HDR"),
        (b"DDS ", "a DDS"),
        (b"\x93NUMPY", "a NumPy array"),
        (b"BM", "a BMP"),
    ];
    KINDS.iter().find(|(start, _)| bytes.starts_with(start)).map_or("not a picture", |(_, name)| name)
}

fn header_of(path: &Path, bytes: &[u8]) -> Result<MapHeader, FileFault> {
    let header = if path.extension().is_some_and(|ending| ending == "exr") {
        ExrHeader::of(bytes).map(MapHeader::Exr).map_err(|error| error.to_string())
    } else {
        PngHeader::of(bytes).map(MapHeader::Png).map_err(|error| error.to_string())
    };
    header.map_err(|what| {
        let message = format!("its header is invalid: {}", shortened(&what));
        FileFault::new("bad_header", message, "write the map again")
    })
}

/// Fails unless the map is a square of a size that a submission may use.
fn check_size(width: usize, height: usize) -> Result<(), FileFault> {
    let (least, most) = (*MAP_SIZES.start(), *MAP_SIZES.end());
    let found = format!("{width}x{height} texels; expected a square with sides of {least} to {most}");
    if width != height {
        return Err(FileFault::new("not_square", found, "bake it to the square atlas of instances.glb"));
    }
    if width < least {
        return Err(FileFault::new("too_few_texels", found, "bake it larger"));
    }
    if width > most {
        return Err(FileFault::new("too_many_texels", found, "bake it smaller"));
    }
    Ok(())
}

/// A PNG without its closing chunk was truncated. That holds even if all texels can be
/// decoded, since nothing else proves that the file is complete.
fn check_end(png: &PngHeader) -> Result<(), FileFault> {
    if png.ended {
        return Ok(());
    }
    let message = "truncated: it has no closing chunk (IEND)";
    Err(FileFault::new("truncated_picture", message, "write or copy it again, whole"))
}

fn check_exr(exr: &ExrHeader, map: Map) -> Result<(), FileFault> {
    if exr.deep {
        let message = "deep data: a list of samples in each texel";
        return Err(FileFault::new("deep_data", message, "write one number per texel and channel"));
    }
    check_size(exr.width, exr.height)?;
    let wanted: &[&str] = if map == Map::BaseColor { &["R", "G", "B"] } else { &["V"] };
    // Some programs write a grey picture as Y.
    let instead = |name: &str| if name == "V" { exr.channel("Y") } else { None };
    for name in wanted {
        let Some(channel) = exr.channel(name).or_else(|| instead(name)) else {
            let names: Vec<&str> = exr.channels.iter().map(|channel| channel.name.as_str()).collect();
            let message = format!("expected channels {}, found {}", wanted.join(", "), shortened(&names.join(", ")));
            let action = "write R, G, B for base_color, V for roughness and metallic";
            return Err(FileFault::new("missing_channel", message, action));
        };
        if channel.subsampled {
            let message = format!("channel {name} has numbers for some texels only");
            return Err(FileFault::new("subsampled_channel", message, "write one number per texel and channel"));
        }
    }
    if exr.samples > MAX_EXR_NUMBERS {
        let message = format!("{} numbers in all parts and channels; expected at most {MAX_EXR_NUMBERS}", exr.samples);
        return Err(FileFault::new("too_many_channels", message, "write the required channels only"));
    }
    Ok(())
}

fn texels(path: &Path, bytes: Vec<u8>, map: Map, header: &MapHeader) -> Result<Texture, FileFault> {
    let decoded = match (header, map) {
        (MapHeader::Png(_), Map::BaseColor) => map_io::png_color(path, bytes),
        (MapHeader::Png(_), _) => map_io::png_scalar(path, bytes),
        (MapHeader::Exr(_), Map::BaseColor) => map_io::exr_color(path, &bytes),
        (MapHeader::Exr(_), _) => map_io::exr_scalar(path, &bytes),
    };
    decoded.map_err(|error| {
        let what = match error {
            ImageError::Invalid { what, .. } | ImageError::Unsupported { what, .. } => what,
            other => other.to_string(),
        };
        FileFault::new("unreadable_picture", what, "write the map again")
    })
}
