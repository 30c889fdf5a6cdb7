//! The tables and their columns, and the numbers that cells can hold.

use mateval_eval::metric::PictureKind::{
    Albedo, AlbedoAligned, Metallic, RgbFitted, RgbRelit, RgbTrue, Roughness, TextureBaseColor,
};
use mateval_eval::metric::{Better, Metric, NumberStyle, PictureKind};
use mateval_eval::result::key::Views::{Input, Novel, Observed, Unobserved, Wide, WideUnobserved};
use mateval_eval::result::key::{PictureName, ResultKey, Surfaces, Views};
use mateval_eval::result::{Constancy, Deviation};

/// How the rows of a table are grouped; every group has one row for each method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grouping {
    /// One group for the whole dataset: means over scenes.
    Dataset,
    /// One group for each scene: means over its pictures.
    Scene,
    /// One group for each category of instances: errors pooled over pixels.
    Category,
    /// One group for each broader category, in the same way.
    SuperCategory,
}

/// The quantity that a column of numbers holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Quantity {
    /// The number of compared pixels.
    Pixels,
    Score(Metric),
    Constancy(ConstancyNumber),
}

/// A mean over families of scenes and their twins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum ConstancyNumber {
    /// The deviation relative to the answer's own contrast.
    Relative,
    Linear,
    DeltaE,
    /// Of the family's mean.
    MeanPsnr,
    MeanDeltaE,
}

impl ConstancyNumber {
    const DEVIATIONS: [Self; 3] = [Self::Relative, Self::Linear, Self::DeltaE];
    const ACCURACY: [Self; 2] = [Self::MeanPsnr, Self::MeanDeltaE];

    fn style(self) -> NumberStyle {
        match self {
            Self::Relative => NumberStyle { title: "Relative", scale: 1.0, digits: 3 },
            Self::Linear => NumberStyle { title: "RMS 1e-3", scale: 1e3, digits: 1 },
            Self::DeltaE | Self::MeanDeltaE => Metric::DeltaE.style(),
            Self::MeanPsnr => Metric::Psnr.style(),
        }
    }
}

/// The means of a submission over its families.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ConstancyMeans {
    /// Root mean square of linear deviations: raw, then aligned.
    pub(crate) linear: [f64; 2],
    /// Root mean square in CIEDE2000: raw, then aligned.
    pub(crate) delta_e: [f64; 2],
    /// Raw, then aligned; the mean over the families that have a value.
    pub(crate) relative: [Option<f64>; 2],
    /// PSNR in dB of the families' means: the mean over families.
    pub(crate) mean_psnr: f64,
    pub(crate) mean_delta_e: f64,
}

impl ConstancyMeans {
    /// Absent where there is no family.
    pub(crate) fn of(families: &[Constancy]) -> Option<Self> {
        let count = families.len();
        let mean = |value: &dyn Fn(&Constancy) -> f64| families.iter().map(value).sum::<f64>() / count as f64;
        let both = |value: fn(&Deviation) -> f64| [mean(&|f| value(&f.raw)), mean(&|f| value(&f.aligned))];
        let relative = [|f: &Constancy| f.raw.relative, |f: &Constancy| f.aligned.relative].map(|of| {
            let known: Vec<f64> = families.iter().filter_map(of).collect();
            (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
        });
        let psnr = |f: &Constancy| mateval_metrics::Psnr::from_mse(f.mean_mse).map_or(0.0, |psnr| psnr.db);
        (count > 0).then(|| Self {
            linear: both(|deviation| deviation.linear),
            delta_e: both(|deviation| deviation.delta_e),
            relative,
            mean_psnr: mean(&psnr),
            mean_delta_e: mean(&|family| family.mean_delta_e),
        })
    }
}

/// The columns of constancy: title, whether answers are aligned, and numbers.
const CONSTANCY: [(&str, PictureKind, &[ConstancyNumber]); 3] = [
    ("Deviation", TextureBaseColor, &ConstancyNumber::DEVIATIONS),
    ("Aligned deviation", AlbedoAligned, &ConstancyNumber::DEVIATIONS),
    ("Mean answer", TextureBaseColor, &ConstancyNumber::ACCURACY),
];

/// The numbers of constancy, as the cells of [`constancy`] name them.
pub(super) fn constancy_values(families: &[Constancy]) -> Vec<(CellKey, f64)> {
    let Some(means) = ConstancyMeans::of(families) else { return Vec::new() };
    let cell = |kind, number| CellKey {
        picture: PictureName::whole(kind),
        views: Observed,
        quantity: Quantity::Constancy(number),
    };
    let mut values = Vec::new();
    for (at, kind) in [TextureBaseColor, AlbedoAligned].into_iter().enumerate() {
        values.extend(means.relative[at].map(|value| (cell(kind, ConstancyNumber::Relative), value)));
        values.push((cell(kind, ConstancyNumber::Linear), means.linear[at]));
        values.push((cell(kind, ConstancyNumber::DeltaE), means.delta_e[at]));
    }
    values.push((cell(TextureBaseColor, ConstancyNumber::MeanPsnr), means.mean_psnr));
    values.push((cell(TextureBaseColor, ConstancyNumber::MeanDeltaE), means.mean_delta_e));
    values
}

/// The table of constancy.
fn constancy() -> Layout {
    let block = |(title, kind, numbers): (&'static str, PictureKind, &[ConstancyNumber])| Block {
        title,
        picture: PictureName::whole(kind),
        views: Observed,
        quantities: numbers.iter().map(|number| Quantity::Constancy(*number)).collect(),
    };
    Layout { title: "Constancy of base colour over light".to_owned(), blocks: CONSTANCY.map(block).into() }
}

impl Quantity {
    /// Every score, in the order in which tables show them.
    pub(crate) fn scores() -> Vec<Self> {
        Metric::ALL.iter().copied().map(Self::Score).collect()
    }

    /// Whether higher or lower is better; none for counts.
    pub(crate) fn better(self) -> Option<Better> {
        match self {
            Self::Pixels => None,
            Self::Score(metric) => Some(metric.better()),
            Self::Constancy(ConstancyNumber::MeanPsnr) => Some(Better::Higher),
            Self::Constancy(_) => Some(Better::Lower),
        }
    }

    /// Title, scale and digits.
    pub(crate) fn style(self) -> NumberStyle {
        match self {
            Self::Pixels => NumberStyle { title: "Pixels", scale: 1.0, digits: 0 },
            Self::Score(metric) => metric.style(),
            Self::Constancy(number) => number.style(),
        }
    }
}

/// Which number of a row a cell shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct CellKey {
    pub(crate) picture: PictureName,
    pub(crate) views: Views,
    pub(crate) quantity: Quantity,
}

impl From<ResultKey> for CellKey {
    fn from(ResultKey { picture, views, metric }: ResultKey) -> Self {
        Self { picture, views, quantity: Quantity::Score(metric) }
    }
}

/// A number and its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Value {
    pub(crate) value: f64,
    /// The standard error that render noise causes, in the value's unit.
    pub(crate) standard_error: Option<f64>,
}

/// Columns under one title.
pub(super) struct Block {
    pub(super) title: &'static str,
    pub(super) picture: PictureName,
    pub(super) views: Views,
    pub(super) quantities: Vec<Quantity>,
}

pub(super) struct Layout {
    pub(super) title: String,
    pub(super) blocks: Vec<Block>,
}

const POOLED: [Quantity; 3] = [Quantity::Pixels, Quantity::Score(Metric::Mse), Quantity::Score(Metric::Psnr)];

/// A block's title, kind of picture and views.
type BlockWords = (&'static str, PictureKind, Views);

/// A table's title, and its blocks.
type TableWords = (&'static str, &'static [BlockWords]);

/// The paper's Tables II to V in its order.
const PAPER: [TableWords; 4] = [
    ("RGB, fitted light", &[("Input view", RgbFitted, Input), ("Novel views", RgbFitted, Novel)]),
    ("Albedo, input view", &[("Albedo", Albedo, Input), ("Aligned albedo", AlbedoAligned, Input)]),
    ("Albedo, novel views", &[("Albedo", Albedo, Novel), ("Aligned albedo", AlbedoAligned, Novel)]),
    ("Aligned albedo, unobserved regions", &[("Aligned albedo", AlbedoAligned, Unobserved)]),
];

/// The tables that the paper does not have.
const OURS: [TableWords; 7] = [
    ("Albedo, unobserved regions", &[("Albedo", Albedo, Unobserved)]),
    ("RGB, true light", &[("Input view", RgbTrue, Input), ("Novel views", RgbTrue, Novel)]),
    ("RGB, relit", &[("Input view", RgbRelit, Input), ("Novel views", RgbRelit, Novel)]),
    ("Roughness and metallic, input view", &[("Roughness", Roughness, Input), ("Metallic", Metallic, Input)]),
    ("Roughness and metallic, novel views", &[("Roughness", Roughness, Novel), ("Metallic", Metallic, Novel)]),
    ("Albedo, wide views", &[("Wide views", Albedo, Wide), ("Unobserved in wide views", Albedo, WideUnobserved)]),
    (
        "RGB, true light, wide views",
        &[("Wide views", RgbTrue, Wide), ("Unobserved in wide views", RgbTrue, WideUnobserved)],
    ),
];

const TEXTURE_SPACE: TableWords = (
    "Base colour, texture space",
    &[("Observed", TextureBaseColor, Observed), ("Unobserved", TextureBaseColor, Unobserved)],
);

/// Pictures whose errors are pooled over instances.
const POOLED_PICTURES: [PictureKind; 4] = [Albedo, AlbedoAligned, RgbTrue, RgbFitted];

/// The tables of scores: the paper's, ours, those of pictures that have no table among these, and ours again over
/// specular regions.
pub(super) fn all() -> Vec<Layout> {
    let listed = || PAPER.into_iter().chain(OURS).chain([TEXTURE_SPACE]);
    let is_listed = |kind: PictureKind| listed().any(|(_, blocks)| blocks.iter().any(|(_, known, _)| *known == kind));
    let others = PictureKind::ALL.iter().copied().filter(|kind| !is_listed(*kind));
    let other = |kind: PictureKind| {
        let blocks = [("Input view", kind, Input), ("Novel views", kind, Novel)];
        layout(kind.title().to_owned(), &blocks, Surfaces::All)
    };
    let plain = listed().map(|(title, blocks)| layout(title.to_owned(), blocks, Surfaces::All));
    let plain = plain.chain(others.map(other));
    let specular = OURS
        .into_iter()
        .map(|(title, blocks)| layout(format!("{title}, specular regions only"), blocks, Surfaces::Specular));
    plain.chain(specular).chain([constancy()]).collect()
}

const HEADLINE: [BlockWords; 6] = [
    ("Albedo, input view", Albedo, Input),
    ("Albedo, novel views", Albedo, Novel),
    ("True light, input view", RgbTrue, Input),
    ("True light, novel views", RgbTrue, Novel),
    ("Relit, input view", RgbRelit, Input),
    ("Relit, novel views", RgbRelit, Novel),
];

/// One table of what matters most.
pub(super) fn headline() -> Layout {
    let mut layout = layout("PSNR in dB".to_owned(), &HEADLINE, Surfaces::All);
    layout.blocks.iter_mut().for_each(|block| block.quantities = vec![Quantity::Score(Metric::Psnr)]);
    layout
}

fn layout(title: String, blocks: &[BlockWords], surfaces: Surfaces) -> Layout {
    let block = |&(title, kind, views): &BlockWords| Block {
        title,
        picture: PictureName { kind, surfaces },
        views,
        quantities: Quantity::scores(),
    };
    Layout { title, blocks: blocks.iter().map(block).collect() }
}

/// The tables of errors that are pooled over the pixels of instances.
pub(super) fn pooled() -> Vec<Layout> {
    let views = [Input, Novel, Unobserved];
    let block = |kind, views: Views| Block {
        title: views.title(),
        picture: PictureName::whole(kind),
        views,
        quantities: POOLED.into(),
    };
    let layout = |kind: PictureKind| Layout {
        title: format!("{}, pooled over pixels", kind.title()),
        blocks: views.map(|views| block(kind, views)).into(),
    };
    POOLED_PICTURES.map(layout).into()
}

#[cfg(test)]
mod tests {
    use mateval_dataset::SceneId;
    use mateval_dataset::lighting::LightingName;

    use super::*;

    #[test]
    fn means_over_families_skip_what_has_no_value() {
        let family = |relative, mse| Constancy {
            scene: SceneId::new("s").unwrap(),
            lightings: vec![LightingName::WarmCool],
            area_m2: 1.0,
            raw: Deviation { linear: 0.2, relative, ..Deviation::default() },
            aligned: Deviation { linear: 0.1, ..Deviation::default() },
            mean_mse: mse,
            mean_delta_e: 3.0,
        };
        let found = ConstancyMeans::of(&[family(Some(0.5), 0.1), family(None, 0.001)]).unwrap();
        assert_eq!((found.relative, found.linear), ([Some(0.5), None], [0.2, 0.1]));
        assert!((found.mean_psnr - 20.0).abs() < 1e-12);
        assert_eq!(ConstancyMeans::of(&[]), None);
    }
}
