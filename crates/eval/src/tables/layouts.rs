//! Which tables there are, and their columns.

/// Whether more is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Better {
    Lower,
    Higher,
}

/// One kind of number.
pub(super) struct Metric {
    /// Last word of its key.
    pub(super) key: &'static str,
    pub(super) title: &'static str,
    /// What values are multiplied by to be shown.
    pub(super) scale: f64,
    pub(super) digits: usize,
    /// None for what is no score.
    pub(super) better: Option<Better>,
}

/// Columns that stand under one title.
pub(super) struct Block {
    pub(super) title: &'static str,
    /// `<picture>.<views>`.
    pub(super) key: String,
    pub(super) metrics: &'static [Metric],
}

/// One table.
pub(super) struct Layout {
    pub(super) title: String,
    pub(super) blocks: Vec<Block>,
}

/// The paper prints MSE in units of 1e-3.
const MSE: Metric = Metric { key: "mse", title: "MSE (1e-3)", scale: 1e3, digits: 3, better: Some(Better::Lower) };
const PSNR: Metric = Metric { key: "psnr", title: "PSNR", scale: 1.0, digits: 2, better: Some(Better::Higher) };
const SSIM: Metric = Metric { key: "ssim", title: "SSIM", scale: 1.0, digits: 4, better: Some(Better::Higher) };
const LPIPS: Metric = Metric { key: "lpips_alex", title: "LPIPS", scale: 1.0, digits: 4, better: Some(Better::Lower) };
const PIXELS: Metric = Metric { key: "pixels", title: "Pixels", scale: 1.0, digits: 0, better: None };

/// The paper's four columns.
const COLUMNS: &[Metric] = &[MSE, PSNR, SSIM, LPIPS];
const POOLED: &[Metric] = &[PIXELS, MSE, PSNR];

/// A block's title, picture and views.
type BlockWords = (&'static str, &'static str, &'static str);

/// A table's title, and its blocks.
type TableWords = (&'static str, &'static [BlockWords]);

/// The paper's Tables II to V in its order.
const PAPER: [TableWords; 4] = [
    ("RGB, fitted light", &[("Input view", "rgb_fitted", "input"), ("Novel views", "rgb_fitted", "novel")]),
    ("Albedo, input view", &[("Albedo", "albedo", "input"), ("Aligned albedo", "albedo_aligned", "input")]),
    ("Albedo, novel views", &[("Albedo", "albedo", "novel"), ("Aligned albedo", "albedo_aligned", "novel")]),
    ("Aligned albedo, unobserved regions", &[("Aligned albedo", "albedo_aligned", "unobserved")]),
];

/// Those that the paper does not have.
const OURS: [TableWords; 4] = [
    ("RGB, true light", &[("Input view", "rgb_true", "input"), ("Novel views", "rgb_true", "novel")]),
    ("RGB, relit", &[("Input view", "rgb_relit", "input"), ("Novel views", "rgb_relit", "novel")]),
    ("Roughness and metallic, input view", &[("Roughness", "roughness", "input"), ("Metallic", "metallic", "input")]),
    ("Roughness and metallic, novel views", &[("Roughness", "roughness", "novel"), ("Metallic", "metallic", "novel")]),
];

/// What texels are compared in.
const TEXTURE_SPACE: TableWords = (
    "Base colour, texture space",
    &[("Observed", "texture_base_color", "observed"), ("Unobserved", "texture_base_color", "unobserved")],
);

/// What is pooled over instances: title and picture.
const POOLED_PICTURES: [(&str, &str); 4] = [
    ("Albedo", "albedo"),
    ("Aligned albedo", "albedo_aligned"),
    ("RGB, true light", "rgb_true"),
    ("RGB, fitted light", "rgb_fitted"),
];

/// The tables of scores: the paper's, ours, and all of them again over specular regions.
pub(super) fn all() -> Vec<Layout> {
    let plain = PAPER.into_iter().chain(OURS).chain([TEXTURE_SPACE]).map(|(title, blocks)| layout(title, blocks, ""));
    let specular = PAPER
        .into_iter()
        .chain(OURS)
        .map(|(title, blocks)| layout(&format!("{title}, specular regions only"), blocks, "_specular"));
    plain.chain(specular).collect()
}

fn layout(title: &str, blocks: &[BlockWords], suffix: &str) -> Layout {
    let block = |&(title, picture, views): &BlockWords| Block {
        title,
        key: format!("{picture}{suffix}.{views}"),
        metrics: COLUMNS,
    };
    Layout { title: title.to_owned(), blocks: blocks.iter().map(block).collect() }
}

/// The tables of what is pooled over instances' pixels.
pub(super) fn pooled() -> Vec<Layout> {
    let views = [("Input view", "input"), ("Novel views", "novel"), ("Unobserved", "unobserved")];
    let layout = |(title, picture): (&str, &str)| Layout {
        title: format!("{title}, pooled over pixels"),
        blocks: views.map(|(title, views)| Block { title, key: format!("{picture}.{views}"), metrics: POOLED }).into(),
    };
    POOLED_PICTURES.map(layout).into()
}
