//! The bounds of a score: `gt`, the ceiling, is the ground truth baked to the atlases; `grey`, the floor, is one colour
//! for every surface.

use std::path::Path;

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::open::Dataset;
use mateval_dataset::submission::{GREY as GREY_VALUE, MAP_SIZES, Map};
use mateval_files::FileError;
use mateval_image::Picture;
use mateval_image::png_io::write_rgb_bytes;

use crate::error::BaselineError;
use crate::maps::srgb_bytes;
use crate::submission::{Baseline, Method, write};

pub const TRUTH: Baseline = Baseline {
    name: "gt",
    about: "Ceiling: the true materials, baked to the dataset's own atlases",
    write: write_truth,
};

pub const GREY: Baseline =
    Baseline { name: "grey", about: "Floor: base colour 0.5 (linear) everywhere", write: write_grey };

/// Copies the baked maps of every instance and returns the number of instances.
pub fn write_truth(dataset: &Dataset, out: &Path, force: bool) -> Result<usize, BaselineError> {
    dataset.scenes.iter().try_for_each(SceneFile::check_materials_known)?;
    // A public tree is refused before anything is written.
    for scene in dataset.scenes.iter().filter(|scene| !dataset.folder(&scene.id).truth().exists()) {
        dataset.check_files(&scene.id, |path| path.starts_with("ground_truth/materials/"))?;
    }
    let method =
        Method { is_oracle: true, ..Method::new("gt", "the true materials baked to the dataset's own atlases") };
    write(dataset, out, force, &method, |scene, instance, folder| {
        let truth = dataset.folder(&scene.id).truth_material(&instance.id);
        for map in Map::ALL {
            let name = Path::new(map.stem()).with_extension("png");
            let (from, to) = (truth.join(&name), folder.join(&name));
            std::fs::copy(&from, &to).map_err(FileError::io("copy", &from))?;
        }
        Ok(())
    })
}

/// Writes base colour 0.5 (linear) for every instance and returns their number. Roughness and metallic have no files,
/// so that the format's defaults hold.
pub fn write_grey(dataset: &Dataset, out: &Path, force: bool) -> Result<usize, BaselineError> {
    let (side, texel) = (*MAP_SIZES.start(), srgb_bytes([GREY_VALUE; 3]));
    let method = Method::new("grey", "base colour 0.5 (linear) everywhere, roughness 0.5, metallic 0");
    write(dataset, out, force, &method, |_, _, folder| {
        let path = folder.join(Map::BaseColor.stem()).with_extension("png");
        Ok(write_rgb_bytes(&path, &Picture::filled(side, side, texel))?)
    })
}
