//! The licence beside a scene's main file.

use mateval_scene::Severity;
use mateval_scene::source_folder::SourceFolder;

use crate::log::Log;
use crate::source_scene::{LICENCES, LicenceText};

/// The licence beside the scene. A scene must not be passed on without it, so an unreadable licence is a finding.
pub(crate) fn read_licence(source: &mut SourceFolder, log: &mut Log) -> Option<LicenceText> {
    let file = LICENCES.into_iter().find(|name| source.path(name).is_ok())?;
    match source.read(file) {
        Ok(bytes) => Some(LicenceText { file: file.to_owned(), text: String::from_utf8_lossy(&bytes).into_owned() }),
        Err(fault) => {
            let action = "left it out; copy it by hand";
            log.push(Severity::Warning, fault.code, file, "", fault.message, action);
            None
        }
    }
}
