//! Maps that can be read but look wrong: header fields that are ignored or that no such map should have, and numbers
//! that are far smaller than those of any material.

use mateval_dataset::Finding;
use mateval_dataset::submission::Map;
use mateval_files::untrusted::shortened;
use mateval_image::exr_io::{ExrChannel, ExrHeader, ExrNumber};
use mateval_image::png_io::{PngColor, PngHeader};
use mateval_image::texture_io::FewerBits;
use mateval_image::{Texels, Texture};

use crate::error::{note, warning};
use crate::map_file::{MapFile, MapHeader};

/// Code, message, what to do.
type Remark = (&'static str, String, &'static str);

pub(super) fn remarks(path: &str, map: Map, file: &MapFile) -> Vec<Finding> {
    let (warnings, known) = match &file.header {
        MapHeader::Png(header) => {
            let warnings = [samples(map, header), chunks(map, header), pictures(header)].concat();
            let message = "interlaced rows";
            (warnings, header.interlaced.then(|| note("interlaced", path, message, "read, but larger than necessary")))
        }
        MapHeader::Exr(header) => {
            let warnings = [parts(header), channels(map, header), beyond_unit(&file.texture)].concat();
            (warnings, header.tiled.then(|| note("tiled", path, "stored in tiles", "read as any other")))
        }
    };
    let warned = warnings.into_iter().map(|(code, message, action)| warning(code, path, message, action));
    warned.chain(known).collect()
}

fn samples(map: Map, header: &PngHeader) -> Vec<Remark> {
    let mut remarks = Vec::new();
    if header.bit_depth < 8 {
        remarks.push(("low_bit_depth", format!("{} bits per sample", header.bit_depth), "write 8 or 16 bits"));
    } else if header.color == PngColor::Palette {
        let message = "a palette of at most 256 colours".to_owned();
        remarks.push(("palette", message, "write RGB or grey; the palette's colours are read"));
    }
    if matches!(header.color, PngColor::GreyAlpha | PngColor::Rgba) {
        let message = format!("{}: alpha is dropped", header.color.name());
        remarks.push(("alpha", message, "write it without alpha"));
    } else if header.has(b"tRNS") {
        let message = "one colour marked as transparent (tRNS)".to_owned();
        remarks.push(("transparent_colour", message, "write it without transparency"));
    }
    if map != Map::BaseColor && matches!(header.color, PngColor::Rgb | PngColor::Rgba | PngColor::Palette) {
        let message = format!("{} for a map of one number per texel: only red is read", header.color.name());
        remarks.push(("colour_scalar", message, "write grey; split packed maps into one file each"));
    }
    remarks
}

fn chunks(map: Map, header: &PngHeader) -> Vec<Remark> {
    const IGNORED: [(&[u8; 4], &str, &str); 4] = [
        (b"gAMA", "gamma_chunk", "a gamma (gAMA)"),
        (b"iCCP", "icc_profile", "a colour profile (iCCP)"),
        (b"cHRM", "primaries_chunk", "primaries of its own (cHRM)"),
        (b"cICP", "coding_chunk", "a colour coding of its own (cICP)"),
    ];
    let read_as = if map == Map::BaseColor { "sRGB" } else { "linear" };
    let ignored = IGNORED.iter().filter(|(chunk, ..)| header.has(chunk));
    let mut remarks: Vec<Remark> = ignored
        .map(|(_, code, what)| {
            let message = format!("{what}, which is ignored: the numbers are read as {read_as}");
            (*code, message, "convert the numbers and leave out the chunk")
        })
        .collect();
    if map != Map::BaseColor && header.has(b"sRGB") {
        let message = "an sRGB chunk, which is ignored: the numbers are read as linear".to_owned();
        remarks.push(("srgb_chunk", message, "write linear numbers and leave out the chunk"));
    }
    remarks
}

fn pictures(header: &PngHeader) -> Vec<Remark> {
    let mut remarks = Vec::new();
    if header.has(b"acTL") {
        remarks.push(("animated", "several pictures, of which the first is read".to_owned(), "write a single picture"));
    }
    if header.trailing_bytes > 0 {
        let message = format!("{} bytes after the end of the PNG", header.trailing_bytes);
        remarks.push(("trailing_bytes", message, "write the PNG without them; they are not read"));
    }
    remarks
}

fn parts(header: &ExrHeader) -> Vec<Remark> {
    let mut remarks = Vec::new();
    if header.parts > 1 {
        remarks.push((
            "several_parts",
            format!("{} parts, of which the first is read", header.parts),
            "write a single part",
        ));
    }
    if (header.width, header.height) != header.display {
        let ((width, height), shown) = ((header.width, header.height), header.display);
        let message =
            format!("its data window has {width}x{height} texels, its display window {}x{}", shown.0, shown.1);
        remarks.push((
            "cropped_window",
            message,
            "write a data window equal to the display window; only the data window is read",
        ));
    }
    if header.other_primaries {
        let message = "primaries other than Rec. 709's".to_owned();
        remarks.push(("other_primaries", message, "convert the colours; they are read as Rec. 709"));
    }
    remarks
}

fn channels(map: Map, header: &ExrHeader) -> Vec<Remark> {
    let wanted: &[&str] = if map == Map::BaseColor { &["R", "G", "B"] } else { &["V", "Y"] };
    let (read, others): (Vec<&ExrChannel>, Vec<&ExrChannel>) =
        header.channels.iter().partition(|channel| wanted.contains(&channel.name.as_str()));
    let mut remarks = Vec::new();
    if read.iter().any(|channel| channel.number == ExrNumber::Whole) {
        remarks.push(("whole_numbers", "channels of integers".to_owned(), "write half or float"));
    }
    if !others.is_empty() {
        let names: Vec<&str> = others.iter().map(|channel| channel.name.as_str()).collect();
        let message = format!("channels that are not read: {}", shortened(&names.join(", ")));
        remarks.push(("extra_channels", message, "write the map without them"));
    }
    remarks
}

/// Remarks about base colours outside 0..1, which no surface has.
fn beyond_unit(texture: &Texture) -> Vec<Remark> {
    let Texels::Linear(values) = texture.texels() else { return Vec::new() };
    let beyond = values.as_flattened().iter().find(|value| !(0.0..=1.0).contains(*value));
    let remark = |value| ("beyond_unit", format!("a base colour of {value}"), "keep to 0 to 1; rendering clips it");
    beyond.map(remark).into_iter().collect()
}

/// A scene whose stored numbers are smaller, and not all 0, was written in another range: 0 and 1 as bytes in place of
/// 0 and 255, or floats that were divided once too often. No room has colours or a roughness below it throughout.
const LEAST_LARGEST: f32 = 1.5 / 255.0;

/// The largest number of a map as its file stores it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Largest {
    Byte(u8),
    Word(u16),
    Float(f32),
}

impl Largest {
    pub(super) fn of(file: &MapFile) -> Self {
        let float = |values: &[f32]| values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let is_png = matches!(file.header, MapHeader::Png(_));
        match file.texture.texels() {
            Texels::Srgb8(texels) | Texels::Linear8(texels) => {
                Self::Byte(texels.as_flattened().iter().copied().max().unwrap_or(0))
            }
            Texels::Grey8(texels) => Self::Byte(texels.iter().copied().max().unwrap_or(0)),
            Texels::Srgb16(texels) => Self::Word(texels.as_flattened().iter().copied().max().unwrap_or(0)),
            Texels::Grey(values) if is_png => Self::Word((float(values) * f32::from(u16::MAX)).round() as u16),
            Texels::Grey(values) => Self::Float(float(values)),
            Texels::Linear(values) => Self::Float(float(values.as_flattened())),
        }
    }

    /// With the largest number of its type as 1.
    fn unit(self) -> f32 {
        match self {
            Self::Byte(byte) => f32::from(byte) / 255.0,
            Self::Word(word) => f32::from(word) / f32::from(u16::MAX),
            Self::Float(value) => value,
        }
    }
}

/// A finding where even the largest number of all maps of one kind in a scene is that of another range. Single maps
/// prove nothing: a screen is black, and a network's metallic of a wall is noise.
pub(super) fn small_numbers(place: &str, map: Map, all: &[Largest]) -> Option<Finding> {
    let largest = all.iter().map(|one| one.unit()).reduce(f32::max)?;
    let words: Option<Vec<u16>> =
        all.iter().map(|one| if let Largest::Word(word) = one { Some(*word) } else { None }).collect();
    let fewer = words.and_then(|words| FewerBits::of_largest(words.into_iter().max()?));
    let fewer = fewer.filter(|words| map != Map::Metallic || words.bits == 8 || words.largest == words.full());
    let are_floats = all.iter().any(|one| matches!(one, Largest::Float(_)));
    let message = if let Some(FewerBits { bits, largest }) = fewer {
        format!("16-bit integers that reach only {largest} of 65535, as those of {bits} bits do")
    } else if largest <= 0.0 && map == Map::BaseColor {
        "black everywhere".to_owned()
    } else if 0.0 < largest && largest < LEAST_LARGEST && !(map == Map::Metallic && are_floats) {
        format!("no number above {largest:?} of 1")
    } else {
        return None;
    };
    let message = format!("all {} maps of '{}' together: {message}", all.len(), map.stem());
    Some(warning("small_numbers", place, message, "write 1 as 255 in 8 bits, as 65535 in 16 bits, as 1.0 in EXR"))
}
