//! Compares the pictures without light: base colours, ids, depths, normals.

use std::collections::BTreeMap;

use mateval_dataset::dataset::View;
use mateval_dataset::layout::SceneFolder;
use mateval_image::{ImageError, LinearRgb, Mask, Normal, Picture, exr_io, png_io};
use mateval_metrics::{Psnr, mse};
use mateval_tracer::World;

use super::file::{BOUNDS, Check, Quantity, State};
use super::pictures::TheirView;
use super::tiles::median;
use crate::views::base_color_at_centres;

/// The dataset's own pictures of a view.
pub(super) struct OurGeometry {
    pub(super) base_color: Picture<LinearRgb>,
    pub(super) instance: Picture<u16>,
    pub(super) part: Picture<u16>,
    pub(super) depth: Picture<f32>,
    pub(super) normal: Picture<Normal>,
    pub(super) valid: Mask,
}

/// Blender's pictures of a view; absent if a picture could not be read.
#[derive(Default)]
pub(super) struct TheirGeometry {
    pub(super) base_color: Option<Picture<LinearRgb>>,
    pub(super) instance: Option<Picture<u16>>,
    pub(super) part: Option<Picture<u16>>,
    pub(super) depth: Option<Picture<f32>>,
    pub(super) normal: Option<Picture<Normal>>,
}

impl OurGeometry {
    /// Reads the view's pictures. Base colours are looked up again, since Blender's are those at pixel centres.
    pub(super) fn read(folder: &SceneFolder, view: &View, world: &World) -> Result<Self, ImageError> {
        let shown = folder.view(&view.id);
        Ok(Self {
            base_color: base_color_at_centres(world, &view.camera),
            instance: png_io::read_ids(&shown.join("instance.png"))?,
            part: png_io::read_ids(&shown.join("part.png"))?,
            depth: exr_io::read_scalar(&shown.join("depth.exr"))?,
            normal: exr_io::read_normal(&shown.join("normal.exr"))?,
            valid: png_io::read_mask(&shown.join("valid.png"))?,
        })
    }

    /// Whether all pictures have this width and height.
    pub(super) fn has_size(&self, (width, height): (usize, usize)) -> bool {
        let sizes = [
            (self.base_color.width(), self.base_color.height()),
            (self.instance.width(), self.instance.height()),
            (self.part.width(), self.part.height()),
            (self.depth.width(), self.depth.height()),
            (self.normal.width(), self.normal.height()),
            (self.valid.width(), self.valid.height()),
        ];
        sizes.iter().all(|size| *size == (width, height))
    }
}

impl TheirGeometry {
    /// Reads the pictures; adds a check for each one that could not be read.
    pub(super) fn read(view: &TheirView, checks: &mut Vec<Check>) -> Self {
        Self {
            base_color: view.linear("base_color", "base_color.exr").map_err(|check| checks.push(check)).ok(),
            instance: view.read("instance", "instance.png", png_io::read_ids).map_err(|c| checks.push(c)).ok(),
            part: view.read("part", "part.png", png_io::read_ids).map_err(|check| checks.push(check)).ok(),
            depth: view.read("depth", "depth.exr", exr_io::read_scalar).map_err(|check| checks.push(check)).ok(),
            normal: view.read("normal", "normal.exr", exr_io::read_normal).map_err(|check| checks.push(check)).ok(),
        }
    }
}

/// A check of each picture that Blender made. All pictures must have the same size.
pub(super) fn compare(ours: &OurGeometry, theirs: &TheirGeometry) -> Vec<Check> {
    // At silhouettes the two renderers may see different surfaces, which the ids report.
    let inner = away_from_edges(&ours.instance);
    let (width, height) = (ours.valid.width(), ours.valid.height());
    // Not the parts: two sheets of one instance in one plane are seen as one part or the other, and that is a fault.
    let is_same =
        |at: usize| theirs.instance.as_ref().is_none_or(|theirs| theirs.pixels()[at] == ours.instance.pixels()[at]);
    let compared = Mask::from_fn(width, height, |x, y| {
        let at = y * width + x;
        ours.valid.get(x, y) && inner[at] && is_same(at)
    });
    let checks = [
        theirs.base_color.as_ref().map(|theirs| base_color(&ours.base_color, theirs, &compared)),
        theirs.instance.as_ref().map(|theirs| ids("instance", &ours.instance, theirs)),
        theirs.instance.as_ref().map(|theirs| silhouettes(&ours.instance, theirs, &inner)),
        theirs.part.as_ref().map(|theirs| ids("part", &ours.part, theirs)),
        theirs.depth.as_ref().map(|depth| depths(ours, depth, theirs.instance.as_ref())),
        theirs.normal.as_ref().map(|normal| normals(ours, normal, theirs.instance.as_ref())),
    ];
    checks.into_iter().flatten().collect()
}

fn base_color(ours: &Picture<LinearRgb>, theirs: &Picture<LinearRgb>, valid: &Mask) -> Check {
    let count = valid.pixels().iter().filter(|valid| **valid).count();
    // This cannot fail: sizes were compared, and the files were read, so that all numbers are finite.
    let error = mse(theirs, ours, Some(valid)).ok().flatten();
    let psnr = error.and_then(|mse| Psnr::from_mse(mse).ok()).map(|psnr| psnr.db);
    let message = psnr.map_or("no valid pixel of equal ids lies away from edges".to_owned(), |db| {
        format!("PSNR {db:.1} dB over valid pixels of equal ids, expected at least {} dB", BOUNDS.base_color_psnr_db)
    });
    let agrees = psnr.map(|db| db >= BOUNDS.base_color_psnr_db);
    check("base_color", Quantity::PsnrDb, agrees, (psnr, BOUNDS.base_color_psnr_db), count, message)
}

fn ids(picture: &str, ours: &Picture<u16>, theirs: &Picture<u16>) -> Check {
    let inner = away_from_edges(ours);
    let pairs = || ours.pixels().iter().zip(theirs.pixels()).zip(&inner).filter(|(_, inner)| **inner);
    let count = pairs().count();
    let equal = pairs().filter(|((ours, theirs), _)| ours == theirs).count();
    let share = (count > 0).then(|| equal as f64 / count as f64);
    let message = share.map_or("every pixel is at an edge".to_owned(), |share| {
        format!(
            "{:.2} % of {count} ids away from edges are equal, expected at least {} %",
            100.0 * share,
            100.0 * BOUNDS.equal_id_share
        )
    });
    let agrees = share.map(|share| share >= BOUNDS.equal_id_share);
    check(picture, Quantity::EqualShare, agrees, (share, BOUNDS.equal_id_share), count, message)
}

/// Instances whose edges have fewer pixels are compared together, and not at all where that is still fewer: a few pixels
/// that rounding decides are a large share of them.
const LEAST_EDGE: usize = 64;

/// The edges of each instance, and the one whose ids are equal in the smallest share of its pixels.
fn silhouettes(ours: &Picture<u16>, theirs: &Picture<u16>, inner: &[bool]) -> Check {
    // By instance, the number of pixels at its edge and of those with equal ids.
    let mut edges: BTreeMap<u16, [usize; 2]> = BTreeMap::new();
    let pairs = ours.pixels().iter().zip(theirs.pixels()).zip(inner);
    for ((ours, theirs), _) in pairs.filter(|((ours, _), inner)| **ours > 0 && !**inner) {
        let [all, equal] = edges.entry(*ours).or_default();
        *all += 1;
        *equal += usize::from(ours == theirs);
    }
    let count = edges.values().map(|[all, _]| all).sum();
    let (long, short): (Vec<_>, Vec<_>) = edges.into_iter().partition(|(_, [all, _])| *all >= LEAST_EDGE);
    let together = short.iter().fold([0; 2], |sum, (_, edge)| [sum[0] + edge[0], sum[1] + edge[1]]);
    let long = long.into_iter().map(|(id, edge)| (format!("instance {id}"), edge));
    let short = (together[0] >= LEAST_EDGE).then(|| ("all instances of short edges".to_owned(), together));
    let shares = long.chain(short).map(|(name, [all, equal])| (equal as f64 / all as f64, name, all));
    let worst = shares.min_by(|a, b| a.0.total_cmp(&b.0));
    let none = || format!("the edges of all instances have fewer than {LEAST_EDGE} pixels");
    let message = worst.as_ref().map_or_else(none, |(share, name, all)| {
        format!(
            "{:.2} % of {all} ids at the edge of {name} are equal, the least of all instances; expected at least {} %",
            100.0 * share,
            100.0 * BOUNDS.silhouette_share
        )
    });
    let share = worst.map(|(share, ..)| share);
    let agrees = share.map(|share| share >= BOUNDS.silhouette_share);
    check("silhouette", Quantity::EqualShare, agrees, (share, BOUNDS.silhouette_share), count, message)
}

fn depths(ours: &OurGeometry, theirs: &Picture<f32>, instance: Option<&Picture<u16>>) -> Check {
    let off = |at: usize| f64::from((ours.depth.pixels()[at] - theirs.pixels()[at]).abs());
    let common = common(ours, instance);
    let off = median(common.iter().map(|at| off(*at)).collect());
    let message = off.map_or("no pixel shows the same instance".to_owned(), |off| {
        format!("median difference {:.3} mm, expected at most {} mm", 1e3 * off, 1e3 * BOUNDS.depth_median_m)
    });
    let agrees = off.map(|off| off <= BOUNDS.depth_median_m);
    check("depth", Quantity::MedianM, agrees, (off, BOUNDS.depth_median_m), common.len(), message)
}

fn normals(ours: &OurGeometry, theirs: &Picture<Normal>, instance: Option<&Picture<u16>>) -> Check {
    let common = common(ours, instance);
    let angles = common.iter().map(|at| angle_deg(ours.normal.pixels()[*at], theirs.pixels()[*at]));
    let off = median(angles.collect());
    let message = off.map_or("no pixel shows the same instance".to_owned(), |off| {
        format!("median angle {off:.2} degrees, expected at most {}", BOUNDS.normal_median_deg)
    });
    let agrees = off.map(|off| off <= BOUNDS.normal_median_deg);
    check("normal", Quantity::MedianDeg, agrees, (off, BOUNDS.normal_median_deg), common.len(), message)
}

/// The angle between two normals of any length, in degrees; 180 where one of them is zero.
pub(super) fn angle_deg(a: Normal, b: Normal) -> f64 {
    let [a, b] = [a, b].map(|Normal(v)| glam::DVec3::from(v.map(f64::from)));
    if a.length_squared() * b.length_squared() == 0.0 {
        return 180.0;
    }
    // The arc tangent, since the arc cosine is inaccurate for small angles.
    libm::atan2(a.cross(b).length(), a.dot(b)).to_degrees()
}

/// Pixels in which both renderers show the same instance; where Blender's ids are missing, all pixels in which the
/// dataset shows one.
fn common(ours: &OurGeometry, theirs: Option<&Picture<u16>>) -> Vec<usize> {
    let same = |at: usize, id: u16| theirs.is_none_or(|theirs| theirs.pixels()[at] == id);
    let ids = ours.instance.pixels().iter().enumerate();
    ids.filter(|(at, id)| **id > 0 && same(*at, **id)).map(|(at, _)| at).collect()
}

/// For each pixel, whether all of its neighbours (up to eight) have the same id.
pub(super) fn away_from_edges(ids: &Picture<u16>) -> Vec<bool> {
    let (width, height) = (ids.width(), ids.height());
    let around = |at: usize, length: usize| at.saturating_sub(1)..(at + 2).min(length);
    let inner =
        |x: usize, y: usize| around(y, height).all(|v| around(x, width).all(|u| ids.get(u, v) == ids.get(x, y)));
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| inner(x, y)).collect()
}

fn check(
    picture: &str,
    quantity: Quantity,
    agrees: Option<bool>,
    (measured, bound): (Option<f64>, f64),
    count: usize,
    message: String,
) -> Check {
    let state = match agrees {
        Some(true) => State::Agrees,
        Some(false) => State::Differs,
        None => State::Undecided,
    };
    let picture = picture.to_owned();
    Check { picture, quantity, state, measured, bound: Some(bound), count, to_decide: None, message }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: usize = 64;

    /// A room of 64x64 pixels whose wall is instance 1; instance 2, a cabinet, stands before it from this column on.
    fn room(cabinet: usize) -> OurGeometry {
        let instance = Picture::from_fn(SIZE, SIZE, |x, y| {
            if (cabinet..cabinet + 30).contains(&x) && (10..50).contains(&y) { 2 } else { 1 }
        });
        let base_color = instance.map(|id| LinearRgb([if id == 2 { 0.1 } else { 0.8 }; 3]));
        OurGeometry {
            base_color,
            part: instance.clone(),
            depth: Picture::filled(SIZE, SIZE, 2.0),
            normal: Picture::filled(SIZE, SIZE, Normal([0.0, 0.0, 1.0])),
            valid: Picture::filled(SIZE, SIZE, true),
            instance,
        }
    }

    fn theirs(room: &OurGeometry) -> TheirGeometry {
        TheirGeometry {
            base_color: Some(room.base_color.clone()),
            instance: Some(room.instance.clone()),
            part: Some(room.part.clone()),
            depth: Some(room.depth.clone()),
            normal: Some(room.normal.clone()),
        }
    }

    fn differing(ours: &OurGeometry, theirs: &TheirGeometry) -> Vec<String> {
        let checks = compare(ours, theirs);
        assert_eq!(checks.len(), 6);
        checks.into_iter().filter(|check| check.state != State::Agrees).map(|check| check.picture).collect()
    }

    /// Two pixels of thousands show a lamp's wire that our picture misses: their base colours are not compared, and so
    /// few ids matter nowhere. The twins: the same colours with the wall's ids are found as colours, and a cabinet that
    /// is a pixel aside by its silhouette alone.
    #[test]
    fn silhouettes_are_a_check_of_their_own() {
        let ours = room(12);
        assert_eq!(differing(&ours, &theirs(&ours)), [""; 0]);
        let with_wire = |id: u16| {
            let mut seen = theirs(&ours);
            for y in [5, 6] {
                seen.base_color.as_mut().unwrap().set(60, y, LinearRgb([9.0; 3]));
                seen.instance.as_mut().unwrap().set(60, y, id);
                seen.part.as_mut().unwrap().set(60, y, id);
            }
            seen
        };
        assert_eq!(differing(&ours, &with_wire(3)), [""; 0]);
        assert_eq!(differing(&ours, &with_wire(1)), ["base_color"]);
        assert_eq!(differing(&ours, &theirs(&room(13))), ["silhouette"]);
    }

    #[test]
    fn angles() {
        let angle = |a, b| angle_deg(Normal(a), Normal(b));
        assert!((angle([1.0, 0.0, 0.0], [1.0, 1.0, 0.0]) - 45.0).abs() < 1e-9);
        assert_eq!(angle([1.0, 0.0, 0.0], [0.0; 3]), 180.0);
    }
}
