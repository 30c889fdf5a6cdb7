//! The pixels of one instance in one view.

use std::collections::BTreeMap;

use mateval_eval::shown_scene::SceneAlbedo;

/// A patch of fewer pixels gets neither a smooth factor nor a shift, which would fit chance: eight pixels for each
/// term of the factor.
pub(super) const FEWEST_PIXELS: usize = 48;

/// The valid pixels of one instance in one view, with their bounding box.
pub(super) struct Patch {
    /// Number of the view.
    pub(super) view: usize,
    /// Column and row of the box's top left pixel in the picture.
    pub(super) corner: [usize; 2],
    /// Columns and rows of the box.
    pub(super) size: [usize; 2],
    /// The pixel at each position of the box, row by row.
    index: Vec<Option<u32>>,
    /// Column and row in the picture, row by row.
    pub(super) places: Vec<[usize; 2]>,
    /// Linear RGB of the truth at each place.
    pub(super) truth: Vec<[f64; 3]>,
    /// Linear RGB of the prediction at each place.
    pub(super) predicted: Vec<[f64; 3]>,
    /// Whether the photo shows the surface at each place.
    pub(super) observed: Vec<bool>,
}

/// The patches of every instance that has any, by its index, in the order of views. Pixels that show no instance are
/// left out.
pub(super) fn patches(views: &[SceneAlbedo]) -> BTreeMap<u16, Vec<Patch>> {
    let mut all: BTreeMap<u16, Vec<Patch>> = BTreeMap::new();
    for (number, view) in views.iter().enumerate() {
        let width = view.truth.valid.width();
        let mut places: BTreeMap<u16, Vec<[usize; 2]>> = BTreeMap::new();
        for (at, instance) in view.truth.instances.pixels().iter().enumerate() {
            if *instance != 0 && view.truth.valid.pixels()[at] {
                places.entry(*instance).or_default().push([at % width, at / width]);
            }
        }
        for (instance, places) in places {
            let values = |picture: &mateval_image::Picture<mateval_image::LinearRgb>| {
                places.iter().map(|&[x, y]| picture.get(x, y).0.map(f64::from)).collect()
            };
            let (truth, predicted) = (values(&view.truth.albedo), values(&view.predicted[0]));
            let unobserved = view.truth.unobserved.as_ref();
            let observed = places.iter().map(|&[x, y]| unobserved.is_none_or(|mask| !mask.get(x, y))).collect();
            all.entry(instance).or_default().push(Patch::new(number, places, truth, predicted, observed));
        }
    }
    all
}

impl Patch {
    /// `places` holds at least one position, each once. `truth`, `predicted` and `observed` hold a value for each.
    pub(super) fn new(
        view: usize,
        places: Vec<[usize; 2]>,
        truth: Vec<[f64; 3]>,
        predicted: Vec<[f64; 3]>,
        observed: Vec<bool>,
    ) -> Self {
        let least = |axis: usize| places.iter().map(|place| place[axis]).min().unwrap_or(0);
        let most = |axis: usize| places.iter().map(|place| place[axis]).max().unwrap_or(0);
        let corner = [0, 1].map(least);
        let size = [0, 1].map(|axis| most(axis) - corner[axis] + 1);
        let mut index = vec![None; size[0] * size[1]];
        for (at, [x, y]) in places.iter().enumerate() {
            index[(y - corner[1]) * size[0] + x - corner[0]] = Some(at as u32);
        }
        Self { view, corner, size, index, places, truth, predicted, observed }
    }

    /// The pixels whose surface the photo shows; none if it shows no such pixel.
    pub(super) fn observed_part(&self) -> Option<Self> {
        fn kept<T: Copy>(values: &[T], observed: &[bool]) -> Vec<T> {
            values.iter().zip(observed).filter(|(_, observed)| **observed).map(|(value, _)| *value).collect()
        }
        let places = kept(&self.places, &self.observed);
        let [truth, predicted] = [&self.truth, &self.predicted].map(|values| kept(values, &self.observed));
        let all = vec![true; places.len()];
        (!places.is_empty()).then(|| Self::new(self.view, places, truth, predicted, all))
    }

    /// The pixel at a position of the box; none if it does not belong to the instance.
    pub(super) fn at(&self, x: isize, y: isize) -> Option<usize> {
        let inside = |v: isize, axis: usize| usize::try_from(v).ok().filter(|v| *v < self.size[axis]);
        let (x, y) = (inside(x, 0)?, inside(y, 1)?);
        self.index[y * self.size[0] + x].map(|at| at as usize)
    }

    /// Column and row in the box.
    pub(super) fn in_box(&self, pixel: usize) -> [isize; 2] {
        let place = self.places[pixel];
        [0, 1].map(|axis| (place[axis] - self.corner[axis]) as isize)
    }
}
