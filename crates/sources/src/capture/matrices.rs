//! Cameras as bare matrices: IDR's `.npz` (MAW 2.0), FIPT's `cam.txt` with `K_list.txt`, and the `camera_<n>.txt` of
//! Objects With Lighting. None of them distorts, and only the last states the size of its photo.

use std::io::Read as _;
use std::path::Path;

use glam::{DMat3, DVec3};
use mateval_dataset::lens::Lens;
use mateval_files::untrusted::quoted;
use mateval_image::npy_io;

use super::cameras::{CapturedCamera, MOST_CAMERAS, PhotoName, of_opencv};
use crate::open::Invalid;

/// Largest skew of a camera's axes, as a share of its focal length, that counts as rounding.
const MOST_SKEW: f64 = 1e-3;
/// FIPT's axes ahead and up are perpendicular to this.
const MOST_TILT: f64 = 2e-3;
/// The most bytes of one array: 16 numbers.
const MATRIX_BYTES: u64 = npy_io::most_bytes(16);

/// `world_mat_<n>` of an `.npz`: 4x4 or 3x4 matrices that take the world, in the unit of the mesh, to pixels. The
/// matrices `scale_mat_<n>` describe another space, that of a unit sphere, and are not read.
pub(super) fn of_npz(bytes: &[u8]) -> Result<Vec<CapturedCamera>, Invalid> {
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(bytes))
        .map_err(|error| Invalid(format!("not an .npz file: {error}")))?;
    let number = |name: &str| name.strip_prefix("world_mat_")?.strip_suffix(".npy")?.parse::<usize>().ok();
    let mut found: Vec<(usize, String)> =
        archive.file_names().filter_map(|name| Some((number(name)?, name.to_owned()))).collect();
    found.sort();
    if found.is_empty() || found.len() > MOST_CAMERAS {
        let found = found.len();
        return Err(Invalid(format!("expected 1 to {MOST_CAMERAS} arrays world_mat_<n>, found {found}")));
    }
    let camera = |(place, (_, name)): (usize, (usize, String))| {
        let file = archive.by_name(&name).map_err(|error| Invalid(format!("{name}: {error}")))?;
        let mut bytes = Vec::new();
        let read = file.take(MATRIX_BYTES + 1).read_to_end(&mut bytes);
        read.map_err(|error| Invalid(format!("{name}: {error}")))?;
        let (shape, numbers) = npy_io::real_numbers(&bytes).map_err(|fault| Invalid(format!("{name}: {fault}")))?;
        if !matches!(shape[..], [4 | 3, 4]) {
            return Err(Invalid(format!("{name}: expected a matrix of 4x4 or 3x4, found the shape {shape:?}")));
        }
        let row = |at: usize| DVec3::new(numbers[4 * at], numbers[4 * at + 1], numbers[4 * at + 2]);
        let last = DVec3::new(numbers[3], numbers[7], numbers[11]);
        projection(&name, PhotoName::Number(place), [row(0), row(1), row(2)], last)
    };
    found.into_iter().enumerate().map(camera).collect()
}

/// The camera whose matrix from world to pixels has these rows of three and this last column.
fn projection(what: &str, photo: PhotoName, rows: [DVec3; 3], last: DVec3) -> Result<CapturedCamera, Invalid> {
    let matrix = DMat3::from_cols_array_2d(&rows.map(|row| row.to_array())).transpose();
    let determinant = matrix.determinant();
    if !(determinant.is_finite() && determinant != 0.0 && last.is_finite()) {
        return Err(Invalid(format!("{what}: expected an invertible matrix, found determinant {determinant}")));
    }
    // Both signs are the same projection; that of a rotation is wanted.
    let [m1, m2, m3] = rows.map(|row| row * determinant.signum());
    // The rows are those of an upper triangular matrix times a rotation, from the bottom.
    let scale = m3.length();
    let r3 = m3 / scale;
    let k23 = m2.dot(r3);
    let k22 = (m2 - r3 * k23).length();
    let r2 = (m2 - r3 * k23) / k22;
    let (k13, k12) = (m1.dot(r3), m1.dot(r2));
    let rest = m1 - r3 * k13 - r2 * k12;
    let k11 = rest.length();
    let rotation = DMat3::from_cols(rest / k11, r2, r3).transpose();
    if k12.abs() > MOST_SKEW * k11 {
        return Err(Invalid(format!("{what}: its pixels are skewed by {}, which is not read", k12 / k11)));
    }
    let lens = pinhole([k11 / scale, k22 / scale, k13 / scale, k23 / scale], [0, 0]);
    let centre = -(matrix.inverse() * last);
    of_opencv(what, photo, rotation, -(rotation * centre), lens)
}

fn pinhole([fx, fy, cx, cy]: [f64; 4], [width, height]: [u32; 2]) -> Lens {
    Lens { width, height, fx, fy, cx, cy, k1: 0.0, k2: 0.0, p1: 0.0, p2: 0.0 }
}

/// The numbers of a text, row by row.
fn rows(what: &str, text: &str) -> Result<Vec<Vec<f64>>, Invalid> {
    let number = |line: usize, word: &str| {
        let fault = || Invalid(format!("{what}, line {line}: expected a number, found {}", quoted(word)));
        word.parse::<f64>().ok().filter(|number| number.is_finite()).ok_or_else(fault)
    };
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty() && !line.trim().starts_with('#'));
    lines.map(|(at, line)| line.split_whitespace().map(|word| number(at + 1, word)).collect()).collect()
}

/// Rows of three numbers.
fn triples(what: &str, rows: &[Vec<f64>]) -> Result<Vec<DVec3>, Invalid> {
    let triple = |row: &Vec<f64>| match row[..] {
        [x, y, z] => Ok(DVec3::new(x, y, z)),
        _ => Err(Invalid(format!("{what}: expected rows of 3 numbers, found one of {}", row.len()))),
    };
    rows.iter().map(triple).collect()
}

/// A file of FIPT: a count, then three rows of three numbers for each camera.
fn counted(what: &str, text: &str) -> Result<Vec<[DVec3; 3]>, Invalid> {
    let all = rows(what, text)?;
    let Some((&[count], rest)) = all
        .split_first()
        .map(|(first, rest)| (&first[..], rest))
        .and_then(|(first, rest)| <&[f64; 1]>::try_from(first).ok().map(|first| (first, rest)))
    else {
        return Err(Invalid(format!("{what}: expected the number of cameras in its first line")));
    };
    let triples = triples(what, rest)?;
    if count != (triples.len() / 3) as f64 || triples.len() % 3 != 0 || triples.len() / 3 > MOST_CAMERAS {
        return Err(Invalid(format!("{what}: expected 3 rows for each of {count} cameras, found {}", triples.len())));
    }
    Ok(triples.chunks_exact(3).map(|three| [three[0], three[1], three[2]]).collect())
}

/// FIPT's `cam.txt` (place, a point ahead, the direction up) and `K_list.txt` (3x3 matrices).
pub(super) fn of_fipt(poses: &str, matrices: &str) -> Result<Vec<CapturedCamera>, Invalid> {
    let (poses, matrices) = (counted("cam.txt", poses)?, counted("K_list.txt", matrices)?);
    if poses.len() != matrices.len() {
        let (a, b) = (poses.len(), matrices.len());
        return Err(Invalid(format!("cam.txt has {a} cameras, K_list.txt {b}")));
    }
    let camera = |(at, ([origin, ahead, up], matrix)): (usize, ([DVec3; 3], [DVec3; 3]))| {
        let what = format!("cam.txt, camera {at}");
        let (ahead, up) = ((ahead - origin).normalize_or_zero(), up.normalize_or_zero());
        if !(ahead.dot(up).abs() < MOST_TILT && ahead != DVec3::ZERO && up != DVec3::ZERO) {
            let expected = "expected a point ahead of the camera and a direction up that is perpendicular to it";
            return Err(Invalid(format!("{what}: {expected}")));
        }
        let up = (up - ahead * ahead.dot(up)).normalize();
        // The rows of the rotation are OpenCV's axes: right, down, ahead.
        let rotation = DMat3::from_cols(ahead.cross(up), -up, ahead).transpose();
        of_opencv(&what, PhotoName::Number(at), rotation, -(rotation * origin), lens(&what, matrix, [0, 0])?)
    };
    poses.into_iter().zip(matrices).enumerate().map(camera).collect()
}

/// The lens of a 3x3 matrix, by rows.
fn lens(what: &str, [a, b, c]: [DVec3; 3], size: [u32; 2]) -> Result<Lens, Invalid> {
    let is_upper = b.x == 0.0 && c == DVec3::Z && a.y.abs() <= MOST_SKEW * a.x.abs();
    match is_upper {
        true => Ok(pinhole([a.x, b.y, a.z, b.z], size)),
        false => Err(Invalid(format!("{what}: expected K = [fx 0 cx; 0 fy cy; 0 0 1], found {a}, {b}, {c}"))),
    }
}

/// The names of the files `camera_<n>.txt` and `gt_camera_<n>.txt` in a folder, in order.
pub(super) fn camera_files(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder).into_iter().flatten().flatten().take(MOST_CAMERAS);
    let names = names.filter_map(|entry| entry.file_name().into_string().ok());
    let mut files: Vec<String> = names.filter(|name| name.contains("camera_") && name.ends_with(".txt")).collect();
    files.sort();
    files
}

/// A camera of Objects With Lighting: K, R and t of `x = K (R X + t)` and, in an eighth row, the photo's size. Its photo
/// is `image_<n>` beside it.
pub(super) fn of_lighting(file: &str, text: &str) -> Result<CapturedCamera, Invalid> {
    let all = triples(file, &rows(file, text)?)?;
    let &[k1, k2, k3, r1, r2, r3, t, ref rest @ ..] = &all[..] else {
        return Err(Invalid(format!("{file}: expected 7 or 8 rows: K, R, t, and the size; found {}", all.len())));
    };
    let size = match rest {
        [] => [0, 0],
        [size]
            if size.x.fract() == 0.0
                && size.y.fract() == 0.0
                && (size.x.min(size.y) >= 1.0)
                && size.x.max(size.y) <= 65_536.0 =>
        {
            [size.x as u32, size.y as u32]
        }
        _ => return Err(Invalid(format!("{file}: expected width, height and channels in its last row"))),
    };
    let rotation = DMat3::from_cols(r1, r2, r3).transpose();
    let photo = file.replace("camera_", "image_").trim_end_matches(".txt").to_owned();
    of_opencv(file, PhotoName::File(photo), rotation, t, lens(file, [k1, k2, k3], size)?)
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use mateval_testkit::npy;

    use super::super::cameras::tests::{lens, pose};
    use super::*;

    /// Rotation and translation of the pose to OpenCV's axes.
    fn to_opencv() -> (DMat3, DVec3) {
        let (axes, position) = pose();
        let rotation = (axes * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0))).transpose();
        (rotation, -(rotation * position))
    }

    fn matrix() -> DMat3 {
        let Lens { fx, fy, cx, cy, .. } = lens();
        DMat3::from_cols(DVec3::X * fx, DVec3::Y * fy, DVec3::new(cx, cy, 1.0))
    }

    fn check(camera: &CapturedCamera, size: [u32; 2]) {
        let (axes, position) = pose();
        assert!(camera.rotation.abs_diff_eq(axes, 1e-10) && camera.position.abs_diff_eq(position, 1e-10));
        let found = camera.lens;
        assert_eq!([found.width, found.height], size);
        let numbers = [found.fx - lens().fx, found.fy - lens().fy, found.cx - lens().cx, found.cy - lens().cy];
        assert!(numbers.iter().all(|off| off.abs() < 1e-9), "{found:?}");
    }

    fn text(rows: &[DVec3]) -> String {
        rows.iter().map(|row| format!("{} {} {}\n", row.x, row.y, row.z)).collect()
    }

    fn rows_of(matrix: DMat3) -> [DVec3; 3] {
        [matrix.row(0), matrix.row(1), matrix.row(2)]
    }

    fn npz(name: &str, numbers: &[f64], shape: &[u64]) -> Vec<u8> {
        let mut file = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        file.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        file.write_all(&npy(numbers, shape)).unwrap();
        file.finish().unwrap().into_inner()
    }

    /// K [R | t], times a factor of either sign, which means the same projection.
    #[test]
    fn a_projection_is_taken_apart() {
        let (rotation, translation) = to_opencv();
        for factor in [1.0, -2.5] {
            let (m, t) = (matrix() * rotation * factor, matrix() * translation * factor);
            let mut numbers: Vec<f64> = (0..3).flat_map(|at| [m.row(at).x, m.row(at).y, m.row(at).z, t[at]]).collect();
            check(&of_npz(&npz("world_mat_4.npy", &numbers, &[3, 4])).unwrap()[0], [0, 0]);
            numbers.extend([0.0, 0.0, 0.0, 1.0]);
            check(&of_npz(&npz("world_mat_4.npy", &numbers, &[4, 4])).unwrap()[0], [0, 0]);
        }
        let refused = |bytes: &[u8], words: &str| {
            let found = of_npz(bytes).unwrap_err().0;
            assert!(found.contains(words), "{found}");
        };
        refused(b"PK", "not an .npz file");
        refused(&npz("scale_mat_0.npy", &[1.0; 16], &[4, 4]), "found 0");
        refused(&npz("world_mat_0.npy", &[1.0; 16], &[4, 4]), "determinant 0");
        refused(&npz("world_mat_0.npy", &[f64::NAN; 16], &[4, 4]), "determinant NaN");
        refused(&npz("world_mat_0.npy", &[1.0; 4], &[4]), "shape [4]");
    }

    #[test]
    fn fipt_states_a_place_a_point_ahead_and_up() {
        let (axes, position) = pose();
        let pose = [position, position - axes.z_axis * 2.0, axes.y_axis];
        let (poses, matrices) = (format!("1\n{}", text(&pose)), format!("1\n{}", text(&rows_of(matrix()))));
        check(&of_fipt(&poses, &matrices).unwrap()[0], [0, 0]);
        let refused = |poses: &str, matrices: &str, words: &str| {
            let found = of_fipt(poses, matrices).unwrap_err().0;
            assert!(found.contains(words), "{found}");
        };
        refused(&poses.replacen('1', "2", 1), &matrices, "each of 2 cameras, found 3");
        refused("", &matrices, "cam.txt: expected the number of cameras");
        refused(&poses, "0\n", "cam.txt has 1 cameras, K_list.txt 0");
        refused("1\n0 0 0\n0 0 1\n0 0 1\n", &matrices, "perpendicular");
        refused("1\n0 0 0\n0 0 x\n0 1 0\n", &matrices, "found 'x'");
        refused(&poses, "1\n1 0 0\n2 1 0\n0 0 1\n", "expected K");
    }

    #[test]
    fn objects_with_lighting_state_k_r_and_t() {
        let (rotation, translation) = to_opencv();
        let whole: Vec<DVec3> = rows_of(matrix()).into_iter().chain(rows_of(rotation)).chain([translation]).collect();
        check(&of_lighting("camera_0003.txt", &text(&whole)).unwrap(), [0, 0]);
        let sized: Vec<DVec3> = whole.iter().copied().chain([DVec3::new(64.0, 48.0, 3.0)]).collect();
        let camera = of_lighting("gt_camera_0003.txt", &text(&sized)).unwrap();
        check(&camera, [64, 48]);
        assert_eq!(camera.photo, PhotoName::File("gt_image_0003".to_owned()));
        assert!(of_lighting("camera_0.txt", &text(&whole[..5])).unwrap_err().0.contains("7 or 8 rows"));
    }
}
