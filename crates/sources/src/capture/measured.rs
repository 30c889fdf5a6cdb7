//! Colours that were measured on surfaces of a captured room: our own `measured.json`, and the tables of MAW (Measured
//! Albedo in the Wild).

use mateval_dataset::measured::{MEASUREMENTS_FORMAT, MeasurementsFile, color_fault};
use mateval_files::source_folder::SourceFolder;
use mateval_files::untrusted::quoted;
use mateval_image::npy_io;

use crate::open::{Invalid, SourceError};

/// The most measurements of a file, and the most rows of a table.
const MOST_MEASUREMENTS: usize = 10_000;
/// Columns of a row of MAW's tables: colours, mask, split, image, a picture of albedo, judgements.
const MAW_COLUMNS: usize = 6;
/// Linear Adobe RGB (1998) to XYZ, and XYZ to linear sRGB, as both standards round them; MAW applies them without a
/// chromatic adaptation, as both have D65.
const XYZ_FROM_ADOBE: [[f64; 3]; 3] =
    [[0.57667, 0.18556, 0.18823], [0.29734, 0.62736, 0.07529], [0.02703, 0.07069, 0.99134]];
const SRGB_FROM_XYZ: [[f64; 3]; 3] = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];

/// A region of a photo with its measured colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    pub name: String,
    /// The photo, with or without its ending.
    pub photo: String,
    /// The picture of regions, relative to the folder.
    pub mask: String,
    pub value: MaskValue,
    /// Linear Rec. 709 under D65, 0 to 1.
    pub color: [f64; 3],
    pub standard_error: Option<[f64; 3]>,
}

/// How a region is marked in its picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaskValue {
    Exactly(u16),
    /// The pixels have the number at this place among all numbers of the picture in their order. That at place 0 is the
    /// background.
    Place(usize),
}

/// Reads the measurements at `path` in the folder: a `.json` file of ours, or a table of MAW's with any other ending.
pub fn read(folder: &mut SourceFolder, path: &str) -> Result<Vec<Measurement>, SourceError> {
    let place = folder.root().join(path);
    let bytes = folder.read(path).map_err(|fault| Invalid(fault.message).in_file(&place))?;
    let found = match path.ends_with(".json") {
        true => of_json(path, &bytes),
        false => of_maw(folder, path, &bytes),
    };
    let found = found.and_then(|all| match all.len() {
        1..=MOST_MEASUREMENTS => Ok(all),
        count => Err(Invalid(format!("expected 1 to {MOST_MEASUREMENTS} measured regions, found {count}"))),
    });
    found.map_err(|fault| fault.in_file(&place))
}

fn of_json(path: &str, bytes: &[u8]) -> Result<Vec<Measurement>, Invalid> {
    let file: MeasurementsFile =
        serde_json::from_slice(bytes).map_err(|error| Invalid(format!("no file of measurements: {error}")))?;
    if file.format != MEASUREMENTS_FORMAT {
        return Err(Invalid(format!("/format: expected '{MEASUREMENTS_FORMAT}', found {}", quoted(&file.format))));
    }
    let parent = path.rsplit_once('/').map_or(String::new(), |(parent, _)| format!("{parent}/"));
    let mut faults = Vec::new();
    let mut all = Vec::new();
    for (at, area) in file.regions.into_iter().enumerate() {
        let fault = color_fault(&area.color, area.standard_error.as_ref());
        faults.extend(fault.map(|fault| format!("/regions/{at}: {fault}")));
        if area.value == 0 {
            faults.push(format!("/regions/{at}/value: 0 is no region"));
        }
        match SourceFolder::relative(&format!("{parent}{}", area.mask)) {
            Err(fault) => faults.push(format!("/regions/{at}/mask: {fault}")),
            Ok(mask) => all.push(Measurement {
                name: area.name,
                photo: area.photo,
                mask,
                value: MaskValue::Exactly(area.value),
                color: area.color,
                standard_error: area.standard_error,
            }),
        }
    }
    if faults.is_empty() { Ok(all) } else { Err(Invalid(faults.join("; "))) }
}

/// The regions of a table of MAW's: rows of six columns between tabs, which name a NumPy file of colours and a mask.
fn of_maw(folder: &mut SourceFolder, path: &str, bytes: &[u8]) -> Result<Vec<Measurement>, Invalid> {
    let text = std::str::from_utf8(bytes).map_err(|_| Invalid("expected MAW's table, found no text".to_owned()))?;
    let rows = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let mut all = Vec::new();
    for (at, line) in rows {
        let what = |why: String| Invalid(format!("line {}: {why}", at + 1));
        let columns: Vec<&str> = line.split('\t').collect();
        let &[colors, mask, _, image, ..] = columns.as_slice() else {
            return Err(what(format!("expected {MAW_COLUMNS} columns between tabs, found {}", columns.len())));
        };
        let [colors, mask] = [colors, mask].map(|name| found_from(folder, path, name));
        let (colors, mask) = (colors.map_err(|fault| what(fault.0))?, mask.map_err(|fault| what(fault.0))?);
        let bytes = folder.read(&colors).map_err(|fault| what(fault.message))?;
        let (shape, numbers) = npy_io::real_numbers(&bytes).map_err(|fault| what(format!("'{colors}': {fault}")))?;
        if !matches!(shape[..], [_, 3]) {
            return Err(what(format!("'{colors}': expected rows of 3 numbers, found the shape {shape:?}")));
        }
        for (row, adobe) in numbers.chunks_exact(3).enumerate() {
            let color = srgb_of_adobe([adobe[0], adobe[1], adobe[2]]);
            if let Some(fault) = color_fault(&color, None) {
                return Err(what(format!("'{colors}', row {row}: {fault}")));
            }
            let (name, photo) = (format!("{image} {}", row + 1), image.to_owned());
            let value = MaskValue::Place(row + 1);
            all.push(Measurement { name, photo, mask: mask.clone(), value, color, standard_error: None });
            if all.len() > MOST_MEASUREMENTS {
                return Err(what(format!("expected at most {MOST_MEASUREMENTS} measured regions")));
            }
        }
    }
    Ok(all)
}

/// The path of a file that the table at `path` names, from the table's folder or from one above it.
fn found_from(folder: &SourceFolder, path: &str, name: &str) -> Result<String, Invalid> {
    let name = SourceFolder::relative(name).map_err(|fault| Invalid(fault.message))?;
    let mut parent = path;
    while let Some((above, _)) = parent.rsplit_once('/') {
        let inside = format!("{above}/{name}");
        if folder.contains(&inside) {
            return Ok(inside);
        }
        parent = above;
    }
    Ok(name)
}

/// MAW's conversion: linear Adobe RGB to linear sRGB, clipped to 0..1.
fn srgb_of_adobe(adobe: [f64; 3]) -> [f64; 3] {
    let times = |matrix: [[f64; 3]; 3], v: [f64; 3]| matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
    // Clamping keeps NaN, which is refused afterwards.
    times(SRGB_FROM_XYZ, times(XYZ_FROM_ADOBE, adobe)).map(|value| value.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use mateval_testkit::npy;

    use super::*;

    fn folder_with(files: &[(&str, Vec<u8>)]) -> (tempfile::TempDir, SourceFolder) {
        let root = tempfile::tempdir().unwrap();
        for (file, bytes) in files {
            let path = root.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, bytes).unwrap();
        }
        let folder = SourceFolder::new(root.path(), 1 << 20).unwrap();
        (root, folder)
    }

    fn json(color: &str, more: &str) -> Vec<u8> {
        let region =
            format!("\"name\":\"wall\",\"photo\":\"1\",\"mask\":\"m.png\",\"value\":2,\"color\":{color}{more}");
        format!("{{\"format\":\"mateval-measurements/1\",\"regions\":[{{{region}}}]}}").into_bytes()
    }

    #[test]
    fn our_own_file_states_colours_and_their_errors() {
        let error = ",\"standard_error\":[0.01,0.01,0.02]";
        let (_root, mut folder) = folder_with(&[("a/measured.json", json("[0.5,0.25,1.0]", error))]);
        let found = read(&mut folder, "a/measured.json").unwrap();
        let expected = Measurement {
            name: "wall".to_owned(),
            photo: "1".to_owned(),
            mask: "a/m.png".to_owned(),
            value: MaskValue::Exactly(2),
            color: [0.5, 0.25, 1.0],
            standard_error: Some([0.01, 0.01, 0.02]),
        };
        assert_eq!(found, [expected]);
        let refused = |bytes: Vec<u8>, words: &str| {
            let (_root, mut folder) = folder_with(&[("m.json", bytes)]);
            let found = read(&mut folder, "m.json").unwrap_err().to_string();
            assert!(found.contains("m.json") && found.contains(words), "{found}");
        };
        refused(json("[0.5,0.25,1.5]", ""), "/regions/0: the colour is [0.5, 0.25, 1.5]");
        refused(json("[0.5,0.25,null]", ""), "no file of measurements");
        refused(json("[0.5,0.25,1]", ",\"standard_error\":[-1,0,0]"), "standard error is [-1.0");
        refused(b"{\"format\":\"mateval-measurements/1\",\"regions\":[]}".to_vec(), "found 0");
        refused(b"{\"format\":\"a\",\"regions\":[]}".to_vec(), "/format");
    }

    /// White is white in both spaces, to the rounding of the matrices; Adobe's green lies outside of sRGB. The third by
    /// hand: XYZ = (0.288335, 0.14867, 0.013515), and so sRGB 0.69909 (by the first row of the second matrix).
    #[test]
    fn maw_states_linear_adobe_rgb() {
        let numbers = [1.0, 1.0, 1.0, 0.0, 1.0, 0.0, 0.5, 0.0, 0.0];
        let table = b"masks/X.npy\tmasks/X_mask.png\tval\tIMG_1\tX_albedo.png\tNone\n\n".to_vec();
        let (_root, mut folder) = folder_with(&[("p/meta/t.csv", table), ("p/masks/X.npy", npy(&numbers, &[3, 3]))]);
        let found = read(&mut folder, "p/meta/t.csv").unwrap();
        assert_eq!(found.len(), 3);
        assert!(found[0].color.iter().all(|value| (value - 1.0).abs() < 2e-3), "{:?}", found[0].color);
        assert!(found[1].color[0] == 0.0 && found[1].color[1] > 0.99);
        assert!((found[2].color[0] - 0.699_09).abs() < 1e-4 && found[2].color[1..].iter().all(|v| *v < 1e-3));
        assert_eq!((found[1].value, found[1].photo.as_str()), (MaskValue::Place(2), "IMG_1"));
        let refused = |table: &[u8], numbers: Vec<u8>, words: &str| {
            let (_root, mut folder) = folder_with(&[("t.csv", table.to_vec()), ("X.npy", numbers)]);
            let found = read(&mut folder, "t.csv").unwrap_err().to_string();
            assert!(found.contains("line 1") && found.contains(words), "{found}");
        };
        refused(b"a,b,c\n", npy(&[1.0; 3], &[1, 3]), "between tabs, found 1");
        refused(b"X.npy\tm.png\tv\ti\n", npy(&[f64::NAN; 3], &[1, 3]), "the colour is [NaN");
        refused(b"X.npy\tm.png\tv\ti\n", npy(&[1.0; 4], &[1, 4]), "rows of 3 numbers");
        refused(b"../X.npy\tm.png\tv\ti\n", npy(&[1.0; 3], &[1, 3]), "leads out");
    }
}
