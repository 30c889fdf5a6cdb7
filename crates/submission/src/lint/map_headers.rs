//! Headers of maps that can be read but look wrong: fields that are ignored, and fields that no such map should have.

use mateval_dataset::Finding;
use mateval_dataset::submission::Map;
use mateval_files::untrusted::shortened;
use mateval_image::exr_io::{ExrChannel, ExrHeader, ExrNumber};
use mateval_image::png_io::{PngColor, PngHeader};
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
