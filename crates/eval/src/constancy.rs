//! Constancy: whether an answer stays the same when the light changes.
//!
//! A family is a scene and its twins, which show it under other weights of its light groups. Their true maps are the
//! same, so that every difference between a method's answers is an error. In: the maps that a submission holds for the
//! scene and for each twin. Out: [`Constancy`], over the texels that the input view shows, weighted by area.
//!
//! A constant answer is easily had: grey everywhere, or colours drawn towards grey. So the deviation is also divided by
//! the answer's own contrast, in luminance and in colour apart. A copy of reduced saturation or contrast has the same
//! quotient, and an answer without contrast has none. Beside it stands how far the family's mean is from the truth.
//!
//! Two passes over the texels: the means, from which the scales of aligned answers follow; then everything else.

use std::path::Path;

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::lighting::LightingName;
use mateval_dataset::open::Dataset;
use mateval_dataset::{Finding, Progress, Severity};
use mateval_image::{LUMINANCE, LinearRgb, Texture};
use mateval_metrics::color_difference;
use mateval_submission::atlas::AtlasMeshes;
use mateval_submission::prediction::{PredictedScene, read_scene};
use mateval_submission::texel_map::TexelMap;

use crate::error::EvalError;
use crate::materials::texels::each_atlas;
use crate::result::{Constancy, Deviation, PartSpread};
use crate::truth::OpenScene;

/// The answers of a submission to the twins of a scene.
pub(crate) struct Twins {
    pub(crate) answers: Vec<(LightingName, PredictedScene)>,
    pub(crate) findings: Vec<Finding>,
}

impl Twins {
    /// `atlases` are the scene's, which its twins share.
    pub(crate) fn read(
        dataset: &Dataset,
        submission: &Path,
        scene: &SceneFile,
        atlases: &AtlasMeshes<'_>,
    ) -> Result<Self, EvalError> {
        let (mut answers, mut findings) = (Vec::new(), Vec::new());
        for twin in dataset.twins_of(&scene.id) {
            let Some(shown) = dataset.file.twins.get(&twin.id) else { continue };
            let mut answer = read_scene(submission, twin, atlases)?;
            if answer.files.is_empty() {
                let message = format!("the submission holds no map of this twin of scene '{}'", scene.id);
                let action = "constancy has no value in that scene; answer each twin from its own photo";
                let file = format!("scenes/{}", twin.id);
                findings.push(Finding::new(Severity::Note, "twin_not_predicted", file, "", message, action));
            } else {
                findings.append(&mut answer.findings);
            }
            answers.push((shown.lighting, answer));
        }
        Ok(Self { answers, findings })
    }

    /// All answers to the family. Absent where the scene has no twins, or where the submission holds no map of the
    /// scene or of one of them.
    pub(crate) fn members<'a>(&'a self, prediction: &'a PredictedScene) -> Option<Vec<&'a PredictedScene>> {
        let answers = self.answers.iter().map(|(_, answer)| answer);
        let members: Vec<&PredictedScene> = std::iter::once(prediction).chain(answers).collect();
        (members.len() > 1 && members.iter().all(|member| !member.files.is_empty())).then_some(members)
    }
}

/// The answers to a family: those to the scene first, then those to its twins.
pub(crate) struct Family<'a> {
    pub(crate) scene: &'a SceneFile,
    pub(crate) lightings: Vec<LightingName>,
    pub(crate) members: Vec<&'a PredictedScene>,
}

impl Family<'_> {
    /// Compares the answers. Absent where the input view shows no texel.
    pub(crate) fn constancy(&self, open: &OpenScene, progress: Progress<'_>) -> Result<Option<Constancy>, EvalError> {
        let mut means = Means::default();
        each_atlas(open, self.scene, "constancy, means", progress, |at, map, _| {
            let answers = self.answers(at);
            means.add(&map.of_rows(|y| Means::of_row(map, &answers, y)));
            Ok(())
        })?;
        if means.area_m2 == 0.0 {
            return Ok(None);
        }
        let unit = vec![[1.0; 3]; self.members.len()];
        let passes = [unit, means.scales()];
        let centre = means.of_family();
        let mut sums = Sums::default();
        each_atlas(open, self.scene, "constancy, deviations", progress, |at, map, truth| {
            let answers = self.answers(at);
            sums.add(&map.of_rows(|y| Sums::of_row(map, &answers, &truth.base_color, &passes, centre, y)));
            Ok(())
        })?;
        let members = self.members.len() as f64;
        let [raw, aligned] = sums.passes.map(|pass| pass.deviation(means.area_m2, members));
        Ok(Some(Constancy {
            scene: self.scene.id.clone(),
            lightings: self.lightings.clone(),
            area_m2: means.area_m2,
            raw,
            aligned,
            mean_mse: sums.squared_error / means.area_m2,
            mean_delta_e: sums.delta_e / means.area_m2,
        }))
    }

    /// The base colours of an instance that has an atlas, for which every answer has a material, if only the default.
    fn answers(&self, instance: usize) -> Vec<&Texture> {
        let materials = self.members.iter().filter_map(|member| member.materials[instance].as_ref());
        materials.map(|material| &material.base_color).collect()
    }
}

/// Sums over texels, weighted by area.
#[derive(Clone, Debug, Default)]
struct Means {
    area_m2: f64,
    /// Of each answer, by channel.
    colors: Vec<[f64; 3]>,
}

impl Means {
    fn of_row(map: &TexelMap, answers: &[&Texture], y: usize) -> Self {
        let mut sums = Self { area_m2: 0.0, colors: vec![[0.0; 3]; answers.len()] };
        for texel in map.row(y).filter(|texel| texel.observed) {
            sums.area_m2 += texel.area_m2;
            for (sum, texture) in sums.colors.iter_mut().zip(answers) {
                let color = map.value(texture, &texel, y);
                (0..3).for_each(|c| sum[c] += texel.area_m2 * f64::from(color[c]));
            }
        }
        sums
    }

    fn add(&mut self, rows: &[Self]) {
        for row in rows {
            self.area_m2 += row.area_m2;
            self.colors.resize(row.colors.len(), [0.0; 3]);
            for (sum, color) in self.colors.iter_mut().zip(&row.colors) {
                (0..3).for_each(|c| sum[c] += color[c]);
            }
        }
    }

    /// The mean of all texels of the family's mean.
    fn of_family(&self) -> [f64; 3] {
        let count = self.area_m2 * self.colors.len() as f64;
        [0, 1, 2].map(|c| self.colors.iter().map(|color| color[c]).sum::<f64>() / count)
    }

    /// What brings the mean of each answer to that of the family; 1 where it is 0.
    fn scales(&self) -> Vec<[f64; 3]> {
        let mean = |c: usize| self.colors.iter().map(|color| color[c]).sum::<f64>() / self.colors.len() as f64;
        let scale = |color: &[f64; 3], c: usize| if color[c] == 0.0 { 1.0 } else { mean(c) / color[c] };
        self.colors.iter().map(|color| [0, 1, 2].map(|c| scale(color, c))).collect()
    }
}

/// Sums over texels, weighted by area: of raw, then of aligned answers.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    passes: [PassSums; 2],
    /// Of the raw mean against the truth, mean over channels.
    squared_error: f64,
    delta_e: f64,
}

/// Sums of squares over the texels, weighted by area.
#[derive(Clone, Copy, Debug, Default)]
struct PassSums {
    /// Over the family and channels.
    linear: f64,
    delta_e: f64,
    /// Of deviations over the family, then of contrast.
    luminance: [f64; 2],
    chroma: [f64; 2],
}

impl PassSums {
    fn deviation(&self, area_m2: f64, members: f64) -> Deviation {
        let root = |sum: f64, count: f64| (sum / (area_m2 * count)).sqrt();
        let spread = |[deviation, contrast]: [f64; 2], channels: f64| PartSpread {
            deviation: root(deviation, members * channels),
            contrast: root(contrast, channels),
        };
        let mut found = Deviation {
            linear: root(self.linear, 3.0 * members),
            delta_e: root(self.delta_e, members),
            luminance: spread(self.luminance, 1.0),
            chroma: spread(self.chroma, 3.0),
            relative: None,
        };
        found.relative = found.guarded();
        found
    }
}

impl Sums {
    fn of_row(
        map: &TexelMap,
        answers: &[&Texture],
        truth: &Texture,
        passes: &[Vec<[f64; 3]>; 2],
        centre: [f64; 3],
        y: usize,
    ) -> Self {
        let mut sums = Self::default();
        for texel in map.row(y).filter(|texel| texel.observed) {
            let area = texel.area_m2;
            let colors: Vec<[f64; 3]> =
                answers.iter().map(|texture| map.value(texture, &texel, y).map(f64::from)).collect();
            for (at, (pass, scales)) in sums.passes.iter_mut().zip(passes).enumerate() {
                let scaled = || colors.iter().zip(scales).map(|(color, scale)| [0, 1, 2].map(|c| color[c] * scale[c]));
                let mean = [0, 1, 2].map(|c| scaled().map(|color| color[c]).sum::<f64>() / answers.len() as f64);
                for color in scaled() {
                    let [luminance, chroma] = parts([0, 1, 2].map(|c| color[c] - mean[c]));
                    pass.linear += area * (0..3).map(|c| (color[c] - mean[c]).powi(2)).sum::<f64>();
                    pass.delta_e += area * color_difference(shown(color), shown(mean)).powi(2);
                    pass.luminance[0] += area * luminance;
                    pass.chroma[0] += area * chroma;
                }
                let [luminance, chroma] = parts([0, 1, 2].map(|c| mean[c] - centre[c]));
                pass.luminance[1] += area * luminance;
                pass.chroma[1] += area * chroma;
                if at == 0 {
                    let truth = map.value(truth, &texel, y).map(f64::from);
                    sums.squared_error += area * (0..3).map(|c| (mean[c] - truth[c]).powi(2)).sum::<f64>() / 3.0;
                    sums.delta_e += area * color_difference(shown(mean), shown(truth));
                }
            }
        }
        sums
    }

    fn add(&mut self, rows: &[Self]) {
        for row in rows {
            for (pass, more) in self.passes.iter_mut().zip(&row.passes) {
                pass.linear += more.linear;
                pass.delta_e += more.delta_e;
                for at in 0..2 {
                    pass.luminance[at] += more.luminance[at];
                    pass.chroma[at] += more.chroma[at];
                }
            }
            self.squared_error += row.squared_error;
            self.delta_e += row.delta_e;
        }
    }
}

/// The squares of the luminance of a difference of colours, and of what remains of it, summed over channels.
fn parts(difference: [f64; 3]) -> [f64; 2] {
    let luminance: f64 = LUMINANCE.iter().zip(difference).map(|(weight, value)| weight * value).sum();
    [luminance * luminance, difference.iter().map(|value| (value - luminance).powi(2)).sum()]
}

fn shown(color: [f64; 3]) -> LinearRgb {
    LinearRgb(color.map(|value| value as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spread(deviation: f64, contrast: f64) -> PartSpread {
        PartSpread { deviation, contrast }
    }

    /// Half the luminance's contrast and a tenth of the chroma's, by hand; without one of both contrasts no value.
    #[test]
    fn the_guard_is_relative_to_contrast() {
        let of = |luminance, chroma| Deviation { luminance, chroma, ..Deviation::default() }.guarded();
        let found = of(spread(0.1, 0.2), spread(0.01, 0.1)).unwrap();
        assert!((found - (0.26_f64 / 2.0).sqrt()).abs() < 1e-12, "{found}");
        assert_eq!(of(spread(0.0, 0.2), spread(0.0, 0.1)), Some(0.0));
        assert_eq!(of(spread(0.0, 0.0), spread(0.0, 0.1)), None);
        assert_eq!(of(spread(0.1, 0.2), spread(0.0, 0.001)), None);
    }

    /// Any colour is its luminance and the rest, whose luminance is 0; drawing it towards grey scales the rest alone.
    #[test]
    fn saturation_scales_chroma_alone() {
        let color = [0.7, 0.2, 0.4];
        let luminance: f64 = LUMINANCE.iter().zip(color).map(|(weight, value)| weight * value).sum();
        let half = color.map(|value| luminance + (value - luminance) / 2.0);
        let ([l, c], [l_half, c_half]) = (parts(color), parts(half));
        assert!((l - l_half).abs() < 1e-15 && (c / 4.0 - c_half).abs() < 1e-15);
        assert!(parts([0.3; 3])[1] < 1e-30);
    }

    /// One answer is twice the other: aligned, both are their mean.
    #[test]
    fn scales_bring_answers_to_the_mean_of_the_family() {
        let means = Means { area_m2: 2.0, colors: vec![[0.4, 0.2, 0.0], [0.8, 0.4, 0.0]] };
        let expected = [[1.5, 1.5, 1.0], [0.75, 0.75, 1.0]];
        let pairs =
            || means.scales().into_iter().zip(expected).flat_map(|(found, expected)| found.into_iter().zip(expected));
        assert!(pairs().count() == 6 && pairs().all(|(found, expected)| (found - expected).abs() < 1e-12));
    }
}
