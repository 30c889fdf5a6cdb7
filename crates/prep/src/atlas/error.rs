//! Why a mesh has no atlas.

use serde::{Deserialize, Serialize};
use xatlas_rs_v2::AddMeshError;

use super::size::GUTTER;

/// Why a mesh has no atlas.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
pub enum AtlasError {
    /// No triangle has an area.
    #[error("no triangle has an area")]
    NoArea,
    /// xatlas refused the mesh.
    #[error("xatlas refused the mesh: {}", reason_of(*.0))]
    Refused(Refusal),
    /// xatlas returned another number of meshes.
    #[error("xatlas returned {found} meshes, expected one")]
    Meshes {
        /// The number of meshes.
        found: usize,
    },
    /// xatlas returned the triangles in another order.
    #[error("xatlas returned the triangles in another order")]
    Reordered,
    /// Too many charts for the size.
    #[error("its {charts} charts do not fit into {size}x{size} texels with gutters of {GUTTER}")]
    DoesNotFit {
        /// Charts.
        charts: u32,
        /// Texels a side.
        size: u32,
    },
}

/// Why xatlas refuses a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refusal {
    /// xatlas states no reason.
    Unspecified,
    /// A triangle has a corner that does not exist.
    IndexOutOfRange,
    /// A face has fewer than three corners.
    FaceVertexCount,
    /// The number of corners is not a multiple of three.
    IndexCount,
}

fn reason_of(refusal: Refusal) -> &'static str {
    match refusal {
        Refusal::Unspecified => "it states no reason",
        Refusal::IndexOutOfRange => "a triangle has a corner that does not exist",
        Refusal::FaceVertexCount => "a face has fewer than three corners",
        Refusal::IndexCount => "the number of corners is not a multiple of three",
    }
}

impl From<AddMeshError> for AtlasError {
    fn from(error: AddMeshError) -> Self {
        Self::Refused(match error {
            AddMeshError::Error => Refusal::Unspecified,
            AddMeshError::IndexOutOfRange => Refusal::IndexOutOfRange,
            AddMeshError::InvalidFaceVertexCount => Refusal::FaceVertexCount,
            AddMeshError::InvalidIndexCount => Refusal::IndexCount,
        })
    }
}
