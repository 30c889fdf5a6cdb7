//! Values of nodes: defaults of inputs, and numbers from an independent source.

use super::graphs::color_at;

/// The value of one node without connections.
fn bare(word: &str, kind: &str) -> [f64; 3] {
    let nodes = format!(
        r#"<{word} name="n" type="{kind}" />
        <convert name="c" type="color3"><input name="in" type="{kind}" nodename="n" /></convert>"#
    );
    let (nodes, color) = if kind == "color3" { (nodes.lines().next().unwrap().to_owned(), "n") } else { (nodes, "c") };
    color_at(&nodes, color, 1.25, -0.5)
}

/// What is not set is the default of the node's definition (`stdlib_defs.mtlx` of MaterialX 1.39).
#[test]
fn inputs_that_are_not_set_have_the_defaults_of_the_definition() {
    assert_eq!(bare("multiply", "color3"), [0.0; 3]);
    assert_eq!(bare("ln", "float"), [0.0; 3]);
    // 1 > 0, so the first input.
    assert_eq!(bare("ifgreater", "color3"), [0.0; 3]);
    assert_eq!(bare("invert", "vector3"), [1.0; 3]);
    assert_eq!(bare("contrast", "float"), [0.0; 3]);
    assert_eq!(bare("exp", "vector3"), [1.0; 3]);
    // The place.
    assert_eq!(bare("texcoord", "vector2"), [1.25, -0.5, 0.0]);
    assert_eq!(bare("position", "vector3"), [1.25, -0.5, 0.0]);
    let noise = |texcoord: &str| {
        let nodes = format!(r#"<noise2d name="n" type="color3">{texcoord}</noise2d>"#);
        color_at(&nodes, "n", 1.25, -0.5)
    };
    assert_eq!(noise(""), noise(r#"<input name="texcoord" type="vector2" value="1.25, -0.5" />"#));
    assert_ne!(noise(""), noise(r#"<input name="texcoord" type="vector2" value="1.25, 0.5" />"#));
}

/// Open Shading Language as of Blender 4.5, in single precision: `noise("snoise", x, y)` and `cellnoise(x, y)`.
#[test]
fn noises_are_those_of_open_shading_language() {
    let osl = [
        ((-7.382_812_5, 6.015_625), -0.135_572_84, 0.187_664_06),
        ((-13.531_25, 6.257_812_5), -0.683_802_6, 0.860_763_73),
    ];
    for ((u, v), snoise, cellnoise) in osl {
        for (word, expected) in [("noise2d", snoise), ("cellnoise2d", cellnoise)] {
            let nodes = format!(
                r#"<{word} name="n" type="float" />
                <convert name="c" type="color3"><input name="in" type="float" nodename="n" /></convert>"#
            );
            let [found, ..] = color_at(&nodes, "c", u, v);
            assert!((found - expected).abs() < 1e-6, "{word}: {found} {expected}");
            // The twin: in the next cell.
            let [elsewhere, ..] = color_at(&nodes, "c", u + 1.5, v + 0.5);
            assert!((elsewhere - expected).abs() > 1e-3, "{word}: {elsewhere}");
        }
    }
}

/// A positive angle turns the place clockwise (MaterialX' definition), by degrees.
#[test]
fn rotation_is_in_degrees() {
    let nodes = r#"
        <texcoord name="uv" type="vector2" />
        <rotate2d name="r" type="vector2">
          <input name="in" type="vector2" nodename="uv" /><input name="amount" type="float" value="90" />
        </rotate2d>
        <convert name="c" type="color3"><input name="in" type="vector2" nodename="r" /></convert>"#;
    let [x, y, _] = color_at(nodes, "c", 1.0, 0.0);
    assert!(x.abs() < 1e-15 && (y + 1.0).abs() < 1e-15, "{x} {y}");
}

/// `switch` takes the first input whose number is above `which`, and zero from 10 on.
#[test]
fn switch_selects() {
    let selected = |which: f64| {
        let nodes = format!(
            r#"<switch name="s" type="float"><input name="in1" type="float" value="0.1" />
              <input name="in3" type="float" value="0.3" /><input name="in10" type="float" value="1" />
              <input name="which" type="float" value="{which}" /></switch>
            <convert name="c" type="color3"><input name="in" type="float" nodename="s" /></convert>"#
        );
        color_at(&nodes, "c", 0.0, 0.0)[0]
    };
    assert_eq!([-3.0, 0.0, 0.9, 1.0, 2.5, 9.5, 10.0].map(selected), [0.1, 0.1, 0.1, 0.0, 0.3, 1.0, 0.0]);
}
