//! The cameras of a COLMAP model, text and binary (`cameras`, `images`; points are not read).
//!
//! The number and order of each model's parameters are those of COLMAP's `sensor/models.h`. Poses take the world to
//! OpenCV's axes.

use std::collections::BTreeMap;

use glam::{DMat3, DQuat, DVec3};
use mateval_dataset::lens::Lens;
use mateval_files::untrusted::quoted;

use super::cameras::{CapturedCamera, MOST_CAMERAS, PhotoName, of_opencv};
use crate::open::Invalid;

/// COLMAP's number of a model, its name, and how many parameters it has.
const MODELS: [(i32, &str, usize); 11] = [
    (0, "SIMPLE_PINHOLE", 3),
    (1, "PINHOLE", 4),
    (2, "SIMPLE_RADIAL", 4),
    (3, "RADIAL", 5),
    (4, "OPENCV", 8),
    (5, "OPENCV_FISHEYE", 8),
    (6, "FULL_OPENCV", 12),
    (7, "FOV", 5),
    (8, "SIMPLE_RADIAL_FISHEYE", 4),
    (9, "RADIAL_FISHEYE", 5),
    (10, "THIN_PRISM_FISHEYE", 12),
];
/// The longest name of a photo, in bytes.
const LONGEST_NAME: usize = 1024;

type Lenses = BTreeMap<u32, Lens>;

/// The cameras of `cameras.txt` and `images.txt`.
pub(super) fn of_text(cameras: &str, images: &str) -> Result<Vec<CapturedCamera>, Invalid> {
    let mut lenses = Lenses::new();
    for (line, words) in lines(cameras).filter(|(_, line)| !line.trim().is_empty()) {
        let what = format!("cameras.txt, line {line}");
        let words: Vec<&str> = words.split_whitespace().collect();
        let [id, model, width, height, parameters @ ..] = &words[..] else {
            return Err(Invalid(format!("{what}: expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS")));
        };
        let known = MODELS.iter().find(|(_, name, _)| name == model);
        let (_, model, count) = known.ok_or_else(|| Invalid(format!("{what}: unknown model {}", quoted(model))))?;
        let parameters = parameters.iter().map(|word| number(&what, word)).collect::<Result<Vec<f64>, _>>()?;
        if parameters.len() != *count {
            let found = parameters.len();
            return Err(Invalid(format!("{what}: expected {count} parameters of {model}, found {found}")));
        }
        let size = [number(&what, width)?, number(&what, height)?];
        lenses.insert(number(&what, id)?, lens(&what, model, size, &parameters)?);
    }
    // Each photo has a second line, of its points, which may be empty.
    let mut cameras = Vec::new();
    let mut rest = lines(images).skip_while(|(_, line)| line.trim().is_empty());
    while let Some((line, words)) = rest.next() {
        if words.trim().is_empty() {
            continue;
        }
        rest.next();
        let what = format!("images.txt, line {line}");
        let mut words = words.split_whitespace();
        let mut numbers = [0.0; 9];
        for place in &mut numbers {
            let word = words
                .next()
                .ok_or_else(|| Invalid(format!("{what}: expected IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME")))?;
            *place = number(&what, word)?;
        }
        let [_, pose @ .., camera] = numbers;
        let name = words.collect::<Vec<_>>().join(" ");
        cameras.push(camera_of(&what, pose, camera as u32, name, &lenses)?);
    }
    Ok(cameras)
}

/// The lines that are no comments, numbered from 1.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let numbered = text.lines().enumerate().map(|(at, line)| (at + 1, line));
    numbered.filter(|(_, line)| !line.trim_start().starts_with('#'))
}

fn number<T: std::str::FromStr>(what: &str, word: &str) -> Result<T, Invalid> {
    word.parse().map_err(|_| Invalid(format!("{what}: expected a number, found {}", quoted(word))))
}

/// The cameras of `cameras.bin` and `images.bin`.
pub(super) fn of_binary(cameras: &[u8], images: &[u8]) -> Result<Vec<CapturedCamera>, Invalid> {
    let mut lenses = Lenses::new();
    let mut rest = Rest { what: "cameras.bin", bytes: cameras };
    for at in 0..rest.count()? {
        let what = format!("cameras.bin, camera {at}");
        let [id, model] = [rest.take()?, rest.take()?].map(i32::from_le_bytes);
        let [width, height] = [rest.take()?, rest.take()?].map(u64::from_le_bytes);
        let known = MODELS.iter().find(|(number, ..)| *number == model);
        let (_, model, count) = known.ok_or_else(|| Invalid(format!("{what}: unknown model {model}")))?;
        let parameters: Result<Vec<f64>, Invalid> = (0..*count).map(|_| rest.take().map(f64::from_le_bytes)).collect();
        let parameters = parameters?;
        let size = [width, height].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
        lenses.insert(id.cast_unsigned(), lens(&what, model, size, &parameters)?);
    }
    let mut found = Vec::new();
    let mut rest = Rest { what: "images.bin", bytes: images };
    for at in 0..rest.count()? {
        let what = format!("images.bin, photo {at}");
        let _: [u8; 4] = rest.take()?;
        let mut pose = [0.0; 7];
        for place in &mut pose {
            *place = f64::from_le_bytes(rest.take()?);
        }
        let camera = u32::from_le_bytes(rest.take()?);
        let name = rest.name()?;
        let points = u64::from_le_bytes(rest.take()?);
        // Two coordinates and the number of a point.
        rest.skip(points.saturating_mul(24))?;
        found.push(camera_of(&what, pose, camera, name, &lenses)?);
    }
    Ok(found)
}

/// What is left of a file.
struct Rest<'a> {
    what: &'static str,
    bytes: &'a [u8],
}

impl Rest<'_> {
    fn cut_off(&self) -> Invalid {
        Invalid(format!("{} is cut off", self.what))
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], Invalid> {
        let (taken, rest) = self.bytes.split_first_chunk::<N>().ok_or_else(|| self.cut_off())?;
        self.bytes = rest;
        Ok(*taken)
    }

    fn skip(&mut self, count: u64) -> Result<(), Invalid> {
        let count = usize::try_from(count).ok().filter(|count| *count <= self.bytes.len());
        self.bytes = &self.bytes[count.ok_or_else(|| self.cut_off())?..];
        Ok(())
    }

    fn count(&mut self) -> Result<u64, Invalid> {
        let count = u64::from_le_bytes(self.take()?);
        if count > MOST_CAMERAS as u64 {
            return Err(Invalid(format!("{} states {count} entries; expected at most {MOST_CAMERAS}", self.what)));
        }
        Ok(count)
    }

    /// A text that ends with a zero.
    fn name(&mut self) -> Result<String, Invalid> {
        let end = self.bytes.iter().take(LONGEST_NAME).position(|byte| *byte == 0).ok_or_else(|| self.cut_off())?;
        let name = String::from_utf8_lossy(&self.bytes[..end]).into_owned();
        self.bytes = &self.bytes[end + 1..];
        Ok(name)
    }
}

/// The lens of a model with its parameters, whose number is right.
fn lens(what: &str, model: &str, [width, height]: [u32; 2], parameters: &[f64]) -> Result<Lens, Invalid> {
    if ![width, height].iter().all(|side| (1..=65_536).contains(side)) {
        return Err(Invalid(format!("{what}: expected sides of 1 to 65536 pixels, found {width}x{height}")));
    }
    let all = |fx, fy, cx, cy, [k1, k2, p1, p2]: [f64; 4]| Lens { width, height, fx, fy, cx, cy, k1, k2, p1, p2 };
    let refused = |why: &str| Err(Invalid(format!("{what}: {model} {why}; undistort its photos first")));
    match (model, parameters) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => Ok(all(f, f, cx, cy, [0.0; 4])),
        ("PINHOLE", &[fx, fy, cx, cy]) => Ok(all(fx, fy, cx, cy, [0.0; 4])),
        ("SIMPLE_RADIAL", &[f, cx, cy, k1]) => Ok(all(f, f, cx, cy, [k1, 0.0, 0.0, 0.0])),
        ("RADIAL", &[f, cx, cy, k1, k2]) => Ok(all(f, f, cx, cy, [k1, k2, 0.0, 0.0])),
        ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => Ok(all(fx, fy, cx, cy, [k1, k2, p1, p2])),
        ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, ref higher @ ..]) => match higher.iter().all(|k| *k == 0.0) {
            true => Ok(all(fx, fy, cx, cy, [k1, k2, p1, p2])),
            false => refused("has k3 to k6, which are not read"),
        },
        ("FOV", _) => refused("is not read"),
        _ => refused("is a fisheye, which is not read"),
    }
}

fn camera_of(
    what: &str,
    [qw, qx, qy, qz, tx, ty, tz]: [f64; 7],
    camera: u32,
    name: String,
    lenses: &Lenses,
) -> Result<CapturedCamera, Invalid> {
    let lens = lenses.get(&camera).ok_or_else(|| Invalid(format!("{what}: there is no camera {camera}")))?;
    let quaternion = DQuat::from_xyzw(qx, qy, qz, qw);
    let off = (quaternion.length() - 1.0).abs();
    if off.is_nan() || off > 1e-3 {
        return Err(Invalid(format!("{what}: expected a quaternion of length 1, found {}", quaternion.length())));
    }
    let rotation = DMat3::from_quat(quaternion.normalize());
    of_opencv(what, PhotoName::File(name), rotation, DVec3::new(tx, ty, tz), *lens)
}

#[cfg(test)]
mod tests {
    use super::super::cameras::tests::{lens, pose};
    use super::*;

    const CAMERAS: &str = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS\n3 OPENCV 64 48 50 51 31 25 -0.2 0.1 0.01 0.02\n";

    /// The line of a photo of the pose.
    fn image() -> String {
        let (axes, position) = pose();
        let rotation = (axes * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0))).transpose();
        let (q, t) = (DQuat::from_mat3(&rotation), -(rotation * position));
        format!("7 {} {} {} {} {} {} {} 3 a b.png\n1.5 2.5 -1\n", q.w, q.x, q.y, q.z, t.x, t.y, t.z)
    }

    fn binary(cameras: &str, images: &str) -> (Vec<u8>, Vec<u8>) {
        let words = |text: &str| text.lines().last().unwrap_or("").split(' ').map(str::to_owned).collect::<Vec<_>>();
        let (camera, image) = (words(cameras), words(images.lines().next().unwrap()));
        let mut bytes = 1_u64.to_le_bytes().to_vec();
        bytes.extend(3_i32.to_le_bytes());
        bytes.extend(4_i32.to_le_bytes());
        camera[2..4].iter().for_each(|side| bytes.extend(side.parse::<u64>().unwrap().to_le_bytes()));
        camera[4..].iter().for_each(|value| bytes.extend(value.parse::<f64>().unwrap().to_le_bytes()));
        let mut photos = 1_u64.to_le_bytes().to_vec();
        photos.extend(7_u32.to_le_bytes());
        image[1..8].iter().for_each(|value| photos.extend(value.parse::<f64>().unwrap().to_le_bytes()));
        photos.extend(3_u32.to_le_bytes());
        photos.extend(b"a b.png\0");
        photos.extend(1_u64.to_le_bytes());
        photos.extend([0; 24]);
        (bytes, photos)
    }

    #[test]
    fn text_and_binary_state_the_same_camera() {
        let (axes, position) = pose();
        let of_text = of_text(CAMERAS, &image()).unwrap();
        let (cameras, images) = binary(CAMERAS, &image());
        assert_eq!(of_binary(&cameras, &images).unwrap(), of_text);
        let [camera] = &of_text[..] else { panic!() };
        assert!(camera.rotation.abs_diff_eq(axes, 1e-12) && camera.position.abs_diff_eq(position, 1e-12));
        assert_eq!(camera.lens, Lens { k1: -0.2, k2: 0.1, p1: 0.01, p2: 0.02, ..lens() });
        assert_eq!(camera.photo, PhotoName::File("a b.png".to_owned()));
        for end in 0..cameras.len() {
            assert!(of_binary(&cameras[..end], &images).is_err(), "{end}");
        }
        for end in 0..images.len() {
            assert!(of_binary(&cameras, &images[..end]).is_err(), "{end}");
        }
    }

    /// By hand: the unit quaternion is no rotation, so the camera looks along +Z with +Y down; ours along -Z.
    #[test]
    fn a_pose_without_rotation_looks_along_z() {
        let images = "1 1 0 0 0 1 2 3 1 a.png\n\n2 1 0 0 0 0 0 0 1 b.png\n";
        let found = of_text("1 SIMPLE_RADIAL 64 48 50 31 25 0.1", images).unwrap();
        assert_eq!(found.len(), 2);
        assert_eq!(found[0].rotation, DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)));
        assert_eq!(found[0].position, DVec3::new(-1.0, -2.0, -3.0));
        assert_eq!((found[1].lens.fy, found[1].lens.k1, found[1].lens.k2), (50.0, 0.1, 0.0));
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let refused = |cameras: &str, images: &str, words: &str| {
            let found = of_text(cameras, images).unwrap_err().0;
            assert!(found.contains(words), "{found}");
        };
        refused("1 OPENCV_FISHEYE 64 48 1 1 1 1 0 0 0 0", "", "OPENCV_FISHEYE is a fisheye");
        refused("1 FULL_OPENCV 64 48 1 1 1 1 0 0 0 0 0.1 0 0 0", "", "k3 to k6");
        refused("1 FOV 64 48 1 1 1 1 1", "", "FOV is not read");
        refused("1 WIDE 64 48 1", "", "unknown model 'WIDE'");
        refused("1 PINHOLE 64 48 1", "", "expected 4 parameters of PINHOLE, found 1");
        refused("1 PINHOLE 0 48 1 1 1 1", "", "found 0x48");
        refused("1 PINHOLE", "", "cameras.txt, line 1");
        refused(CAMERAS, "1 1 0 0 0 1 2 3 9 a.png\n\n", "there is no camera 9");
        refused(CAMERAS, "1 2 0 0 0 1 2 3 3 a.png\n\n", "length 1, found 2");
        refused(CAMERAS, "1 nan 0 0 0 1 2 3 3 a.png\n\n", "found NaN");
        refused(CAMERAS, "1 1 0 0", "images.txt, line 1");
        let many = u64::MAX.to_le_bytes();
        assert!(of_binary(&many, &many).unwrap_err().0.contains("at most"));
    }
}
