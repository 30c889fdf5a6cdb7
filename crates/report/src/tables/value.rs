//! The numbers of a table, by picture, views and quantity.

use mateval_eval::metric::{Better, Metric, NumberStyle};
use mateval_eval::result_key::{PictureName, ResultKey, Views};

/// The quantity that a column of numbers holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Quantity {
    /// The number of compared pixels.
    Pixels,
    /// A score.
    Score(Metric),
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
        }
    }

    /// Title, scale and digits.
    pub(crate) fn style(self) -> NumberStyle {
        match self {
            Self::Pixels => NumberStyle { title: "Pixels", scale: 1.0, digits: 0 },
            Self::Score(metric) => metric.style(),
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
