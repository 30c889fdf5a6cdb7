//! The check of an output file's path before long work begins.

use std::path::Path;

use anyhow::bail;

/// Fails where no file can be written to `path`, the value of `flag`; `kind` names the file in messages.
pub fn check_output_file(path: &Path, flag: &str, kind: &str, force: bool) -> anyhow::Result<()> {
    let shown = path.display();
    if !path.parent().is_some_and(|folder| folder.as_os_str().is_empty() || folder.is_dir()) {
        bail!("the folder of '{shown}' does not exist; make it, or choose another {flag}");
    }
    if path.is_dir() {
        bail!("'{shown}' is a folder; expected the name of a {kind} file");
    }
    if path.exists() && !force {
        bail!("'{shown}' already exists; choose another {flag}, or add --force to overwrite it");
    }
    Ok(())
}
