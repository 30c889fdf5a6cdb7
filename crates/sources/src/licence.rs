//! The licence beside a scene's main file.

use mateval_scene::Severity;
use mateval_scene::source_folder::SourceFolder;

use crate::log::Log;
use crate::source_scene::LicenceText;

const NAMES: [&str; 3] = ["LICENSE.txt", "LICENSE", "license.txt"];

/// Whether a scene that lacks this file lacks nothing.
pub(crate) fn is_optional(file: &str) -> bool {
    NAMES.contains(&file)
}

/// The licence beside the scene. A scene must not be passed on without it, so an unreadable licence is a finding.
pub(crate) fn read_licence(source: &mut SourceFolder, log: &mut Log) -> Option<LicenceText> {
    let file = NAMES.into_iter().find(|name| source.path(name).is_ok())?;
    match source.read(file) {
        Ok(bytes) => Some(LicenceText { file: file.to_owned(), text: String::from_utf8_lossy(&bytes).into_owned() }),
        Err(fault) => {
            let action = "left it out; copy it by hand";
            log.push(Severity::Warning, fault.code, file, "", fault.message, action);
            None
        }
    }
}
