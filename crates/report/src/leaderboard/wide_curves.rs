//! Curves of scores in wide views against how wide they are.
//!
//! In: the pictures' values of each method. Out: a chart for each kind of picture and metric, with a line for each method, whose
//! points are means over all views of one class.

use std::collections::BTreeMap;

use mateval_eval::metric::Metric;
use mateval_eval::result::PictureValues;
use mateval_eval::result_key::{PictureName, Region, Surfaces};
use mateval_scene::dataset::WideView;
use mateval_scene::layout::INPUT;
use mateval_scene::{SceneId, ViewId};

use super::chart::{Chart, Values};

/// What a method scored.
pub(super) struct Method<'a> {
    pub(super) name: &'a str,
    pub(super) pictures: &'a [PictureValues],
    pub(super) wide_views: &'a BTreeMap<SceneId, BTreeMap<ViewId, WideView>>,
}

/// By what views are sorted into classes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    /// Centimetres from the input camera; the input view is at 0.
    Distance,
    /// Fifths of the valid pixels that the input view does not show.
    UnseenShare,
}

/// Number of classes of shares.
const SHARES: u32 = 5;

/// Whether curves show the values of a picture, if its scene has wide views.
pub(super) fn is_shown(picture: &PictureValues) -> bool {
    let is_of_a_class = picture.view.is_wide() || picture.view.as_str() == INPUT;
    is_of_a_class && picture.region == Region::Valid && picture.picture.surfaces == Surfaces::All
}

/// The charts of every kind of picture and metric that wide views have values of.
pub(super) fn charts(methods: &[Method<'_>], axis: Axis) -> Vec<Chart> {
    let mut kinds: Vec<(PictureName, Metric)> = Vec::new();
    let pictures = methods.iter().flat_map(|method| method.pictures);
    for picture in pictures.filter(|picture| picture.view.is_wide() && is_shown(picture)) {
        for metric in picture.values.keys() {
            let kind = (picture.picture, *metric);
            if !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
    }
    kinds.into_iter().filter_map(|kind| chart(methods, axis, kind)).collect()
}

fn chart(methods: &[Method<'_>], axis: Axis, (picture, metric): (PictureName, Metric)) -> Option<Chart> {
    let means: Vec<Values<'_>> =
        methods.iter().map(|method| (method.name, means(method, axis, picture, metric))).collect();
    let title = format!("{}, {}", picture.kind.title(), metric.style().title);
    Chart::new(title, |class| class_title(axis, class), &means, |value| metric.style().text(value))
}

/// The mean of a method's values in each class.
fn means(method: &Method<'_>, axis: Axis, picture: PictureName, metric: Metric) -> BTreeMap<u32, f64> {
    let mut sums: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
    for of_view in method.pictures.iter().filter(|values| values.picture == picture && is_shown(values)) {
        let (Some(class), Some(number)) = (class_of(method, axis, of_view), of_view.values.get(&metric)) else {
            continue;
        };
        let (sum, count) = sums.entry(class).or_default();
        *sum += number;
        *count += 1.0;
    }
    sums.into_iter().map(|(class, (sum, count))| (class, sum / count)).collect()
}

fn class_of(method: &Method<'_>, axis: Axis, picture: &PictureValues) -> Option<u32> {
    let wide = method.wide_views.get(&picture.scene)?;
    match (axis, wide.get(&picture.view)) {
        (Axis::Distance, Some(view)) => Some((100.0 * view.distance_m).round() as u32),
        (Axis::Distance, None) => (picture.view.as_str() == INPUT).then_some(0),
        (Axis::UnseenShare, Some(view)) => {
            Some(((f64::from(SHARES) * view.unseen_share).floor() as u32).min(SHARES - 1))
        }
        (Axis::UnseenShare, None) => None,
    }
}

fn class_title(axis: Axis, class: u32) -> String {
    match axis {
        Axis::Distance => format!("{:.2} m", f64::from(class) / 100.0),
        Axis::UnseenShare => format!("{} to {} %", 100 * class / SHARES, 100 * (class + 1) / SHARES),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mateval_eval::result_key::PictureKind;

    fn value(view: &str, number: f64) -> PictureValues {
        PictureValues {
            scene: SceneId::new("a").unwrap(),
            view: ViewId::new(view).unwrap(),
            picture: PictureName::whole(PictureKind::Albedo),
            lighting: None,
            region: Region::Valid,
            pixels: 1,
            values: BTreeMap::from([(Metric::Psnr, number)]),
            mse_error: None,
            exact: false,
            lower_bound: false,
        }
    }

    fn wide(distance_m: f64, unseen_share: f64) -> WideView {
        WideView { distance_m, unseen_share }
    }

    #[test]
    fn values_are_sorted_into_classes() {
        let pictures = [
            value("input", 40.0),
            value("up_left", 35.0),
            value("wide_1", 30.0),
            value("wide_2", 20.0),
            value("wide_3", 10.0),
        ];
        let views = [("wide_1", wide(0.3, 0.1)), ("wide_2", wide(0.3, 0.19)), ("wide_3", wide(1.0, 1.0))];
        let views = views.map(|(id, view)| (ViewId::new(id).unwrap(), view));
        let wide_views = BTreeMap::from([(SceneId::new("a").unwrap(), BTreeMap::from(views))]);
        let methods = [Method { name: "m", pictures: &pictures, wide_views: &wide_views }];
        let cells = |axis| {
            let charts = charts(&methods, axis);
            assert_eq!(charts.len(), 1);
            let cells: Vec<String> = charts[0].lines[0].cells.iter().flatten().cloned().collect();
            (charts[0].classes.clone(), cells)
        };
        let titles = |titles: &[&str]| titles.iter().map(|title| (*title).to_owned()).collect::<Vec<_>>();
        assert_eq!(
            cells(Axis::Distance),
            (titles(&["0.00 m", "0.30 m", "1.00 m"]), titles(&["40.00", "25.00", "10.00"]))
        );
        assert_eq!(cells(Axis::UnseenShare), (titles(&["0 to 20 %", "80 to 100 %"]), titles(&["25.00", "10.00"])));
    }
}
