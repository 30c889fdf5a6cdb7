//! Decodes one map of a submission: its header and texels, or the fault that makes it unusable. Texels that hold no
//! usable number are replaced, unless there are too many.
//!
//! Scoring and `eval lint` both decode maps here. The file is untrusted input: sizes are checked before memory is
//! taken.

use std::ops::RangeInclusive;
use std::path::Path;

use mateval_dataset::submission::{GREY, MAP_SIZES, MISSING_METALLIC, MISSING_ROUGHNESS, Map};
use mateval_dataset::{DatasetError, TriangleMesh};
use mateval_files::untrusted::{is_lfs_pointer, kind_name, shortened};
use mateval_image::exr_io::{self, EXR_SIGNATURE, ExrHeader};
use mateval_image::png_io::{self, PNG_SIGNATURE, PngHeader};
use mateval_image::{ImageError, Texels, Texture};

use crate::atlas::{TexelSet, reached};
use crate::error::FileFault;
use crate::files::{HashedFile, SubmittedFile};

/// Most numbers that an OpenEXR file may hold in all its parts and channels together: eight channels of the largest
/// map.
pub const MAX_EXR_NUMBERS: usize = 8 * 4096 * 4096;

/// The range of a linear base colour. One stray value must not dominate the mean over all pixels.
pub const BASE_COLOR_RANGE: RangeInclusive<f32> = -1.0..=16.0;

/// The range of a roughness and of a metallic.
pub const SCALAR_RANGE: RangeInclusive<f32> = 0.0..=1.0;

/// The largest share of the reached texels that may be bad; a map with more of them is unsound.
pub const MOST_BAD_SHARE: f64 = 0.01;

/// The linear value of the map that replaces a missing one, in all channels.
pub fn default_value(map: Map) -> f32 {
    match map {
        Map::BaseColor => GREY,
        Map::Roughness => MISSING_ROUGHNESS,
        Map::Metallic => MISSING_METALLIC,
    }
}

#[derive(Clone, Debug, PartialEq)]
pub enum MapHeader {
    Png(PngHeader),
    Exr(ExrHeader),
}

#[derive(Clone, Debug)]
pub struct MapFile {
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
    atlas: impl FnOnce() -> Result<&'a TriangleMesh, DatasetError>,
) -> Result<Result<MapFile, FileFault>, DatasetError> {
    let SubmittedFile { path, hashed: HashedFile { sha256, .. }, bytes } = file;
    let decoded = check_header(&path, &bytes, map).and_then(|header| {
        let texture = texels(&path, bytes, map, &header)?;
        Ok((header, texture))
    });
    let (header, texture) = match decoded {
        Ok(decoded) => decoded,
        Err(fault) => return Ok(Err(fault)),
    };
    let repaired = repaired(texture, map, atlas)?;
    Ok(repaired.map(|(texture, bad_texels)| MapFile { header, texture, bad_texels, sha256 }))
}

/// Reads the header. Fails if the file's kind, size or channels rule it out, before any texel is decoded.
fn check_header(path: &Path, bytes: &[u8], map: Map) -> Result<MapHeader, FileFault> {
    check_kind(path, bytes)?;
    let header = if path.extension().is_some_and(|ending| ending == "exr") {
        ExrHeader::of(bytes).map(MapHeader::Exr).map_err(|error| error.to_string())
    } else {
        PngHeader::of(bytes).map(MapHeader::Png).map_err(|error| error.to_string())
    };
    let header = header.map_err(|what| {
        let message = format!("its header is invalid: {}", shortened(&what));
        FileFault::new("bad_header", message, "write the map again")
    })?;
    match &header {
        MapHeader::Png(png) => {
            check_size(png.width as usize, png.height as usize)?;
            // Without its closing chunk a PNG was truncated, even if all texels can be decoded: nothing else proves
            // that the file is complete.
            if !png.ended {
                let message = "truncated: it has no closing chunk (IEND)";
                return Err(FileFault::new("truncated_picture", message, "write or copy it again, whole"));
            }
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
    if is_lfs_pointer(bytes) {
        let message = "a Git LFS pointer, not the file that it stands for";
        return Err(FileFault::new("git_lfs_pointer", message, "fetch the file itself (git lfs pull)"));
    }
    // A file that was cut within its signature is a truncated file of that kind.
    if bytes.starts_with(expected) || expected.starts_with(bytes) {
        return Ok(());
    }
    let kind = kind_name(bytes).unwrap_or("not a picture");
    let message = format!("{kind} in a file named .{}", name.to_lowercase());
    Err(FileFault::new("wrong_kind", message, "convert it to PNG (.png) or OpenEXR (.exr); nothing else is read"))
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
        (MapHeader::Png(_), Map::BaseColor) => png_io::png_color(path, bytes),
        (MapHeader::Png(_), _) => png_io::png_scalar(path, bytes),
        (MapHeader::Exr(_), Map::BaseColor) => exr_io::exr_color(path, &bytes),
        (MapHeader::Exr(_), _) => exr_io::exr_scalar(path, &bytes),
    };
    decoded.map_err(|error| {
        let what = match error {
            ImageError::Invalid { what, .. } | ImageError::Unsupported { what, .. } => what,
            other => other.to_string(),
        };
        FileFault::new("unreadable_picture", what, "write the map again")
    })
}

/// A map without bad texels, and the finding about those that were reached; or the fault of a map that has too many of
/// them.
type Repaired = Result<(Texture, Option<FileFault>), FileFault>;

/// Replaces the bad texels of a map: those that hold no finite number in range. `atlas` is asked for only if there are
/// any; fails only where it does.
fn repaired<'a>(
    texture: Texture,
    map: Map,
    atlas: impl FnOnce() -> Result<&'a TriangleMesh, DatasetError>,
) -> Result<Repaired, DatasetError> {
    let range = range_of(map);
    let values: &[f32] = match texture.texels() {
        Texels::Linear(values) => values.as_flattened(),
        Texels::Grey(values) => values,
        // Integers decode to 0 to 1.
        _ => return Ok(Ok((texture, None))),
    };
    if values.iter().all(|value| range.contains(value)) {
        return Ok(Ok((texture, None)));
    }
    let reach = reached(atlas()?, texture.width(), texture.height());
    let (width, height, wrap) = (texture.width(), texture.height(), texture.wrap());
    let mut texels = texture.into_texels();
    let (values, channels) = match &mut texels {
        Texels::Linear(values) => (values.as_flattened_mut(), 3),
        Texels::Grey(values) => (values.as_mut_slice(), 1),
        _ => unreachable!("integers have been returned"),
    };
    let finding = match repair(&mut Numbers { values, channels }, map, reach) {
        Ok(finding) => finding,
        Err(fault) => return Ok(Err(fault)),
    };
    let texture = Texture::new(width, height, texels, wrap).expect("the texels are as many as before");
    Ok(Ok((texture, finding)))
}

fn range_of(map: Map) -> RangeInclusive<f32> {
    if map == Map::BaseColor { BASE_COLOR_RANGE } else { SCALAR_RANGE }
}

/// The numbers of all texels, `channels` for each.
struct Numbers<'a> {
    values: &'a mut [f32],
    channels: usize,
}

impl Numbers<'_> {
    fn texel(&self, at: usize) -> &[f32] {
        &self.values[at * self.channels..][..self.channels]
    }

    fn set(&mut self, at: usize, texel: [f32; 3]) {
        self.values[at * self.channels..][..self.channels].copy_from_slice(&texel[..self.channels]);
    }

    /// The mean of some texels, in their order.
    fn mean(&self, texels: impl Iterator<Item = usize>) -> [f32; 3] {
        let (mut sums, mut count) = ([0.0_f64; 3], 0.0);
        for at in texels {
            sums.iter_mut().zip(self.texel(at)).for_each(|(sum, value)| *sum += f64::from(*value));
            count += 1.0;
        }
        sums.map(|sum| (sum / count) as f32)
    }
}

/// Replaces every bad texel. A texel is bad as a whole if any of its numbers is. Bad texels that no lookup reaches, as
/// gutters often are, take the map's default, those that are reached the mean of their sound neighbours. Returns the
/// finding about those in `reach`, none if there are none; fails where there are too many.
fn repair(numbers: &mut Numbers<'_>, map: Map, reach: TexelSet) -> Result<Option<FileFault>, FileFault> {
    let range = range_of(map);
    let (width, reached) = (reach.width(), reach.texels.count_ones(..));
    let (mut bad, mut sound) = (TexelSet::none(width, reach.height()), reach);
    let mut first = None;
    for at in 0..numbers.values.len() / numbers.channels {
        let Some(value) = numbers.texel(at).iter().copied().find(|value| !range.contains(value)) else { continue };
        if sound.texels.contains(at) {
            first = first.or(Some((at, value)));
            sound.texels.remove(at);
            bad.texels.insert(at);
        }
        numbers.set(at, [default_value(map); 3]);
    }
    let Some((at, value)) = first else { return Ok(None) };
    let count = bad.texels.count_ones(..);
    let found = BadTexels { map, count, reached, place: [at % width, at / width], value };
    if count as f64 / reached as f64 > MOST_BAD_SHARE {
        return Err(found.too_many());
    }
    fill_from_neighbours(numbers, bad, sound);
    Ok(Some(found.few()))
}

/// Gives bad texels the mean of their sound neighbours, in rounds: those that have any take it, all at once, and are
/// sound from the next round on. Texels that no round reaches keep what they hold.
///
/// Each texel is visited once as a member of a round and once for each neighbour, so that the work is linear whatever
/// the shape of the bad area.
fn fill_from_neighbours(numbers: &mut Numbers<'_>, mut bad: TexelSet, mut sound: TexelSet) {
    let touches_sound = |at: &usize| sound.neighbours(*at).any(|other| sound.texels.contains(other));
    let mut round: Vec<usize> = bad.texels.ones().filter(touches_sound).collect();
    while !round.is_empty() {
        let sound_around = |at: &usize| sound.neighbours(*at).filter(|other| sound.texels.contains(*other));
        let means: Vec<[f32; 3]> = round.iter().map(|at| numbers.mean(sound_around(at))).collect();
        for (at, mean) in round.iter().zip(means) {
            numbers.set(*at, mean);
            bad.texels.remove(*at);
            sound.texels.insert(*at);
        }
        round = round.iter().flat_map(|at| bad.neighbours(*at)).filter(|at| bad.texels.contains(*at)).collect();
        round.sort_unstable();
        round.dedup();
    }
}

/// The bad texels of a map that lookups reach.
struct BadTexels {
    map: Map,
    count: usize,
    /// How many texels lookups reach, bad or not.
    reached: usize,
    /// Column and row of the first.
    place: [usize; 2],
    /// The first bad number of that texel.
    value: f32,
}

impl BadTexels {
    /// The finding about a map that is scored with them replaced.
    fn few(&self) -> FileFault {
        self.fault("bad_texels", "", "write finite numbers in range; the mean of their neighbours is scored")
    }

    /// The fault of a map that has too many, named after the first.
    fn too_many(&self) -> FileFault {
        let code = match self.value {
            value if value.is_nan() => "nan",
            value if value.is_infinite() => "infinity",
            _ => "out_of_range",
        };
        let share = format!(", more than {:.0} %,", 100.0 * MOST_BAD_SHARE);
        self.fault(code, &share, "write finite numbers in range")
    }

    fn fault(&self, code: &'static str, share: &str, action: &'static str) -> FileFault {
        let Self { map, count, reached, place: [x, y], value } = self;
        let name = match map {
            Map::BaseColor => "base colour",
            Map::Roughness => "roughness",
            Map::Metallic => "metallic",
        };
        let range = range_of(*map);
        let message = format!(
            "{count} of the {reached} texels that lookups reach{share} hold no {name} of {} to {}; the first is {value}",
            range.start(),
            range.end()
        );
        FileFault { place: format!("texel ({x}, {y})"), ..FileFault::new(code, message, action) }
    }
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, Vec3};
    use mateval_image::Wrap;

    use super::*;

    const SIDE: usize = 64;

    /// Rectangles of an atlas, in texels of a map of this size: left, top, right, bottom.
    fn atlas(size: usize, charts: &[[f32; 4]]) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for [left, top, right, bottom] in charts {
            let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
            let uv = |[x, y]: [&f32; 2]| Vec2::new(x / size as f32, 1.0 - y / size as f32);
            mesh.append(&TriangleMesh {
                positions: vec![Vec3::ZERO; 4],
                normals: None,
                uvs: Some(corners.map(uv).into()),
                triangles: vec![[0, 1, 2], [0, 2, 3]],
            });
        }
        mesh
    }

    /// One chart, of which lookups reach the columns and rows 10 to 49: 1600 texels.
    fn chart() -> TriangleMesh {
        atlas(SIDE, &[[11.0, 11.0, 49.0, 49.0]])
    }

    fn is_reached(at: usize) -> bool {
        (10..50).contains(&(at % SIDE)) && (10..50).contains(&(at / SIDE))
    }

    /// A number of its own for each texel, in range for every map, exact in single precision.
    fn ramp(at: usize) -> f32 {
        (at % 97) as f32 / 128.0
    }

    /// A map of this size; of a base colour the channels differ, and `value` is the second one.
    fn texture(map: Map, size: usize, value: impl Fn(usize) -> f32) -> Texture {
        let all = 0..size * size;
        let texels = match map {
            Map::BaseColor => Texels::Linear(all.map(|at| [ramp(at + 1), value(at), ramp(at + 2)]).collect()),
            _ => Texels::Grey(all.map(value).collect()),
        };
        Texture::new(size, size, texels, Wrap::Clamp).unwrap()
    }

    fn repaired_map(map: Map, value: impl Fn(usize) -> f32) -> Repaired {
        let chart = chart();
        repaired(texture(map, SIDE, value), map, || Ok(&chart)).unwrap()
    }

    fn bits(texture: &Texture, at: usize) -> [u32; 3] {
        texture.texel(at % SIDE, at / SIDE).map(f32::to_bits)
    }

    const BAD: [(f32, &str); 5] = [
        (f32::NAN, "nan"),
        (f32::INFINITY, "infinity"),
        (f32::NEG_INFINITY, "infinity"),
        (16.5, "out_of_range"),
        (-1.5, "out_of_range"),
    ];

    #[test]
    fn sound_maps_do_not_ask_for_the_atlas() {
        for map in Map::ALL {
            let sound = texture(map, SIDE, ramp);
            let answer = repaired(sound.clone(), map, || panic!("asked")).unwrap();
            assert_eq!(answer, Ok((sound, None)));
        }
        // Bytes have no bad values.
        let bytes = Texture::new(8, 8, Texels::Grey8(vec![255; 64]), Wrap::Clamp).unwrap();
        assert_eq!(repaired(bytes.clone(), Map::Metallic, || panic!("asked")).unwrap(), Ok((bytes, None)));
        // The twin: a map with a bad texel does ask.
        let error = || DatasetError::Unsupported { path: "a".into(), what: "asked".to_owned() };
        let bad = texture(Map::Metallic, SIDE, |at| if at == 0 { 2.0 } else { 0.5 });
        assert!(repaired(bad, Map::Metallic, || Err(error())).unwrap_err().to_string().contains("asked"));
    }

    /// Bad values everywhere outside the chart change no bit inside, and all texels are finite.
    #[test]
    fn what_no_lookup_reaches_may_be_bad() {
        for (map, (bad, _)) in Map::ALL.into_iter().flat_map(|map| BAD.map(|bad| (map, bad))) {
            let value = |at: usize| if is_reached(at) { ramp(at) } else { bad };
            let (found, finding) = repaired_map(map, value).unwrap();
            assert_eq!(finding, None, "{map:?} {bad}");
            let sound = texture(map, SIDE, ramp);
            for at in 0..SIDE * SIDE {
                let expected = if is_reached(at) { bits(&sound, at) } else { [default_value(map).to_bits(); 3] };
                assert_eq!(bits(&found, at), expected, "{map:?} {bad} {at}");
            }
        }
    }

    /// In the middle of the chart, on its edge and in its corner. Texels outside, which are 9 or 0, are no neighbours.
    #[test]
    fn a_bad_texel_takes_the_mean_of_its_reached_neighbours() {
        let places = [(30, 20, 8), (49, 20, 5), (10, 49, 3)];
        for (map, (bad, _), (x, y, neighbours)) in
            Map::ALL.into_iter().flat_map(|map| BAD.into_iter().flat_map(move |bad| places.map(|at| (map, bad, at))))
        {
            let planted = y * SIDE + x;
            let outside = if map == Map::BaseColor { 9.0 } else { 0.0 };
            let sound = |at: usize| if is_reached(at) { ramp(at) } else { outside };
            let (found, finding) = repaired_map(map, |at| if at == planted { bad } else { sound(at) }).unwrap();
            let around: Vec<usize> = (0..SIDE * SIDE)
                .filter(|at| *at != planted && is_reached(*at))
                .filter(|at| (at % SIDE).abs_diff(x) <= 1 && (at / SIDE).abs_diff(y) <= 1)
                .collect();
            assert_eq!(around.len(), neighbours);
            // Multiples of 1/128 have an exact sum.
            let mean =
                |value: &dyn Fn(usize) -> f32| around.iter().map(|at| value(*at)).sum::<f32>() / neighbours as f32;
            let second = mean(&sound);
            let expected = match map {
                Map::BaseColor => [mean(&|at| ramp(at + 1)), second, mean(&|at| ramp(at + 2))],
                _ => [second; 3],
            };
            assert_eq!(found.texel(x, y), expected, "{map:?} {bad} ({x}, {y})");
            let others = texture(map, SIDE, sound);
            assert!((0..SIDE * SIDE).all(|at| at == planted || bits(&found, at) == bits(&others, at)));
            let finding = finding.unwrap();
            assert_eq!((finding.code, finding.place), ("bad_texels", format!("texel ({x}, {y})")));
            assert!(
                finding.message.starts_with("1 of the 1600 texels that lookups reach hold no "),
                "{}",
                finding.message
            );
            assert!(finding.message.ends_with(&format!("the first is {bad}")), "{}", finding.message);
        }
    }

    /// The ring of a block takes means of sound texels alone, the middle the mean of the ring, all of one round at
    /// once.
    #[test]
    fn blocks_are_filled_from_outside_in_rounds() {
        let is_bad = |at: usize| (29..32).contains(&(at % SIDE)) && (29..32).contains(&(at / SIDE));
        let value = |at: usize| if is_bad(at) { f32::NAN } else { (at % SIDE) as f32 / 64.0 };
        let (found, finding) = repaired_map(Map::Roughness, value).unwrap();
        assert!(finding.unwrap().message.starts_with("9 of the 1600"));
        let row = |y: usize| [29, 30, 31].map(|x| 64.0 * found.texel(x, y)[0]);
        // The corner has sound neighbours in columns 28, 28, 28, 29 and 30.
        let [corner, side] = [(28.0 * 3.0 + 29.0 + 30.0) / 5.0, 28.0];
        let ring = [corner, 30.0, 60.0 - corner];
        for (found, expected) in [row(29), row(30), row(31)].iter().zip([ring, [side, 30.0, 60.0 - side], ring]) {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?} {expected:?}");
        }
    }

    /// One in a hundred may be bad, wherever they are.
    #[test]
    fn more_than_one_percent_is_a_fault() {
        for (map, (bad, code)) in Map::ALL.into_iter().flat_map(|map| BAD.map(|bad| (map, bad))) {
            let with = |count: usize| {
                let place = |at: usize| is_reached(at) && (at / SIDE - 10) * 40 + at % SIDE - 10 < count;
                repaired_map(map, |at| if place(at) || !is_reached(at) { bad } else { ramp(at) })
            };
            let (_, finding) = with(16).unwrap();
            assert!(finding.unwrap().message.starts_with("16 of the 1600 texels"));
            for count in [17, 32, 1600] {
                let fault = with(count).unwrap_err();
                assert_eq!((fault.code, fault.place.as_str()), (code, "texel (10, 10)"));
                let start = format!("{count} of the 1600 texels that lookups reach, more than 1 %, hold no ");
                assert!(fault.message.starts_with(&start), "{}", fault.message);
            }
        }
    }

    /// A chart of its own without a sound texel has nobody to ask.
    #[test]
    fn a_chart_of_bad_texels_takes_the_default() {
        let mesh = atlas(SIDE, &[[1.0, 1.0, 63.0, 40.0], [30.0, 50.0, 31.0, 51.0]]);
        let value = |at: usize| if at / SIDE > 45 { f32::NAN } else { 0.25 };
        let both = |map: Map| repaired(texture(map, SIDE, value), map, || Ok(&mesh)).unwrap().unwrap();
        for (map, expected) in [(Map::BaseColor, 0.5), (Map::Roughness, 0.5), (Map::Metallic, 0.0)] {
            let (found, finding) = both(map);
            assert!(finding.unwrap().message.starts_with("9 of the"));
            assert_eq!(found.texel(30, 50), [expected; 3]);
        }
    }

    /// A bad strip that only its left end can fill, two texels wide: one round for each column, each of two texels.
    #[test]
    fn long_strips_take_time_in_proportion() {
        let size = 1024;
        let mesh = atlas(size, &[[0.0, 40.0, 1024.0, 1024.0], [1.0, 10.0, 1023.0, 10.0]]);
        let value = |at: usize| if at / size < 20 && !at.is_multiple_of(size) { f32::NAN } else { 0.25 };
        let (found, finding) =
            repaired(texture(Map::Metallic, size, value), Map::Metallic, || Ok(&mesh)).unwrap().unwrap();
        assert!(finding.unwrap().message.starts_with("2046 of the"));
        assert!((0..size).all(|x| found.texel(x, 9) == [0.25; 3] && found.texel(x, 10) == [0.25; 3]));
    }

    #[test]
    fn without_any_triangle_nothing_is_reached() {
        let nothing = TriangleMesh { uvs: Some(Vec::new()), ..TriangleMesh::default() };
        let bad = texture(Map::BaseColor, SIDE, |_| f32::NAN);
        let (found, finding) = repaired(bad, Map::BaseColor, || Ok(&nothing)).unwrap().unwrap();
        assert_eq!((found.collapsed().texel(0, 0), finding), ([0.5; 3], None));
    }
}
