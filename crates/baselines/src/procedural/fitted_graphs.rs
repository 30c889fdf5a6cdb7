//! The graphs that are fitted: the built-in ones, and those of a user's folder.

use std::path::{Path, PathBuf};

use mateval_procedural::Graph;
use mateval_procedural::fit::choose::Fitter;
use mateval_procedural::library::entry;
use mateval_procedural::mtlx::Limits;
use mateval_procedural::mtlx::read_file;
use mateval_scene::SceneError;

use super::options::ProceduralOptions;
use crate::error::BaselineError;

/// The most files that are read.
const MOST_FILES: usize = 256;

/// The built-in graphs and those of the options' folder, ready to be fitted.
pub(super) fn fitter(options: &ProceduralOptions) -> Result<Fitter, BaselineError> {
    let own = options.graphs.as_deref().map(read).transpose()?.unwrap_or_default();
    Ok(Fitter::new()?.with_graphs(own))
}

/// Reads every `.mtlx` file of a folder, in the order of their names. Fails with everything that is wrong with any of
/// them, and where there is none.
fn read(folder: &Path) -> Result<Vec<Graph>, BaselineError> {
    let entries = std::fs::read_dir(folder).map_err(SceneError::io("read", folder))?;
    let paths: Result<Vec<PathBuf>, _> = entries.map(|entry| entry.map(|entry| entry.path())).collect();
    let mut paths = paths.map_err(SceneError::io("read", folder))?;
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "mtlx"));
    paths.sort();
    if paths.is_empty() || paths.len() > MOST_FILES {
        return Err(BaselineError::GraphCount { folder: folder.to_owned(), found: paths.len(), most: MOST_FILES });
    }
    let (mut graphs, mut faults): (Vec<Graph>, _) = (Vec::new(), Vec::new());
    for path in &paths {
        match read_file(path, &Limits::default()) {
            Ok(graph) if entry(&graph.name).is_some() || graphs.iter().any(|other| other.name == graph.name) => {
                return Err(BaselineError::SameGraph { path: path.clone(), name: graph.name });
            }
            Ok(graph) => graphs.push(graph),
            Err(fault) => faults.push(fault),
        }
    }
    if faults.is_empty() { Ok(graphs) } else { Err(BaselineError::BadGraphs(faults)) }
}
