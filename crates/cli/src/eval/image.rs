//! `mateval eval image`: the metrics of two pictures.

use std::path::PathBuf;

use mateval_eval::score::LpipsWeights;
use mateval_metrics::{Lpips, Net};
use mateval_report::pair::{PairValues, compare};
use mateval_scene::json;

use crate::format::Format;
use crate::outcome::{Outcome, print};
use crate::tool::TOOL;
use crate::weights::{self, FETCH_LPIPS};

/// Arguments of `eval image`.
#[derive(clap::Args)]
pub struct ImageArgs {
    /// The picture to judge: 8-bit sRGB PNG or linear EXR.
    prediction: PathBuf,
    /// The true picture, of the same size: 8-bit sRGB PNG or linear EXR.
    reference: PathBuf,
    /// 8-bit grey PNG of the same size: 255 where pixels count, 0 elsewhere.
    #[arg(long)]
    mask: Option<PathBuf>,
    /// Network of LPIPS; may be given several times.
    #[arg(long = "net", value_name = "NET", value_enum, default_values = ["alex"])]
    nets: Vec<NetName>,
    /// How to print the metrics.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum NetName {
    Alex,
    Vgg,
}

/// Compares the pictures and prints the metrics.
pub fn run(args: &ImageArgs) -> anyhow::Result<Outcome> {
    let mut nets: Vec<Lpips> = Vec::new();
    let mut missing = Vec::new();
    for name in &args.nets {
        let net = if *name == NetName::Alex { Net::Alex } else { Net::Vgg };
        match weights::load(net) {
            LpipsWeights::Loaded(lpips) => nets.push(*lpips),
            LpipsWeights::Missing { reason, .. } => missing.push((net.key(), reason)),
        }
    }
    let values = compare(&args.prediction, &args.reference, args.mask.as_deref(), &nets)?;
    match args.format {
        Format::Json => print(&json::to_text(&serde_json::json!({
            "format": "mateval-image/1",
            "tool": TOOL,
            "values": values,
            "missing": missing
                .iter()
                .map(|(net, reason)| serde_json::json!({ "metric": net, "reason": reason, "fix": FETCH_LPIPS }))
                .collect::<Vec<_>>(),
        })))?,
        Format::Text => print(&text(&values, &missing))?,
    }
    Ok(Outcome::Good)
}

fn text(values: &PairValues, missing: &[(&str, String)]) -> String {
    let mut lines = Vec::new();
    let mut line = |name: &str, value: Option<f64>| {
        lines.push(format!("{name:24} {}", value.map_or("none".to_owned(), |value| format!("{value:.6}"))));
    };
    line("mse", values.mse);
    line("psnr_db", values.psnr);
    line("ssim", values.ssim);
    for net in &values.lpips {
        line(&net.metric, net.value);
    }
    if let Some(masked) = &values.masked {
        line("masked mse", masked.mse);
        line("masked psnr_db", masked.psnr);
        line("masked ssim inside", masked.ssim_inside);
        line("masked ssim black_fill", masked.ssim_black_fill);
        for (rule, nets) in [("inside", &masked.lpips_inside), ("black_fill", &masked.lpips_black_fill)] {
            for net in nets {
                line(&format!("masked {} {rule}", net.metric), net.value);
            }
        }
    }
    lines.extend(missing.iter().map(|(net, _)| format!("{net:24} missing; run: {FETCH_LPIPS}")));
    lines.join("\n") + "\n"
}
