//! Pictures of graphs.

use mateval_procedural::evaluator::{Square, render};
use mateval_procedural::library::entry;
use mateval_procedural::{ProceduralError, Program, Settings};

use super::graphs::{read, text};

#[test]
fn pixels_are_the_same_on_any_number_of_threads() {
    let graph = entry("brick").unwrap().graph().unwrap();
    let program = Program::new(&graph);
    let settings = Settings::defaults(&graph);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&program, &settings, Square::new(0.5, 100).unwrap()).unwrap())
    };
    let one = on(1);
    assert_eq!(one.len(), 100 * 100);
    assert_eq!(one, on(3));
    // The twin: another seed of the pattern, a shift, changes pixels.
    let mut shifted = settings.clone();
    shifted.set(&graph, "t_u", "0.5").unwrap();
    assert_ne!(one, render(&program, &shifted, Square::new(0.5, 100).unwrap()).unwrap());
}

/// The first row is at the top, where v is greatest.
#[test]
fn pixels_are_centres_of_a_square_above_and_right_of_the_origin() {
    let place = r#"<texcoord name="uv" type="vector2" />
        <convert name="c" type="color3"><input name="in" type="vector2" nodename="uv" /></convert>"#;
    let graph = read(&text("", place, "c")).unwrap();
    let pixels = render(&Program::new(&graph), &Settings::defaults(&graph), Square::new(2.0, 4).unwrap()).unwrap();
    assert_eq!(pixels[0].base_color, [0.25, 1.75, 0.0]);
    assert_eq!(pixels[15].base_color, [1.75, 0.25, 0.0]);
    assert_eq!(pixels[15].roughness, 0.5);
}

#[test]
fn values_that_are_not_finite_are_errors() {
    let great = r#"<constant name="g" type="float"><input name="value" type="float" value="1000" /></constant>
        <exp name="e" type="float"><input name="in" type="float" nodename="g" /></exp>
        <convert name="c" type="color3"><input name="in" type="float" nodename="e" /></convert>"#;
    let square = Square::new(1.0, 2).unwrap();
    let render = |nodes: &str| {
        let graph = read(&text("", nodes, "c")).unwrap();
        render(&Program::new(&graph), &Settings::defaults(&graph), square)
    };
    let error = render(great).unwrap_err();
    assert!(matches!(error, ProceduralError::NotFinite { output: "red", .. }), "{error}");
    assert!(render(&great.replace("1000", "1")).is_ok());
}

#[test]
fn sizes_are_checked() {
    for (size, resolution) in [(0.0, 4), (-1.0, 4), (f64::NAN, 4), (f64::INFINITY, 4), (1.0, 0), (1.0, 4097)] {
        assert!(
            matches!(Square::new(size, resolution), Err(ProceduralError::PictureSize { .. })),
            "{size} {resolution}"
        );
    }
    assert!(Square::new(0.01, 1).is_ok() && Square::new(0.01, 4096).is_ok());
}
