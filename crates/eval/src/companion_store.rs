//! Where the converged pictures of companions come from: the dataset, a cache, or a render made now.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use mateval_scene::bounded_cache::{keep_below, mark_used};
use mateval_scene::companions_file::COMPANIONS_JSON;
use mateval_scene::manifest::sha256_of_bytes;
use mateval_scene::{Progress, Report, json};
use tempfile::TempDir;

use crate::companion_pictures::{CompanionPictures, HALVES};
use crate::companions::{COMPANION_SCALES, Companions};
use crate::error::EvalError;
use crate::light_pass::LightPass;
use crate::light_rules::LightRules;
use crate::lit_scene::LitScene;
use crate::protocol::SCORER_VERSION;

/// The largest size of a cache, in bytes.
const MOST_BYTES: u64 = 20 << 30;

/// Where pictures that are not found are made.
#[derive(Clone, Copy, Debug)]
pub(crate) enum MadeIn<'a> {
    /// In the dataset.
    Dataset,
    /// In the folder of a cache.
    Cache(&'a Path),
    /// In a folder that this run removes.
    ThisRun,
}

/// The places where a scene's companions may be found and kept.
pub(crate) struct CompanionStore<'a> {
    /// `ground_truth/companions` of the scene.
    pub(crate) of_dataset: PathBuf,
    pub(crate) made_in: MadeIn<'a>,
    /// SHA-256, hex, of the scene's files that the pictures depend on.
    pub(crate) inputs_sha256: String,
    /// Holds the pictures of this run where no cache can.
    temporary: OnceLock<TempDir>,
}

impl<'a> CompanionStore<'a> {
    pub(crate) fn new(of_dataset: PathBuf, made_in: MadeIn<'a>, inputs_sha256: String) -> Self {
        Self { of_dataset, made_in, inputs_sha256, temporary: OnceLock::new() }
    }

    /// The converged pictures of `companions` under the lightings of a pass. Pictures that are truncated, changed, or of other
    /// inputs are reported through `progress` and not used.
    pub(crate) fn find(
        &self,
        lit: &LitScene<'_>,
        rules: &LightRules,
        pass: &LightPass<'_>,
        companions: &Companions,
        progress: Progress<'_>,
    ) -> Result<CompanionPictures, EvalError> {
        let key = self.key(lit, rules, pass);
        let (of_dataset, cached) = (self.of_dataset.join(pass.name), self.cache_folder(&key));
        for folder in [Some(&of_dataset), cached.as_ref()].into_iter().flatten() {
            match CompanionPictures::open(folder, &key) {
                Some(Ok(found)) => {
                    if cached.as_ref() == Some(folder) {
                        mark_used(&folder.join(COMPANIONS_JSON));
                    }
                    return Ok(found);
                }
                Some(Err(reason)) => {
                    progress(Report::Message(&format!("scene {}: companions not used: {reason}", lit.scene.id)))
                }
                None => {}
            }
        }
        let made_from = MadeFrom { key: &key, inputs_sha256: &self.inputs_sha256 };
        let make = |folder: &Path| make(lit, rules, pass, companions, &made_from, folder);
        match (self.made_in, cached) {
            (MadeIn::Dataset, _) => make(&of_dataset),
            (_, None) => make(&self.temporary_folder(&key)?),
            (_, Some(folder)) => match make(&folder) {
                // A cache that cannot be written must not end the score.
                Err(error) if error.is_io() => {
                    let what = format!("scene {}: companions cannot be kept: {error}", lit.scene.id);
                    progress(Report::Message(&what));
                    make(&self.temporary_folder(&key)?)
                }
                made => {
                    self.bound_cache(lit, progress);
                    made
                }
            },
        }
    }

    fn cache_folder(&self, key: &str) -> Option<PathBuf> {
        let MadeIn::Cache(cache) = self.made_in else { return None };
        Some(cache.join(format!("companions-{}", &key[..32])))
    }

    fn bound_cache(&self, lit: &LitScene<'_>, progress: Progress<'_>) {
        let MadeIn::Cache(cache) = self.made_in else { return };
        // A cache that is too large must not end the score.
        if let Err(error) = keep_below(cache, MOST_BYTES) {
            let what =
                format!("scene {}: cannot remove old companions from '{}': {error}", lit.scene.id, cache.display());
            progress(Report::Message(&what));
        }
    }

    fn temporary_folder(&self, key: &str) -> Result<PathBuf, EvalError> {
        if self.temporary.get().is_none() {
            let made = tempfile::tempdir().map_err(|source| EvalError::Io {
                action: "create a folder in",
                path: std::env::temp_dir(),
                source,
            })?;
            // The cell is empty: only this thread holds the store.
            let _ = self.temporary.set(made);
        }
        Ok(self.temporary.get().expect("it has just been made").path().join(key))
    }

    /// The hash of everything that the pictures depend on.
    fn key(&self, lit: &LitScene<'_>, rules: &LightRules, pass: &LightPass<'_>) -> String {
        let settings = (rules.flavour, rules.max_bounces, rules.roulette_start, rules.roulette_survival, &rules.stage);
        let definition =
            (SCORER_VERSION, &rules.noise.seed, COMPANION_SCALES, rules.noise.companion_samples(lit.truth_samples));
        let views: Vec<_> = lit.views.iter().map(|view| &view.id).collect();
        let of_scene = (&lit.scene.id, lit.scene.exposure, views, &self.inputs_sha256);
        let lights = (pass.companion_mixes(), &pass.group_shares);
        sha256_of_bytes(json::to_text(&(definition, settings, pass.name, of_scene, lights)).as_bytes())
    }
}

/// How the names of folders begin whose pictures are not whole yet.
pub(crate) const UNFINISHED: &str = ".companions-";

/// The hashes of what pictures are made from.
struct MadeFrom<'a> {
    /// Of everything that they depend on.
    key: &'a str,
    /// Of the scene's files alone.
    inputs_sha256: &'a str,
}

/// Renders both halves into a new folder beside `folder`, which it becomes when it is whole.
fn make(
    lit: &LitScene<'_>,
    rules: &LightRules,
    pass: &LightPass<'_>,
    companions: &Companions,
    MadeFrom { key, inputs_sha256 }: &MadeFrom<'_>,
    folder: &Path,
) -> Result<CompanionPictures, EvalError> {
    let io = |action: &'static str, path: &Path| {
        let path = path.to_owned();
        move |source| EvalError::Io { action, path, source }
    };
    let parent = folder.parent().expect("the folder lies in a cache");
    std::fs::create_dir_all(parent).map_err(io("create", parent))?;
    let work = tempfile::Builder::new().prefix(UNFINISHED).tempdir_in(parent).map_err(io("write in", parent))?;
    let views: Vec<_> = lit.views.iter().map(|view| view.id.clone()).collect();
    let mut files = std::collections::BTreeMap::new();
    for (half, name) in HALVES.iter().enumerate() {
        let stream = format!("companions_{name}");
        let samples = rules.noise.companion_samples(lit.truth_samples);
        let renders = pass.trace_companions(companions, samples, &stream)?;
        files.extend(CompanionPictures::write_half(work.path(), &views, half, &renders, lit.scene.exposure)?);
    }
    CompanionPictures::finish(work.path(), key, inputs_sha256, files)?;
    // Another process may have made the same in the meantime; what cannot be used gives way.
    if let Some(Err(_)) = CompanionPictures::open(folder, key) {
        std::fs::remove_dir_all(folder).map_err(io("remove", folder))?;
    }
    if !folder.exists() {
        let made = work.keep();
        if let Err(source) = std::fs::rename(&made, folder) {
            let lost = std::fs::remove_dir_all(&made);
            if !folder.exists() {
                lost.map_err(io("remove", &made))?;
                return Err(io("rename", folder)(source));
            }
        }
    }
    match CompanionPictures::open(folder, key) {
        Some(Ok(pictures)) => Ok(pictures),
        _ => Err(EvalError::CompanionsVanished { path: folder.to_owned() }),
    }
}
