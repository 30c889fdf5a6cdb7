//! What a recipe must contain, and that all of its faults are reported.

use super::*;
use mateval_sources::front3d::AppearanceRule;

fn read_text(text: &str) -> Result<Recipe, PrepError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recipe.toml");
    std::fs::write(&path, text).unwrap();
    read(&path).map(|(recipe, _)| recipe)
}

#[test]
fn absent_keys_have_their_defaults() {
    let recipe = read_text("name = 'mini'\n[[scene]]\nid = 'a'\nbitterli = 'a/scene.xml'").unwrap();
    assert_eq!(recipe.views.len(), 4);
    assert_eq!((recipe.views[1].id.as_str(), recipe.views[1].x_deg, recipe.views[1].y_deg), ("up_right", 5.0, -5.0));
    assert_eq!((recipe.samples, recipe.scenes[0].exposure), (64, 1.0));
}

#[test]
fn camera_rules_have_names() {
    let with = |words: &str| read_text(&format!("name = 'x'\n{words}\n[[scene]]\nid = 'a'\nbitterli = 'a'\n"));
    let name = |recipe: Recipe| recipe.camera_rules.name();
    assert_eq!(name(with("camera_rules = '3dlg'").unwrap()), "3dlg");
    assert_eq!(name(with("").unwrap()), "blenderproc");
    let error = with("camera_rules = 'mine'").unwrap_err().to_string();
    assert!(error.contains("expected one of: blenderproc, 3dlg"), "{error}");
}

#[test]
fn all_faults_are_reported_together() {
    let text = "name = 'x'\nresolution = [4, 9]\nsamples = 0\n\
        [[scene]]\nid = 'a'\nbitterli = 'a'\nexposure = 0.0\n[[scene]]\nid = 'a'\nbitterli = 'b'\natlas_size = 9";
    let error = read_text(text).unwrap_err().to_string();
    for part in ["resolution = [4, 9]", "samples = 0", "'a' is listed twice", "exposure = 0", "atlas_size = 9"] {
        assert!(error.contains(part), "{part} not in {error}");
    }
}

#[test]
fn wide_views_have_ids_and_distances_of_their_own() {
    let with = |words: &str| read_text(&format!("name = 'x'\n{words}\n[[scene]]\nid = 'a'\nbitterli = 'a'\n"));
    let recipe = with("wide = { count = 4, distance_m = [0.3, 1.0] }").unwrap();
    let drawn = DrawnViews { count: 4, distance_m: [0.3, 1.0], seed: 0 };
    assert_eq!(recipe.wide, Some(WideViews::Drawn(drawn)));
    with("wide = { views = [{ id = 'wide_left', offset_m = [-0.5, 0, 0] }] }").unwrap();
    for (words, expected) in [
        ("wide = { count = 0, distance_m = [0.3, 1.0] }", "count = 0: expected 1 to 16"),
        ("wide = { count = 17, distance_m = [0.3, 1.0] }", "count = 17: expected 1 to 16"),
        ("wide = { count = 1, distance_m = [1.0, 0.3] }", "distance_m = [1.0, 0.3]: expected two rising numbers"),
        ("wide = { count = 1, distance_m = [nan, 1.0] }", "distance_m = [NaN, 1.0]"),
        ("wide = { count = 1 }", "expected { count, distance_m }"),
        ("wide = { views = [{ id = 'left', offset_m = [1, 0, 0] }] }", "the id must begin with 'wide_'"),
        ("wide = { views = [{ id = 'wide_1', offset_m = [0, 0, 0] }] }", "expected a length of 0.05 to 10 m"),
        ("views = [{ id = 'wide_1', x_deg = 1, y_deg = 1 }]", "choose another id"),
        (
            "wide = { views = [{ id = 'wide_1', offset_m = [1, 0, 0] }, { id = 'wide_1', offset_m = [2, 0, 0] }] }",
            "'wide_1' is listed twice",
        ),
    ] {
        let error = with(words).unwrap_err().to_string();
        assert!(error.contains(expected), "{words}: {error}");
    }
}

#[test]
fn cameras_are_within_a_million_metres() {
    let at = |x: &str| {
        let text = "name = 'x'\n[[scene]]\nid = 'a'\nbitterli = 'a'\n";
        read_text(&format!("{text}camera = {{ position = [{x}, 0, 0], target = [0, 0, 0], fov_y_deg = 40 }}"))
    };
    at("1e6").unwrap();
    for far in ["1.1e6", "-1e300", "inf", "nan"] {
        assert!(at(far).unwrap_err().to_string().contains("camera: expected coordinates"), "{far}");
    }
}

#[test]
fn inputs_are_hashes_of_files_below() {
    let with = |file: &str, hash: &str| {
        read_text(&format!("name = 'x'\n[[scene]]\nid = 'a'\nbitterli = 'a'\ninputs = {{ '{file}' = '{hash}' }}"))
    };
    with("b/c.obj", &"0a".repeat(32)).unwrap();
    for hash in ["", "0a", &"0A".repeat(32), &"0g".repeat(32), &"0a".repeat(33)] {
        assert!(with("c.obj", hash).unwrap_err().to_string().contains("64 lower-case hexadecimal digits"), "{hash}");
    }
    for file in ["/dev/zero", "../c.obj"] {
        assert!(with(file, &"0a".repeat(32)).unwrap_err().to_string().contains("below the scene's folder"), "{file}");
    }
}

#[test]
fn labels_lie_below_the_scenes_folder() {
    let with = |folder: &str| {
        let text = "name = 'x'\n[[scene]]\nid = 'a'\nbitterli = 'a/scene.xml'\npart_labels = { one = ";
        read_text(&format!("{text}'{folder}' }}"))
    };
    with("labels/one").unwrap();
    with("labels/../one").unwrap();
    for bad in ["/labels", "../labels", "labels/../..", "."] {
        let error = with(bad).unwrap_err().to_string();
        assert!(error.contains(&format!("part_labels.one = '{bad}'")) && error.contains("XML's folder"), "{error}");
    }
}

#[test]
fn a_seed_of_roughnesses_needs_stated_ones() {
    let with = |words: &str| {
        let room = "front3d = { house = 'h.json', room = 'R-1', models = 'm', ";
        read_text(&format!("name = 'x'\n[[scene]]\nid = 'a'\n{room}{words} }}\ncamera = {{ seed = 1 }}"))
    };
    let rule = |recipe: Recipe| recipe.scenes[0].front3d.as_ref().unwrap().appearance_rule();
    assert_eq!(rule(with("textures = 't'").unwrap()), AppearanceRule::Constant);
    assert_eq!(rule(with("appearance = 'stated'").unwrap()), AppearanceRule::Stated { seed: 0 });
    assert_eq!(rule(with("appearance = 'stated', appearance_seed = 7").unwrap()), AppearanceRule::Stated { seed: 7 });
    let error = with("appearance_seed = 7").unwrap_err().to_string();
    assert!(error.contains("`appearance_seed` needs"), "{error}");
}

#[test]
fn unknown_words_are_refused_with_their_line() {
    let error = read_text("name = 'x'\nresolutoin = [4, 9]").unwrap_err().to_string();
    assert!(error.contains("resolutoin") && error.contains("line 2"), "{error}");
}

#[test]
fn a_gltf_is_a_source() {
    let with = |words: &str| read_text(&format!("name = 'x'\n[[scene]]\nid = 'a'\ngltf = 'rooms/a.glb'\n{words}"));
    let recipe = with("").unwrap();
    assert_eq!(recipe.scenes[0].source().unwrap(), RecipeSource::Gltf(Path::new("rooms/a.glb")));
    assert_eq!(recipe.scenes[0].root(Path::new("all")), Path::new("all/rooms"));
    for (words, message) in [
        ("bitterli = 'b.xml'", "exactly one of the keys `bitterli`, `front3d`, `gltf`"),
        ("camera = { seed = 1 }", "`seed` and `designer` are for `front3d`"),
        ("part_labels = { one = '../labels' }", "glTF's folder"),
    ] {
        assert!(with(words).unwrap_err().to_string().contains(message), "{words}");
    }
}
