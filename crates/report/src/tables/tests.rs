//! Tables show what results hold, and refuse results that cannot be compared.

use std::collections::BTreeMap;

use mateval_dataset::dataset::Secrecy;
use mateval_dataset::open::DatasetId;
use mateval_dataset::{InstanceId, SceneId};

use super::*;
use crate::ranking;
use mateval_eval::metric::{Metric, PictureKind};
use mateval_eval::protocol::Protocol;
use mateval_eval::result::key::{ResultKey, Views};
use mateval_eval::result::{InstancePixelErrors, ProtocolResult};

fn scene(name: &str) -> SceneId {
    SceneId::new(name).unwrap()
}

fn result(method: &str, summary: &[(&str, f64)]) -> ResultFile {
    let summary: BTreeMap<ResultKey, f64> = summary.iter().map(|(key, value)| (key.parse().unwrap(), *value)).collect();
    let key = ResultKey::whole(PictureKind::RgbTrue, Views::Input, Metric::Psnr);
    let summary_noise = summary.keys().filter(|other| **other == key).map(|key| (*key, 0.016)).collect();
    let base = ranking::tests::result(method, &[]);
    let scores = ProtocolResult {
        protocol: Protocol::named("paper").unwrap(),
        fingerprint: "f".to_owned(),
        scenes: BTreeMap::from([(scene("b"), summary.clone()), (scene("a"), BTreeMap::new())]),
        noise: BTreeMap::from([(scene("b"), BTreeMap::from([(key, 0.25)]))]),
        summary,
        summary_noise,
        ..base.protocols["mateval-3"].clone()
    };
    let dataset = DatasetId { scenes: vec![scene("b"), scene("a")], total_scenes: 2, ..base.dataset };
    ResultFile { dataset, protocols: BTreeMap::from([("paper".to_owned(), scores)]), ..base }
}

/// Three methods; the second has no SSIM, none has LPIPS.
fn three() -> [ResultFile; 3] {
    let of = |method, psnr: f64, rest: &[(&str, f64)]| {
        let light = [("rgb_true.input.psnr", psnr), ("rgb_true.novel.mse", 1.0 / psnr)];
        result(method, &[&light[..], rest].concat())
    };
    let ssim = |value| [("rgb_true.input.ssim", value)];
    [of("a|1", 10.0, &ssim(0.5)), of("b_2", 40.0, &[]), of("c\"3", 20.0, &ssim(0.5))]
}

fn shown(results: &[ResultFile], grouping: Grouping, format: TableFormat) -> String {
    tables(results, None, "paper", grouping, format).unwrap()
}

#[test]
fn markdown_by_the_byte() {
    let expected = "\
### RGB, true light

| Method | Input view PSNR ↑ | Input view SSIM ↑ | Novel views MSE (1e-3) ↓ |
|---|---:|---:|---:|
| a\\|1 | 10.00 ± 0.02 | **0.5000** | 100.000 |
| b_2 | **40.00** ± 0.02 | missing | **25.000** |
| c\"3 | <u>20.00</u> ± 0.02 | **0.5000** | <u>50.000</u> |

";
    assert_eq!(shown(&three(), Grouping::Dataset, TableFormat::Markdown), expected);
}

#[test]
fn titles_state_that_the_truth_is_withheld() {
    let mut withheld = three();
    withheld.iter_mut().for_each(|result| result.dataset.withheld = Some(Secrecy::NotSecret));
    let text = TableFormat::Text { bold: false, columns: None };
    for format in [TableFormat::Markdown, TableFormat::Latex, TableFormat::Csv, text] {
        let title = "RGB, true light (truth withheld, not secret)";
        assert!(shown(&withheld, Grouping::Dataset, format).contains(title), "{format:?}");
        assert!(!shown(&three(), Grouping::Dataset, format).contains("withheld"), "{format:?}");
    }
}

/// The twin is bold: its lines have the same letters between escape sequences.
#[test]
fn text_is_aligned_and_fits_a_terminal() {
    let expected = "\
RGB, true light

                            Novel
         Input    Input     views
          view     view       MSE
Method  PSNR ↑   SSIM ↑  (1e-3) ↓
a|1      10.00   0.5000   100.000
b_2      40.00  missing    25.000
c\"3      20.00   0.5000    50.000
";
    let text = shown(&three(), Grouping::Dataset, TableFormat::Text { bold: false, columns: None });
    assert_eq!(text, expected);
    let bold = shown(&three(), Grouping::Dataset, TableFormat::Text { bold: true, columns: None });
    assert!(bold.contains("\x1b[1m40.00\x1b[0m"), "{bold}");
    assert_eq!(bold.replace("\x1b[1m", "").replace("\x1b[0m", ""), text);

    let two = result("a", &[("albedo.input.mse", 0.01), ("rgb_true.input.mse", 0.01)]);
    let text = shown(&[two], Grouping::Dataset, TableFormat::Text { bold: false, columns: None });
    assert_eq!(text.lines().filter(|line| line.is_empty()).count(), 3, "two below titles, one between tables: {text}");

    let scores =
        ["albedo", "rgb_true", "rgb_relit"].map(|kind| [format!("{kind}.input.psnr"), format!("{kind}.novel.psnr")]);
    let all: Vec<(&str, f64)> = scores.as_flattened().iter().map(|key| (key.as_str(), 12.345)).collect();
    let wide = result("a-method-with-a-name", &all);
    let text =
        headline(std::slice::from_ref(&wide), None, "paper", TableFormat::Text { bold: false, columns: None }).unwrap();
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    let narrow = headline(&[wide], None, "paper", TableFormat::Text { bold: false, columns: Some(60) }).unwrap();
    assert!(narrow.lines().all(|line| line.chars().count() <= 60), "{narrow}");
    let blocks = [&narrow, &text].map(|text| text.matches("a-method-with-a-name").count());
    assert_eq!((blocks, narrow.matches("12.35").count() + narrow.matches("12.34").count()), ([2, 1], 6), "{narrow}");
}

#[test]
fn the_ceiling_comes_last() {
    let light = |method, psnr| result(method, &[("rgb_true.input.psnr", psnr)]);
    let results = [light("a", 20.2), light("b", 20.4), light("c", 20.0), light("d", 15.0)];
    let ceiling = light("gt", 45.0);
    let of = |format| tables(&results, Some(&ceiling), "paper", Grouping::Dataset, format).unwrap();
    let expected = "\
### RGB, true light

| Method | Input view PSNR ↑ |
|---|---:|
| a | <u>20.20</u> ± 0.02 |
| b | **20.40** ± 0.02 |
| c | 20.00 ± 0.02 |
| d | 15.00 ± 0.02 |
| gt (ceiling) | 45.00 ± 0.02 |

";
    assert_eq!(of(TableFormat::Markdown), expected);
    assert!(of(TableFormat::Csv).contains("\"gt (ceiling)\",45,0.016"), "{}", of(TableFormat::Csv));
    let mut lit = light("gt", 45.0);
    let mut scores = lit.protocols.remove("paper").unwrap();
    scores.protocol = Protocol::named(Protocol::DEFAULT).unwrap();
    scores.summary.insert("rgb_true.input.mse".parse().unwrap(), 1e-9);
    lit.protocols.insert("paper".to_owned(), scores);
    let refused = tables(&results, Some(&lit), "paper", Grouping::Dataset, TableFormat::Csv).unwrap_err();
    assert!(refused.to_string().contains("the ceiling 'gt' is not the truth: expected 0"), "{refused}");
    let mut other = ceiling;
    other.protocols.get_mut("paper").unwrap().fingerprint = "another".to_owned();
    let error = tables(&results, Some(&other), "paper", Grouping::Dataset, TableFormat::Csv).unwrap_err();
    assert!(error.to_string().contains("'a' and 'gt' have different fingerprints"), "{error}");
}

#[test]
fn latex_by_the_byte() {
    let expected = r#"% RGB, true light
\begin{tabular}{lrrr}
\toprule
& \multicolumn{2}{c}{Input view} & \multicolumn{1}{c}{Novel views} \\
Method & PSNR $\uparrow$ & SSIM $\uparrow$ & MSE ($10^{-3}$) $\downarrow$ \\
\midrule
a\textbar{}1 & 10.00 $\pm$ 0.02 & \textbf{0.5000} & 100.000 \\
b\_2 & \textbf{40.00} $\pm$ 0.02 & missing & \textbf{25.000} \\
c"3 & \underline{20.00} $\pm$ 0.02 & \textbf{0.5000} & \underline{50.000} \\
\bottomrule
\end{tabular}

"#;
    assert_eq!(shown(&three(), Grouping::Dataset, TableFormat::Latex), expected);
}

#[test]
fn csv_by_the_byte() {
    let expected = "\
\"RGB, true light\",\"Input view PSNR ↑\",\"Input view PSNR standard error\",\"Input view SSIM ↑\",\"Novel views MSE (1e-3) ↓\"
\"a|1\",10,0.016,0.5,100
\"b_2\",40,0.016,,25
\"c\"\"3\",20,0.016,0.5,50

";
    assert_eq!(shown(&three(), Grouping::Dataset, TableFormat::Csv), expected);
}

/// Names are untrusted: no format takes a part of one for its own syntax, and no spreadsheet for a formula. The twin, a
/// negative number, has no quote in front.
#[test]
fn names_are_shown_as_they_are() {
    let row = |name: &str, format| {
        let results = [result(name, &[("rgb_true.novel.mse", -0.25)])];
        let text = shown(&results, Grouping::Dataset, format);
        let is_row = |line: &&str| line.contains("-250");
        text.lines().find(is_row).unwrap_or_else(|| panic!("{text}")).to_owned()
    };
    let hostile = "a|b`c`[d](http://e)<img src=x>*f* _g_ h_i\\\n\n|j";
    let expected = "| a\\|b\\`c\\`\\[d\\](http://e)&lt;img src=x&gt;\\*f\\* \\_g\\_ h_i\\\\  \\|j | -250.000 |";
    assert_eq!(row(hostile, TableFormat::Markdown), expected);
    assert_eq!(row("a\n\n<b>|", TableFormat::Latex), r"a  \textless{}b\textgreater{}\textbar{} & -250.000 \\");
    for name in ["=1+1", "+1", "-1", "@sum(a1)", "\t=1"] {
        assert_eq!(row(name, TableFormat::Csv), format!("\"'{name}\",-250"));
    }
    assert_eq!(row("a=1", TableFormat::Csv), "\"a=1\",-250");
}

/// A map that a submission never contains is a dash and never the best; the twin lacks the value and is missing.
#[test]
fn maps_that_are_not_predicted_are_no_missing_values() {
    let light = ("rgb_true.novel.psnr", 20.0);
    let last_row = |not_predicted: &str| {
        let with = |name, mae| result(name, &[light, ("roughness.novel.mae", mae)]);
        let without = ResultFile { not_predicted: vec![not_predicted.to_owned()], ..result("c", &[light]) };
        let results = [with("a", 0.25), with("b", 0.5), without];
        let markdown = shown(&results, Grouping::Dataset, TableFormat::Markdown);
        let table = markdown.split("### Roughness").nth(1).unwrap();
        assert!(table.contains("| a | **0.2500** |"), "{table}");
        table.trim_end().lines().last().unwrap().to_owned()
    };
    assert_eq!([last_row("roughness"), last_row("metallic")], ["| c | – |", "| c | missing |"]);
}

/// Scene a has no values and is left out; scene b shows its own noise.
#[test]
fn by_scene_in_the_datasets_order() {
    let markdown = shown(&three(), Grouping::Scene, TableFormat::Markdown);
    assert!(markdown.contains("| Scene | Method | Input view PSNR ↑"), "{markdown}");
    assert!(markdown.contains("| b | b_2 | **40.00** ± 0.25 | missing | **25.000** |"), "{markdown}");
    assert!(!markdown.contains("| a | "), "{markdown}");
    let latex = shown(&three(), Grouping::Scene, TableFormat::Latex);
    assert!(latex.contains("{llrrr}\n\\toprule\n&  & \\multicolumn{2}"), "{latex}");
    assert!(latex.contains("\\midrule\nb & a\\textbar{}1 & 10.00 $\\pm$ 0.25"), "{latex}");
}

/// The paper's four tables come first, in its order; columns without values and tables without columns are left out.
#[test]
fn papers_tables_then_ours() {
    let keys = ["rgb_fitted.novel", "albedo_aligned.unobserved", "albedo.novel", "albedo.input", "roughness.input"];
    let ours = ["texture_base_color.observed", "rgb_relit.input", "rgb_true_specular.input"];
    let values: Vec<(String, f64)> = keys.iter().chain(&ours).map(|key| (format!("{key}.mse"), 0.01)).collect();
    let values: Vec<(&str, f64)> = values.iter().map(|(key, value)| (key.as_str(), *value)).collect();
    let markdown = shown(&[result("a", &values)], Grouping::Dataset, TableFormat::Markdown);
    let titles: Vec<&str> = markdown.lines().filter_map(|line| line.strip_prefix("### ")).collect();
    let expected = [
        "RGB, fitted light",
        "Albedo, input view",
        "Albedo, novel views",
        "Aligned albedo, unobserved regions",
        "RGB, relit",
        "Roughness and metallic, input view",
        "Base colour, texture space",
        "RGB, true light, specular regions only",
    ];
    assert_eq!(titles, expected);
    // A single value is not marked as the best.
    assert!(!markdown.contains("**") && !markdown.contains("missing"), "{markdown}");
}

fn errors(of: &str, category: Option<&str>, picture: PictureKind, pixels: usize, mse: f64) -> InstancePixelErrors {
    InstancePixelErrors {
        scene: scene(of),
        instance: InstanceId::new("i").unwrap(),
        category: category.map(str::to_owned),
        super_category: category.map(|_| "Seat".to_owned()),
        picture,
        views: Views::Input,
        pixels,
        mse,
    }
}

fn with_instances() -> ResultFile {
    let mut result = result("m", &[]);
    result.protocols.get_mut("paper").unwrap().instances = vec![
        errors("a", Some("Sofa"), PictureKind::Albedo, 100, 0.04),
        errors("b", Some("Sofa"), PictureKind::Albedo, 300, 0.0),
        errors("b", Some("Zebra"), PictureKind::Albedo, 600, 0.11),
        errors("b", None, PictureKind::Albedo, 10, 0.1),
        errors("b", None, PictureKind::RgbTrue, 10, -1e-6),
    ];
    result
}

/// (100 * 0.04 + 300 * 0) / 400 = 0.01, which is 20 dB; with 600 * 0.11 it is 70 / 1000.
#[test]
fn pools_by_pixels_over_scenes() {
    let markdown = shown(&[with_instances()], Grouping::Category, TableFormat::Markdown);
    assert!(markdown.contains("| Category | Method | Input view Pixels | Input view MSE (1e-3) ↓ |"), "{markdown}");
    assert!(markdown.contains("| Sofa | m | 400 | 10.000 | 20.00 |\n| Zebra | m | 600 | 110.000"), "{markdown}");
    assert!(markdown.contains("\n| other | m | 10 | 100.000 | 10.00 |"), "{markdown}");
    let csv = shown(&[with_instances()], Grouping::SuperCategory, TableFormat::Csv);
    assert!(csv.contains("\"Seat\",\"m\",1000,70,11.54901959985743"), "{csv}");
}

/// An error that is below 0 after noise removal has no PSNR.
#[test]
fn pooled_noise_has_no_psnr() {
    let markdown = shown(&[with_instances()], Grouping::Category, TableFormat::Markdown);
    let light = markdown.split("### RGB, true light").nth(1).unwrap();
    assert!(light.contains("| other | m | 10 | -0.001 |\n"), "{light}");
}

/// A value that only another method has is missing; if no method has it, there was nothing to measure.
#[test]
fn missing_values_and_values_that_cannot_exist() {
    let mut both = [with_instances(), with_instances()];
    both[0].protocols.get_mut("paper").unwrap().instances.push(errors("b", None, PictureKind::Albedo, 10, 0.1));
    both[1].protocols.get_mut("paper").unwrap().instances.retain(|errors| errors.category.is_some());
    both.iter_mut().for_each(|result| {
        let scores = result.protocols.get_mut("paper").unwrap();
        scores.instances.push(InstancePixelErrors {
            views: Views::Novel,
            ..errors("b", Some("Sofa"), PictureKind::Albedo, 1, 0.1)
        });
    });
    let markdown = shown(&both, Grouping::Category, TableFormat::Markdown);
    assert!(markdown.contains("| other | m | missing | missing | missing | – | – | – |"), "{markdown}");
}

#[test]
fn fingerprints_are_not_mixed() {
    let mut other = result("b", &[]);
    other.protocols.get_mut("paper").unwrap().fingerprint = "g".to_owned();
    let csv = |results: &[ResultFile], protocol| tables(results, None, protocol, Grouping::Dataset, TableFormat::Csv);
    let error = csv(&[result("a", &[]), other], "paper").unwrap_err();
    assert!(error.to_string().contains("different fingerprints"));
    let error = csv(&[result("a", &[])], "mateval-3").unwrap_err();
    assert!(error.to_string().contains("--protocol mateval-3"));
    let error = csv(&[result("a", &[])], "paper").unwrap_err();
    assert!(error.to_string().contains("no score under protocol 'paper'"));
}
