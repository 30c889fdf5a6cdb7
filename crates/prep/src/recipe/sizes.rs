//! Checks the sizes of pictures and atlases, which both a recipe and its scenes may state.

use super::fault::RecipeFault;
use super::limits::{ATLAS_SIZES, RESOLUTION};

/// Adds a [`RecipeFault`] for each size that is out of range. `owner` is the recipe or the scene, as messages name it.
pub(super) fn check_sizes(
    owner: &str,
    resolution: Option<[u32; 2]>,
    atlas_size: Option<u32>,
    faults: &mut Vec<RecipeFault>,
) {
    let owner = || owner.to_owned();
    if let Some(found) = resolution.filter(|sides| !sides.iter().all(|side| RESOLUTION.contains(side))) {
        faults.push(RecipeFault::Resolution { owner: owner(), found });
    }
    if let Some(found) = atlas_size.filter(|size| !ATLAS_SIZES.contains(size)) {
        faults.push(RecipeFault::AtlasSize { owner: owner(), found });
    }
}
