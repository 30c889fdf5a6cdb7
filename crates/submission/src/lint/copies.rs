//! Maps that are copies of the ground truth.
//!
//! A copy is not a fault, as the baseline `gt` shows, but a ranking must not hide it.

use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{Texture, Wrap};
use mateval_scene::layout::SceneFolder;
use mateval_scene::submission::Map;
use mateval_scene::{Finding, InstanceId};

use super::finding::note;
use crate::map_file::MapFile;

/// The share of maps from which a scene counts as a copy.
const LEAST_SHARE: f64 = 0.5;

/// Of the maps with more than one value, how many there are and how many equal the truth's.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CopyCount {
    copies: usize,
    of: usize,
}

impl CopyCount {
    /// Counts an instance's maps; none where the ground truth is withheld.
    pub(super) fn of(folder: &SceneFolder, instance: &InstanceId, files: &[Option<MapFile>; 3]) -> Self {
        let mut count = Self::default();
        for (map, file) in Map::ALL.into_iter().zip(files) {
            let path = folder.truth_material(instance).join(map.stem()).with_extension("png");
            let Some(file) = file.as_ref().filter(|file| path.is_file() && !is_constant(&file.texture)) else {
                continue;
            };
            let encoding = if map == Map::BaseColor { Encoding::Srgb } else { Encoding::Linear };
            // Scoring reports a truth that cannot be read.
            let Ok(truth) = read_texture(&path, encoding, Wrap::Clamp) else { continue };
            count.of += 1;
            count.copies += usize::from(same(&file.texture, &truth));
        }
        count
    }
}

fn is_constant(texture: &Texture) -> bool {
    texture.clone().collapsed().width() == 1
}

fn same(map: &Texture, truth: &Texture) -> bool {
    let (width, height) = (truth.width(), truth.height());
    (map.width(), map.height()) == (width, height)
        && (0..width * height).all(|at| {
            let [a, b] = [map, truth].map(|texture| texture.texel(at % width, at / width));
            a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5)
        })
}

/// A note where most of a scene's maps are the truth's.
pub(super) fn copies(place: &str, instances: impl Iterator<Item = CopyCount>) -> Option<Finding> {
    let CopyCount { copies, of } = instances.fold(CopyCount::default(), |sum, count| CopyCount {
        copies: sum.copies + count.copies,
        of: sum.of + count.of,
    });
    (of > 0 && copies as f64 >= LEAST_SHARE * of as f64).then(|| {
        let message = format!("{copies} of {of} maps with more than one value are the truth's, texel by texel");
        note("copy_of_truth", place, message, "present it as an upper bound, not as a method")
    })
}
