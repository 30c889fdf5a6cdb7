//! The page of a room in 3D; `rooms` writes the scripts that it loads.

use std::io::Read as _;

use flate2::read::GzDecoder;
use minijinja::context;
use minijinja::value::Serde;
use serde::Serialize;

use super::board::Board;
use super::heads::MethodHead;
use super::room_maps::MOST_TEXELS;
use super::rooms::Room;
use super::site::{Page, SiteWriter};
use crate::error::ReportError;
use crate::picture_set::TRUTH;

#[derive(Serialize)]
struct RoomPage<'a> {
    scene: &'a str,
    methods: Vec<&'a MethodHead>,
    most_texels: usize,
}

/// Writes `rooms/<scene>.html` of each room that can be shown, and the script that shows it.
pub(super) fn write(board: &Board<'_>, site: &SiteWriter<'_>) -> Result<(), ReportError> {
    for (scene, room) in &board.rooms {
        let Room::Shown { methods: ids } = room else { continue };
        let methods =
            board.best_first().into_iter().map(|at| &board.heads[at]).filter(|head| ids.contains(&head.id)).collect();
        let page = RoomPage { scene: scene.as_str(), methods, most_texels: MOST_TEXELS };
        site.page(&Page {
            file: &format!("rooms/{scene}.html"),
            template: "room.j2",
            title: &format!("{scene} in 3D"),
            scripts: &["rooms/room.min.js"],
            values: context! { page => Serde(&page), truth => TRUTH },
        })?;
    }
    let has_rooms = board.rooms.values().any(|room| matches!(room, Room::Shown { .. }));
    if has_rooms { site.file("rooms/room.min.js", &viewer()) } else { Ok(()) }
}

/// The script that shows a room, bundled with three.js and compressed; `tools/build_viewer.sh` builds it.
const VIEWER: &[u8] = include_bytes!("../../viewer/room.min.js.gz");

/// The script that shows a room.
fn viewer() -> String {
    let mut text = String::new();
    GzDecoder::new(VIEWER).read_to_string(&mut text).expect("the file is part of the program, and a test reads it");
    text
}

#[cfg(test)]
mod tests {
    use mateval_scene::manifest::sha256_of_bytes;

    use super::*;

    /// The README beside it states the version and the hash of the viewer, which carries its licence.
    #[test]
    fn the_viewer_is_the_one_that_its_readme_states() {
        let readme = include_str!("../../viewer/README.md");
        let viewer = viewer();
        let sha256 = sha256_of_bytes(viewer.as_bytes());
        assert!(readme.contains(&sha256), "{sha256}");
        let package: serde_json::Value = serde_json::from_str(include_str!("../../viewer/package.json")).unwrap();
        let version = package["dependencies"]["three"].as_str().unwrap();
        assert!(readme.contains(&format!("three.js {version}")) && viewer.contains(&format!("three.js {version}")));
        assert!(viewer.contains("The MIT License") && viewer.contains("three.js authors"));
    }
}
