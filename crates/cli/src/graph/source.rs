//! The graph that a word of the command line names.

use std::path::Path;

use anyhow::bail;
use mateval_procedural::library::{LIBRARY, entry};
use mateval_procedural::limits::Limits;
use mateval_procedural::mtlx::read_file;
use mateval_procedural::{Graph, ProceduralError};

use crate::outcome::say;

/// Reads a `.mtlx` file, or takes the built-in graph of this name. Prints all findings about a file that is refused.
pub fn open(word: &Path) -> anyhow::Result<Graph> {
    if word.extension().is_some_and(|extension| extension == "mtlx") {
        let read = read_file(word, &Limits::default());
        if let Err(ProceduralError::Invalid { name, findings }) = &read {
            findings.iter().for_each(|finding| say(&format!("{name}: {finding}")));
        }
        return Ok(read?);
    }
    match word.to_str().and_then(entry) {
        Some(entry) => Ok(entry.graph()?),
        None => {
            let names: Vec<&str> = LIBRARY.iter().map(|entry| entry.name).collect();
            bail!("'{}' is neither a .mtlx file nor a built-in graph; those are {}", word.display(), names.join(", "))
        }
    }
}
