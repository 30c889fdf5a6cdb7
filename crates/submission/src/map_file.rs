//! One map of a submission, read as scores and `eval lint` read it: what the file says of itself and its texels, or why it
//! cannot be used.
//!
//! A stranger made it. Nothing outside the submission's folder is read, and sizes are checked before memory is taken.

use std::path::{Path, PathBuf};

use mateval_image::exr_header::{EXR_SIGNATURE, ExrHeader};
use mateval_image::limits::read_at_most;
use mateval_image::png_header::{PNG_SIGNATURE, PngHeader};
use mateval_image::{ImageError, Texels, Texture, map_io};
use mateval_scene::findings::shortened;
use mateval_scene::manifest::sha256_of_bytes;
use mateval_scene::submission::{MAP_SIZES, Map, instance_folder};
use mateval_scene::{InstanceId, SceneId};

/// Largest file of a map, in bytes.
pub const MAX_MAP_BYTES: u64 = 512 << 20;

/// Most numbers of an OpenEXR file, all its parts and channels together: eight channels of the largest map.
pub const MAX_EXR_NUMBERS: usize = 8 * 4096 * 4096;

/// What a base colour may be, linear; a stray value must not swamp the mean over all pixels.
pub const BASE_COLOR_RANGE: std::ops::RangeInclusive<f32> = -1.0..=16.0;

/// What a roughness and a metallic may be.
pub const SCALAR_RANGE: std::ops::RangeInclusive<f32> = 0.0..=1.0;

/// What a file says of itself.
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
    /// What the file says of itself.
    pub header: MapHeader,
    /// Colours of a base colour; scalars of the others.
    pub texture: Texture,
    /// Of the file's bytes, hex.
    pub sha256: String,
}

/// Why a map cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MapFault {
    /// A stable word, as in `not_square`.
    pub code: &'static str,
    /// Where in the file, as in `texel (3, 2)`; empty for the whole file.
    pub place: String,
    /// What was expected and what was found.
    pub message: String,
    /// What to do.
    pub action: &'static str,
}

impl MapFault {
    fn new(code: &'static str, message: impl Into<String>, action: &'static str) -> Self {
        Self { code, place: String::new(), message: message.into(), action }
    }
}

/// Where an instance's map may lie: as PNG, as EXR.
pub fn candidates(submission: &Path, scene: &SceneId, instance: &InstanceId, map: Map) -> [PathBuf; 2] {
    let folder = instance_folder(submission, scene, instance);
    ["png", "exr"].map(|ending| folder.join(map.stem()).with_extension(ending))
}

/// Whether something is at a path, be it a link that leads nowhere.
pub fn is_there(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}

/// Reads a map; `path` is one of [`candidates`].
pub fn read(submission: &Path, path: &Path, map: Map) -> Result<MapFile, MapFault> {
    check_place(submission, path)?;
    let bytes = read_at_most(path, MAX_MAP_BYTES).map_err(|error| match error.kind() {
        std::io::ErrorKind::FileTooLarge => MapFault::new(
            "file_too_large",
            format!("more than {MAX_MAP_BYTES} bytes"),
            "save it with compression, or with fewer texels",
        ),
        _ => MapFault::new("unreadable_file", error.to_string(), "make it an ordinary file that can be read"),
    })?;
    read_bytes(path, bytes, map)
}

/// The same from a file's bytes; its ending says what they should be.
pub fn read_bytes(path: &Path, bytes: Vec<u8>, map: Map) -> Result<MapFile, MapFault> {
    check_kind(path, &bytes)?;
    let header = header_of(path, &bytes)?;
    match &header {
        MapHeader::Png(png) => {
            check_size(png.width as usize, png.height as usize)?;
            check_end(png)?;
        }
        MapHeader::Exr(exr) => check_exr(exr, map)?,
    }
    let sha256 = sha256_of_bytes(&bytes);
    let texture = decode(path, bytes, map, &header)?;
    check_values(&texture, map)?;
    Ok(MapFile { header, texture, sha256 })
}

/// Whether a file is an ordinary one that does not lie outside the submission's folder, behind links.
pub fn check_place(submission: &Path, path: &Path) -> Result<(), MapFault> {
    let unreadable = |error: std::io::Error| {
        MapFault::new("unreadable_file", error.to_string(), "make it an ordinary file that can be read")
    };
    let place = path.canonicalize().map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => {
            MapFault::new("broken_link", "a link to nothing", "put the file itself in its place")
        }
        _ => unreadable(error),
    })?;
    let root = submission.canonicalize().map_err(unreadable)?;
    if !place.starts_with(&root) {
        let message = "a link that leads out of the submission's folder; it is not followed";
        return Err(MapFault::new("link_leads_out", message, "put the file itself in its place"));
    }
    if !place.metadata().map_err(unreadable)?.is_file() {
        return Err(MapFault::new("not_a_file", "not an ordinary file", "put a PNG or an EXR in its place"));
    }
    Ok(())
}

fn check_kind(path: &Path, bytes: &[u8]) -> Result<(), MapFault> {
    if bytes.is_empty() {
        return Err(MapFault::new("empty_file", "a file of 0 bytes", "write the map again"));
    }
    let (expected, name) = if path.extension().is_some_and(|ending| ending == "exr") {
        (EXR_SIGNATURE, "EXR")
    } else {
        (PNG_SIGNATURE, "PNG")
    };
    if bytes.starts_with(b"version https://git-lfs") {
        let message = "a Git LFS pointer, not the file that it stands for";
        return Err(MapFault::new("git_lfs_pointer", message, "fetch the file itself (git lfs pull)"));
    }
    // What is cut within its first bytes is a cut file of its kind.
    if bytes.starts_with(expected) || expected.starts_with(bytes) {
        return Ok(());
    }
    let message = format!("{} in a file named .{}", kind_of(bytes), name.to_lowercase());
    Err(MapFault::new("wrong_kind", message, "write a PNG as .png, an EXR as .exr; nothing else is read"))
}

/// What a file is, by its first bytes.
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
    KINDS.iter().find(|(start, _)| bytes.starts_with(start)).map_or("no picture", |(_, name)| name)
}

fn header_of(path: &Path, bytes: &[u8]) -> Result<MapHeader, MapFault> {
    let header = if path.extension().is_some_and(|ending| ending == "exr") {
        ExrHeader::of(bytes).map(MapHeader::Exr).map_err(|error| error.to_string())
    } else {
        PngHeader::of(bytes).map(MapHeader::Png).map_err(|error| error.to_string())
    };
    header.map_err(|what| {
        let message = format!("its header is not sound: {}", shortened(&what));
        MapFault::new("bad_header", message, "write the map again")
    })
}

/// Square, and of a side that a submission may use.
fn check_size(width: usize, height: usize) -> Result<(), MapFault> {
    let (least, most) = (*MAP_SIZES.start(), *MAP_SIZES.end());
    let found = format!("{width}x{height} texels; expected a square of {least} to {most} a side");
    if width != height {
        return Err(MapFault::new("not_square", found, "bake it to the square atlas of instances.glb"));
    }
    if width < least {
        return Err(MapFault::new("too_few_texels", found, "bake it larger"));
    }
    if width > most {
        return Err(MapFault::new("too_many_texels", found, "bake it smaller"));
    }
    Ok(())
}

/// A PNG whose closing chunk is not there was cut, be it behind its last texel: nothing says that this was the last.
fn check_end(png: &PngHeader) -> Result<(), MapFault> {
    if png.ended {
        return Ok(());
    }
    let message = "it ends early: there is no closing chunk (IEND)";
    Err(MapFault::new("truncated_picture", message, "write or copy it again, whole"))
}

fn check_exr(exr: &ExrHeader, map: Map) -> Result<(), MapFault> {
    if exr.deep {
        let message = "deep data: lists of samples a pixel";
        return Err(MapFault::new("deep_data", message, "write one number a texel and channel"));
    }
    check_size(exr.width, exr.height)?;
    let wanted: &[&str] = if map == Map::BaseColor { &["R", "G", "B"] } else { &["V"] };
    // Others write a grey picture as Y.
    let instead = |name: &str| if name == "V" { exr.channel("Y") } else { None };
    for name in wanted {
        let Some(channel) = exr.channel(name).or_else(|| instead(name)) else {
            let names: Vec<&str> = exr.channels.iter().map(|channel| channel.name.as_str()).collect();
            let message = format!("expected channels {}, found {}", wanted.join(", "), shortened(&names.join(", ")));
            let action = "write R, G, B for base_color, V for roughness and metallic";
            return Err(MapFault::new("missing_channel", message, action));
        };
        if channel.subsampled {
            let message = format!("channel {name} has numbers for some texels only");
            return Err(MapFault::new("subsampled_channel", message, "write one number a texel and channel"));
        }
    }
    if exr.samples > MAX_EXR_NUMBERS {
        let message = format!("{} numbers in all parts and channels; expected at most {MAX_EXR_NUMBERS}", exr.samples);
        return Err(MapFault::new("too_many_channels", message, "leave out all but the channels that are asked for"));
    }
    Ok(())
}

fn decode(path: &Path, bytes: Vec<u8>, map: Map, header: &MapHeader) -> Result<Texture, MapFault> {
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
        MapFault::new("unreadable_picture", what, "write the map again")
    })
}

/// Every number finite and within its range.
fn check_values(texture: &Texture, map: Map) -> Result<(), MapFault> {
    let (name, range) = match map {
        Map::BaseColor => ("base colour", BASE_COLOR_RANGE),
        Map::Roughness => ("roughness", SCALAR_RANGE),
        Map::Metallic => ("metallic", SCALAR_RANGE),
    };
    let (values, a_texel): (&[f32], usize) = match texture.texels() {
        Texels::Linear(values) => (values.as_flattened(), 3),
        Texels::Grey(values) => (values, 1),
        // Whole numbers are 0 to 1.
        _ => return Ok(()),
    };
    let Some(at) = values.iter().position(|value| !range.contains(value)) else { return Ok(()) };
    // What is not finite is told before what is only too large.
    let at = values.iter().position(|value| !value.is_finite()).unwrap_or(at);
    let (value, texel) = (values[at], at / a_texel);
    let (low, high) = (range.start(), range.end());
    let code = if value.is_nan() {
        "nan"
    } else if value.is_infinite() {
        "infinity"
    } else {
        "out_of_range"
    };
    Err(MapFault {
        place: format!("texel ({}, {})", texel % texture.width(), texel / texture.width()),
        ..MapFault::new(code, format!("a {name} of {value}; expected {low} to {high}"), "write finite numbers in range")
    })
}
