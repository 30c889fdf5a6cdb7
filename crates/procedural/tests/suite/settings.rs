//! Parameters set from text.

use mateval_procedural::Settings;
use mateval_procedural::graph::slots;
use mateval_procedural::library::entry;
use mateval_procedural::mtlx::to_text;

use super::graphs::{read, text};

#[test]
fn parameters_are_set_by_name() {
    let graph = entry("brick").unwrap().graph().unwrap();
    let mut settings = Settings::defaults(&graph);
    settings.set(&graph, "joint_color", "0.1, 0.2,0.3").unwrap();
    settings.set(&graph, "row_shift", "0.25").unwrap();
    let set = slots(&graph).into_iter().zip(settings.numbers()).filter(|(slot, number)| slot.value != **number);
    let set: Vec<_> = set.map(|(slot, number)| (graph.parameters[slot.parameter].name.clone(), *number)).collect();
    let expected = [("row_shift", 0.25), ("joint_color", 0.1), ("joint_color", 0.2), ("joint_color", 0.3)];
    assert_eq!(set, expected.map(|(name, number)| (name.to_owned(), number)));
}

#[test]
fn wrong_names_and_values_are_refused() {
    let graph = entry("herringbone").unwrap().graph().unwrap();
    let mut settings = Settings::defaults(&graph);
    let before = settings.clone();
    let mut refusal = |name: &str, text: &str| settings.set(&graph, name, text).unwrap_err().to_string();
    assert!(refusal("widht", "1").contains("has no parameter 'widht'; expected one of: theta, t_u, t_v, width"));
    assert_eq!(refusal("width", "9"), "parameter 'width' of 'herringbone': expected 0.02 to 0.3, found 9");
    assert_eq!(refusal("ratio", "4.5"), "parameter 'ratio' of 'herringbone': expected a whole number, found '4.5'");
    assert!(refusal("color", "0.5").contains("expected 3 numbers separated by commas, found 1"));
    assert!(refusal("width", "nan").contains("expected a finite number"));
    assert!(refusal("footprint", "0.1").contains("it is the extent of a pixel at every point"));
    assert_eq!(settings, before);
}

/// A range may have one end only.
#[test]
fn ranges_are_named_by_the_ends_that_they_have() {
    let grey = r#"<constant name="grey" type="color3" />"#;
    let refusal = |range: &str, value: &str| {
        let graph =
            read(&text(&format!(r#"<input name="a" type="float" value="0.5" {range} />"#), grey, "grey")).unwrap();
        Settings::defaults(&graph).set(&graph, "a", value).err().map(|error| error.to_string())
    };
    for (range, value, expected) in [
        (r#"uimin="0""#, "-1", "at least 0"),
        (r#"uimax="1""#, "2", "at most 1"),
        (r#"uimin="0" uimax="1""#, "2", "0 to 1"),
    ] {
        let message = format!("parameter 'a' of 'test': expected {expected}, found {value}");
        assert_eq!(refusal(range, value), Some(message));
        assert_eq!(refusal("", value), None);
    }
}

/// A graph that carries its settings reads back with them; what no parameter can have leaves the default.
#[test]
fn settings_become_defaults() {
    let graph = entry("herringbone").unwrap().graph().unwrap();
    let mut settings = Settings::defaults(&graph);
    for (name, text) in [("width", "0.123"), ("ratio", "5"), ("color", "0.1, 0.2, 0.3")] {
        settings.set(&graph, name, text).unwrap();
    }
    let own = settings.as_defaults(&graph, "floor");
    assert_eq!((own.name.as_str(), Settings::defaults(&own)), ("floor", settings.clone()));
    assert_eq!(read(&to_text(&own)).unwrap(), own);
    assert_ne!(Settings::defaults(&graph), settings);
    let place = slots(&graph).iter().position(|slot| slot.parameter == graph.parameter("width").unwrap()).unwrap();
    *settings.number_mut(place) = f64::NAN;
    let kept = Settings::defaults(&settings.as_defaults(&graph, "floor"));
    assert_eq!(kept.numbers()[place], Settings::defaults(&graph).numbers()[place]);
}
