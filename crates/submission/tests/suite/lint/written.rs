//! Writes unusual and faulty PNG and OpenEXR files.

use std::io::Write as _;
use std::path::Path;

use exr::prelude as ex;

/// A chunk of a PNG.
pub fn chunk(name: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let mut sum = flate2::Crc::new();
    sum.update(name);
    sum.update(data);
    [&(data.len() as u32).to_be_bytes()[..], name, data, &sum.sum().to_be_bytes()].concat()
}

/// Inserts a chunk after the header.
pub fn insert(path: &Path, name: &[u8; 4], data: &[u8]) {
    const HEADER_END: usize = 33;
    let bytes = std::fs::read(path).unwrap();
    let with = [&bytes[..HEADER_END], &chunk(name, data), &bytes[HEADER_END..]].concat();
    std::fs::write(path, with).unwrap();
}

/// A PNG of these rows of bytes, each preceded by its filter; `before` are chunks in front of the picture.
pub fn png(side: u32, depth: u8, color: u8, interlace: u8, before: &[u8], rows: &[u8]) -> Vec<u8> {
    let size = side.to_be_bytes();
    let header = [&size[..], &size, &[depth, color, 0, 0, interlace]].concat();
    let mut packed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    packed.write_all(rows).unwrap();
    let packed = packed.finish().unwrap();
    let signature = b"\x89PNG\r\n\x1a\n";
    [&signature[..], &chunk(b"IHDR", &header), before, &chunk(b"IDAT", &packed), &chunk(b"IEND", b"")].concat()
}

/// `count` rows of `bytes` bytes each, without filters.
pub fn rows(count: usize, bytes: usize, value: impl Fn(usize, usize) -> u8) -> Vec<u8> {
    (0..count)
        .flat_map(|y| {
            std::iter::once(0).chain((0..bytes).map(move |x| (x, y)).map(|(x, y)| value(x, y)).collect::<Vec<_>>())
        })
        .collect()
}

/// A layer of 64x64 texels of these channels, all of `value`.
pub fn layer(names: &[&str], value: f32) -> ex::Layer<ex::AnyChannels<ex::FlatSamples>> {
    layer_of(names, || ex::FlatSamples::F32(vec![value; 64 * 64]))
}

/// The same with any type of numbers.
pub fn layer_of(names: &[&str], samples: impl Fn() -> ex::FlatSamples) -> ex::Layer<ex::AnyChannels<ex::FlatSamples>> {
    let channels = names.iter().map(|name| ex::AnyChannel::new(*name, samples())).collect();
    let encoding = ex::Encoding::SMALL_LOSSLESS;
    ex::Layer::new((64, 64), ex::LayerAttributes::default(), encoding, ex::AnyChannels::sort(channels))
}

/// Replaces a PNG by an EXR.
pub fn replace(png: &Path, write: impl FnOnce(&Path) -> Result<(), exr::error::Error>) {
    std::fs::remove_file(png).unwrap();
    write(&png.with_extension("exr")).unwrap();
}

/// The header of an OpenEXR file without data: deep or flat, with these channels and their sampling rates.
pub fn exr_header(side: i32, deep: bool, channels: &[(&str, i32)]) -> Vec<u8> {
    let attribute = |name: &str, kind: &str, value: &[u8]| {
        [name.as_bytes(), b"\0", kind.as_bytes(), b"\0", &(value.len() as i32).to_le_bytes(), value].concat()
    };
    let numbers = |values: &[i32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let channel = |(name, every): &(&str, i32)| {
        [name.as_bytes(), b"\0", &numbers(&[2]), &[0, 0, 0, 0], &numbers(&[*every, *every])].concat()
    };
    let list = [channels.iter().flat_map(channel).collect::<Vec<u8>>(), vec![0]].concat();
    let window = numbers(&[0, 0, side - 1, side - 1]);
    let mut bytes = [&[0x76, 0x2f, 0x31, 0x01][..], &numbers(&[if deep { 0x802 } else { 2 }])].concat();
    bytes.extend(attribute("channels", "chlist", &list));
    bytes.extend(attribute("compression", "compression", &[0]));
    bytes.extend(attribute("dataWindow", "box2i", &window));
    bytes.extend(attribute("displayWindow", "box2i", &window));
    bytes.extend(attribute("lineOrder", "lineOrder", &[0]));
    bytes.extend(attribute("pixelAspectRatio", "float", &floats(&[1.0])));
    bytes.extend(attribute("screenWindowCenter", "v2f", &floats(&[0.0, 0.0])));
    bytes.extend(attribute("screenWindowWidth", "float", &floats(&[1.0])));
    if deep {
        bytes.extend(attribute("name", "string", b"deep"));
        bytes.extend(attribute("type", "string", b"deepscanline"));
        bytes.extend(attribute("version", "int", &numbers(&[1])));
        bytes.extend(attribute("chunkCount", "int", &numbers(&[side])));
        bytes.extend(attribute("maxSamplesPerPixel", "int", &numbers(&[4])));
    }
    bytes.push(0);
    bytes
}
