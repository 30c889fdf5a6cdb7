//! The bytes that a URI of a glTF names: a file of the scene's folder, or base64 in the URI itself.

use mateval_scene::findings::shortened;
use mateval_scene::source_folder::{FileFault, SourceFolder};

/// The bytes, and the file's name relative to the folder; none for bytes in the URI itself.
pub(super) fn read(uri: &str, folder: &mut SourceFolder) -> Result<(Vec<u8>, Option<String>), FileFault> {
    let fault = |message: String| FileFault { code: "bad_uri", message };
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, encoded) = data
            .split_once(";base64,")
            .ok_or_else(|| fault(format!("expected `data:...;base64,...`, found '{}'", shortened(uri))))?;
        let bytes = base64::decode(encoded).map_err(|error| fault(format!("not base64: {error}")))?;
        return Ok((bytes, None));
    }
    let name = percent_encoding::percent_decode_str(uri)
        .decode_utf8()
        .map_err(|_| fault(format!("expected UTF-8, found '{}'", shortened(uri))))?;
    let relative = SourceFolder::relative(&name)?;
    Ok((folder.read(&relative)?, Some(relative)))
}
