//! Which tables there are, and their columns.

use mateval_eval::metric_kind::{MSE, Metric, PIXELS, PSNR, SCORES};

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
        metrics: SCORES,
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
