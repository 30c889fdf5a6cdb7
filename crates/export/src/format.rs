//! The formats.

/// A format that a dataset can be written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// One tar a scene and one for the rest, so that scenes can be downloaded on their own.
    Tar,
    /// The same tars with a description of them and of every view, in Croissant's JSON-LD.
    Croissant,
    /// A Parquet file with a row a view, and a dataset card.
    Huggingface,
    /// A folder a scene with `transforms.json`.
    Nerfstudio,
    /// A folder a scene with COLMAP's text model.
    Colmap,
}

impl Format {
    /// Whether the export is the whole dataset, so that no scene may be absent.
    pub fn needs_all_scenes(self) -> bool {
        matches!(self, Self::Tar | Self::Croissant | Self::Huggingface)
    }

    /// Whether the export shows the views' pictures, so that they must have been rendered.
    pub fn needs_pictures(self) -> bool {
        self != Self::Tar
    }
}
