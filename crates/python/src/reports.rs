//! The command's reports as texts, which Python parses: `mateval.lint`, `mateval.score`, `mateval.tables` and
//! `mateval.rank`; and the scorer's metrics of two arrays.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use anyhow::{Context as _, anyhow};
use mateval_cli::{TOOL, find_weights};
use mateval_dataset::open::Dataset as OpenDataset;
use mateval_dataset::{Progress, SceneId, json};
use mateval_eval::protocol::Protocol;
use mateval_eval::result::ResultFile;
use mateval_eval::score::{LpipsWeights, ScorePlan};
use mateval_image::{Mask, Picture, SrgbRgb};
use mateval_metrics::{Lpips, MetricError, Net, Pixel, Psnr, mse, ssim_valid_windows};
use mateval_report::tables::{Grouping, TableFormat};
use mateval_submission::lint::{LintFile, LintPlan, lint as check, plain, refused};
use mateval_submission::map_file::BASE_COLOR_RANGE;
use mateval_submission::{SubmissionError, archive};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays::{ColoursOrNumbers, MapInput, mask_of};
use crate::dataset::{Dataset, scene_place};
use crate::long_work::{Listener, failed, run_long, wrong_shape};

/// Checks a submission, a folder or an archive. Returns the report as JSON, and as text for people.
#[pyfunction]
#[pyo3(signature = (submission, dataset, *, progress))]
pub fn lint<'py>(
    py: Python<'py>,
    submission: PathBuf,
    dataset: &Dataset,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<(String, String)> {
    let listener = Listener::of(py, progress)?;
    let dataset = Arc::clone(&dataset.0);
    let checked = run_long(py, &listener, move |progress| lint_file(&dataset, &submission, progress))?;
    let file = checked.context("cannot check the submission").map_err(failed)?;
    Ok((json::to_text(&file), plain(&file)))
}

fn lint_file(dataset: &OpenDataset, submission: &Path, progress: Progress<'_>) -> Result<LintFile, SubmissionError> {
    let opened = match archive::open(submission, &std::env::temp_dir()) {
        // An unsound archive is a result of the check, not a failure to check.
        Err(SubmissionError::Archive { findings, .. }) => return Ok(refused(dataset, TOOL, findings)),
        opened => opened?,
    };
    check(&LintPlan { dataset, submission: opened.root(), tool: TOOL.to_owned() }, progress)
}

/// Scores a submission, a folder or an archive. Returns the result as JSON.
#[pyfunction]
#[pyo3(signature = (submission, dataset, *, scenes, protocol, cache, progress))]
pub fn score<'py>(
    py: Python<'py>,
    submission: PathBuf,
    dataset: &Dataset,
    scenes: Vec<String>,
    protocol: &str,
    cache: Option<PathBuf>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<String> {
    let listener = Listener::of(py, progress)?;
    let dataset = Arc::clone(&dataset.0);
    scenes.iter().try_for_each(|id| scene_place(&dataset, id).map(drop))?;
    let task = ScoreTask {
        dataset,
        submission,
        scenes: scenes.into_iter().map(SceneId::new).collect::<Result<_, _>>().map_err(failed)?,
        protocol: Protocol::named(protocol).map_err(failed)?,
        cache,
    };
    run_long(py, &listener, move |progress| task.run(progress))?.map_err(failed)
}

/// Reads `RESULT.json`. Returns its text.
#[pyfunction]
pub fn read_result(path: PathBuf) -> PyResult<String> {
    // As the command writes it, whatever its layout was.
    ResultFile::read(&path).map(|result| json::to_lines(&result)).map_err(failed)
}

/// The tables of several results, and of that of the truth as their ceiling, in a format of `mateval eval tables`.
#[pyfunction]
pub fn tables(
    py: Python<'_>,
    results: Vec<String>,
    ceiling: Option<&str>,
    protocol: &str,
    by: &str,
    format: &str,
) -> PyResult<String> {
    let grouping = match by {
        "dataset" => Grouping::Dataset,
        "scene" => Grouping::Scene,
        "category" => Grouping::Category,
        "super_category" => Grouping::SuperCategory,
        other => {
            let expected = "'dataset', 'scene', 'category' or 'super_category'";
            return Err(PyValueError::new_err(format!("by: expected {expected}, found '{other}'")));
        }
    };
    let format = match format {
        "csv" => TableFormat::Csv,
        "markdown" => TableFormat::Markdown,
        "latex" => TableFormat::Latex,
        "text" => TableFormat::Text { bold: false, columns: None },
        other => {
            let expected = "'frames', 'csv', 'markdown', 'latex' or 'text'";
            return Err(PyValueError::new_err(format!("format: expected {expected}, found '{other}'")));
        }
    };
    let (results, ceiling) = (parsed(&results)?, ceiling.map(parsed_result).transpose()?);
    let tables = py.detach(|| mateval_report::tables::tables(&results, ceiling.as_ref(), protocol, grouping, format));
    tables.map_err(failed)
}

/// The ranking of several results, as the file `leaderboard.json` of a leaderboard has it.
#[pyfunction]
pub fn rank(py: Python<'_>, results: Vec<String>, protocol: &str) -> PyResult<String> {
    let (results, protocol) = (parsed(&results)?, protocol.to_owned());
    let ranking = run_long(py, &Listener::none(), move |_| mateval_report::ranking::rank(&results, &protocol, false))?;
    ranking.map(|ranking| json::to_text(&ranking)).map_err(failed)
}

fn parsed(texts: &[String]) -> PyResult<Vec<ResultFile>> {
    texts.iter().map(|text| parsed_result(text)).collect()
}

fn parsed_result(text: &str) -> PyResult<ResultFile> {
    json::parse(Path::new("result"), text.as_bytes()).map_err(failed)
}

struct ScoreTask {
    dataset: Arc<OpenDataset>,
    submission: PathBuf,
    scenes: Vec<SceneId>,
    protocol: Protocol,
    cache: Option<PathBuf>,
}

impl ScoreTask {
    /// The result as the command writes it.
    fn run(self, progress: Progress<'_>) -> anyhow::Result<String> {
        let opened = archive::open(&self.submission, &std::env::temp_dir())?;
        if let Some(cache) = &self.cache {
            std::fs::create_dir_all(cache).with_context(|| format!("cannot create '{}'", cache.display()))?;
        }
        let plan = ScorePlan {
            dataset: &self.dataset,
            submissions: vec![opened.root()],
            protocols: vec![self.protocol],
            scenes: self.scenes,
            lpips: find_weights(Net::Alex),
            tool: TOOL.to_owned(),
            // Threads of the scorer's own would work in rayon's global pool.
            jobs: 1,
            cache: self.cache.as_deref(),
            only_cached: false,
            pictures: None,
            seen: None,
            timed: None,
        };
        let results = mateval_eval::score::score(&plan, progress).context("cannot score")?;
        Ok(results.iter().map(json::to_lines).collect())
    }
}

/// Prediction and reference, both of colours or both of numbers.
enum Pair {
    Colours(Picture<SrgbRgb>, Picture<SrgbRgb>),
    Numbers(Picture<f32>, Picture<f32>),
}

impl Pair {
    /// The pair and the mask of its pixels. Fails where their shapes do not fit.
    fn with_mask(
        prediction: &Bound<'_, PyAny>,
        reference: &Bound<'_, PyAny>,
        mask: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(Self, Option<Mask>)> {
        let prediction = MapInput::new("prediction", prediction)?;
        let reference = MapInput::new("reference", reference)?;
        reference.check_same_kind(&prediction)?;
        // The peak is 1, so floats of 0 to 255 are refused.
        [&prediction, &reference].into_iter().try_for_each(|array| array.check_range(&BASE_COLOR_RANGE))?;
        let pictures = (prediction.colours_or_numbers()?, reference.colours_or_numbers()?);
        reference.check_same_size(&prediction)?;
        let mask = mask.map(|mask| mask_of(mask, &prediction)).transpose()?;
        let pair = match pictures {
            (ColoursOrNumbers::Colours(a), ColoursOrNumbers::Colours(b)) => Self::Colours(a, b),
            (ColoursOrNumbers::Numbers(a), ColoursOrNumbers::Numbers(b)) => Self::Numbers(a, b),
            (ColoursOrNumbers::Colours(_), ColoursOrNumbers::Numbers(_)) => {
                return Err(reference.wrong_shape("(height, width, 3) of the prediction"));
            }
            (ColoursOrNumbers::Numbers(_), ColoursOrNumbers::Colours(_)) => {
                return Err(reference.wrong_shape("(height, width) of the prediction"));
            }
        };
        Ok((pair, mask))
    }
}

/// The peak signal-to-noise ratio in dB, at most 100, of arrays of shape (height, width, 3), RGB (not BGR as OpenCV
/// reads it), or (height, width). The peak is 1, and floats must lie from -1 to 16. Values are compared as they are;
/// uint8 and uint16 are divided by their largest value. The scorer compares linear values of albedo. If mask, (height,
/// width) of bool, is given, only its pixels count; None if it has none. Arrays of different sizes raise
/// `mateval.WrongShape`, which is a ValueError.
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
    measured(py, Pair::with_mask(prediction, reference, mask)?, of, of)
}

/// The structural similarity in windows of 11x11 pixels, of arrays as `psnr` takes them, at least 11 pixels wide and
/// high. The scorer compares sRGB-encoded albedo. Where mask is given, only windows that lie wholly inside it count;
/// None without such a window.
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
    measured(py, Pair::with_mask(prediction, reference, mask)?, of, of)
}

/// A metric of two pictures; `None` where no pixel counts.
type Metric<P> = fn(&Picture<P>, &Picture<P>, Option<&Mask>) -> Result<Option<f64>, MetricError>;

fn measured(
    py: Python<'_>,
    (pair, mask): (Pair, Option<Mask>),
    of_colours: Metric<SrgbRgb>,
    of_numbers: Metric<f32>,
) -> PyResult<Option<f64>> {
    let work = move || match &pair {
        Pair::Colours(a, b) => of_colours(a, b, mask.as_ref()),
        Pair::Numbers(a, b) => of_numbers(a, b, mask.as_ref()),
    };
    run_long(py, &Listener::none(), move |_| work())?.map_err(not_measured)
}

/// Pictures that are too small for a metric are the caller's fault; other sizes were checked before.
fn not_measured(error: impl Into<anyhow::Error>) -> PyErr {
    let error = error.into();
    match error.downcast_ref::<MetricError>() {
        Some(MetricError::TooSmall { .. }) => wrong_shape(format!("{error}; compare larger ones")),
        _ => failed(error),
    }
}

/// LPIPS 0.1 with AlexNet, of sRGB-encoded arrays of shape (height, width, 3), RGB (not BGR as OpenCV reads it). Where
/// mask is given, the mean is over its pixels; None if it is empty. Fails where the network's weights were not
/// fetched.
#[pyfunction]
#[pyo3(signature = (prediction, reference, mask=None))]
pub fn lpips(
    py: Python<'_>,
    prediction: &Bound<'_, PyAny>,
    reference: &Bound<'_, PyAny>,
    mask: Option<&Bound<'_, PyAny>>,
) -> PyResult<Option<f64>> {
    let (Pair::Colours(a, b), mask) = Pair::with_mask(prediction, reference, mask)? else {
        let found = "expected arrays of the shape (height, width, 3), found (height, width)";
        return Err(wrong_shape(format!("{found}; `numpy.stack(3 * [array], -1)` repeats a grey picture's channel")));
    };
    let work = move || {
        let network = network()?;
        anyhow::Ok(match &mask {
            Some(mask) => network.inside(&a, &network.features(&b)?, mask)?,
            None => Some(network.whole(&a, &b)?),
        })
    };
    run_long(py, &Listener::none(), move |_| work())?.map_err(not_measured)
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
