//! The scorer's metrics of two arrays.

use std::sync::OnceLock;

use anyhow::anyhow;
use mateval_eval::score::LpipsWeights;
use mateval_image::{Mask, Picture, SrgbRgb};
use mateval_metrics::{Lpips, MetricError, Net, Pixel, Psnr, mse, ssim_valid_windows};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::failure::failed;
use crate::long_work::run_long;
use crate::map_input::{ColoursOrNumbers, MapInput, mask_of};

/// Prediction and reference, both of colours or both of numbers.
enum Pair {
    Colours(Picture<SrgbRgb>, Picture<SrgbRgb>),
    Numbers(Picture<f32>, Picture<f32>),
}

impl Pair {
    fn new(prediction: &Bound<'_, PyAny>, reference: &Bound<'_, PyAny>) -> PyResult<Self> {
        let prediction = MapInput::new("prediction", prediction)?;
        let reference = MapInput::new("reference", reference)?;
        reference.check_same_kind(&prediction)?;
        match (prediction.colours_or_numbers()?, reference.colours_or_numbers()?) {
            (ColoursOrNumbers::Colours(a), ColoursOrNumbers::Colours(b)) => Ok(Self::Colours(a, b)),
            (ColoursOrNumbers::Numbers(a), ColoursOrNumbers::Numbers(b)) => Ok(Self::Numbers(a, b)),
            _ => Err(PyValueError::new_err("expected prediction and reference with the same number of axes")),
        }
    }
}

/// The peak signal-to-noise ratio in dB, at most 100, of arrays of shape (height, width, 3) or (height, width) whose peak
/// is 1. Values are compared as they are; uint8 and uint16 are divided by their largest value. The scorer compares linear
/// values of albedo. Where mask, (height, width) of bool, is given, only its pixels count; None where there are none.
#[pyfunction]
#[pyo3(signature = (prediction, reference, mask=None))]
pub fn psnr(
    py: Python<'_>,
    prediction: &Bound<'_, PyAny>,
    reference: &Bound<'_, PyAny>,
    mask: Option<&Bound<'_, PyAny>>,
) -> PyResult<Option<f64>> {
    fn of<P: Pixel>(a: &Picture<P>, b: &Picture<P>, mask: Option<&Mask>) -> Result<Option<f64>, MetricError> {
        let error = mse(a, b, mask)?;
        Ok(error.map(Psnr::from_mse).transpose()?.map(|psnr| psnr.db))
    }
    measured(py, Pair::new(prediction, reference)?, mask, of, of)
}

/// The structural similarity in windows of 11x11 pixels, of arrays as `psnr` takes them, at least 11 pixels wide and high.
/// The scorer compares sRGB-encoded albedo. Where mask is given, only windows that lie wholly inside it count; None where
/// there are none.
#[pyfunction]
#[pyo3(signature = (prediction, reference, mask=None))]
pub fn ssim(
    py: Python<'_>,
    prediction: &Bound<'_, PyAny>,
    reference: &Bound<'_, PyAny>,
    mask: Option<&Bound<'_, PyAny>>,
) -> PyResult<Option<f64>> {
    fn of<P: Pixel>(a: &Picture<P>, b: &Picture<P>, mask: Option<&Mask>) -> Result<Option<f64>, MetricError> {
        match mask {
            Some(mask) => Ok(ssim_valid_windows(a, b, mask)?.map(|found| found.ssim)),
            None => mateval_metrics::ssim(a, b).map(Some),
        }
    }
    measured(py, Pair::new(prediction, reference)?, mask, of, of)
}

/// A metric of two pictures; `None` where no pixel counts.
type Metric<P> = fn(&Picture<P>, &Picture<P>, Option<&Mask>) -> Result<Option<f64>, MetricError>;

fn measured(
    py: Python<'_>,
    pair: Pair,
    mask: Option<&Bound<'_, PyAny>>,
    of_colours: Metric<SrgbRgb>,
    of_numbers: Metric<f32>,
) -> PyResult<Option<f64>> {
    let mask = mask.map(mask_of).transpose()?;
    let work = move || match &pair {
        Pair::Colours(a, b) => of_colours(a, b, mask.as_ref()),
        Pair::Numbers(a, b) => of_numbers(a, b, mask.as_ref()),
    };
    run_long(py, move |_| work())?.map_err(failed)
}

/// LPIPS 0.1 with AlexNet, of sRGB-encoded arrays of shape (height, width, 3). Where mask is given, the mean is over its
/// pixels; None where there are none. Fails where the network's weights were not fetched.
#[pyfunction]
#[pyo3(signature = (prediction, reference, mask=None))]
pub fn lpips(
    py: Python<'_>,
    prediction: &Bound<'_, PyAny>,
    reference: &Bound<'_, PyAny>,
    mask: Option<&Bound<'_, PyAny>>,
) -> PyResult<Option<f64>> {
    let Pair::Colours(a, b) = Pair::new(prediction, reference)? else {
        return Err(PyValueError::new_err("expected arrays of the shape (height, width, 3), found (height, width)"));
    };
    let mask = mask.map(mask_of).transpose()?;
    let work = move || {
        let network = network()?;
        anyhow::Ok(match &mask {
            Some(mask) => network.masked(&a, &b, mask)?,
            None => Some(network.whole(&a, &b)?),
        })
    };
    run_long(py, move |_| work())?.map_err(failed)
}

/// The network, which is loaded once.
fn network() -> anyhow::Result<&'static Lpips> {
    static NETWORK: OnceLock<Box<Lpips>> = OnceLock::new();
    if let Some(network) = NETWORK.get() {
        return Ok(network);
    }
    match mateval_cli::find_weights(Net::Alex) {
        // Two threads may both load it; no lock is held meanwhile, which a forked child could wait for.
        LpipsWeights::Loaded(network) => Ok(NETWORK.get_or_init(|| network)),
        LpipsWeights::Missing { reason, fix } => Err(anyhow!("{} is missing: {reason}; run: {fix}", Net::Alex.key())),
    }
}
